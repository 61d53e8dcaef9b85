"""Conditions on a sampler: guidance by hand and in closed form, masks, mask completion, keyframe schemes."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import torch

from mwlib.diffusion import (
    KeyframeConfig,
    WindowNoise,
    alpha_bar,
    classifier_free,
    ddim,
    ddim_indices,
    eps_of,
    history_completion,
    keyframe_mask,
    keyframed,
    masked,
    noised,
    pasted,
    reconstruction_guided,
    with_keyframes,
    y0_hat_of,
)
from mwlib.transforms import DCTTransform, ScaledTransform, WaveletTransform, fit_scale, pad_history

T, C, H = 12, 6, 5
A_BAR = alpha_bar("cosine", 1000)
INDICES = ddim_indices(1000, 10)
PAPER = KeyframeConfig()
SCHEMES = {
    "replacement": PAPER,
    "fixed noise": KeyframeConfig(keyframe_noise="fixed"),
    "eta": KeyframeConfig(eta=1.0),
    "repaint": KeyframeConfig(repeats=3),
    "paste": KeyframeConfig("paste"),
    "gradient": KeyframeConfig("none", reconstruction_weight=1.0),
    "all": KeyframeConfig(eta=0.5, repeats=2, reconstruction_weight=0.5),
}
each_scheme = pytest.mark.parametrize("how", SCHEMES.values(), ids=SCHEMES)


def _scaled() -> ScaledTransform:
    x = torch.randn(50, T, C, generator=torch.Generator().manual_seed(1), dtype=torch.float64) * torch.arange(1, 1 + C) + 2
    base = DCTTransform(T, C)
    return ScaledTransform(base, *fit_scale(base, x, "coefficient"))


COSINES = DCTTransform(T, C)
TRANSFORMS = {"dct": COSINES, "wavelet": WaveletTransform(T, C, "haar"), "scaled": _scaled()}


def _clip() -> torch.Tensor:
    return torch.randn(T, C, generator=torch.Generator().manual_seed(7), dtype=torch.float64).cumsum(0)


def _noise(tf, samples: int, seed: int = 0):
    generator = torch.Generator().manual_seed(seed)
    return lambda: torch.randn(samples, *tf.shape, generator=generator, dtype=torch.float64)


def some_denoiser(y: torch.Tensor, t: int) -> torch.Tensor:
    """Mixes rows and columns of a sample, as a network does, and is no more linear than one."""
    return torch.tanh(0.5 * y + 0.2 * y.roll(1, -2) - 0.1 * y.roll(1, -1)) + 0.001 * t / 1000


def test_the_two_forms_by_hand(generator):
    c, u = torch.randn(2, 5, generator=generator, dtype=torch.float64)
    torch.testing.assert_close(classifier_free(c, u, 0.3, "eq7"), 1.3 * c - 0.3 * u)
    torch.testing.assert_close(classifier_free(c, u, 0.3, "alg1"), 0.3 * c + 0.7 * u)
    assert torch.equal(classifier_free(c, u, 0.0), c) and torch.equal(classifier_free(c, u, 0.0, "alg1"), u)
    torch.testing.assert_close(classifier_free(c, u, 0.3, "eq7"), classifier_free(c, u, 1.3, "alg1"))
    with pytest.raises(ValueError, match="'eq8'"):
        classifier_free(c, u, 1.0, "eq8")


@pytest.mark.parametrize(
    "tf", [COSINES, DCTTransform(T, C, 4), WaveletTransform(T, C, "haar")], ids=["dct", "few rows", "wavelet"]
)
@pytest.mark.parametrize("t", [5, 500, 950])
def test_the_gradient_of_a_linear_denoiser_in_closed_form(tf, t, generator):
    """eps = B y over all entries: y0_hat = G y, and the gradient is 2 (M S G)^T (M S G y - M x), S the synthesis."""
    size, a, w = tf.shape[0] * tf.shape[1], float(A_BAR[t]), 0.7
    b = torch.randn(size, size, generator=generator, dtype=torch.float64) / size**0.5
    y = torch.randn(3, *tf.shape, generator=generator, dtype=torch.float64)
    x, mask = torch.randn(T, C, generator=generator, dtype=torch.float64), keyframe_mask(T, [0, 4, -1])
    found = reconstruction_guided(lambda y, t: (y.flatten(1) @ b.mT).reshape(y.shape), tf, x, mask, A_BAR, w)(y, t)
    g = (torch.eye(size, dtype=torch.float64) - (1 - a) ** 0.5 * b) / a**0.5
    synthesis = tf.inverse(torch.eye(size, dtype=torch.float64).reshape(size, *tf.shape)).flatten(1).mT
    kept = mask[:, None].expand(T, C).ravel().double()[:, None] * synthesis @ g
    flat = y.flatten(1)
    gradient = 2 * (flat @ kept.mT - (mask[:, None] * x).ravel()) @ kept
    estimate = flat @ g.mT - w * a**0.5 / 2 * gradient
    torch.testing.assert_close(y0_hat_of(y, found, a).flatten(1), estimate, atol=1e-9 / a, rtol=1e-9)


class _Net(torch.nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.layer = torch.nn.Linear(C, C)

    def forward(self, y: torch.Tensor, t: int) -> torch.Tensor:
        return torch.tanh(self.layer(y)) + 0.1 * y.mean(-2, keepdim=True)


def test_the_gradient_is_had_in_inference_mode_and_leaves_nothing_behind(generator):
    net, tf, states = _Net(), COSINES, []
    hidden = lambda y, t: (states.append(weakref.ref(out := net(y, t))), out)[1]  # noqa: E731
    y, x, mask = torch.randn(2, *tf.shape, generator=generator), torch.ones(T, C), keyframe_mask(T, [0])
    outside = reconstruction_guided(net, tf, x, mask, A_BAR, 2.0)(y, 300)
    with torch.inference_mode():
        guided = reconstruction_guided(hidden, tf, x * 1, mask.clone(), A_BAR, 2.0)
        inside = guided(y * 1, 300)
    with torch.no_grad():
        assert torch.equal(reconstruction_guided(net, tf, x, mask, A_BAR, 2.0)(y, 300), outside)
    assert torch.equal(inside, outside) and not torch.equal(outside, net(y, 300))
    assert not outside.requires_grad and outside.grad_fn is None
    assert all(p.grad is None for p in net.parameters())
    gc.collect()
    assert [state() for state in states] == [None]


def test_samples_do_not_draw_each_other_and_no_weight_is_no_gradient(generator):
    net, tf = _Net(), COSINES
    y, x, mask = torch.randn(2, 3, *tf.shape, generator=generator), torch.randn(2, T, C, generator=generator), torch.ones(T)
    together = reconstruction_guided(net, tf, x, mask, A_BAR, 2.0)(y, 300)
    alone = reconstruction_guided(net, tf, x[1], mask, A_BAR, 2.0)(y[1, 2], 300)
    torch.testing.assert_close(together[1, 2], alone)
    assert reconstruction_guided(net, tf, x, mask, A_BAR, 0.0) is net


def _walks(count: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return torch.randn(count, T, C, generator=generator, dtype=torch.float64).cumsum(1)


def test_eq_12_and_13_by_hand(generator):
    tf = WaveletTransform(T, C)
    x, z = _walks(2), torch.randn(*tf.shape, generator=generator, dtype=torch.float64)
    mask = torch.zeros(T, C, dtype=torch.bool)
    mask[:, 1:4] = True
    y, a = tf(x[0]) + 0.1, 0.7
    expected = tf(mask * tf.inverse(a**0.5 * tf(x[1]) + (1 - a) ** 0.5 * z) + ~mask * tf.inverse(y))
    torch.testing.assert_close(masked(tf, x[1], mask, lambda: z)(y, a), expected)
    assert masked(tf, x[1], mask, lambda: z, until=0.5)(y, a) is y
    torch.testing.assert_close(noised(tf(x[1]), z, a), a**0.5 * tf(x[1]) + (1 - a) ** 0.5 * z)


@pytest.mark.parametrize("tf", [WaveletTransform(T, C), COSINES], ids=["wavelet", "dct"])
@pytest.mark.parametrize("lead", [(3,), (3, 4)], ids=str)
def test_completion_without_noise_keeps_history_and_future(tf, lead, generator):
    x = _walks(3)
    y = torch.randn(*lead, *tf.shape, generator=generator, dtype=x.dtype)
    padded = pad_history(x[:, :H], T)
    complete = history_completion(tf, padded, H, lambda: torch.randn(y.shape, generator=generator, dtype=x.dtype))
    found = tf.inverse(complete(y, 1.0))
    torch.testing.assert_close(found[..., :H, :], x[:, :H].reshape(3, *[1] * (len(lead) - 1), H, C).expand(*lead, H, C))
    torch.testing.assert_close(found[..., H:, :], tf.inverse(y)[..., H:, :])


def test_completion_is_humanmacs():
    """Against a transcription in matrices: few DCT rows, noise left, known in front of unknown."""
    rows, a = 5, 0.3
    tf = DCTTransform(T, C, rows)
    i, k = np.arange(T), np.arange(rows)[:, None]
    dct = np.sqrt(2 / (T)) * np.cos(np.pi * (i + 0.5) * k / (T))
    dct[0] /= np.sqrt(2)
    generator = torch.Generator().manual_seed(0)
    y, eps = torch.randn(2, 3, rows, C, generator=generator, dtype=torch.float64)
    padded = pad_history(_walks(3)[:, :H], T)
    known = dct.T @ (np.sqrt(a) * dct @ padded.numpy() + np.sqrt(1 - a) * eps.numpy())
    mask = (i < H)[:, None]
    expected = dct @ (mask * known + ~mask * (dct.T @ y.numpy()))
    found = history_completion(tf, padded, H, lambda: eps)(y, a)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_completion_draws_anew_each_step():
    tf = WaveletTransform(T, C)
    generator = torch.Generator().manual_seed(0)
    y = torch.zeros(1, *tf.shape)
    complete = history_completion(tf, torch.zeros(1, T, C), H, lambda: torch.randn(y.shape, generator=generator))
    assert not torch.equal(complete(y, 0.5), complete(y, 0.5))


@pytest.mark.parametrize("rows", [T, 5])
def test_what_a_target_says_outside_of_the_mask_does_not_matter(rows, generator):
    """Where rows are cut off, too: the noise is cut, the target is not."""
    tf, mask, a = DCTTransform(T, C, rows), torch.zeros(T, dtype=torch.bool), 0.4
    mask[[2, -1]] = True
    x, z = _walks(1)[0], torch.randn(*tf.shape, generator=generator, dtype=torch.float64)
    y = torch.randn(3, *tf.shape, generator=generator, dtype=torch.float64)
    known = a**0.5 * x + (1 - a) ** 0.5 * tf.inverse(z)
    expected = tf(torch.where(mask[:, None], known, tf.inverse(y)))
    unknown = x.where(mask[:, None], torch.nan)
    torch.testing.assert_close(masked(tf, unknown, mask, lambda: z)(y, a), expected)
    pasted_by_hand = tf(torch.where(mask[:, None], x, tf.inverse(y)))
    torch.testing.assert_close(pasted(tf, unknown, mask)(y), pasted_by_hand)


def test_a_target_of_each_window_serves_all_its_samples(generator):
    tf, mask, x = COSINES, torch.arange(T) < 2, _walks(3)
    y = torch.randn(3, 4, *tf.shape, generator=generator, dtype=x.dtype)
    for found in (pasted(tf, x, mask)(y), masked(tf, x, mask, lambda: y)(y, 1.0)):
        torch.testing.assert_close(tf.inverse(found)[:, :, :2], x[:, None, :2].expand(3, 4, 2, C))
        torch.testing.assert_close(tf.inverse(found)[:, :, 2:], tf.inverse(y)[:, :, 2:])


@each_scheme
@pytest.mark.parametrize("tf", TRANSFORMS.values(), ids=TRANSFORMS)
def test_who_knows_the_clip_gives_the_clip(how, tf):
    clip, mask = _clip(), keyframe_mask(T, [0, 5, -1])
    knows = lambda y, t: eps_of(y, tf(clip), A_BAR[t])  # noqa: E731
    x = keyframed(knows, tf, clip, mask, A_BAR, INDICES, _noise(tf, 2), how)
    torch.testing.assert_close(x, clip.expand(2, T, C), atol=1e-5, rtol=0)


@each_scheme
@pytest.mark.parametrize("rows", [T, 5])
def test_keyframes_come_back_to_the_bit_where_that_is_promised(how, rows):
    tf, clip, mask = DCTTransform(T, C, rows), _clip(), keyframe_mask(T, [0, 3, -1])
    x = keyframed(some_denoiser, tf, clip, mask, A_BAR, INDICES, _noise(tf, 2), how)
    assert torch.equal(x[:, mask], clip[mask].expand(2, 3, C)) == (how.scheme != "none")
    assert (x[:, ~mask] - clip[~mask]).abs().min() > 1e-6


def _papers_loop(x_start: np.ndarray, drawn: np.ndarray, s: np.ndarray, e: np.ndarray, indices: list[int]) -> np.ndarray:
    """The paper's sampling, frame by frame as it tells it: one clip, noise (steps, 2, C) of its ends made over time."""
    i = np.arange(T)
    dct = np.sqrt(2 / T) * np.cos(np.pi * (2 * i + 1) * i[:, None] / (2 * T))
    dct[0] /= np.sqrt(2)
    x_mid = x_start[1:-1]
    for number, t in enumerate(indices):
        a = float(A_BAR[t])
        a_prev = float(A_BAR[indices[number + 1]]) if number + 1 < len(indices) else 1.0
        ends = np.sqrt(a) * np.stack([s, e]) + np.sqrt(1 - a) * drawn[number]
        y = dct @ np.concatenate([ends[:1], x_mid, ends[1:]])
        eps = some_denoiser(torch.from_numpy(y), t).numpy()
        y0 = (y - np.sqrt(1 - a) * eps) / np.sqrt(a)
        x_mid = (dct.T @ (np.sqrt(a_prev) * y0 + np.sqrt(1 - a_prev) * eps))[1:-1]
    return np.concatenate([s[None], x_mid, e[None]])


