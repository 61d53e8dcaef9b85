"""Networks that see the keyframes and not, motions shorter than the longest, and the linear denoiser by hand."""

from __future__ import annotations

import pytest
import torch

from mwlib.diffusion import alpha_bar, ddim, ddim_indices, noised, to_eps
from mwlib.inbetweening.objective import BESIDE, LARGEST, SMOOTH, KeyframeNetwork, MeanNetwork, SizedNetwork, WienerNetwork
from tests.inbetweening.sample import PAPER, shaken, small

A_BAR = alpha_bar("cosine", 1000)


def network(**changes) -> KeyframeNetwork:
    return shaken(KeyframeNetwork(small(**changes).model, 8, 5), 0.3).eval()


@pytest.mark.parametrize("rows", [8, 5, 1])
@pytest.mark.parametrize("changes, beside", [(PAPER, 0), ({}, 5 + BESIDE)], ids=["paper", "conditioned"])
def test_outputs_have_the_shape_of_inputs_and_fewer_tokens_are_the_first(changes, beside, rows, generator):
    net = network(**changes)
    y = torch.randn(3, rows, 5, generator=generator)
    seen = torch.randn(3, rows, beside, generator=generator) if beside else None
    t = torch.tensor([1, 20, 49])
    found = net(y, t, seen)
    assert found.shape == y.shape
    fewer = shaken(KeyframeNetwork(small(**changes).model, rows, 5), 0.3).eval()
    weights = net.state_dict() | {"net.position": net.net.position[:rows]}
    fewer.load_state_dict(weights)
    torch.testing.assert_close(found, fewer(y, t, seen))
    one = net(y[1:2], 20, None if seen is None else seen[1:2])
    torch.testing.assert_close(found[1:2], one, atol=1e-4, rtol=1e-4)
    assert net.net.condition is None


def test_the_conditioning_matters(generator):
    net, y = network(), torch.randn(3, 8, 5, generator=generator)
    seen = torch.randn(3, 8, 5 + BESIDE, generator=generator)
    for column in (0, 5, 6, 7):
        other = seen.clone()
        other[..., column] += 1
        assert (net(y, 5, other) - net(y, 5, seen)).abs().max() > 1e-3


class Says(KeyframeNetwork):
    """A network that says one number, and remembers what it was asked."""

    def __init__(self, number: float) -> None:
        torch.nn.Module.__init__(self)
        self.number = number

    def forward(self, y, t, conditioning=None):
        self.seen = y
        return torch.full_like(y, self.number)


def wiener(number: float = 0.0) -> WienerNetwork:
    power = torch.tensor([[3.0, 0.5], [1.0, 0.05], [0.1, 1.0]])
    return WienerNetwork(Says(number), power, A_BAR)


@pytest.mark.parametrize("t", [1, 300, 700, 990])
def test_silence_is_the_posterior_mean_of_independent_gaussians(t, generator):
    """y0 ~ N(0, s²), y_t = sqrt(a) y0 + sqrt(1 - a) eps: by Bayes, precision-weighted."""
    net, a = wiener(), float(A_BAR[t])
    y_t = torch.randn(4, 3, 2, generator=generator)
    precision = 1 / net.power.double() ** 2 + a / (1 - a)
    expected = (a**0.5 / (1 - a)) * y_t.double() / precision
    torch.testing.assert_close(net(y_t, t).double(), expected, atol=1e-4, rtol=1e-3)
    deviation = precision**-0.5  # of the posterior
    torch.testing.assert_close(net.share(y_t, t)[0].double(), deviation, atol=1e-5, rtol=1e-3)
    torch.testing.assert_close((wiener(2.0)(y_t, t) - net(y_t, t))[0].double(), 2 * deviation, atol=1e-4, rtol=1e-3)


