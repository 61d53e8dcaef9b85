"""The training loop: resumes to the bit (after real kills), refuses what is not its own, disturbs nobody's randomness."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from mwlib.experiments import train_run
from mwlib.files import load_tensors
from mwlib.prediction.objective import PredictionObjective
from mwlib.training import CHECKPOINT, MODEL, train
from tests.sample_settings import small, two_people

ROOT = Path(__file__).parents[2]


def equal(found: Path, expected: Path) -> bool:
    """Whether two files hold the same tensors, to the bit."""
    (here, _), (there, _) = load_tensors(found), load_tensors(expected)
    return here.keys() == there.keys() and all(torch.equal(here[name], there[name]) for name in there)


def test_resume_equals_uninterrupted_at_every_step(finished, tmp_path):
    for stop in (1, 4, 11):
        folder = tmp_path / str(stop)
        for step in train_run(small(), two_people(), folder):
            if step.step == stop:
                break
        list(train_run(small(), two_people(), folder))
        for name in (MODEL, CHECKPOINT):
            assert equal(folder / name, finished / name), f"stopped at {stop}: {name}"


KILLED = """
import sys; from pathlib import Path; import torch; torch.set_num_threads(1)
from tests.sample_settings import small, two_people
from mwlib.experiments import train_run
for s in train_run(small(train_steps=40, checkpoint_every=1), two_people(), Path(sys.argv[1])): print(s.step, flush=True)
"""


def test_kill_minus_nine_at_any_moment(tmp_path):
    def start(folder):
        return subprocess.Popen(
            [sys.executable, "-c", KILLED, str(folder)], stdout=subprocess.PIPE, text=True, cwd=ROOT,
            env={**os.environ, "PYTHONPATH": ".", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip

    reference = start(tmp_path / "whole")
    killed, reached = 0, 0
    while reached < 40 and killed < 3:
        process = start(tmp_path / "killed")
        for line in process.stdout:
            if int(line) >= min(reached + 9, 40):
                break
        time.sleep(0.004 * (killed + 1))  # anywhere within a step, also while a checkpoint is written
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        killed, reached = killed + 1, reached + 9
    last = start(tmp_path / "killed")
    lines = last.communicate()[0].split()
    assert int(lines[0]) > 15, "the killed run began again from the start"
    reference.communicate()
    assert killed == 3 and last.returncode == reference.returncode == 0
    for name in (MODEL, CHECKPOINT):
        assert equal(tmp_path / "killed" / name, tmp_path / "whole" / name)


def test_a_checkpoint_of_another_configuration_is_refused(finished):
    with pytest.raises(ValueError, match="use another folder"):
        next(train_run(small(lr=1e-3, train_steps=20), two_people(), finished))


def test_the_callers_randomness_is_left_alone():
    cfg = small(train_steps=2)
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    list(train(lambda learnt: PredictionObjective(cfg, two_people().train[:2], (), learnt), cfg.training))
    assert torch.equal(torch.rand(1), expected)


def test_a_finished_training_goes_no_further(finished):
    assert list(train_run(small(), two_people(), finished)) == []


def test_validation_comes_with_the_checkpoints():
    cfg = small(train_steps=7, checkpoint_every=3)
    steps = list(train(lambda learnt: PredictionObjective.of_split(cfg, two_people(), learnt), cfg.training))
    assert [s.step for s in steps if s.validation is not None] == [3, 6, 7]
    alone = list(train(lambda learnt: PredictionObjective(cfg, two_people().train, (), learnt), cfg.training))
    assert all(s.validation is None for s in alone) and [s.loss for s in alone] == [s.loss for s in steps]
