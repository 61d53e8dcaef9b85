"""Every number that the papers report for stochastic motion prediction, per window and over a whole test set.

Predictions p are (N, S, F, C), truths g are (N, F, C): metres, root-relative, root dropped. The norm of a frame is the
Euclidean norm of its C = 3J values, not a mean over joints: with 16 joints, numbers are about 4 times a mean per-joint error.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor

from .multimodal import MultimodalFutures, check_finite, multimodal_apd, multimodal_futures
from .skeleton import Skeleton

__all__ = [
    "MetricTable",
    "MultimodalFutures",
    "ade",
    "apd",
    "apde",
    "bone_length_jitter",
    "cmd",
    "fde",
    "mmade",
    "mmfde",
    "multimodal_apd",
    "multimodal_futures",
    "step_length",
]

MM_SINGLETONS = ("keep", "skip_all", "skip_mm")
# Differences, not the Gram matrix: coincident poses must come out as 0, also in float32.
_EXACT = "donot_use_mm_for_euclid_dist"
_TILE = 16  # members of a multimodal set that share one copy of the samples
_BUDGET = 2**23  # numbers held at once, 32 MiB in float32


def apd(p: Float[Tensor, "N S F C"]) -> Float[Tensor, " N"]:
    """Average pairwise distance, metres over all F·C values of a sequence (no mean over time); 0 when S is 1.

    Mean over the S(S-1)/2 unordered pairs of ‖vec(p_a) - vec(p_b)‖. Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: p is not (N, S, F, C) or not finite; the message names the window.
    """
    _check(p)
    pairs = max(p.shape[1] * (p.shape[1] - 1) // 2, 1)
    # pdist knows no batch, and does half the work of cdist.
    return torch.stack([torch.pdist(samples).sum() / pairs for samples in p.flatten(2)]) if len(p) else p.new_zeros(0)


def ade(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"]) -> Float[Tensor, " N"]:
    """Average displacement error of the best sample, metres over the C values of a frame: min_s mean_t ‖p_s,t - g_t‖.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.
    """
    _check(p, g)
    return torch.linalg.vector_norm(p - g[:, None], dim=-1).mean(-1).amin(1)


def fde(p: Float[Tensor, "N S F C"], g: Float[Tensor, "N F C"]) -> Float[Tensor, " N"]:
    """Final displacement error, metres: min_s ‖p_s,F - g_F‖; the best sample may differ from that of `ade`.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.
    """
    _check(p, g)
    return ade(p[:, :, -1:], g[:, -1:])


def mmade(p: Float[Tensor, "N S F C"], gs: Sequence[Float[Tensor, "_M F C"]]) -> Float[Tensor, " N"]:
    """Multimodal ADE, metres: mean over the futures g' in a window's set of (min_s mean_t ‖p_s,t - g'_t‖).

    Args:
        p: predictions.
        gs: one set per window, from `multimodal_futures` or a list of tensors.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit, a set is empty or a value is not finite; the message names the window.
    """
    _check(p)
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
    """
    _check(p)
    sets = MultimodalFutures.of(gs)
    return mmade(p[:, :, -1:], MultimodalFutures(sets.futures[:, -1:], sets.members))


def apde(predicted: Float[Tensor, " N"], multimodal: Float[Tensor, " N"]) -> Float[Tensor, ""]:
    """APD error, metres: mean of |APD - APD of the multimodal set| over the windows where the latter is not 0.

    Args:
        predicted: from `apd`.
        multimodal: from `multimodal_apd`.

    Source: BeLFusion (Barquero et al., 2023).
    """
    return (predicted - multimodal)[multimodal > 0].abs().mean()


def step_length(p: Float[Tensor, "N S F C"]) -> Float[Tensor, "N F-1"]:
    """Path that a joint covers from each frame to the next, metres, mean over samples and joints; needs F >= 2.

    The jump from the last observed frame is not included. Source: M_c,t of BeLFusion's CMD, per window.
    """
    _check(p, frames=2)
    return p.unflatten(-1, (-1, 3)).diff(dim=2).norm(dim=-1).mean((1, 3))


def cmd(predicted: Float[Tensor, "N steps"], truth: Float[Tensor, "N steps"], actions: Sequence[Hashable]) -> Float[Tensor, ""]:
    """Cumulative motion distribution, metres: Σ_c w_c Σ_t (F-t) |M_c,t - M̄_c|, w_c the share of action c.

    Args:
        predicted: `step_length(p)`; its mean over the windows of an action is M_c,t.
        truth: `step_length(g[:, None])`; its mean over windows and frames is M̄_c. BeLFusion takes that mean over test
            windows 10 frames apart, so its published values differ in the third digit.
        actions: class of each window.

    Source: BeLFusion (Barquero et al., 2023).
    """
    weight = torch.arange(predicted.shape[1], 0, -1).to(predicted)
    total = predicted.new_zeros(())
    for rows in _by_action(actions).values():
        total += len(rows) * (weight * (predicted[rows].mean(0) - truth[rows].mean()).abs()).sum()
    return total / len(predicted)


def bone_length_jitter(p: Float[Tensor, "N S F C"], skeleton: Skeleton) -> Float[Tensor, " N"]:
    """Change of a bone's length from frame to frame, metres: mean over bones, frames and samples of |l_t+1 - l_t|.

    0 for a rigid body. The dropped root is put back at the origin. Source: own choice, after the realism metrics of
    SkeletonDiffusion (Curreli et al., 2025): nothing else here punishes limbs that stretch, and APD rewards them.

    Raises:
        ValueError: C does not belong to the skeleton, F < 2, or p is not finite.
    """
    _check(p, frames=2)
    if p.shape[-1] != 3 * (len(skeleton) - 1):
        raise ValueError(f"p has {p.shape[-1]} channels; expected {3 * (len(skeleton) - 1)} for {skeleton.name} without root")
    joints = torch.nn.functional.pad(p, (3, 0)).unflatten(-1, (-1, 3))
    parent, child = (torch.tensor(ends, device=p.device) for ends in zip(*skeleton.bones, strict=True))
    bones = joints.index_select(-2, child) - joints.index_select(-2, parent)
    return bones.norm(dim=-1).diff(dim=2).abs().mean((1, 2, 3))


class MetricTable:
    """Metrics of a test set that is too big to hold at once: feed chunks of windows, then ask for the summary.

    Args:
        gs: multimodal sets of all N windows of the test set, from `multimodal_futures` or a list of tensors.
        actions: class of each window, for the table per action and for CMD; None: one class.
        skeleton: if given, `bone_length_jitter` is reported too.
        mm_singletons: what becomes of windows whose set holds only themselves: "keep" (DLow, HumanMAC, BeLFusion; the
            default, as MotionWavelet follows HumanMAC), "skip_all": left out of every number (GSPS, STARS),
            "skip_mm": left out of MMADE and MMFDE only (CoMusion).

    `values` maps each metric to (N,) float64, NaN where a window has not been fed yet. Numbers depend neither on the
    size nor on the order of the chunks; windows that were never fed do not count, their futures still serve as neighbours.

    Raises:
        ValueError: an argument does not fit the others, a window is fed twice, or a prediction is not finite.
    """

    def __init__(
        self,
        gs: Sequence[Float[Tensor, "_M F C"]],
        actions: Sequence[Hashable] | None = None,
        skeleton: Skeleton | None = None,
        mm_singletons: str = "keep",
    ) -> None:
        if mm_singletons not in MM_SINGLETONS:
            raise ValueError(f"mm_singletons is {mm_singletons!r}; expected one of {', '.join(MM_SINGLETONS)}")
        if actions is not None and len(actions) != len(gs):
            raise ValueError(f"{len(actions)} actions for {len(gs)} windows; expected one each")
        self.gs, self.skeleton, self.mm_singletons = MultimodalFutures.of(gs), skeleton, mm_singletons
        self.actions = ["all"] * len(gs) if actions is None else list(actions)
        names = ["apd", "ade", "fde", "mmade", "mmfde"] + ["bone_length_jitter"] * (skeleton is not None)
        self.values = {name: torch.full((len(gs),), torch.nan, dtype=torch.float64) for name in names}
        self._steps = torch.full((2, len(gs), self.gs.futures.shape[1] - 1), torch.nan, dtype=torch.float64)

    def update(self, p: Float[Tensor, "n S F C"], g: Float[Tensor, "n F C"], windows: Sequence[int] | Int[Tensor, " n"]) -> None:
        """Add the predictions of some windows, given by their numbers in the test set."""
        windows = torch.as_tensor(windows)
        if windows.shape != (len(p),) or len(windows.unique()) < len(p):
            raise ValueError(f"{len(windows)} window numbers for {len(p)} predictions; expected one each, all different")
        _check(p, g, windows=windows)
        fed = windows[self.values["apd"][windows].isfinite()].tolist()
        if fed:
            raise ValueError(f"window {fed[0]} was fed before; expected every window once")
        sets = self.gs.take(windows.tolist())
        found = {"apd": apd(p), "ade": ade(p, g), "fde": fde(p, g), "mmade": mmade(p, sets), "mmfde": mmfde(p, sets)}
        if self.skeleton is not None:
            found["bone_length_jitter"] = bone_length_jitter(p, self.skeleton)
        for name, value in found.items():
            self.values[name][windows] = value.double().cpu()
        for row, motion in zip(self._steps, (p, g[:, None]), strict=True):
            row[windows] = step_length(motion).double().cpu()

    def summary(self) -> dict:
        """Plain numbers, ready for JSON.

        Returns:
            {"mean": {metric: metres}, "standard_error": {metric: metres}, "windows": {metric: count}, "cmd": metres,
            "actions": {action: the first three for its windows}}. The standard error takes windows as independent; they
            overlap, so it is a lower bound. NaN where there is nothing to average.
        """
        alone = self.gs.sizes == 1
        counted = self.values["apd"].isfinite() & ~(alone if self.mm_singletons == "skip_all" else torch.zeros_like(alone))
        rows = counted.nonzero()[:, 0].tolist()
        actions = [self.actions[i] for i in rows]
        hidden = alone if self.mm_singletons == "skip_mm" else torch.zeros_like(alone)
        kept = {k: v.masked_fill(hidden, torch.nan)[rows] if k.startswith("mm") else v[rows] for k, v in self.values.items()}
        per_action = {a: _row({k: v[i] for k, v in kept.items()}) for a, i in _by_action(actions).items()}
        return {**_row(kept), "cmd": float(cmd(*self._steps[:, rows], actions)), "actions": per_action}


def _row(values: dict[str, Tensor]) -> dict[str, dict]:
    values = {name: v[v.isfinite()] for name, v in values.items()}
    return {
        "mean": {name: float(v.mean()) for name, v in values.items()},
        "standard_error": {name: float(v.std() / len(v) ** 0.5) if len(v) > 1 else torch.nan for name, v in values.items()},
        "windows": {name: len(v) for name, v in values.items()},
    }


def _by_action(actions: Sequence[Hashable]) -> dict[Hashable, list[int]]:
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
        member = torch.nn.utils.rnn.pad_sequence(members, batch_first=True, padding_value=-1)
        g = sets.futures[member.clamp(min=0)].to(p)
        distance = torch.cdist(p[window].transpose(1, 2), g.transpose(1, 2), compute_mode=_EXACT)  # (tiles, F, S, _TILE)
        best = distance.mean(1).amin(1)
        total.index_add_(0, window, best.masked_fill(member.to(p.device) < 0, 0).sum(1))
    return total / sets.sizes.to(p)


def _check(p: Tensor, g: Tensor | None = None, *, windows: Tensor | None = None, frames: int = 1) -> None:
    if p.ndim != 4 or p.shape[1] < 1 or p.shape[2] < frames:
        raise ValueError(f"p has shape {tuple(p.shape)}; expected (N, S, F, C) with S >= 1 and F >= {frames}")
    if g is not None and g.shape != (p.shape[0], *p.shape[2:]):
        raise ValueError(f"g has shape {tuple(g.shape)}; expected {(p.shape[0], *p.shape[2:])} to fit p {tuple(p.shape)}")
    check_finite("p", p, windows)
    if g is not None:
        check_finite("g", g, windows)
