"""Guidance of Algorithm 1: classifier-free (CFG) and temporal attention-based (TABG), around the network's noise estimates.

Each formula is one short function; `guided` composes them into the ``denoise(y_t, t)`` that the samplers ask for.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional as F

from mwlib.diffusion import Denoise, classifier_free, to_eps
from mwlib.networks import TransLinear
from mwlib.networks.layers import Precision, products_in
from mwlib.prediction.config import ModelConfig

Coefficients = Float[Tensor, "N S rows columns"]


def make_network(model: ModelConfig, shape: tuple[int, int]) -> TransLinear:
    """The untrained network that a configuration names, for coefficients of `shape`."""
    sizes = model.width, model.layers, model.heads, model.feedforward
    return TransLinear(*shape, *sizes, model.dropout, model.attention_dropout)


@dataclass
class NetworkBranches:
    """The network's evaluations as noise estimates; the windows' conditions are embedded once.

    Args:
        net: in evaluation mode.
        added: (N, 1, width) embedded conditions, shared by the samples of a window.
        alpha_bar: schedule.
        prediction: what the network predicts.
        precision: of the network's products.
    """

    net: TransLinear
    added: Tensor
    alpha_bar: Tensor
    prediction: str
    precision: Precision = "float32"

    def _evaluate(self, y: Tensor, t: int, added: Tensor | None, attention_rows: int = 0) -> tuple[Tensor, Tensor | None]:
        items = y.flatten(0, -3)
        with products_in(self.precision, y.device):
            output, attention = self.net.evaluate(items, t, added, attention_rows)
        return to_eps(self.prediction, output.to(y.dtype), items, self.alpha_bar[t]).reshape(y.shape), attention

    def _conditions(self, y: Tensor) -> Tensor:
        return self.added.expand(*y.shape[:2], -1).flatten(0, 1)

    def conditional(self, y: Coefficients, t: int) -> Coefficients:
        """eps_theta(y, y_pad, t)."""
        return self._evaluate(y, t, self._conditions(y))[0]

    def unconditional(self, y: Coefficients, t: int) -> Coefficients:
        """eps_theta(y, t)."""
        return self._evaluate(y, t, None)[0]

    def both(self, y: Coefficients, t: int, with_attention: bool) -> tuple[Tensor, Tensor, Tensor | None]:
        """Conditional and unconditional estimate in one batch; attention (N, S, 2, heads, rows, rows) of the latter."""
        conditions = self._conditions(y)  # (N S, width)
        added = torch.cat([torch.zeros_like(conditions), conditions])
        eps, attention = self._evaluate(torch.cat([y, y]), t, added, len(conditions) if with_attention else 0)
        unconditional, conditional = eps.chunk(2)
        return conditional, unconditional, None if attention is None else attention.unflatten(0, y.shape[:2]).to(y.dtype)


def temporal_attention(attention: Float[Tensor, "... 2 heads rows rows"]) -> Float[Tensor, "... rows"]:
    """A_t: how much each row of coefficients is attended to; the mean over the rows is exactly 1.

    Source: MotionWavelet Sec. 3.3: mean over the middle two blocks (and heads), summed over the first axis (queries).
    """
    return attention.mean(dim=(-4, -3)).sum(dim=-2)


def attention_mask(a_t: Float[Tensor, "... rows"], threshold: float, window: int) -> Bool[Tensor, "... rows 1"]:
    """M_t: rows attended more than `threshold`, each hit widened to `window` rows (odd; Sec. 3.3), ends included."""
    hit = (a_t > threshold).float().reshape(-1, 1, a_t.shape[-1])
    return F.max_pool1d(hit, window, stride=1, padding=window // 2).reshape(*a_t.shape, 1) > 0


@dataclass(frozen=True)
class TABG:
    """Temporal attention-based guidance, Eq. 9 to 11.

    Args:
        scale: s of Eq. 11; 0 switches it off.
        sigma: noise scale of Eq. 9, in the coefficients' unit.
        threshold, window: phi and m of the mask. Not given in the paper; own choice: 1 (the mean of A_t) and 3.
        noise: "independent" draws for Eq. 9 and for the re-noising, "shared" (Algorithm 1: the same z), or "eps_hat"
            (self-attention guidance: re-noise with the predicted noise).
        space: where Eq. 11 compares the two branches. "eps": noise estimates, as written; but the degraded input holds another
            noise, so their difference is mostly that of the two noises, and grows by 1/sqrt(alpha_bar_t) in the clean
            estimate. "y0_hat": clean estimates (own choice for networks that predict them).
        sigma_place: "eq9" adds sigma z to the clean estimate; "alg1" inside the bracket, i.e. divided by sqrt(alpha_bar_t).
        active: diffusion indices at which it acts; None = all.
    """

    scale: float = 1.0
    sigma: float = 2.5
    threshold: float = 1.0
    window: int = 3
    noise: str = "independent"
    sigma_place: str = "eq9"
    space: str = "eps"
    active: Collection[int] | None = None

    def acts(self, t: int) -> bool:
        """Whether the degraded branch is evaluated at index t."""
        return self.scale != 0 and (self.active is None or t in self.active)

    def degraded(
        self, y_t: Tensor, eps: Tensor, attention: Tensor, alpha_bar_t: float, draw: Callable[[], Tensor]
    ) -> Float[Tensor, "... rows columns"]:
        """y_hat_t of Eq. 10: y_t with the most attended rows noised once more.

        With a = alpha_bar_t, Eq. 9 and the re-noising give sqrt(a) y0_hat + sqrt(a) sigma z + sqrt(1-a) z', and
        sqrt(a) y0_hat is y_t - sqrt(1-a) eps. Two independent draws add up to one of their joint deviation.
        """
        mask = attention_mask(temporal_attention(attention), self.threshold, self.window)
        noise = (1 - alpha_bar_t) ** 0.5
        deviation = self.sigma if self.sigma_place == "alg1" else alpha_bar_t**0.5 * self.sigma
        if self.noise == "independent":
            added = (deviation**2 + noise**2) ** 0.5 * draw()
        elif self.noise == "shared":
            added = (deviation + noise) * draw()
        else:
            added = deviation * draw() + noise * eps
        return torch.where(mask, y_t - noise * eps + added, y_t)


def guided(
    branches: NetworkBranches,
    alpha_bar: Float[Tensor, " M"],
    *,
    weight: float,
    form: str = "eq7",
    tabg: TABG | None = None,
    draw: Callable[[], Tensor] | None = None,
) -> Denoise:
    """CFG around TABG around the network: the body of Algorithm 1's loop up to eps_hat.

    A branch whose weight is zero is not evaluated: one evaluation a step without CFG, two with it, three while TABG acts.

    Args:
        branches: the network's evaluations.
        alpha_bar: schedule.
        weight: w; 0 in "eq7" and 1 in "alg1" leave the conditional estimate alone, and switch TABG off with it.
        form: see `classifier_free`.
        tabg: None or scale 0 = off.
        draw: noise source for TABG.

    Raises:
        ValueError: TABG is on and there is no noise source.
    """
    if tabg and tabg.scale and not draw:
        raise ValueError("TABG draws noise; expected a noise source with it")
    neutral = 0.0 if form == "eq7" else 1.0

    def denoise(y: Tensor, t: int) -> Tensor:
        """(y_t, t) -> eps, guided."""
        if weight == neutral:
            return branches.conditional(y, t)
        acting = tabg if tabg and tabg.acts(t) else None
        conditional, eps, attention = branches.both(y, t, with_attention=acting is not None)
        if acting and draw and attention is not None:
            y_hat = acting.degraded(y, eps, attention, float(alpha_bar[t]), draw)
            degraded = branches.unconditional(y_hat, t)
            if acting.space == "y0_hat":  # the noise that leads from the degraded branch's clean estimate to y
                degraded = degraded + (y - y_hat) / (1 - float(alpha_bar[t])) ** 0.5
            eps = eps + acting.scale * (degraded - eps)  # Eq. 11
        return classifier_free(conditional, eps, weight, form)

    return denoise
