"""What a finished run can do: predict reproducibly, with every option of the sampling, and nothing else changed by it."""

from __future__ import annotations

import pytest
import torch

from mwlib.data.windowing import windows
from mwlib.experiments import load_run
from mwlib.prediction.predictor import Predictor
from tests.sample_settings import small, two_people


@pytest.fixture
def predictor(finished) -> Predictor:
    return load_run(finished)


@pytest.fixture
def past() -> torch.Tensor:
    people = two_people()
    return windows([*people.train, *people.validation], 6, 14, 9).x_history[:5]


def test_a_finished_run_predicts(predictor, past):
    futures = predictor.predict(past, samples=3, seed=1)
    assert futures.shape == (5, 3, 14, 48) and futures.isfinite().all()
    torch.testing.assert_close(predictor.predict(past, 3, 1, chunk=2), futures, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(predictor.predict(past[3:], 3, 1, window_ids=[3, 4]), futures[3:], atol=1e-5, rtol=1e-5)
    assert not torch.allclose(predictor.predict(past, 3, 2), futures, atol=1e-3)
    with pytest.raises(ValueError, match="6, 48"):
        predictor.predict(past[:, :5])


def test_samples_and_seed_are_the_settings_own_unless_given(predictor, past):
    assert predictor.predict(past).shape[1] == predictor.sampling.samples == 3
    changed = predictor.with_sampling(samples=2, sampling_seed=8)
    torch.testing.assert_close(changed.predict(past), predictor.predict(past, 2, 8), atol=0, rtol=0)


@pytest.mark.parametrize(
    "changes",
    [
        dict(wmsg="off"),
        dict(wmsg="y0_hat"),
        dict(wmsg="every_step"),
        dict(bound=0.4, wmsg="off"),
        dict(sampler="eq6"),
        dict(sampler="dpmpp"),
        dict(eta=0.5),
        dict(guidance_form="alg1", guidance_weight=0.7, tabg_noise="eps_hat", tabg_sigma_place="alg1"),
    ],
)
def test_every_sampling_option_runs_and_is_heard(predictor, past, changes):
    futures = predictor.with_sampling(**changes).predict(past[:2], 2)
    assert futures.isfinite().all()
    if "bound" in changes:
        assert futures.abs().max() <= 0.4 + 1e-4
    elif changes != {"wmsg": "off"}:  # the preset's own
        assert not torch.allclose(futures, predictor.predict(past[:2], 2), atol=1e-6)


def test_with_sampling_changes_the_sampling_alone(predictor, past):
    other = predictor.with_sampling(guidance_weight=0.9, samples=7)
    assert (other.sampling.guidance_weight, other.sampling.samples) == (0.9, 7)
    assert predictor.sampling.guidance_weight == 0.0, "the first one is left alone"
    assert other.with_sampling(guidance_weight=0.0, samples=3).sampling == predictor.sampling
    for name in ("net", "representation", "diffusion", "bodies"):
        assert getattr(other, name) is getattr(predictor, name), name
    for changes in (dict(steps=100), dict(samples=2, schedule="linear"), dict(history=3)):
        with pytest.raises(ValueError, match="settings of the sampling"):
            predictor.with_sampling(**changes)
    with pytest.raises(ValueError, match="did you mean 'eta'"):
        predictor.with_sampling(etta=0.1)


def test_both_branches_come_in_the_order_of_classifier_free_guidance(predictor, past):
    """Conditional first, then unconditional; in one batch as one by one."""
    branches = predictor.branches(past)
    y = predictor.noise(0, range(5), 2)()
    conditional, unconditional, attention = branches.both(y, 30, with_attention=True)
    torch.testing.assert_close(conditional, branches.conditional(y, 30), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(unconditional, branches.unconditional(y, 30), atol=1e-5, rtol=1e-5)
    assert not torch.allclose(conditional, unconditional, atol=1e-4)
    rows = predictor.transform.shape[0]
    assert attention.shape == (5, 2, 2, 2, rows, rows)
    other = predictor.branches(past.flip(0)).both(y, 30, with_attention=True)
    torch.testing.assert_close(other[1], unconditional, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(other[2], attention, atol=1e-5, rtol=1e-5)
    assert (other[0] - conditional).abs().max() > 10 * (other[1] - unconditional).abs().max()


def test_complete_history_puts_the_history_back(predictor, past):
    *_, last = predictor.with_sampling(complete_history=True, wmsg="off").steps(past[:2], 2)
    whole = predictor.representation.decode(last.y, past[:2])
    torch.testing.assert_close(whole[:, :, :6], past[:2, None].expand(-1, 2, -1, -1), atol=1e-4, rtol=1e-3)


def test_the_indices_are_those_of_the_settings(predictor):
    assert len(predictor.indices()) == small().sampling.ddim_steps == 5
    assert predictor.indices()[0] == 49 and predictor.with_sampling(spacing="leading").indices()[0] == 41
    acts = predictor.with_sampling(tabg_steps=0.4).tabg()
    assert [acts.acts(t) for t in predictor.indices()] == [True, True, False, False, False]


def test_half_precision_is_of_the_networks_products_only(predictor, past):
    """The transform, the schedule and the guidance stay as they are: what comes out is near, and in float32."""
    exact, rough = (predictor.with_sampling(precision=p).predict(past, 2) for p in ("float32", "bf16"))
    assert rough.dtype == torch.float32 and not torch.equal(rough, exact)
    assert (rough - exact).abs().mean() < 0.05 * exact.abs().mean()
    assert torch.equal(predictor.with_sampling(precision="tf32").predict(past, 2), exact)  # a processor has none
    assert torch.get_float32_matmul_precision() == "highest"


def test_noise_may_be_drawn_where_the_network_is(predictor, past):
    """On a processor that is the same place."""
    there = predictor.with_sampling(noise_on="device")
    assert torch.equal(there.predict(past, 2), predictor.predict(past, 2))
    assert {g.device.type for g in there.noise(0, [0, 1], 2).generators} == {"cpu"}


def test_a_graphics_card_takes_as_many_windows_as_its_memory_holds(predictor, monkeypatch):
    assert predictor.chunk(50) == 8
    monkeypatch.setattr(Predictor, "device", torch.device("cuda"))
    chunks = []
    for free in (2**30, 2**34):
        monkeypatch.setattr(torch.cuda, "mem_get_info", lambda device, free=free: (free, free))
        chunks.append(predictor.chunk(50))
    assert 1 <= chunks[0] < chunks[1] and chunks[1] == pytest.approx(16 * chunks[0], rel=0.1)
    assert predictor.chunk(100) == chunks[1] // 2


def test_every_window_has_one_identity_and_at_least_one_sample(predictor, past):
    with pytest.raises(ValueError, match="window_ids has 5 entries for 1 windows"):
        predictor.predict(past[:1], window_ids=range(5))
    with pytest.raises(ValueError, match="samples is 0"):
        predictor.predict(past, 0)
    with pytest.raises(ValueError, match="there are no windows"):
        predictor.predict(past[:0])
    assert torch.equal(predictor.predict(past.numpy(), 2), predictor.predict(past, 2))


def test_gradients_flow_through_a_transform_that_has_predicted(predictor, past):
    predictor.predict(past[:1], 1)
    x = torch.zeros(1, 20, 48, requires_grad=True)
    predictor.transform(x).sum().backward()
    assert x.grad.isfinite().all()
