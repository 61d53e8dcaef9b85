"""What a representation loses: nothing for wavelets, what the best linear code loses for components, on people held out."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mwlib.data.sources import Split
from mwlib.data.windows import windows
from mwlib.experiments import read_grids, system
from mwlib.experiments.grids import row_config
from mwlib.metrics import clustered_error
from mwlib.prediction import rebuilding
from mwlib.prediction.rebuilding import METRICS, Config, evaluate, principal
from mwlib.prediction.representation import learning_windows
from mwlib.transforms import DCTTransform, PhaseTransform, pad_history
from tests.sample_settings import SMALL, two_people

H, F, C = 6, 14, 48


@pytest.fixture(scope="module")
def split() -> Split:
    people = two_people()
    return Split(people.train, people.validation[:1], people.validation)


def small(**changes) -> Config:
    return Config.preset("tiny", **{**SMALL, "test_windows": 0, **changes})


def lost(split: Split, **changes) -> dict:
    found = evaluate(small(**changes), lambda: pytest.fail("a representation needs no network"), split)
    assert found["mean"].keys() == found["standard_error"].keys() == METRICS.keys()
    return found


def test_wavelets_lose_rounding(split):
    found = lost(split, transform="wavelet", wavelet="haar")
    assert found["mean"]["error"] < 1e-6 and found["mean"]["rmse"] < 1e-6 and found["mean"]["seen"] < 1e-6
    assert found["mean"]["numbers"] == 10 * 96 / 20 and found["windows"] == len(found["clips"])


@pytest.mark.parametrize("representation", ["pose", "displacement"])
def test_errors_by_hand(split, representation):
    """Distances and squares of a truncated cosine transform; standard errors over clips; the root's by its derivative."""
    found = lost(split, transform="dct", dct_rows=5, representation=representation, test_stride=4)
    cut, tf = windows(split.test, H, F, 4), DCTTransform(H + F, C, 5)
    x = cut.x - cut.x[:, H - 1 : H] if representation == "displacement" else cut.x
    apart = (tf.inverse(tf(x)) - x).double().numpy().reshape(len(x), H + F, C // 3, 3)
    distance = np.sqrt((apart**2).sum(-1)).mean((1, 2))
    square = (apart**2).mean((1, 2, 3))
    clips = [split.test[i].name for i in cut.clip.tolist()]
    assert found["mean"]["numbers"] == 5 * C / (H + F)
    assert found["mean"]["error"] == pytest.approx(distance.mean()) and found["values"]["error"] == pytest.approx(distance)
    assert found["mean"]["rmse"] == pytest.approx(square.mean() ** 0.5)
    assert found["standard_error"]["error"] == pytest.approx(clustered_error(distance, clips))
    smaller, larger = (np.sqrt(square.mean() + sign * clustered_error(square, clips)) for sign in (-0.01, 0.01))
    assert found["standard_error"]["rmse"] == pytest.approx((larger - smaller) / 0.02, rel=1e-3)


def test_components_are_the_best_linear_code():
    frames = torch.randn(500, 7, generator=torch.Generator().manual_seed(0), dtype=torch.float64) @ torch.randn(
        7, 7, generator=torch.Generator().manual_seed(1), dtype=torch.float64
    )
    for components in (1, 3, 7):
        rebuilt = principal(frames, components)(frames)
        values = np.linalg.svd(frames.numpy() - frames.numpy().mean(0), compute_uv=False)
        assert float((rebuilt - frames).square().sum()) == pytest.approx((values[components:] ** 2).sum(), rel=1e-9, abs=1e-18)
    with pytest.raises(ValueError, match="components is 8; expected at most the 7 channels"):
        principal(frames, 8)


def test_components_are_fitted_on_the_people_seen(split):
    few, more = (lost(split, components=k)["mean"] for k in (4, 12))
    assert few["numbers"] == 4 and more["numbers"] == 12
    assert more["error"] < 0.6 * few["error"] and more["seen"] < 0.6 * few["seen"]
    assert lost(split, components=C)["mean"]["error"] < 1e-6
    others = Split(split.train, split.validation, split.test[:2])
    assert lost(others, components=4)["mean"]["seen"] == pytest.approx(few["seen"])


def test_settings_are_chosen_on_one_part_and_reported_on_another(split):
    test, chosen = (lost(split, transform="dct", dct_rows=5, rebuilt=part, test_stride=4) for part in ("test", "validation"))
    assert {*test["clips"]} == {motion.name for motion in split.test}
    assert chosen["mean"]["error"] != test["mean"]["error"] and chosen["mean"]["seen"] == test["mean"]["seen"]
    name, starts = split.validation[0].name, windows(split.validation, H, F, 4).start.tolist()
    assert chosen["clips"] == [f"{name}, {start // (H + F)}" for start in starts], "one clip: its stretches are the clusters"
    assert chosen["standard_error"]["error"] > 0
    with pytest.raises(ValueError, match="rebuilt is 'validation', and nobody is held out for it"):
        lost(split._replace(validation=[]), rebuilt="validation")


def test_a_periodic_autoencoder_is_fitted_once_for_both_parts_and_as_asked(split, monkeypatch):
    asked = []
    fit = PhaseTransform.fit
    monkeypatch.setattr(rebuilding, "_fitted", {})
    monkeypatch.setattr(
        PhaseTransform,
        "fit",
        lambda self, draw, steps, lr: asked.append((len(draw(torch.Generator())), steps, lr)) or fit(self, draw, steps, lr),
    )
    settings = dict(transform="straight_phase", phases=3, phase_steps=4, phase_batch=5, phase_lr=0.02)
    found = [lost(split, rebuilt=part, **settings)["mean"] for part in ("test", "validation")]
    assert asked == [(5, 4, 0.02)] and found[0]["seen"] == found[1]["seen"] and found[0]["numbers"] == 12
    lost(split, **settings | {"phase_lr": 0.01})
    assert asked[1:] == [(5, 4, 0.01)]


def test_an_autoencoder_learns_from_what_is_modelled_and_what_is_conditioned_on(split):
    cfg = small(representation="displacement", augment="none")
    both = learning_windows(cfg, split.train, 3)(torch.Generator().manual_seed(0))
    poses = learning_windows(small(augment="none"), split.train, 3)(torch.Generator().manual_seed(0))
    assert torch.equal(both[:3], poses - poses[:, H - 1 : H]) and torch.equal(both[3:], pad_history(poses[:, :H], H + F))


@pytest.mark.parametrize("changes", [dict(representation="relaxing"), dict(heading="body")])
def test_what_is_not_rebuilt_is_refused(changes):
    with pytest.raises(ValueError, match="expected poses or displacements as people face"):
        small(**changes)


def test_the_grid_chooses_on_the_validation_person():
    grid = read_grids()["phase_sweep"]
    assert system(grid.system) is rebuilding
    parts = {row.name: row_config(grid, row, Config.preset("cmu_paper")).get("rebuilt") for row in grid.rows}
    assert {*parts.values()} == {"validation", "test"}
    assert all((part == "test") == name.startswith("test people: ") for name, part in parts.items())
