"""A trained matcher: it scales by itself, padding changes nothing, gradients pass, its own scores and null checks are sound."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.experiments import get_model, get_result, get_run, system
from mwlib.matching import system as matching_system
from mwlib.matching.system import DETAILS, METRICS, null_checks
from mwlib.metrics import fid, r_precision
from tests.matching.sample import parts, small, toy_clips, untrained


def padded(clips) -> tuple[torch.Tensor, torch.Tensor]:
    rows = [torch.from_numpy(clip.features) for clip in clips]
    return torch.nn.utils.rnn.pad_sequence(rows, batch_first=True), torch.tensor([len(row) for row in rows])


def test_motions_come_in_raw_and_the_matcher_scales_them():
    matcher = untrained()
    x, lengths = padded(toy_clips()[:6])
    found = matcher.embed_motion(x, lengths)
    assert found.shape == (6, 6)
    scaled = (x - matcher.statistics.mean) / matcher.statistics.deviation
    kept = torch.arange(x.shape[1]) < 4 * (lengths[:, None] // 4)
    codes = matcher.movement(torch.nn.functional.pad(scaled * kept[..., None], (0, 0, 0, 8 - x.shape[1] % 4)))
    torch.testing.assert_close(found, matcher.network.motion(codes, lengths // 4))
    forgotten = matcher.embed_motion(scaled, lengths)
    assert (found - forgotten).norm(dim=1).min() > 0.05, "motion that was scaled before is another motion"


def test_neither_padding_nor_order_nor_company_changes_an_embedding():
    matcher, clips = untrained(), [*toy_clips()[:7]]
    x, lengths = padded(clips)
    found = matcher.embed_motion(x, lengths)
    more = torch.nn.functional.pad(x, (0, 0, 0, 9), value=torch.nan)
    for row, n in zip(more, lengths, strict=True):
        row[n:] = torch.nan
    torch.testing.assert_close(matcher.embed_motion(more, lengths), found)
    torch.testing.assert_close(matcher.embed_motion(x.flip(0), lengths.flip(0)), found.flip(0))
    alone = torch.cat([matcher.embed_motions([torch.from_numpy(clip.features)]) for clip in clips])
    torch.testing.assert_close(alone, found)
    torch.testing.assert_close(matcher.embed_motions([torch.from_numpy(clip.features) for clip in clips * 60])[-7:], found)
    matcher = untrained()
    texts = ["The arm moves much.", "hip", "Much, much more says the little head than the leg."]
    found = matcher.embed_text(texts)
    torch.testing.assert_close(torch.cat([matcher.embed_text([text]) for text in texts]), found)
    torch.testing.assert_close(matcher.embed_text(texts * 100)[-3:], found)
    torch.testing.assert_close(*matcher.embed_text(["the elephant moves", "the rhinoceros moves"]))
    assert not torch.allclose(*matcher.embed_text(["the arm moves", "the rhinoceros moves"]))


def test_a_critic_passes_gradients_to_the_motion_and_learns_nothing():
    matcher = untrained()
    x, lengths = padded(toy_clips()[:3])
    x.requires_grad_()
    target = matcher.embed_text(["The arm moves much."] * 3)
    (matcher.embed_motion(x, lengths) - target).square().sum().backward()
    assert x.grad is not None and x.grad.isfinite().all()
    for row, n in zip(x.grad, lengths.tolist(), strict=True):
        whole = n // 4 * 4
        assert (row[:whole, :-4] != 0).any(1).all() and (row[whole:] == 0).all() and (row[:, -4:] == 0).all()
    weights = [*matcher.network.parameters(), *matcher.movement.parameters()]
    assert not any(p.requires_grad or p.grad is not None for p in weights)
    torch.optim.SGD([x], lr=1e-3).step()
    moved = (matcher.embed_motion(x.detach(), lengths) - target).square().sum()
    x = padded(toy_clips()[:3])[0]
    assert moved < (matcher.embed_motion(x, lengths) - target).square().sum()


def test_what_does_not_fit_is_refused(unchecked):
    matcher = untrained()
    x, lengths = padded(toy_clips()[:2])
    for bad, counts in ((x[..., 1:], lengths), (x, lengths + 40), (x, torch.tensor([8, 3]))):
        with pytest.raises(ValueError, match=r"expected \(B, T, 263\) and lengths from 4 to T"):
            matcher.embed_motion(bad, counts)
    for bad in ("a man walks", []):
        with pytest.raises(ValueError, match="expected a sequence of at least one sentence"):
            matcher.embed_text(bad)
    with pytest.raises(ValueError, match="there are 7 test clips; expected at least the pool of 8"):
        matching_system.evaluate(small(), untrained, parts()._replace(test=parts().test[:7]))


@pytest.mark.parametrize("pool", [8, 16, 32])
def test_null_checks_of_perfect_embeddings(pool, generator):
    x = torch.randn(2000, 5, generator=generator)
    assert float(r_precision(x, x, pool)[0]) == 1
    shuffled, floor = null_checks(x, x, generator, pool)
    chance = torch.arange(1, 4) / pool
    assert ((shuffled - chance).abs() < 4 * (chance / 2000).sqrt()).all()
    assert 0 < floor < 0.1
    rows = torch.tensor([[0.0], [1.0], [2.0], [3.0]])
    floors = {round(null_checks(rows, rows, torch.Generator().manual_seed(s), 2, 1)[1], 6) for s in range(30)}
    halves = [((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2))]
    assert floors == {round(fid(rows[list(a)], rows[list(b)]), 6) for a, b in halves}


def test_a_run_is_trained_once_and_judged(monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    cfg = small(train_steps=80, batch=16, lr=1e-2, movement_steps=30, ema=0.0, loss="infonce", checkpoint_every=40)
    result = get_result(cfg, parts())
    assert {*result["mean"]} <= {*METRICS, *DETAILS} and {*METRICS} <= {*result["mean"]} and result["windows"] == 40
    mean = result["mean"]
    assert mean["top1"] <= mean["top2"] <= mean["top3"] and mean["top3"] > 0.6 > mean["shuffled"]
    assert mean["chance"] == 3 / 8 and mean["top3_of_8"] > mean["top3_of_32"] and "top1_of_64" not in mean
    assert abs(mean["shuffled"] - mean["chance"]) < 0.15 and 0 < result["standard_error"]["top1"] < 0.1
    folder = get_run(cfg, parts())
    assert (
        get_run(cfg.override(pool=4, repeats=1), parts())
        == folder
        != get_run(cfg.override(half="critic", train_steps=3), parts())
    )
    one, other = get_model(cfg, parts()), get_model(cfg, parts())
    x, lengths = padded(parts().test[:4])
    assert torch.equal(one.embed_motion(x, lengths), other.embed_motion(x, lengths))
    assert np.isclose(get_result(cfg.override(pool=16), parts())["mean"]["chance"], 3 / 16)


def test_it_is_known_by_name(monkeypatch):
    assert system("matching") is matching_system and matching_system.Config.system == "matching"
    monkeypatch.setattr(matching_system, "load_clips", lambda source: parts()._replace(test=[*parts().test][: source.clips]))
    assert len(matching_system.load_data(small(clips=9)).test) == 9