@pytest.mark.parametrize("t", [1, 500, 999])
def test_what_the_network_sees_and_should_say_has_unit_deviation(t, generator):
    net = wiener()
    y = net.power * torch.randn(20000, 3, 2, generator=generator)
    y_t = noised(y, torch.randn(20000, 3, 2, generator=generator), A_BAR[t])
    missed = (y - net(y_t, torch.full((20000,), t))) / net.share(y_t, t)
    for unit in (net.inner.seen, missed):
        torch.testing.assert_close(unit.std(0), torch.ones(3, 2), atol=0.03, rtol=0)


def test_sampling_with_silence_gives_every_coefficient_its_power(generator):
    """The map of the sampler is linear: what it makes of noise 1 is the deviation."""
    net = wiener()
    start = torch.ones(1, 3, 2)
    indices = ddim_indices(1000, 250, "trailing")
    denoise = lambda y, t: to_eps("y0", net(y, t), y, A_BAR[t])  # noqa: E731
    for step in ddim(denoise, start, A_BAR, indices, noise=lambda: torch.zeros_like(start)):
        last = step.y
    torch.testing.assert_close(last[0], net.power, atol=0.002, rtol=0.05)


def test_shorter_motions_have_the_deviations_of_the_first_tokens(generator):
    power = torch.rand(9, 3, generator=generator) + 0.1
    whole, first = WienerNetwork(Says(0.0), power, A_BAR), WienerNetwork(Says(0.0), power[:5], A_BAR)
    y_t, t = torch.randn(2, 5, 3, generator=generator), torch.tensor([3, 900])
    torch.testing.assert_close(whole(y_t, t), first(y_t, t), atol=0, rtol=0)
    assert [*whole.state_dict()] == []  # the statistics are what the representation learnt


def test_sizes_begin_as_usual_and_are_bounded(generator):
    net = SizedNetwork(network(), 4, A_BAR, 30.0)
    ends = 3 * torch.randn(3, 4, generator=generator)
    assert torch.equal(net.factor(ends, 5), torch.ones(3, 5, 1))
    shaken(net.log_factor, 1.0)
    found = net.factor(ends, 5)
    assert found.unique().numel() > 2 and found.log().abs().max() <= LARGEST + 1e-5
    torch.testing.assert_close(net.factor(ends, 8)[:, :5], found)


def test_samples_of_fast_people_have_no_more_of_what_is_fine_than_usual(generator):
    """Sine k of windows of T frames at 30 Hz has 15 k / (T - 1) Hz: above 6 Hz from k = 5 on at 13 frames, k = 7 at 17."""
    net = SizedNetwork(network(), 4, A_BAR, 30.0)
    last = net.log_factor[-1]
    torch.nn.init.constant_(last.bias, 0.7)
    ends = torch.zeros(2, 4)
    ends[:, -1] = torch.tensor([13.0, 17.0]).log()
    found, factor = net.factor_of_samples(ends, 8), net.factor(ends, 8)
    assert (found[0, :4] == factor[0, :4]).all() and (found[0, 4:] == 1).all() and (factor > 2).all()
    assert (found[1, :6] == factor[1, :6]).all() and (found[1, 6:] == 1).all()
    torch.nn.init.constant_(last.bias, -0.7)
    assert torch.equal(net.factor_of_samples(ends, 8), net.factor(ends, 8))  # smaller ones stay


def test_a_mean_is_smooth_and_begins_as_none(generator):
    ends = 3 * torch.randn(3, 4, generator=generator)
    without, mean = SizedNetwork(network(), 4, A_BAR, 30.0), MeanNetwork(4, 20, 5, 8, 0.5)
    assert torch.equal(without.mean(ends, 8), torch.zeros(3, 8, 5)) and torch.equal(mean(ends), torch.zeros(3, 20, 5))
    found = shaken(mean, 1.0).eval()(ends)
    assert SMOOTH < 20 and not found[:, SMOOTH:].any() and found[:, :SMOOTH].abs().min() > 0
    assert torch.equal(SizedNetwork(network(), 4, A_BAR, 30.0, mean).mean(ends, 7), found[:, :7])
