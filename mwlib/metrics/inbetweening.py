"""L2P, L2Q and NPSS: the errors of transitions between keyframes, as the LaFAN1 benchmark defines them.

A pose is the vector of all its numbers, as elsewhere in this room: positions are (..., F, C) with C = 3J, world coordinates,
root included. Leading axes are free and those of truth and prediction broadcast: for samples (N, S, F, C) give the truth as
`g[:, None]`. Frames are those of the transition only; keyframes are not among them.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.rotation import continuous

POWERS = ("real", "magnitude")


def l2p(
    p: Float[Tensor, "*#lead F C"], g: Float[Tensor, "*#lead F C"], mean: Float[Tensor, " C"], deviation: Float[Tensor, " C"]
) -> Float[Tensor, "*lead"]:
    """Global position error of each sequence: mean over frames of ‖z(p_t) - z(g_t)‖, z(x) = (x - mean) / deviation.

    The norm is that of all C numbers of a pose at once, not a mean over joints. No unit: that of the positions cancels.

    Args:
        p: predicted positions.
        g: true ones.
        mean, deviation: of each coordinate over the training set, in the unit of the positions. The mean cancels, too; it is
            an argument because the definition has it, and so that nobody passes the deviations of another set of statistics.

    Source: Harvey et al., Robust Motion In-betweening, 2020, as their code for LaFAN1 computes it.

    Raises:
        ValueError: shapes do not fit, a value is not finite, or a deviation is not positive.

    >>> p, g = torch.tensor([[[0.0, 3.0]]]), torch.tensor([[[0.0, 1.0]]])
    >>> l2p(p, g, mean=torch.tensor([0.0, 1.0]), deviation=torch.tensor([1.0, 4.0]))
    tensor([0.5000])
    """
    check_pair(p, g, axes=2)
    if mean.shape != p.shape[-1:] or deviation.shape != p.shape[-1:]:
        found = f"mean {tuple(mean.shape)} and deviation {tuple(deviation.shape)}"
        raise ValueError(f"{found}; expected ({p.shape[-1]},), one number for each coordinate of a pose")
    if not (deviation > 0).all():
        raise ValueError(f"the smallest deviation is {float(deviation.min()):g}; expected positive ones")
    mean, deviation = mean.to(p), deviation.to(p)
    return torch.linalg.vector_norm((p - mean) / deviation - (g - mean) / deviation, dim=-1).mean(-1)


def l2q(
    p: Float[Tensor, "*#lead F J 4"], g: Float[Tensor, "*#lead F J 4"], start: Float[Tensor, "*#lead J 4"] | None = None
) -> Float[Tensor, "*lead"]:
    """Global rotation error of each sequence: mean over frames of the norm of all 4J differences of quaternions.

    A quaternion and its negative are one turn, but far-apart numbers. The benchmark's code leaves signs as they are, which
    suits what was recorded and interpolated; what a network predicts has any sign and needs `start`.

    Args:
        p: predicted global (not local) unit quaternions (w, x, y, z).
        g: true ones.
        start: the true global quaternions of the last frame before these. If given, `continued` is applied to both first.

    Source: Harvey et al., 2020, as their code for LaFAN1 computes it; continuity from the start frame after the
    Δ-interpolator (Oreshkin et al., 2022).

    Raises:
        ValueError: shapes do not fit or a value is not finite.

    >>> still = torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(1, 3, 1, 4)
    >>> l2q(-still, still), l2q(-still, still, start=still[:, 0])
    (tensor([2.]), tensor([0.]))
    """
    check_pair(p, g, axes=3)
    if p.shape[-1] != 4:
        raise ValueError(f"p has shape {tuple(p.shape)}; expected (..., F, J, 4), quaternions")
    if start is not None:
        p, g = continued(p, start), continued(g, start)
    return torch.linalg.vector_norm((p - g).flatten(-2), dim=-1).mean(-1)


def continued(q: Float[Tensor, "*#lead F J 4"], start: Float[Tensor, "*#lead J 4"]) -> Float[Tensor, "*lead F J 4"]:
    """The same turns with signs such that no quaternion lies opposite to the one before, the first not to `start`.

    Source: the evaluation of the Δ-interpolator (Oreshkin et al., 2022): the frame before is put in front, signs are made
    continuous, the frame is dropped.

    Raises:
        ValueError: the shapes do not fit each other.
    """
    if start.ndim != q.ndim - 1 or start.shape[-2:] != q.shape[-2:]:
        expected = f"one frame, (..., {', '.join(map(str, q.shape[-2:]))}) with {q.ndim - 1} axes, for {tuple(q.shape)}"
        raise ValueError(f"start has shape {tuple(start.shape)}; expected {expected}")
    lead = torch.broadcast_shapes(q.shape[:-3], start.shape[:-2])
    first = start.to(q)[..., None, :, :].expand(*lead, 1, *start.shape[-2:])
    return continuous(torch.cat([first, q.expand(*lead, *q.shape[-3:])], dim=-3))[..., 1:, :, :]


class NPSS:
    """Normalised power spectrum similarity, over all sequences and channels that were fed.

    NPSS = Σ P E / Σ P over sequences and channels together, P the total power of a true channel and E the sum over frequency
    bins of |difference of the cumulated shares of power|. A mean of the values of batches is another number. E is a sum, so it
    grows with the number of frames.

    At 0/0: a predicted channel without any power has the shares 0, so E is the sum of the truth's cumulated shares; a true
    one has the weight P = 0 and does not count. `value` is NaN if nothing that was fed had power.

    Args:
        power: "real", as in the benchmark: the squared real part of the Fourier coefficients, all F bins; it depends on the
            phase. "magnitude": |coefficient|², what is usually called power; not the benchmark.

    Source: Gopalakrishnan et al., A Neural Temporal Model for Human Motion Prediction, 2019, as the code of Harvey et al.,
    2020, computes it for LaFAN1. At 0/0: own choice, as in the Two-stage Transformers (Qin et al., 2022); the benchmark's code
    has no guard.

    Raises:
        ValueError: no such power.

    >>> npss = NPSS()
    >>> npss.update(torch.tensor([1.0, 1.0, 1.0, 2.0])[None, :, None], torch.tensor([1.0, 2.0, 3.0, 4.0])[None, :, None])
    >>> round(npss.value(), 6)
    0.137363
    """

    def __init__(self, power: str = "real") -> None:
        if power not in POWERS:
            raise ValueError(f"power is {power!r}; expected one of {', '.join(POWERS)}")
        self.power = power
        self._weighted, self._weight = 0.0, 0.0

    def update(self, p: Float[Tensor, "*#lead F C"], g: Float[Tensor, "*#lead F C"]) -> None:
        """Add sequences: predictions, and their truths. Quaternions are flattened, `q.flatten(-2)`, their signs continuous.

        Raises:
            ValueError: shapes do not fit or a value is not finite.
        """
        check_pair(p, g, axes=2)
        predicted, _ = self._cumulated(p)
        true, total = self._cumulated(g)
        distance = (predicted - true).abs().sum(-2)
        total = total.expand_as(distance)
        self._weighted += float((distance * total).sum())
        self._weight += float(total.sum())

    def value(self) -> float:
        """NPSS of everything fed so far; NaN before anything with power was."""
        return self._weighted / self._weight if self._weight else float("nan")

    def _cumulated(self, x: Float[Tensor, "*lead F C"]) -> tuple[Float[Tensor, "*lead F C"], Float[Tensor, "*lead C"]]:
        """Cumulated shares of power over frequency, and the total."""
        coefficients = torch.fft.fft(x.double(), dim=-2)
        power = coefficients.real**2 if self.power == "real" else coefficients.abs() ** 2
        total = power.sum(-2)
        return power.cumsum(-2) / torch.where(total > 0, total, 1.0)[..., None, :], total


def npss(p: Float[Tensor, "*#lead F C"], g: Float[Tensor, "*#lead F C"], power: str = "real") -> float:
    """`NPSS` of one batch that holds all sequences.

    Raises:
        ValueError: no such power, shapes do not fit or a value is not finite.

    >>> swing = torch.sin(torch.arange(30.0))[None, :, None]
    >>> npss(-swing, swing)
    0.0
    """
    found = NPSS(power)
    found.update(p, g)
    return found.value()


def check_pair(p: Tensor, g: Tensor, axes: int) -> None:
    """Refuse predictions and truths that do not fit each other, and what is not finite.

    Args:
        axes: how many of the last axes must be equal; those before them broadcast.

    Raises:
        ValueError: the message has the shapes.
    """
    if p.ndim != g.ndim or p.ndim < axes or p.shape[-axes:] != g.shape[-axes:] or 0 in p.shape[-axes:]:
        hint = "equal but for leading axes of 1; for samples p (N, S, F, ...) give the truth as g[:, None]"
        raise ValueError(f"p has shape {tuple(p.shape)} and g {tuple(g.shape)}; expected them {hint}")
    try:
        torch.broadcast_shapes(p.shape, g.shape)
    except RuntimeError:
        raise ValueError(f"p has shape {tuple(p.shape)} and g {tuple(g.shape)}; expected as many sequences in both") from None
    for name, x in (("p", p), ("g", g)):
        if not x.isfinite().all():
            first = (~x.isfinite()).nonzero()[0].tolist()
            raise ValueError(f"{name} is not finite at {first}; expected finite numbers")
