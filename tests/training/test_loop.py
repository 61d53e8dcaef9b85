"""The training loop: resumes to the bit, refuses what is not its own, disturbs nobody's randomness."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from accelerate.state import AcceleratorState

from mwlib.diffusion import noised
from mwlib.experiments import load_run, train_run
from mwlib.prediction.objective import PredictionObjective
from mwlib.training import CHECKPOINT, MODEL, TrainingConfig, learning_rate, read_model, seeded, train
from mwlib.training.checkpoint import load_tensors
from tests.forked import started
from tests.sample_settings import small, two_people
from tests.training.line import SETTINGS, Line, one_of_several

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


def test_a_checkpoint_of_another_configuration_is_refused(finished):
    with pytest.raises(ValueError, match="use another folder"):
        next(train_run(small(lr=1e-3, train_steps=20), two_people(), finished))


def test_the_callers_randomness_is_left_alone(tmp_path):
    """By dropout, initial weights, the copy for the validation, checkpoints and the model read again."""
    cfg = small(train_steps=4, checkpoint_every=2)
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    steps = list(train_run(cfg, two_people(), tmp_path))
    load_run(tmp_path)
    assert torch.equal(torch.rand(1), expected) and steps[1].validation is not None


def test_a_finished_training_goes_no_further(finished):
    assert list(train_run(small(), two_people(), finished)) == []


def test_validation_comes_with_the_checkpoints():
    cfg = small(train_steps=7, checkpoint_every=3)
    steps = list(train(lambda learnt: PredictionObjective(cfg, two_people(), learnt), cfg.training))
    assert [s.step for s in steps if s.validation is not None] == [3, 6, 7]
    alone = list(train(lambda learnt: PredictionObjective(cfg, two_people()._replace(validation=[]), learnt), cfg.training))
    assert all(s.validation is None for s in alone) and [s.loss for s in alone] == [s.loss for s in steps]


def by_hand(settings: TrainingConfig, processes: int = 1) -> tuple[torch.Tensor, torch.Tensor]:
    """Weights of `Line` after the training, and their moving average: AdamW on the mean of the processes' gradients."""
    w, m, v = (torch.zeros(3, dtype=torch.float64) for _ in range(3))
    average = w
    for step in range(1, settings.train_steps + 1):
        gradients = []
        for process in range(processes):
            with seeded(settings.seed, step, process) as generator:
                x = torch.randn(settings.batch // processes, 3, generator=generator).double()
            gradients.append(2 * ((x @ w - x.sum(1))[:, None] * x).mean(0))
        g = torch.stack(gradients).mean(0)
        if settings.clip_gradient:
            g = g * min(1.0, settings.clip_gradient / float(g.norm()))
        lr = learning_rate(settings, step - 1)
        m, v = 0.9 * m + 0.1 * g, 0.999 * v + 0.001 * g**2
        step_of = (m / (1 - 0.9**step)) / ((v / (1 - 0.999**step)).sqrt() + 1e-8)
        w = w - lr * settings.weight_decay * w - lr * step_of
        average = w if step <= settings.ema_start else settings.ema * average + (1 - settings.ema) * w
    return w, average


@pytest.mark.parametrize("clip", [0.0, 0.1])
def test_a_training_by_hand(tmp_path, clip):
    """Weights, their average in the finished model, and the learning rate of every step."""
    settings = replace(SETTINGS, clip_gradient=clip)
    line = Line()
    steps = list(train(lambda learnt: line, settings, tmp_path))
    w, average = by_hand(settings)
    torch.testing.assert_close(line.network.weight.detach()[0].double(), w, rtol=0, atol=1e-6)
    torch.testing.assert_close(read_model(tmp_path)[0]["weight"][0].double(), average, rtol=0, atol=1e-6)
    assert (w - average).abs().max() > 1e-3
    assert [s.lr for s in steps] == pytest.approx([0.05, 0.05, 0.025, 0.025, 0.025, 0.0125, 0.0125])


def test_the_validation_is_of_the_averaged_weights():
    line = Line()
    list(train(lambda learnt: line, SETTINGS))
    averages = [by_hand(replace(SETTINGS, train_steps=steps))[1] for steps in (2, 4, 6, 7)]
    torch.testing.assert_close(torch.stack(line.validated).double(), torch.stack(averages), rtol=0, atol=1e-6)


@pytest.fixture
def one_precision() -> Iterator[None]:
    """Accelerate keeps one precision for a process: forget it before and after."""
    AcceleratorState._reset_state(reset_partial_state=True)
    yield
    AcceleratorState._reset_state(reset_partial_state=True)


class Watched(PredictionObjective):
    """Remembers in which precision loss and network ran, and what the network was given."""

    def loss(self, network, batch, generator):
        self.batch, self.target = batch, self.representation.encode(batch)
        self.outside = torch.is_autocast_enabled("cpu")
        self.network.register_forward_pre_hook(lambda _, given: setattr(self, "given", given[:2]))
        self.network.enter.register_forward_pre_hook(lambda *_: setattr(self, "inside", torch.is_autocast_enabled("cpu")))
        return super().loss(network, batch, generator)


def test_half_precision_stays_within_the_network(one_precision):
    """Transform, scales, schedule and target are those of float32."""
    cfg = small(mixed_precision="bf16", train_steps=1, representation="displacement")
    watched = Watched(cfg, two_people()._replace(validation=[]))
    (step,) = train(lambda learnt: watched, cfg.training)
    assert watched.inside and not watched.outside and step.loss > 0
    y_t, t = watched.given
    alone = PredictionObjective(cfg, two_people()._replace(validation=[]))
    expected = alone.representation.encode(watched.batch)
    torch.testing.assert_close(watched.target, expected, rtol=0, atol=1e-6)
    with seeded(cfg.training.seed, 1, 0) as generator:
        alone.draw(8, generator)
        assert torch.equal(t, torch.randint(1, cfg.diffusion.steps, (8,), generator=generator))
        eps = torch.randn(expected.shape, generator=generator)
    torch.testing.assert_close(y_t, noised(expected, eps, alone.denoising.alpha_bar[t]), rtol=0, atol=1e-6)


def test_two_processes_share_each_batch(tmp_path):
    """Each draws half of a batch of its own; gradients are averaged, so that both have the weights worked out by hand."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    shared = {"OMP_NUM_THREADS": "1", "ACCELERATE_USE_CPU": "true", "WORLD_SIZE": "2"}
    shared |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port), "GLOO_SOCKET_IFNAME": "lo"}
    logs = [tmp_path / f"{rank}.log" for rank in "01"]
    processes = [
        started(one_of_several, tmp_path, log=log, cwd=ROOT, env={**shared, "RANK": log.stem, "LOCAL_RANK": log.stem})
        for log in logs
    ]
    for process in processes:
        process.join(300)
    assert [process.exitcode for process in processes] == [0, 0], "\n".join(log.read_text() for log in logs)
    weights = [torch.load(tmp_path / f"{rank}.pt") for rank in "01"]
    w, average = by_hand(SETTINGS, processes=2)
    assert torch.equal(*weights)
    torch.testing.assert_close(weights[0].double(), w, rtol=0, atol=1e-6)
    torch.testing.assert_close(read_model(tmp_path)[0]["weight"][0].double(), average, rtol=0, atol=1e-6)
