"""Training: schedules, losses, resume to the bit (after real kills), and what a finished run can do."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from mwlib.checkpoint import load_tensors, save_tensors
from mwlib.config import Config, TrainingConfig
from mwlib.data.synthetic import synthetic_motions
from mwlib.data.windows import windows
from mwlib.runs import prepare
from mwlib.training import CHECKPOINT, MODEL, Objective, learning_rate, load_run, seeded, train

SMALL = dict(
    fps=10.0, history=6, future=14, latent=16, layers=2, heads=2, feedforward=16, dropout=0.1, attention_dropout=0.1,
    train_steps=12, batch=8, checkpoint_every=3, ema_start=4, steps=50, ddim_steps=5, samples=3, warmup=0,
    loss_weight="uniform",
)  # fmt: skip


def small(**changes) -> Config:
    return Config.preset("tiny", **{**SMALL, **changes})


@pytest.fixture(scope="module")
def motions():
    return prepare(synthetic_motions(subjects=2), 10.0)


@pytest.fixture(scope="module")
def finished(motions, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    list(train(small(), motions[:12], folder, motions[12:]))
    return folder


def test_resume_equals_uninterrupted_at_every_step(motions, finished, tmp_path):
    expected, _ = load_tensors(finished / MODEL)
    whole, _ = load_tensors(finished / CHECKPOINT)
    for stop in (1, 4, 11):
        folder = tmp_path / str(stop)
        for step in train(small(), motions[:12], folder, motions[12:]):
            if step.step == stop:
                break
        list(train(small(), motions[:12], folder, motions[12:]))
        for name, expectation in ((MODEL, expected), (CHECKPOINT, whole)):
            found, _ = load_tensors(folder / name)
            assert found.keys() == expectation.keys()
            assert all(torch.equal(found[k], expectation[k]) for k in expectation), f"stopped at {stop}: {name}"


KILLED = """
import sys; from pathlib import Path; import torch; torch.set_num_threads(1)
from tests.test_training import small; from mwlib.runs import prepare; from mwlib.training import train
from mwlib.data.synthetic import synthetic_motions
m = prepare(synthetic_motions(subjects=2), 10.0)
for s in train(small(train_steps=40, checkpoint_every=1), m[:12], Path(sys.argv[1]), m[12:]): print(s.step, flush=True)
"""


def test_kill_minus_nine_at_any_moment(tmp_path):
    def start(folder):
        return subprocess.Popen(
            [sys.executable, "-c", KILLED, str(folder)], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1],
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
        found, expected = (load_tensors(tmp_path / run / name)[0] for run in ("killed", "whole"))
        assert all(torch.equal(found[k], expected[k]) for k in expected)


def test_a_checkpoint_of_another_configuration_is_refused(motions, finished):
    with pytest.raises(ValueError, match="use another folder"):
        next(train(small(lr=1e-3, train_steps=20), motions[:12], finished))


def test_every_step_and_process_draws_anew():
    draws = []
    for numbers in [(0, 1, 0), (0, 2, 0), (0, 1, 1), (1, 1, 0), (0, 2**20, 0)]:
        with seeded(*numbers) as generator:
            draws += [torch.rand(4, generator=generator), torch.rand(4)]
    assert len({tuple(d.tolist()) for d in draws}) == len(draws)


def test_the_callers_randomness_is_left_alone(motions):
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    list(train(small(train_steps=2), motions[:2]))
    assert torch.equal(torch.rand(1), expected)


@pytest.mark.parametrize("prediction", ["eps", "x0", "v"])
@pytest.mark.parametrize(
    "changes", [dict(), dict(transform="dct", dct_rows=8), dict(target="displacement", loss_weight="metric")]
)
def test_every_option_learns(motions, prediction, changes):
    cfg = small(
        prediction=prediction, train_steps=80, lr=1e-2, lr_schedule="constant", dropout=0.0, attention_dropout=0.0, **changes
    )
    losses = [s.loss for s in train(cfg, motions)]
    assert sum(losses[-10:]) < 0.95 * sum(losses[:10])


def test_learning_rates():
    c = TrainingConfig(lr=1.0, lr_schedule="multistep", lr_milestones=(10, 20), lr_gamma=0.2)
    assert [learning_rate(c, s) for s in (0, 9, 10, 19, 20)] == pytest.approx([1, 1, 0.2, 0.2, 0.04])
    c = TrainingConfig(lr=1.0, lr_schedule="cosine_restarts", lr_period=10, lr_gamma=0.9)
    assert [learning_rate(c, s) for s in (0, 5, 10, 25)] == pytest.approx([1, 0.5, 0.9, 0.405])
    c = TrainingConfig(lr=1.0, lr_schedule="cosine", train_steps=100, warmup=10)
    assert [learning_rate(c, s) for s in (0, 50)] == pytest.approx([0.1, 0.5])


def test_restart_schedule_equals_torch():
    c = TrainingConfig(lr=1.0, lr_schedule="cosine_restarts", lr_period=10, lr_gamma=1.0)
    parameter = torch.nn.Parameter(torch.zeros(1))
    optimiser = torch.optim.SGD([parameter], lr=1.0)
    theirs = torch.optim.lr_scheduler.CosineAnnealingWarmRestarts(optimiser, 10)
    for step in range(25):
        assert learning_rate(c, step) == pytest.approx(theirs.get_last_lr()[0])
        optimiser.step()
        theirs.step()


def test_condition_is_dropped_per_sample_or_per_batch(motions, finished):
    predictor = load_run(finished)
    x = windows(motions, 6, 14, 5).x[:64]
    seen = []

    class Spy(torch.nn.Module):
        def forward(self, y, t, condition, keep):
            seen.append(keep)
            return y

    for per, kinds in (("sample", {2}), ("batch", {1})):
        objective = Objective(small(drop_per=per, drop_condition=0.5), predictor.latent, predictor.conditioning)
        objective(Spy(), x, torch.Generator().manual_seed(0))
        assert {len(seen[-1].unique())} == kinds


def test_a_finished_run_predicts(motions, finished):
    p = load_run(finished)
    past = windows(motions, 6, 14, 9).past[:5]
    futures = p.predict(past, samples=3, seed=1)
    assert futures.shape == (5, 3, 14, 48) and futures.isfinite().all()
    torch.testing.assert_close(p.predict(past, 3, 1, chunk=2), futures, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(p.predict(past[3:], 3, 1, window_ids=[3, 4]), futures[3:], atol=1e-5, rtol=1e-5)
    assert not torch.allclose(p.predict(past, 3, 2), futures, atol=1e-3)
    with pytest.raises(ValueError, match=r"expected \(N, 6, 48\)"):
        p.predict(past[:, :5])


@pytest.mark.parametrize(
    "changes",
    [
        dict(wmsg="off"),
        dict(wmsg="x0_only"),
        dict(bound=0.4, wmsg="off"),
        dict(sampler="eq6"),
        dict(eta=0.5),
        dict(cfg_form="alg1", cfg_weight=0.7, tabg_noise="eps_hat", tabg_sigma_place="alg1"),
    ],
)
def test_every_sampling_option_runs(motions, finished, changes):
    p = load_run(finished)
    futures = p.predict(windows(motions, 6, 14, 9).past[:2], 2, sampling=p.with_sampling(**changes))
    assert futures.isfinite().all()
    if "bound" in changes:
        assert futures.abs().max() <= 0.4 + 1e-4


def test_complete_history_puts_the_history_back(motions, finished):
    p = load_run(finished)
    past = windows(motions, 6, 14, 9).past[:2]
    *_, last = p.steps(past, 2, sampling=p.with_sampling(complete_history=True, wmsg="off"))
    torch.testing.assert_close(p.decode(last.y, past)[:, :, :6], past[:, None].expand(-1, 2, -1, -1), atol=1e-4, rtol=1e-3)


def test_loading_nothing_says_what_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"config.yaml is missing"):
        load_run(tmp_path)


def test_files_are_whole_or_not_there(tmp_path):
    file = tmp_path / "a.safetensors"
    save_tensors(file, {"x": torch.arange(3)}, {"step": "1"})
    tensors, metadata = load_tensors(file)
    assert torch.equal(tensors["x"], torch.arange(3)) and metadata["step"] == "1"
