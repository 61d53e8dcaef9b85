"""Every number that the papers report for stochastic motion prediction, per window.

Predictions p are (N, S, F, C), truths g are (N, F, C): metres, root-relative, root dropped. The norm of a frame is the
Euclidean norm of its C = 3J values, not a mean over joints: with 16 joints, numbers are about 4 times a mean per-joint error.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.kinematics import bones_of
from mwlib.body.skeleton import Skeleton
from mwlib.metrics.multimodal import MultimodalFutures, check_finite

# Differences, not the Gram matrix: coincident poses must come out as 0, also in float32.
_EXACT = "donot_use_mm_for_euclid_dist"
_TILE = 16  # members of a multimodal set that share one copy of the samples
_BUDGET = 2**23  # numbers held at once, 32 MiB in float32


def apd(p: Float[Tensor, "N S F C"]) -> Float[Tensor, " N"]:
    """Average pairwise distance, metres over all F·C values of a sequence (no mean over time); 0 when S is 1.

    Mean over the S(S-1)/2 unordered pairs of ‖vec(p_a) - vec(p_b)‖. Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: p is not (N, S, F, C) or not finite; the message names the window.

    >>> apd(torch.tensor([0.0, 3.0]).reshape(1, 2, 1, 1))
    tensor([3.])
    """
    check_shapes(p)
    pairs = max(p.shape[1] * (p.shape[1] - 1) // 2, 1)
    # pdist knows no batch, and does half the work of cdist.
    return torch.stack([torch.pdist(samples).sum() / pairs for samples in p.flatten(2)]) if len(p) else p.new_zeros(0)


def ade(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"]) -> Float[Tensor, " N"]:
    """Average displacement error of the best sample, metres over the C values of a frame: min_s mean_t ‖p_s,t - g_t‖.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> p, g = torch.tensor([[[1.0], [1.0]], [[0.0], [4.0]]]).reshape(1, 2, 2, 1), torch.zeros(1, 2, 1)
    >>> ade(p, g), fde(p, g)
    (tensor([1.]), tensor([1.]))
    """
    return sample_ade(p, g).amin(1)


def mean_ade(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"]) -> Float[Tensor, " N"]:
    """ADE of a sample drawn blindly, metres: mean over the samples where `ade` takes the smallest.

    It does not fall with the number of samples. Source: own choice; the other reading where a paper says "ADE" only.

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> mean_ade(torch.tensor([1.0, 2.0]).reshape(1, 2, 1, 1), torch.zeros(1, 1, 1))
    tensor([1.5000])
    """
    return sample_ade(p, g).mean(1)


def sample_ade(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"]) -> Float[Tensor, "N S"]:
    """Average displacement error of each sample, metres over the C values of a frame: mean_t ‖p_s,t - g_t‖.

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.
    """
    check_shapes(p, g)
    return torch.linalg.vector_norm(p - g[:, None], dim=-1).mean(-1)


def fde(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"]) -> Float[Tensor, " N"]:
    """Final displacement error, metres: min_s ‖p_s,F - g_F‖; the best sample may differ from that of `ade`.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> fde(torch.tensor([5.0, 2.0]).reshape(1, 1, 2, 1), torch.zeros(1, 2, 1))
    tensor([2.])
    """
    check_shapes(p, g)
    return ade(p[:, :, -1:], g[:, -1:])


def mmade(p: Float[Tensor, "N S F C"], gs: Sequence[Float[Tensor, "_M F C"]]) -> Float[Tensor, " N"]:
    """Multimodal ADE, metres: mean over the futures g' in a window's set of (min_s mean_t ‖p_s,t - g'_t‖).

    Args:
        p: predictions.
        gs: one set per window, from `multimodal_futures` or a list of tensors.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit, a set is empty or a value is not finite; the message names the window.

    >>> p = torch.zeros(1, 1, 2, 1)
    >>> mmade(p, [torch.tensor([[[0.0], [0.0]], [[1.0], [3.0]]])])
    tensor([1.])
    """
    check_shapes(p)
    sets = MultimodalFutures.of(gs)
    if len(sets) != len(p):
        raise ValueError(f"gs holds {len(sets)} multimodal sets; expected one for each of the {len(p)} windows")
    if sets.futures.shape[1:] != p.shape[2:]:
        raise ValueError(f"futures in gs have shape {tuple(sets.futures.shape[1:])}; expected {tuple(p.shape[2:])} as in p")
    return _mean_best_error(p, sets)


def mmfde(p: Float[Tensor, "N S F C"], gs: Sequence[Float[Tensor, "_M F C"]]) -> Float[Tensor, " N"]:
    """Multimodal FDE, metres: as `mmade`, on the last frame alone.

    Raises:
        ValueError: shapes do not fit, a set is empty or a value is not finite; the message names the window.

    >>> p = torch.zeros(1, 1, 2, 1)
    >>> mmfde(p, [torch.tensor([[[0.0], [0.0]], [[1.0], [3.0]]])])
    tensor([1.5000])
    """
    check_shapes(p)
    sets = MultimodalFutures.of(gs)
    return mmade(p[:, :, -1:], MultimodalFutures(sets.futures[:, -1:], sets.members))


def apde(predicted: Float[Tensor, " N"], multimodal: Float[Tensor, " N"]) -> Float[Tensor, ""]:
    """APD error, metres: mean of |APD - APD of the multimodal set| over the windows where the latter is not 0.

    Args:
        predicted: from `apd`.
        multimodal: from `multimodal_apd`.

    Source: BeLFusion (Barquero et al., 2023).

    >>> apde(torch.tensor([1.0, 9.0]), torch.tensor([1.5, 0.0]))
    tensor(0.5000)
    """
    return (predicted - multimodal)[multimodal > 0].abs().mean()


def step_length(p: Float[Tensor, "N S F C"]) -> Float[Tensor, "N F-1"]:
    """Path that a joint covers from each frame to the next, metres, mean over samples and joints; needs F >= 2.

    The jump from the last observed frame is not included. Source: M_c,t of BeLFusion's CMD, per window.

    >>> step_length(torch.tensor([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0]]).reshape(1, 1, 2, 3))
    tensor([[5.]])
    """
    check_shapes(p, frames=2)
    return p.unflatten(-1, (-1, 3)).diff(dim=2).norm(dim=-1).mean((1, 3))


def cmd(predicted: Float[Tensor, "N steps"], truth: Float[Tensor, "N steps"], actions: Sequence[Hashable]) -> Float[Tensor, ""]:
    """Cumulative motion distribution, metres: Σ_c w_c Σ_t (F-t) |M_c,t - M̄_c|, w_c the share of action c.

    Args:
        predicted: `step_length(p)`; its mean over the windows of an action is M_c,t.
        truth: `step_length(g[:, None])`; its mean over windows and frames is M̄_c. BeLFusion takes that mean over test
            windows 10 frames apart, so its published values differ in the third digit.
        actions: class of each window.

    Source: BeLFusion (Barquero et al., 2023).

    >>> still, steady = torch.zeros(2, 3), torch.full((2, 3), 0.1)
    >>> cmd(still, steady, ["walk", "walk"])
    tensor(0.6000)
    """
    weight = torch.arange(predicted.shape[1], 0, -1).to(predicted)
    total = predicted.new_zeros(())
    for rows in by_action(actions).values():
        total += len(rows) * (weight * (predicted[rows].mean(0) - truth[rows].mean()).abs()).sum()
    return total / len(predicted)


def bone_length_jitter(p: Float[Tensor, "N S F C"], skeleton: Skeleton) -> Float[Tensor, " N"]:
    """Change of a bone's length from frame to frame, metres: mean over bones, frames and samples of |l_t+1 - l_t|.

    0 for a rigid body. The dropped root is put back at the origin. Source: own choice, after the realism metrics of
    SkeletonDiffusion (Curreli et al., 2025): nothing else here punishes limbs that stretch, and APD rewards them.

    Raises:
        ValueError: C does not belong to the skeleton, F < 2, or p is not finite.

    >>> chain = mw.Skeleton("chain", ("root", "end"), (-1, 0))
    >>> bone_length_jitter(torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.25, 0.0]]).reshape(1, 1, 2, 3), chain)
    tensor([0.2500])
    """
    check_shapes(p, frames=2)
    if p.shape[-1] != 3 * (len(skeleton) - 1):
        raise ValueError(f"p has {p.shape[-1]} channels; expected {3 * (len(skeleton) - 1)} for {skeleton.name} without root")
    return bones_of(p, skeleton).norm(dim=-1).diff(dim=2).abs().mean((1, 2, 3))


def by_action(actions: Sequence[Hashable]) -> dict[Hashable, list[int]]:
    """Row numbers of each action, actions in the order of their first appearance."""
    rows: dict[Hashable, list[int]] = {}
    for i, action in enumerate(actions):
        rows.setdefault(action, []).append(i)
    return rows


def _mean_best_error(p: Tensor, sets: MultimodalFutures) -> Tensor:
    """Mean over each set of min_s mean_t ‖p_s,t - g'_t‖; sets are cut into tiles so that no loop runs over windows."""
    _, samples, frames, channels = p.shape
    tiles = [(i, tile) for i, m in enumerate(sets.members) for tile in m.split(_TILE)]
    step = max(1, _BUDGET // (samples * frames * max(channels, _TILE)))
    total = p.new_zeros(len(p))
    for start in range(0, len(tiles), step):
        windows, members = zip(*tiles[start : start + step], strict=True)
        window = torch.tensor(windows, device=p.device)
        member = torch.nn.utils.rnn.pad_sequence(list(members), batch_first=True, padding_value=-1)
        g = sets.futures[member.clamp(min=0)].to(p)
        distance = torch.cdist(p[window].transpose(1, 2), g.transpose(1, 2), compute_mode=_EXACT)  # (tiles, F, S, _TILE)
        best = distance.mean(1).amin(1)
        total.index_add_(0, window, best.masked_fill(member.to(p.device) < 0, 0).sum(1))
    return total / sets.sizes.to(p)


def check_shapes(p: Tensor, g: Tensor | None = None, *, windows: Tensor | None = None, frames: int = 1) -> None:
    """Refuse predictions, and truths, of other shapes than (N, S, F, C) and (N, F, C), and what is not finite.

    Raises:
        ValueError: the message has the shapes, or the number of the first bad window.
    """
    if p.ndim != 4 or p.shape[1] < 1 or p.shape[2] < frames:
        raise ValueError(f"p has shape {tuple(p.shape)}; expected (N, S, F, C) with S >= 1 and F >= {frames}")
    if g is not None and g.shape != (p.shape[0], *p.shape[2:]):
        raise ValueError(f"g has shape {tuple(g.shape)}; expected {(p.shape[0], *p.shape[2:])} to fit p {tuple(p.shape)}")
    check_finite("p", p, windows)
    if g is not None:
        check_finite("g", g, windows)
