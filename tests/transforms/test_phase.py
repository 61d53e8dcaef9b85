"""The periodic autoencoder: exact on sinusoids, deterministic, stored and restored with the model."""

from __future__ import annotations

import math

import pytest
import torch

from mwlib.data.sources import Split
from mwlib.experiments import load_run, train_run
from mwlib.prediction.config import Config
from mwlib.prediction.representation import make_transform
from mwlib.training import CHECKPOINT, MODEL
from mwlib.training.checkpoint import load_tensors
from mwlib.transforms import PhaseTransform, Transform, periodic_parameters
from mwlib.transforms.phase import Straightened
from tests.sample_settings import small, two_people

FRAMES, CHANNELS, FPS = 30, 6, 20.0


def waves(generator: torch.Generator, batch: int = 16) -> torch.Tensor:
    """Sinusoids of 1 to 2 Hz, one frequency and phase per motion, a fixed mixture of its sine and cosine per channel."""
    frequency, shift = 1 + torch.rand(2, batch, 1, 1, generator=generator)
    turn = 2 * math.pi * (frequency * torch.arange(FRAMES)[:, None] / FPS + shift)
    across = torch.linspace(0, 3, CHANNELS)
    return 0.3 * across.cos() * turn.sin() + 0.2 * across.sin() * turn.cos()


@pytest.fixture(scope="module")
def fitted() -> PhaseTransform:
    tf = PhaseTransform(FRAMES, CHANNELS, phases=3, window=13, fps=FPS)
    tf.fit(waves, steps=150)
    return tf


@pytest.fixture(scope="module")
def x() -> torch.Tensor:
    return waves(torch.Generator().manual_seed(9))


def test_parameters_of_a_sinusoid_are_its_own():
    fps, count = 20.0, 41
    tau = torch.arange(count, dtype=torch.float64) / fps
    for cycles, amplitude, offset in ((1, 0.5, 0.1), (3, 2.0, -1.0)):
        frequency = cycles * fps / count
        signal = amplitude * torch.sin(2 * math.pi * frequency * tau + 0.7) + offset
        a, f, b = periodic_parameters(signal, fps)
        assert (a.item(), f.item(), b.item()) == pytest.approx((amplitude, frequency, offset), rel=1e-5)


def test_two_sinusoids_become_one_with_their_power_and_mean_frequency():
    turn = 2 * math.pi * torch.arange(41, dtype=torch.float64) / 41
    a, f, _ = periodic_parameters(3 * torch.sin(2 * turn) + 4 * torch.cos(6 * turn), 41.0)
    assert (a.item(), f.item()) == pytest.approx((5.0, (9 * 2 + 16 * 6) / 25), rel=1e-5)


def test_a_window_that_stands_still_has_no_amplitude_and_finite_gradients():
    still = torch.full((2, 13), 0.4, requires_grad=True)
    a, f, b = periodic_parameters(still, FPS)
    assert a.max() < 1e-2 and f.max() < 1e-3 and torch.allclose(b, torch.tensor(0.4))
    (a + f + b).sum().backward()
    assert still.grad.isfinite().all()


def test_interface(fitted, x):
    y = fitted(x)
    assert isinstance(fitted, Transform) and fitted.shape == (FRAMES, 12) and y.shape == (16, FRAMES, 12)
    bands = fitted.split(y)
    assert {name: band.shape[-1] for name, band in bands.items()} == {"phase": 6, "frequency": 3, "offset": 3}
    assert torch.equal(fitted.join(bands), y)
    assert torch.equal(fitted.project(y), fitted(fitted.inverse(y)))
    grid = x.double().unflatten(0, (2, 8))
    assert torch.allclose(fitted(grid).flatten(0, 1).float(), y, atol=1e-5) and fitted(grid).dtype == torch.float64
    assert fitted.inverse(y[0]).shape == (FRAMES, CHANNELS)


def test_decodes_periodic_motion_well(fitted, x):
    error = (fitted.inverse(fitted(x)) - x).square().mean().sqrt()
    assert error < 0.2 * x.std()


def test_columns_are_in_metres(fitted, x):
    """Moving one column by its deviation moves the body by about as much."""
    y = fitted(x)
    deviation = y.std((0, 1))
    moved = torch.stack([fitted.inverse(y + nudge) - fitted.inverse(y) for nudge in torch.diag(deviation)])
    ratio = moved.square().mean((1, 2, 3)).sqrt() / deviation
    assert ((ratio > 0.5) & (ratio < 2)).all()


def test_gradients_flow_through_both_ways(fitted, x):
    leaf = x.clone().requires_grad_()
    fitted.project(fitted(leaf)).square().sum().backward()
    assert leaf.grad.isfinite().all() and leaf.grad.abs().max() > 0
    assert not any(p.requires_grad for p in fitted.net.parameters())


