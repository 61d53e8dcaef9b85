"""The denoiser: TransLinear on frequency tokens, without MotionWavelet's condition; perhaps conditioned on keyframes."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from mwlib.inbetweening.config import ModelConfig
from mwlib.networks import TransLinear

BESIDE = 3  # numbers of a token beside the interpolation: mask, frequency, length
SIZES = 64  # width of the network that says how large a window's numbers are
LARGEST = 4.0  # bound of the logarithm that it says


class KeyframeNetwork(nn.Module):
    """A network on noised tokens.

    Source: FreqDiffusionBridge, Sec. 3.2, tells of linear layers, self-attention over the tokens and an embedding of the step
    that is added; HumanMAC's network, which does this and has skips and a learned place for each token, stands in. Own choice:
    the conditioning enters as columns beside each token's numbers.

    Args:
        model: sizes; whether the network sees the keyframes.
        rows: most tokens.
        channels: numbers per token.
        steps: how many steps beyond the keyframes it sees, see `Representation.conditioning`.
    """

    def __init__(self, model: ModelConfig, rows: int, channels: int, steps: int = 0) -> None:
        super().__init__()
        extra = (1 + steps) * channels + BESIDE + steps * bool(model.hide) if model.condition_on_keyframes else 0
        self.net = TransLinear(
            rows, channels, model.width, model.layers, model.heads, model.feedforward, model.dropout, model.attention_dropout,
            extra_columns=extra, conditioned=False,
        )  # fmt: skip

    def forward(
        self,
        y_t: Float[Tensor, "B rows channels"],
        t: Int[Tensor, " B"] | int,
        conditioning: Float[Tensor, "B rows conditioning"] | None = None,
    ) -> Float[Tensor, "B rows channels"]:
        """Its output. Fewer tokens than the most are the first of them.

        Args:
            y_t: noised tokens.
            t: diffusion index, one for all or one per item.
            conditioning: see `Representation.conditioning`; a network that was built for it needs it.
        """
        entering = y_t if conditioning is None else torch.cat([y_t, conditioning], dim=-1)
        return self.net.evaluate(entering, t, None)[0]


class WienerNetwork(nn.Module):
    """The best linear denoiser of independent numbers of known deviations s, and a network for what it misses.

    y0_hat = sqrt(a) s² / v y_t + s sqrt(1 - a) / sqrt(v) network(y_t / sqrt(v)), v = a s² + 1 - a, a = alpha_bar_t. What the
    network sees and what it should say have unit deviation at every level and in every token; one that says zero samples a
    Gaussian process with the right power at each frequency.

    Source: the preconditioning of Karras et al. 2022 (EDM), Eq. 7; own choice: for each number with its own deviation.

    Args:
        inner: the network.
        power: s, of each number of the most tokens; shorter motions have the first of them.
        alpha_bar: schedule.
    """

    def __init__(self, inner: KeyframeNetwork, power: Float[Tensor, "rows channels"], alpha_bar: Float[Tensor, " M"]) -> None:
        super().__init__()
        self.inner = inner
        self.power: Tensor
        self.alpha_bar: Tensor
        self.register_buffer("power", power.clone(), persistent=False)
        self.register_buffer("alpha_bar", alpha_bar.float(), persistent=False)

    def forward(
        self,
        y_t: Float[Tensor, "B rows channels"],
        t: Int[Tensor, " B"] | int,
        conditioning: Float[Tensor, "B rows conditioning"] | None = None,
    ) -> Float[Tensor, "B rows channels"]:
        """The clean estimate."""
        a, s, v = self._levels(y_t, t)
        return (a.sqrt() * s**2 / v) * y_t + self.share(y_t, t) * self.inner(y_t / v.sqrt(), t, conditioning)

    def share(self, y_t: Float[Tensor, "B rows channels"], t: Int[Tensor, " B"] | int) -> Float[Tensor, "*B rows channels"]:
        """Deviation of what the linear denoiser misses: the network's output counts so much."""
        a, s, v = self._levels(y_t, t)
        return s * ((1 - a) / v).sqrt()

    def _levels(self, y_t: Tensor, t: Int[Tensor, " B"] | int) -> tuple[Tensor, Tensor, Tensor]:
        a = self.alpha_bar[t].reshape(-1, 1, 1)
        s = self.power[: y_t.shape[-2]]
        return a, s, a * s**2 + 1 - a


class SizedNetwork(WienerNetwork):
    """`WienerNetwork` of numbers of unit deviation, and a second network that says how much larger or smaller than usual the
    numbers of each token are in each window.

    Own choice: people who stand and people who run differ more than gaps of one length do.

    Args:
        inner, alpha_bar: as of `WienerNetwork`.
        entering: how many numbers tell of a window, see `Representation.ends`.
    """

    def __init__(self, inner: KeyframeNetwork, entering: int, alpha_bar: Float[Tensor, " M"]) -> None:
        rows = inner.net.rows
        super().__init__(inner, torch.ones(rows, inner.net.columns), alpha_bar)
        last = nn.Linear(SIZES, rows)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.log_factor = nn.Sequential(nn.Linear(entering, SIZES), nn.SiLU(), last)

    def factor(self, ends: Float[Tensor, "B entering"], rows: int) -> Float[Tensor, "B rows 1"]:
        """By what the usual sizes of the first tokens are multiplied in each window."""
        return self.log_factor(ends)[:, :rows, None].clamp(-LARGEST, LARGEST).exp()
