"""The forward process: noise schedules, and the three things that a network may predict."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.settings import choice, whole
from mwlib.transforms.linear import Coefficients

Level = Tensor | float  # alpha_bar of the items


def _sigmoid(u: Tensor) -> Tensor:
    """The sigmoid from -3 to 3 at a temperature of 0.7, falling from 1 to 0."""
    low, high = torch.sigmoid(torch.tensor([-3 / 0.7, 3 / 0.7], dtype=u.dtype))
    return (high - torch.sigmoid((6 * u - 3) / 0.7)) / (high - low)


# Continuous alpha_bar at u in [0, 1]; "linear" is given by its betas instead.
CURVES = {
    "cosine": lambda u: torch.cos((u + 0.008) / 1.008 * torch.pi / 2) ** 2,
    "sigmoid": _sigmoid,
    "sqrt": lambda u: 1 - torch.sqrt(u + 1e-4),
}
SCHEDULES = ("linear", *CURVES)
PREDICTIONS = ("eps", "y0", "v")


def alpha_bar(kind: str, steps: int) -> Float[Tensor, " steps"]:
    """Share of signal power that is left after each of the noising steps, float64, falling.

    Source: Ho et al. 2020 (linear), Nichol and Dhariwal 2021 (cosine), Jabri et al. 2022 (sigmoid), Li et al. 2022
    (sqrt), with HumanMAC's constants: beta_i = clip(1 - alpha_bar(i/M) / alpha_bar((i-1)/M), 0, 0.999) and
    alpha_bar_t the running product of 1 - beta.

    Args:
        kind: "linear", "cosine", "sigmoid" or "sqrt".
        steps: M, number of noising steps.

    Raises:
        ValueError: unknown kind or fewer than one step.

    >>> [round(float(a), 3) for a in alpha_bar("cosine", 1000)[[0, 499, 899]]]
    [1.0, 0.494, 0.024]
    """
    choice("kind", kind, SCHEDULES)
    whole("steps", steps, 1)
    if kind == "linear":
        beta = torch.linspace(1e-4, 0.02, steps, dtype=torch.float64) * (1000 / steps)
    else:
        curve = CURVES[kind](torch.arange(steps + 1, dtype=torch.float64) / steps)
        beta = 1 - curve[1:] / curve[:-1]
    return torch.cumprod(1 - beta.clamp(0, 0.999), dim=0)


# Hang et al. 2023, "min-SNR": 5 above. Own choice below: what a window becomes is decided where there is little signal, and
# an error there must not count for nothing.
SNR_BOUNDS = 0.05, 5.0


def snr_weights(alpha_bar: Float[Tensor, " steps"], bounds: tuple[float, float] = SNR_BOUNDS) -> Float[Tensor, " steps"]:
    """Weights of a loss by noise level, float32: signal over noise, bounded (see SNR_BOUNDS)."""
    return (alpha_bar / (1 - alpha_bar)).clamp(*bounds).float()


def ddim_indices(steps: int, subset: int, spacing: str = "leading") -> list[int]:
    """The retained diffusion indices, falling.

    Args:
        steps: M, the schedule's length.
        subset: number of denoising steps.
        spacing: "leading" as HumanMAC (M=1000, 100 steps: 991, 981, ..., 1) or "trailing" (own choice for few
            steps: starts at M-1, where the state really is noise).

    Raises:
        ValueError: unknown spacing, or subset not between 1 and steps.

    >>> ddim_indices(1000, 4), ddim_indices(1000, 4, "trailing")
    ([751, 501, 251, 1], [999, 749, 499, 249])
    """
    whole("subset", subset, 1, steps)
    choice("spacing", spacing, ("leading", "trailing"))
    return [_index(i, steps, subset, spacing) for i in reversed(range(subset))]


def _index(i: int, steps: int, subset: int, spacing: str) -> int:
    """The retained index number i, counted from the clean end."""
    return i * (steps // subset) + (subset < steps) if spacing == "leading" else round((i + 1) * steps / subset) - 1


# alpha_bar where sampling may begin with pure noise: own choice. In training 15 % of the power was signal there; when sampling
# begins it is missing. Of 1000 cosine levels 100 "leading" ones begin at 0.0002, four at 0.14, 334 at 0.24.
MOST_SIGNAL = 0.15


def check_indices(name: str, schedule: str, steps: int, subset: int, spacing: str, first: int = 1) -> None:
    """Refuse denoising steps that begin far from noise, or end where nobody trained.

    Args:
        name: of the setting, in the message.
        schedule: of the noise, see `alpha_bar`.
        steps, subset, spacing: as in `ddim_indices`.
        first: the smallest index that training draws.

    Raises:
        ValueError: the first index has more signal than `MOST_SIGNAL`, or the last is below `first`; the message says which
            number of steps would do: the largest below the given one or, if there is none, the smallest.
    """
    signal = alpha_bar(schedule, steps)

    def wrong(count: int) -> str:
        """What is wrong with so many steps; empty if nothing is."""
        begin, end = _index(count - 1, steps, count, spacing), _index(0, steps, count, spacing)
        if end < first:
            return f"the last step would be at t = {end}, for which no network is trained"
        much = f"{float(signal[begin]):.2f}, more than {MOST_SIGNAL:g}"
        return f"sampling would start from noise at t = {begin}, where alpha_bar is {much}" if signal[begin] > MOST_SIGNAL else ""

    if told := wrong(subset):
        fitting = next((count for count in (*range(subset - 1, 0, -1), *range(subset + 1, steps)) if not wrong(count)), None)
        expected = f"{fitting} steps" if fitting else "more steps, or another schedule"
        other = ", or spacing=trailing" if spacing == "leading" and signal[-1] <= MOST_SIGNAL else ""
        raise ValueError(f"{name} is {subset} of {steps}, spacing {spacing}: {told}; expected {expected}{other}")


def _signal_noise(alpha_bar_t: Level, like: Tensor) -> tuple[Tensor, Tensor]:
    """sqrt(alpha_bar_t) and sqrt(1 - alpha_bar_t), trailing axes added so that they multiply `like`."""
    a = torch.as_tensor(alpha_bar_t, dtype=torch.float64)
    a = a.reshape(a.shape + (1,) * (like.ndim - a.ndim))
    signal, noise = (part.sqrt().to(like.dtype).to(like.device) for part in (a, 1 - a))  # not every device has float64
    return signal, noise


def noised(y: Coefficients, eps: Coefficients, alpha_bar_t: Level) -> Coefficients:
    """y_t = sqrt(alpha_bar_t) y + sqrt(1 - alpha_bar_t) eps: t forward steps at once (Sec. 3.2.2; Ho et al. 2020, Eq. 4).

    >>> y, eps = torch.ones(2, 3), torch.zeros(2, 3)
    >>> noised(y, eps, 0.25)
    tensor([[0.5000, 0.5000, 0.5000],
            [0.5000, 0.5000, 0.5000]])
    """
    signal, noise = _signal_noise(alpha_bar_t, y)
    return signal * y + noise * eps


def network_target(prediction: str, y: Tensor, eps: Tensor, alpha_bar_t: Level) -> Tensor:
    """What the network should say: "eps" (Eq. 5), "y0" (the clean coefficients) or "v" (Salimans and Ho, 2022).

    Raises:
        ValueError: another name.

    >>> y, eps = torch.tensor([1.0]), torch.tensor([2.0])
    >>> [float(network_target(kind, y, eps, 0.36)) for kind in ("eps", "y0")]
    [2.0, 1.0]
    >>> round(float(network_target("v", y, eps, 0.36)), 3)  # 0.6 eps - 0.8 y
    0.4
    """
    choice("prediction", prediction, PREDICTIONS)
    if prediction == "v":
        signal, noise = _signal_noise(alpha_bar_t, y)
        return signal * eps - noise * y
    return eps if prediction == "eps" else y


def to_eps(prediction: str, output: Tensor, y_t: Tensor, alpha_bar_t: Level) -> Tensor:
    """The noise that a network output of the given kind stands for.

    >>> y, eps = torch.ones(2, 3), torch.randn(2, 3)
    >>> output = network_target("v", y, eps, 0.36)
    >>> torch.allclose(to_eps("v", output, noised(y, eps, 0.36), 0.36), eps, atol=1e-6)
    True
    """
    choice("prediction", prediction, PREDICTIONS)
    if prediction == "eps":
        return output
    signal, noise = _signal_noise(alpha_bar_t, y_t)
    return (y_t - signal * output) / noise if prediction == "y0" else signal * output + noise * y_t


def y0_hat_of(y_t: Tensor, eps: Tensor, alpha_bar_t: Level) -> Tensor:
    """y0_hat = (y_t - sqrt(1 - alpha_bar_t) eps) / sqrt(alpha_bar_t).

    >>> y, eps = torch.ones(2, 3), torch.randn(2, 3)
    >>> torch.allclose(y0_hat_of(noised(y, eps, 0.36), eps, 0.36), y, atol=1e-6)
    True
    """
    signal, noise = _signal_noise(alpha_bar_t, y_t)
    return (y_t - noise * eps) / signal


def eps_of(y_t: Tensor, y0_hat: Tensor, alpha_bar_t: Level) -> Tensor:
    """The noise that leads from y0_hat to y_t: the inverse of `y0_hat_of`.

    >>> y, eps = torch.ones(2, 3), torch.randn(2, 3)
    >>> torch.allclose(eps_of(noised(y, eps, 0.36), y, 0.36), eps, atol=1e-6)
    True
    """
    return to_eps("y0", y0_hat, y_t, alpha_bar_t)
