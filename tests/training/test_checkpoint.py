"""What a training keeps: damaged files are refused, the checkpoint before steps in, and a loss that is no number ends the run."""

from __future__ import annotations

import shutil

import pytest
import torch

from mwlib.experiments import load_run, train_run
from mwlib.experiments.runs import CODE
from mwlib.paths import CONFIG
from mwlib.prediction.objective import PredictionObjective
from mwlib.training import CHECKPOINT, MODEL, PREVIOUS, train
from mwlib.training.checkpoint import DamagedFileError, MovingAverage, State, load_tensors, read_checkpoint
from tests.sample_settings import small, two_people


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A run stopped at step 7, with checkpoints of steps 6 and 3; and the same run to its end."""
    folder = tmp_path_factory.mktemp("runs")
    for step in train_run(small(), two_people(), folder / "stopped"):
        if step.step == 7:
            break
    list(train_run(small(), two_people(), folder / "whole"))
    return folder


def spoil(file):
    content = bytearray(file.read_bytes())
    content[-5] ^= 1
    file.write_bytes(bytes(content))


@pytest.mark.parametrize("damage", ["flipped", "cut", "gone"])
def test_the_checkpoint_before_steps_in(stopped, tmp_path, damage):
    folder = shutil.copytree(stopped / "stopped", tmp_path / "run")
    assert [load_tensors(folder / name)[1]["step"] for name in (CHECKPOINT, PREVIOUS)] == ["6", "3"]
    file = folder / CHECKPOINT
    if damage == "flipped":
        spoil(file)
    elif damage == "cut":
        file.write_bytes(file.read_bytes()[:-100])
    else:
        file.unlink()
    assert next(train_run(small(), two_people(), folder)).step == 4
    list(train_run(small(), two_people(), folder))
    for name in (CHECKPOINT, MODEL):
        found, expected = (load_tensors(run / name)[0] for run in (folder, stopped / "whole"))
        assert all(torch.equal(found[k], expected[k]) for k in expected)


def test_without_any_whole_checkpoint_the_run_says_so(stopped, tmp_path):
    folder = shutil.copytree(stopped / "stopped", tmp_path / "run")
    spoil(folder / CHECKPOINT)
    spoil(folder / PREVIOUS)
    with pytest.raises(DamagedFileError, match=r"checkpoint\.safetensors is damaged.*No earlier checkpoint is whole; delete"):
        next(train_run(small(), two_people(), folder))


def test_a_damaged_model_is_refused(stopped, tmp_path):
    folder = shutil.copytree(stopped / "whole", tmp_path / "run")
    spoil(folder / MODEL)
    with pytest.raises(DamagedFileError, match=r"model\.safetensors is damaged"):
        load_run(folder)


def test_a_loss_that_is_no_number_ends_the_run(tmp_path):
    with pytest.raises(ValueError, match=r"(loss of step|not finite after step).*lr"):
        list(train_run(small(lr=1e30), two_people(), tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == {CODE, CONFIG}


def test_the_scale_of_half_precision_is_kept(tmp_path):
    def state() -> State:
        network = torch.nn.Linear(2, 2)
        optimiser = torch.optim.AdamW(network.parameters())
        return State(
            network, MovingAverage(network, 0.9, 0), optimiser, {}, "key", {}, torch.amp.GradScaler("cpu", init_scale=8.0)
        )

    before, after = state(), state()
    loss = before.network(torch.ones(1, 2)).sum()
    before.scaler.scale(loss).backward()
    before.scaler.step(before.optimiser)
    before.scaler.update(4.0)
    before.save(tmp_path, False)
    after.restore(*read_checkpoint(tmp_path, "key"))
    assert after.scaler.get_scale() == 4.0 and after.scaler.state_dict() == before.scaler.state_dict()


def test_trainings_of_one_process_may_differ_in_precision():
    for precision in ("no", "bf16", "no"):
        cfg = small(train_steps=2, mixed_precision=precision)
        losses = [s.loss for s in train(lambda learnt, cfg=cfg: PredictionObjective(cfg, two_people()), cfg.training)]
        assert len(losses) == 2