def test_a_seed_decides_everything_and_the_callers_randomness_is_left_alone(x):
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    codes = []
    for seed in (0, 0, 1):
        tf = PhaseTransform(FRAMES, CHANNELS, 3, 13, FPS, seed)
        tf.fit(waves, steps=3)
        codes.append(tf(x))
    assert torch.equal(torch.rand(1), expected)
    assert torch.equal(codes[0], codes[1]) and not torch.allclose(codes[0], codes[2], atol=1e-3)


def poses(generator: torch.Generator, batch: int = 16) -> torch.Tensor:
    """Bodies that hold a pose, every channel its own."""
    return 0.1 * torch.randn(batch, 1, CHANNELS, generator=generator).expand(-1, FRAMES, -1)


def test_a_linear_path_learns_a_code_of_many_channels_sooner():
    x, errors = poses(torch.Generator().manual_seed(9)), {}
    for straight in (False, True):
        tf = PhaseTransform(FRAMES, CHANNELS, phases=CHANNELS, window=5, fps=FPS, straight=straight)
        tf.fit(poses, steps=60, lr=0.02)
        errors[straight] = float((tf.inverse(tf(x)) - x).square().mean().sqrt())
    assert errors[True] < 0.4 * errors[False] and errors[False] < x.std()


def test_a_linear_path_is_added_to_the_layers_and_stored():
    layers = torch.nn.Conv1d(4, 3, 5, padding=2)
    module, x = Straightened(layers, 4, 3), torch.randn(2, 4, 9)
    by_hand = torch.einsum("oi,bit->bot", module.line.weight[..., 0], x) + module.line.bias[:, None]
    torch.testing.assert_close(module(x) - layers(x), by_hand)
    tf = PhaseTransform(FRAMES, CHANNELS, 2, 13, FPS, straight=True)
    tf.fit(waves, steps=2)
    again, some = PhaseTransform(FRAMES, CHANNELS, 2, 13, FPS, seed=1, straight=True), waves(torch.Generator())
    assert torch.equal(again.restore(tf.tensors())(some), tf(some))


def test_errors(fitted):
    with pytest.raises(ValueError, match="window is 12; expected an odd"):
        PhaseTransform(FRAMES, CHANNELS, window=12)
    with pytest.raises(RuntimeError, match="untrained"):
        PhaseTransform(FRAMES, CHANNELS, window=13)(torch.zeros(FRAMES, CHANNELS))
    with pytest.raises(ValueError, match=r"\(29, 6\); expected \(30, 6\)"):
        fitted(torch.zeros(29, CHANNELS))


def phase(**changes) -> Config:
    return small(transform="phase", phases=3, phase_steps=8, train_steps=6, checkpoint_every=2, ema_start=2, **changes)


@pytest.mark.parametrize("representation", ["pose", "displacement"])
def test_a_diffusion_model_on_phase_codes_resumes_to_the_bit_and_is_found_again(tmp_path, representation):
    cfg, data = phase(representation=representation), Split(two_people().train, [], [])
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    list(train_run(cfg, data, whole))
    for step in train_run(cfg, data, stopped):
        if step.step == 3:
            break
    list(train_run(cfg, data, stopped))
    for name in (MODEL, CHECKPOINT):
        found, expected = load_tensors(stopped / name)[0], load_tensors(whole / name)[0]
        assert found.keys() == expected.keys() and any(key.startswith("objective.transform.") for key in found)
        assert all(torch.equal(found[key], expected[key]) for key in expected)

    predictor, motion = load_run(whole), two_people().validation[0]
    history = torch.from_numpy(motion.root_relative()[None, :6]).float()
    futures = predictor.predict(history, samples=2)
    assert futures.shape == (1, 2, 14, history.shape[-1]) and futures.isfinite().all()
    assert torch.equal(futures, load_run(whole).predict(history, samples=2))
    prefix = "objective.transform."
    stored = {k.removeprefix(prefix): v for k, v in load_tensors(whole / MODEL)[0].items() if k.startswith(prefix)}
    again = make_transform(cfg.model, cfg.windows.frames, 48, cfg.data.fps).restore(stored)
    x = torch.from_numpy(motion.root_relative()[:20]).float()
    assert torch.equal(again(x), predictor.transform.base(x))


def test_linear_models_store_nothing_more(tmp_path):
    list(train_run(phase().override(transform="dct", dct_rows=8), Split(two_people().train, [], []), tmp_path))
    assert not any("transform" in key for key in load_tensors(tmp_path / MODEL)[0])
