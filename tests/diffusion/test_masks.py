"""Masks on the steps of a sampler: what they impose, and that mask completion is HumanMAC's."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.diffusion.conditioning import history_completion, masked, pasted
from mwlib.diffusion.process import noised
from mwlib.transforms import DCTTransform, WaveletTransform, pad_history

H, F, C = 6, 10, 12


def _walks(count: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return torch.randn(count, H + F, C, generator=generator, dtype=torch.float64).cumsum(1)


def test_eq_12_and_13_by_hand(generator):
    tf = WaveletTransform(H + F, C)
    x, z = _walks(2), torch.randn(*tf.shape, generator=generator, dtype=torch.float64)
    mask = torch.zeros(H + F, C, dtype=torch.bool)
    mask[:, 3:9] = True
    y, a = tf(x[0]) + 0.1, 0.7
    expected = tf(mask * tf.inverse(a**0.5 * tf(x[1]) + (1 - a) ** 0.5 * z) + ~mask * tf.inverse(y))
    torch.testing.assert_close(masked(tf, x[1], mask, lambda: z)(y, a), expected)
    assert masked(tf, x[1], mask, lambda: z, until=0.5)(y, a) is y
    torch.testing.assert_close(noised(tf(x[1]), z, a), a**0.5 * tf(x[1]) + (1 - a) ** 0.5 * z)


TRANSFORMS = [WaveletTransform(H + F, C), DCTTransform(H + F, C)]


@pytest.mark.parametrize("tf", TRANSFORMS, ids=lambda tf: type(tf).__name__)
@pytest.mark.parametrize("lead", [(3,), (3, 4)], ids=str)
def test_completion_without_noise_keeps_history_and_future(tf, lead, generator):
    x = _walks(3)
    y = torch.randn(*lead, *tf.shape, generator=generator, dtype=x.dtype)
    padded = pad_history(x[:, :H], H + F)
    complete = history_completion(tf, padded, H, lambda: torch.randn(y.shape, generator=generator, dtype=x.dtype))
    found = tf.inverse(complete(y, 1.0))
    torch.testing.assert_close(found[..., :H, :], x[:, :H].reshape(3, *[1] * (len(lead) - 1), H, C).expand(*lead, H, C))
    torch.testing.assert_close(found[..., H:, :], tf.inverse(y)[..., H:, :])


def test_completion_is_humanmacs():
    """Against a transcription in matrices: few DCT rows, noise left, known in front of unknown."""
    rows, a = 5, 0.3
    tf = DCTTransform(H + F, C, rows)
    i, k = np.arange(H + F), np.arange(rows)[:, None]
    dct = np.sqrt(2 / (H + F)) * np.cos(np.pi * (i + 0.5) * k / (H + F))
    dct[0] /= np.sqrt(2)
    generator = torch.Generator().manual_seed(0)
    y, eps = torch.randn(2, 3, rows, C, generator=generator, dtype=torch.float64)
    padded = pad_history(_walks(3)[:, :H], H + F)
    known = dct.T @ (np.sqrt(a) * dct @ padded.numpy() + np.sqrt(1 - a) * eps.numpy())
    mask = (i < H)[:, None]
    expected = dct @ (mask * known + ~mask * (dct.T @ y.numpy()))
    found = history_completion(tf, padded, H, lambda: eps)(y, a)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_completion_draws_anew_each_step():
    tf = TRANSFORMS[0]
    generator = torch.Generator().manual_seed(0)
    y = torch.zeros(1, *tf.shape)
    complete = history_completion(tf, torch.zeros(1, H + F, C), H, lambda: torch.randn(y.shape, generator=generator))
    assert not torch.equal(complete(y, 0.5), complete(y, 0.5))


@pytest.mark.parametrize("rows", [H + F, 5])
def test_what_a_target_says_outside_of_the_mask_does_not_matter(rows, generator):
    """Where rows are cut off, too: the noise is cut, the target is not."""
    tf, mask, a = DCTTransform(H + F, C, rows), torch.zeros(H + F, dtype=torch.bool), 0.4
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
    tf, mask, x = TRANSFORMS[1], torch.arange(H + F) < 2, _walks(3)
    y = torch.randn(3, 4, *tf.shape, generator=generator, dtype=x.dtype)
    for found in (pasted(tf, x, mask)(y), masked(tf, x, mask, lambda: y)(y, 1.0)):
        torch.testing.assert_close(tf.inverse(found)[:, :, :2], x[:, None, :2].expand(3, 4, 2, C))
        torch.testing.assert_close(tf.inverse(found)[:, :, 2:], tf.inverse(y)[:, :, 2:])