def test_the_defaults_are_the_papers_loop():
    """Draw by draw: white noise over time and its cosine coefficients are the same noise."""
    tf, clip = COSINES, _clip()
    over_time = torch.randn(1 + len(INDICES) + 1, T, C, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    draws = (tf(z) for z in over_time)
    found = keyframed(some_denoiser, tf, clip, keyframe_mask(T, [0, -1]), A_BAR, INDICES, lambda: next(draws), PAPER)
    expected = _papers_loop(over_time[0].numpy(), over_time[1:, [0, -1]].numpy(), clip[0].numpy(), clip[-1].numpy(), INDICES)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_noise_over_time_and_noise_in_coefficients_have_the_same_mean_and_variance():
    tf, clip, many = COSINES, _clip(), 4000
    mask, shared = keyframe_mask(T, [0, -1]), (A_BAR, ddim_indices(1000, 4))
    in_coefficients = keyframed(some_denoiser, tf, clip, mask, *shared, _noise(tf, many), PAPER)
    noise = _noise(tf, many, 1)
    over_time = keyframed(some_denoiser, tf, clip, mask, *shared, lambda: tf(noise()), PAPER)
    errors = (in_coefficients.var(0) * 2 / many).sqrt()[~mask]
    assert (((in_coefficients.mean(0) - over_time.mean(0))[~mask]) / errors).abs().max() < 4.5
    ratio = (in_coefficients.std(0) / over_time.std(0))[~mask]
    assert (ratio - 1).abs().max() < 4.5 / many**0.5


def test_the_network_sees_keyframes_at_the_level_of_the_rest_from_the_first_step_on():
    tf, clip, mask, seen = COSINES, _clip(), keyframe_mask(T, [2, 7]), []
    zeros = lambda: torch.zeros(1, *tf.shape, dtype=torch.float64)  # noqa: E731
    watched = lambda y, t: (seen.append((t, tf.inverse(y)[0, mask])), some_denoiser(y, t))[1]  # noqa: E731
    keyframed(watched, tf, clip, mask, A_BAR, INDICES, zeros, PAPER)
    assert [t for t, _ in seen] == INDICES
    for t, frames in seen:
        torch.testing.assert_close(frames, float(A_BAR[t]) ** 0.5 * clip[mask], atol=1e-12, rtol=0)


@pytest.mark.parametrize("kind, different", [("fresh", True), ("fixed", False)])
def test_keyframe_noise_is_fresh_or_fixed(kind, different):
    tf, clip, mask, seen = COSINES, _clip(), keyframe_mask(T, [0]), []

    def watched(y, t):
        a = float(A_BAR[t])
        seen.append((tf.inverse(y)[0, 0] - a**0.5 * clip[0]) / (1 - a) ** 0.5)
        return some_denoiser(y, t)

    keyframed(watched, tf, clip, mask, A_BAR, INDICES, _noise(tf, 1), KeyframeConfig(keyframe_noise=kind))
    assert bool(((seen[0] - torch.stack(seen)).abs() > 1e-3).any()) is different


@each_scheme
def test_a_batch_is_its_samples_one_by_one(how):
    tf, mask = COSINES, keyframe_mask(T, [0, -1])
    clips = _clip() + torch.arange(3)[:, None, None]

    def sample(x, windows):
        noise = WindowNoise(3, windows, (4, *tf.shape))
        return keyframed(some_denoiser, tf, x, mask, A_BAR, INDICES, lambda: noise().double(), how)

    together = sample(clips, range(3))
    assert together.shape == (3, 4, T, C)
    for n in range(3):
        torch.testing.assert_close(sample(clips[n : n + 1], [n]), together[n : n + 1], atol=1e-12, rtol=0)


@each_scheme
@pytest.mark.parametrize("rows", [T, 5])
def test_frames_outside_of_the_mask_do_not_matter(how, rows):
    """Not even where the transform mixes frames and loses some of them; unknown frames may be NaN."""
    tf, mask, clip = DCTTransform(T, C, rows), keyframe_mask(T, [1, -1]), _clip()
    unknown = clip.where(mask[:, None], torch.nan)
    sample = lambda x, m: keyframed(some_denoiser, tf, x, m, A_BAR, INDICES, _noise(tf, 2), how)  # noqa: E731
    assert torch.equal(sample(unknown, mask), sample(clip, mask))
    assert torch.equal(sample(unknown, mask[:, None].expand(T, C)), sample(clip, mask.double()))


def test_a_mask_may_choose_channels():
    tf, clip = COSINES, _clip()
    mask = torch.zeros(T, C, dtype=torch.bool)
    mask[4, :3] = True
    x = keyframed(some_denoiser, tf, clip, mask, A_BAR, INDICES, _noise(tf, 2), PAPER)
    assert torch.equal(x[:, 4, :3], clip[4, :3].expand(2, 3)) and (x[:, 4, 3:] - clip[4, 3:]).abs().min() > 1e-3


def test_a_soft_mask_mixes():
    x, target = torch.zeros(2, 3, 4, 1), torch.full((4, 1), 2.0)
    found = with_keyframes(x, target, torch.tensor([1.0, 0.25, 0, 0]))
    assert found[1, 2].ravel().tolist() == [2, 0.5, 0, 0]


def test_repeats_cost_what_they_say():
    """r evaluations of the network a step."""
    tf, asked, how = COSINES, [], KeyframeConfig(repeats=4, eta=0.5)
    counted = lambda y, t: (asked.append(t), some_denoiser(y, t))[1]  # noqa: E731
    keyframed(counted, tf, _clip(), keyframe_mask(T, [0]), A_BAR, INDICES, _noise(tf, 1), how)
    assert asked == [t for t in INDICES for _ in range(4)]


def test_the_process_is_the_samplers_where_nothing_is_known():
    """An empty mask leaves DDIM alone."""
    tf, empty = COSINES, torch.zeros(T, dtype=torch.bool)
    *_, plain = ddim(some_denoiser, _noise(tf, 2)(), A_BAR, INDICES)
    for how in (PAPER, KeyframeConfig("paste"), KeyframeConfig("none", reconstruction_weight=3.0)):
        x = keyframed(some_denoiser, tf, _clip(), empty, A_BAR, INDICES, _noise(tf, 2), how)
        torch.testing.assert_close(x, tf.inverse(plain.y), atol=1e-9, rtol=0)


@pytest.mark.parametrize("keyframes", [[], [T], [-T - 1]], ids=str)
def test_keyframes_must_be_of_the_motion(keyframes):
    with pytest.raises(ValueError, match=r"expected one or more of -12 to 11"):
        keyframe_mask(T, keyframes)
