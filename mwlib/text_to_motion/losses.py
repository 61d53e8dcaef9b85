"""The two losses of Free-T2M, and when in the diffusion each of them counts. One number per sample."""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.networks.layers import Features, PerItem, Valid
from mwlib.networks.matching import Embeddings
from mwlib.settings import choice
from mwlib.transforms.linear import DCTTransform

Norm = Literal["l1", "mse"]
Band = Literal["low", "high"]
Stage = Literal["prose", "mdm_code", "eq16", "smf_code", "none", "snr"]
Semantic = Literal["cos_gt", "cos_text", "reward", "hinge", "detached"]

HIGH, MDM_LOW, EQ16 = 0.6, 0.4, 0.3  # shares of the diffusion's steps: see stage_weights
REASONABLE = 0.5  # S_th of Eq. 15: own choice, the paper never gives it


PerSample = Float[Tensor, " B"]


def masked_error(error: Features, mask: Valid) -> PerSample:
    """Mean square of an error over the frames that a sample has.

    Source: MDM (Tevet et al., 2023), its code; the paper's Eq. 5.

    >>> masked_error(torch.ones(1, 3, 2), torch.tensor([[True, True, False]]))
    tensor([1.])
    """
    return (error.square().mean(-1) * mask).sum(-1) / mask.sum(-1).clamp_min(1)


class LowPass:
    """Keeps the first K cosines of each sample, over its own length, never over padding.

    Source: Free-T2M Eq. 7 to 12, an orthonormal DCT-II. Its Eq. 9 counts from 1: the mean over time, k = 0, is kept.

    Args:
        longest: frames of the longest sample.
        rows: K; a shorter sample keeps all its cosines.
        hertz: keep what lies below instead, K = max(1, round(2 N hertz / fps)) for N frames; 0 = `rows` says.
        fps: frames per second, for `hertz`.

    >>> LowPass(4, rows=1)(torch.tensor([[[1.0], [2.0], [3.0], [6.0]]]), torch.tensor([4])).flatten()
    tensor([3., 3., 3., 3.])
    """

    def __init__(self, longest: int, rows: int, hertz: float = 0.0, fps: float = 20.0) -> None:
        self.rows = [min(n, rows if hertz == 0 else max(1, round(2 * n * hertz / fps))) for n in range(1, longest + 1)]
        bank = torch.zeros(longest + 1, max(self.rows), longest)
        for n, kept in enumerate(self.rows, 1):
            bank[n, :kept, :n] = torch.from_numpy(DCTTransform(n, 1, kept).analysis_time).float()
        self.bank = bank

    def cosines(self, x: Features, lengths: PerItem) -> Float[Tensor, "B K T"]:
        """Those that are kept of each sample; zeros beyond its length, and where a short one has fewer."""
        return self.bank[lengths.cpu(), :, : x.shape[1]].to(x)

    def coefficients(self, x: Features, lengths: PerItem) -> Float[Tensor, "B K D"]:
        """Of the cosines that are kept."""
        return self.cosines(x, lengths) @ x

    def __call__(self, x: Features, lengths: PerItem) -> Features:
        """What these cosines make of the sample; zeros beyond its length."""
        return self.cosines(x, lengths).mT @ self.coefficients(x, lengths)


def low_frequency_loss(error: Features, lengths: PerItem, low_pass: LowPass, norm: Norm = "l1", band: Band = "low") -> PerSample:
    """How far the slow part of an estimate is from that of the truth.

    Source: Free-T2M Eq. 13, mean |difference| over frames and features ("l1"); its code takes squares ("mse") and K = 1. With
    squares the sum with the main loss is that loss with weight 1 + lambda on the first K cosines (Parseval); with L1 it is not.

    Args:
        error: estimate minus truth, normalised features; what lies beyond a sample's length is not looked at.
        lengths: frames of each sample.
        low_pass: which cosines.
        norm: the distance.
        band: "high": of what the low-pass takes away instead (the paper's Table 6).

    >>> x, y = torch.tensor([[1.0, 2.0, 3.0, 6.0], [1.0, 3.0, 3.0, 5.0]])[..., None]
    >>> two = LowPass(4, rows=2)
    >>> [round(float(low_frequency_loss((x - y)[None], torch.tensor([4]), two, norm)), 4) for norm in ("l1", "mse")]
    [0.4268, 0.2134]
    """
    kept = low_pass(error, lengths)
    if band == "high":
        inside = torch.arange(error.shape[1], device=error.device) < lengths.to(error.device)[:, None]
        kept = error * inside[..., None] - kept
    distance = kept.square() if norm == "mse" else kept.abs()
    return distance.sum((-2, -1)) / (lengths.to(error) * error.shape[-1])


