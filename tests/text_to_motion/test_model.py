"""Sampling: a motion depends on its sentence, its length, its seed and its number, and on nothing else."""

from __future__ import annotations

import pytest
import torch
from torch.testing import assert_close

from tests.text_to_motion.sample import toy, untrained


@pytest.mark.parametrize("changes", [
    {}, {"sampler": "ddim", "sampling_steps": 4}, {"sampler": "sde_dpm", "sampling_steps": 5},
    {"guidance": 1.0}, {"frames_per_token": 4}, {"network": "unet", "width": 64, "multipliers": (1, 1)}])  # fmt: skip
def test_a_motion_does_not_depend_on_what_is_sampled_with_it(changes):
    one = untrained(**changes)
    texts, frames = ["a person goes up", "someone falls", "a person goes up"], [8, 20, 16]
    together = one.sample(texts, frames, seed=3)
    assert [tuple(x.shape) for x in together] == [(8, 263), (20, 263), (16, 263)]
    alone = one.sample(texts[2:], frames[2:], seed=3, ids=[2])[0]
    assert_close(alone, together[2], atol=2e-4, rtol=2e-4)
    other = one.sample(texts[2:], frames[2:], seed=4, ids=[2])[0]
    assert not torch.allclose(alone, other, atol=1e-2)
    assert all(torch.isfinite(x).all() for x in together)


def test_a_hashed_text_is_read_and_settings_of_the_training_stay():
    one = untrained(text="ngrams")
    unseen = one.sample(["someone ascends"], [8], seed=0)[0]
    assert not torch.allclose(unseen, one.sample(["someone falls"], [8], seed=0)[0])
    with pytest.raises(ValueError, match="width belongs to the trained model"):
        untrained().with_sampling(width=32)


def test_guidance_is_a_line_through_both_estimates():
    one = untrained()
    y, mask = torch.randn(2, 8, 263), torch.ones(2, 8, dtype=torch.bool)
    texts = ["someone falls", "a person goes up"]
    eps = {s: one.with_sampling(guidance=s)._denoise(texts, mask)(y, 6) for s in (0.0, 1.0, 2.5)}
    assert_close(eps[2.5], eps[0.0] + 2.5 * (eps[1.0] - eps[0.0]), atol=1e-4, rtol=1e-4)
    assert not torch.allclose(eps[0.0], eps[1.0])
    others = {s: one.with_sampling(guidance=s)._denoise(["someone waves", "a person sits"], mask)(y, 6) for s in (0.0, 1.0)}
    assert_close(others[0.0], eps[0.0])  # without guidance no sentence is heard
    assert not torch.allclose(others[1.0], eps[1.0])


def test_guidance_stops_below_a_noise_level():
    one = untrained(guidance=2.5)
    part = one.with_sampling(guidance_above=0.5)
    y, mask, texts = torch.randn(2, 8, 263), torch.ones(2, 8, dtype=torch.bool), ["someone falls", "a person goes up"]
    half = len(one.alpha_bar) // 2
    for t, like in ((half, one), (half - 1, one.with_sampling(guidance=1.0))):
        assert_close(part._denoise(texts, mask)(y, t), like._denoise(texts, mask)(y, t))
    assert not torch.allclose(one._denoise(texts, mask)(y, half - 1), part._denoise(texts, mask)(y, half - 1))


def test_a_network_that_knows_the_answer_gives_it():
    """Whatever the sampler: a clean estimate that is right at every step is what comes out."""
    clip = toy().test[0]
    n = len(clip.features) // 4 * 4
    raw = torch.from_numpy(clip.features[:n])
    for changes in ({}, {"sampler": "ddim"}, {"sampler": "sde_dpm", "sampling_steps": 5}):
        one = untrained(guidance=1.0, **changes)
        y = one.statistics.normalise(raw)
        one.net.forward = lambda y_t, *_, y=y: y[None].expand_as(y_t)
        assert_close(one.sample(["someone rises"], [n])[0], raw, atol=1e-4, rtol=1e-4)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("texts, frames, message", [
    ([], [], "0 lengths for 0 sentences"), (["a"], [8, 8], "2 lengths for 1 sentences"),
    (["a", " "], [8, 8], r"texts\[1\] is ' '; expected a sentence"), ("a", [8], "texts is 'a'; expected several sentences"),
    (["a"], [8.0], r"frames\[0\] is 8.0; expected a whole number"), (["a"], 8, "frames is 8; expected several whole numbers"),
    (["a"], [4], "frames is 4; expected 8 to 24 at 20 Hz"), (["a"], [28], "frames is 28"),
])  # fmt: skip
def test_sentences_and_lengths_that_do_not_fit_are_refused(texts, frames, message):
    with pytest.raises(ValueError, match=message):
        untrained().sample(texts, frames)
    with pytest.raises(ValueError, match="seed is -1; expected at least 0"):
        list(untrained().steps(["a"], [8], -1))
