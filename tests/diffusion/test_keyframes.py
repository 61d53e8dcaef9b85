"""Keyframe schemes: what they promise, the paper's loop in numpy, and independence of how samples are grouped."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest
import torch

from mwlib.diffusion import (
    KeyframeConfig,
    WindowNoise,
    alpha_bar,
    ddim,
    ddim_indices,
    eps_of,
    keyframe_mask,
    keyframe_steps,
    keyframed,
    with_keyframes,
)  # fmt: skip
from mwlib.transforms import DCTTransform, ScaledTransform, WaveletTransform, fit_scale

T, C = 12, 6
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


TRANSFORMS = {"dct": DCTTransform(T, C), "wavelet": WaveletTransform(T, C, "haar"), "scaled": _scaled()}


def _clip() -> torch.Tensor:
    return torch.randn(T, C, generator=torch.Generator().manual_seed(7), dtype=torch.float64).cumsum(0)


def _noise(tf, samples: int, seed: int = 0):
    generator = torch.Generator().manual_seed(seed)
    return lambda: torch.randn(samples, *tf.shape, generator=generator, dtype=torch.float64)


def some_denoiser(y: torch.Tensor, t: int) -> torch.Tensor:
    """Mixes rows and columns of a sample, as a network does, and is no more linear than one."""
    return torch.tanh(0.5 * y + 0.2 * y.roll(1, -2) - 0.1 * y.roll(1, -1)) + 0.001 * t / 1000


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
    tf, clip = DCTTransform(T, C), _clip()
    over_time = torch.randn(1 + len(INDICES) + 1, T, C, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    draws = (tf(z) for z in over_time)
    found = keyframed(some_denoiser, tf, clip, keyframe_mask(T, [0, -1]), A_BAR, INDICES, lambda: next(draws), PAPER)
    expected = _papers_loop(over_time[0].numpy(), over_time[1:, [0, -1]].numpy(), clip[0].numpy(), clip[-1].numpy(), INDICES)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_noise_over_time_and_noise_in_coefficients_have_the_same_mean_and_variance():
    tf, clip, many = DCTTransform(T, C), _clip(), 4000
    mask, shared = keyframe_mask(T, [0, -1]), (A_BAR, ddim_indices(1000, 4))
    in_coefficients = keyframed(some_denoiser, tf, clip, mask, *shared, _noise(tf, many), PAPER)
    noise = _noise(tf, many, 1)
    over_time = keyframed(some_denoiser, tf, clip, mask, *shared, lambda: tf(noise()), PAPER)
    errors = (in_coefficients.var(0) * 2 / many).sqrt()[~mask]
    assert (((in_coefficients.mean(0) - over_time.mean(0))[~mask]) / errors).abs().max() < 4.5
    ratio = (in_coefficients.std(0) / over_time.std(0))[~mask]
    assert (ratio - 1).abs().max() < 4.5 / many**0.5


def test_the_network_sees_keyframes_at_the_level_of_the_rest_from_the_first_step_on():
    tf, clip, mask, seen = DCTTransform(T, C), _clip(), keyframe_mask(T, [2, 7]), []
    zeros = lambda: torch.zeros(1, *tf.shape, dtype=torch.float64)  # noqa: E731
    watched = lambda y, t: (seen.append((t, tf.inverse(y)[0, mask])), some_denoiser(y, t))[1]  # noqa: E731
    list(keyframe_steps(watched, tf, clip, mask, A_BAR, INDICES, zeros, PAPER))
    assert [t for t, _ in seen] == INDICES
    for t, frames in seen:
        torch.testing.assert_close(frames, float(A_BAR[t]) ** 0.5 * clip[mask], atol=1e-12, rtol=0)


@pytest.mark.parametrize("kind, different", [("fresh", True), ("fixed", False)])
def test_keyframe_noise_is_fresh_or_fixed(kind, different):
    tf, clip, mask, seen = DCTTransform(T, C), _clip(), keyframe_mask(T, [0]), []

    def watched(y, t):
        a = float(A_BAR[t])
        seen.append((tf.inverse(y)[0, 0] - a**0.5 * clip[0]) / (1 - a) ** 0.5)
        return some_denoiser(y, t)

    list(keyframe_steps(watched, tf, clip, mask, A_BAR, INDICES, _noise(tf, 1), KeyframeConfig(keyframe_noise=kind)))
    assert bool(((seen[0] - torch.stack(seen)).abs() > 1e-3).any()) is different


@each_scheme
def test_a_batch_is_its_samples_one_by_one(how):
    tf, mask = DCTTransform(T, C), keyframe_mask(T, [0, -1])
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
    tf, clip = DCTTransform(T, C), _clip()
    mask = torch.zeros(T, C, dtype=torch.bool)
    mask[4, :3] = True
    x = keyframed(some_denoiser, tf, clip, mask, A_BAR, INDICES, _noise(tf, 2), PAPER)
    assert torch.equal(x[:, 4, :3], clip[4, :3].expand(2, 3)) and (x[:, 4, 3:] - clip[4, 3:]).abs().min() > 1e-3


def test_a_soft_mask_mixes():
    x, target = torch.zeros(2, 3, 4, 1), torch.full((4, 1), 2.0)
    found = with_keyframes(x, target, torch.tensor([1.0, 0.25, 0, 0]))
    assert found[1, 2].ravel().tolist() == [2, 0.5, 0, 0]


def test_repeats_cost_what_they_say():
    """r evaluations of the network a step; one item a step."""
    tf, calls, how = DCTTransform(T, C), count(), KeyframeConfig(repeats=4, eta=0.5)
    counted = lambda y, t: (next(calls), some_denoiser(y, t))[1]  # noqa: E731
    steps = list(keyframe_steps(counted, tf, _clip(), keyframe_mask(T, [0]), A_BAR, INDICES, _noise(tf, 1), how))
    assert [s.t for s in steps] == INDICES and next(calls) == 40


def test_the_process_is_the_samplers_where_nothing_is_known():
    """An empty mask leaves DDIM alone."""
    tf, empty = DCTTransform(T, C), torch.zeros(T, dtype=torch.bool)
    *_, plain = ddim(some_denoiser, _noise(tf, 2)(), A_BAR, INDICES)
    for how in (PAPER, KeyframeConfig("paste"), KeyframeConfig("none", reconstruction_weight=3.0)):
        x = keyframed(some_denoiser, tf, _clip(), empty, A_BAR, INDICES, _noise(tf, 2), how)
        torch.testing.assert_close(x, tf.inverse(plain.y), atol=1e-9, rtol=0)


@pytest.mark.parametrize("keyframes", [[], [T], [-T - 1]], ids=str)
def test_keyframes_must_be_of_the_motion(keyframes):
    with pytest.raises(ValueError, match=r"expected one or more of -12 to 11"):
        keyframe_mask(T, keyframes)