def semantic_loss(
    motion: Embeddings, truth: Embeddings, text: Embeddings, kind: str = "cos_gt", threshold: float = REASONABLE
) -> PerSample:
    """How far an estimate is from what its sentence means, as a critic embeds both.

    The paper's text compares with the sentence (Eq. 14) and rewards what is already close (Eq. 15 with the minus of Eq. 17), so
    that nothing draws an estimate that is far. Its code compares with the true motion, and cuts the gradient off.

    Args:
        motion, truth, text: embeddings of the estimate, the true motion and the sentence.
        kind: "cos_gt" 1 - cos(motion, truth); "cos_text" 1 - cos(motion, text); "reward" -max(0, cos(motion, text) - threshold);
            "hinge" max(0, threshold - cos(motion, text)); "detached" as "cos_gt", without a gradient: what the code does.
        threshold: S_th.

    Raises:
        ValueError: another kind.
    """
    to_truth, close = (1 - torch.cosine_similarity(motion, truth, dim=-1)), torch.cosine_similarity(motion, text, dim=-1)
    losses = {
        "cos_gt": to_truth, "cos_text": 1 - close, "reward": -(close - threshold).clamp_min(0),
        "hinge": (threshold - close).clamp_min(0), "detached": to_truth.detach(),
    }  # fmt: skip
    choice("kind", kind, losses)
    return losses[kind]


def stage_weights(
    stage: str, t: PerItem, alpha_bar: Float[Tensor, " M"], power: Float[Tensor, " K"] | None = None
) -> tuple[PerSample, PerSample]:
    """How much each loss counts at each sample's noise level; t = 0 is almost clean, t = M - 1 is noise.

    Source: the paper says in words that low frequencies come early in denoising, at much noise ("prose": t >= 0.6 M, meaning
    below), and prints the opposite (Eq. 16, "eq16": t <= 0.3 M). Its code for MDM leaves a gap ("mdm_code": t >= 0.6 M and
    t <= 0.4 M). "none": both everywhere (Table 11). Own choice: "snr", the share of the low cosines that noise still drowns.

    The mean of a batch counts samples outside a stage as zeros, as do the equations and the code for MDM. The code for
    StableMoFusion has the stages of Eq. 16, but takes the mean over the samples inside a stage ("smf_code"). With lambda 1 a
    low-frequency loss then counts 1/0.3 times as much on average, a semantic one 1/0.7 times.

    Args:
        stage: which reading.
        t: diffusion index of each sample.
        alpha_bar: of the schedule; M is its length.
        power: of the low cosines in the training data, for "snr".

    Returns:
        Weights of the low-frequency loss and of the semantic one.

    Raises:
        ValueError: another stage, or "snr" without power.

    >>> [w.tolist() for w in stage_weights("mdm_code", torch.tensor([10, 25, 40]), torch.linspace(1, 0, 50))]
    [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    """
    steps = len(alpha_bar)
    if stage == "snr" and power is not None:
        a = alpha_bar[t].float()[:, None]
        low = (a * power < 1 - a).float().mean(-1)
        return low, 1 - low
    late, early = t >= HIGH * steps, t <= int(EQ16 * steps)
    readings = {
        "prose": (late, ~late), "mdm_code": (late, t <= MDM_LOW * steps), "eq16": (early, ~early), "smf_code": (early, ~early),
        "none": (t >= 0, t >= 0),
    }  # fmt: skip
    choice("stage", stage, readings)
    low, semantic = (part.float() for part in readings[stage])
    if stage == "smf_code":
        low, semantic = (part / part.mean().clamp_min(1 / len(t)) for part in (low, semantic))
    return low, semantic
