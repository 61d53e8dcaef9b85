"""Classifier-free guidance in its two spellings; the gradient to a target against its closed form."""

from __future__ import annotations

import gc
import weakref

import pytest
import torch

from mwlib.diffusion import alpha_bar, classifier_free, keyframe_mask, reconstruction_guided, y0_hat_of
from mwlib.transforms import DCTTransform, WaveletTransform

T, C = 10, 6
A_BAR = alpha_bar("cosine", 1000)
TRANSFORMS = {"dct": DCTTransform(T, C), "few rows": DCTTransform(T, C, 4), "wavelet": WaveletTransform(T, C, "haar")}


def test_the_two_forms_by_hand(generator):
    c, u = torch.randn(2, 5, generator=generator, dtype=torch.float64)
    torch.testing.assert_close(classifier_free(c, u, 0.3, "eq7"), 1.3 * c - 0.3 * u)
    torch.testing.assert_close(classifier_free(c, u, 0.3, "alg1"), 0.3 * c + 0.7 * u)
    assert torch.equal(classifier_free(c, u, 0.0), c) and torch.equal(classifier_free(c, u, 0.0, "alg1"), u)


def test_two_forms_of_classifier_free_guidance_agree(generator):
    c, u = torch.randn(2, 5, generator=generator, dtype=torch.float64)
    torch.testing.assert_close(classifier_free(c, u, 0.3, "eq7"), classifier_free(c, u, 1.3, "alg1"))
    with pytest.raises(ValueError, match="'eq8'"):
        classifier_free(c, u, 1.0, "eq8")


@pytest.mark.parametrize("tf", TRANSFORMS.values(), ids=TRANSFORMS)
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
    net, tf, states = _Net(), TRANSFORMS["dct"], []
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
    net, tf = _Net(), TRANSFORMS["dct"]
    y, x, mask = torch.randn(2, 3, *tf.shape, generator=generator), torch.randn(2, T, C, generator=generator), torch.ones(T)
    together = reconstruction_guided(net, tf, x, mask, A_BAR, 2.0)(y, 300)
    alone = reconstruction_guided(net, tf, x[1], mask, A_BAR, 2.0)(y[1, 2], 300)
    torch.testing.assert_close(together[1, 2], alone)
    assert reconstruction_guided(net, tf, x, mask, A_BAR, 0.0) is net
