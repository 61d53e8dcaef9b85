"""Classifier-free guidance in its two spellings."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import classifier_free


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
