"""Metrics of stochastic motion prediction, per window.

Predictions p are (N, S, F, C), truths g are (N, F, C): metres, root-relative, root dropped. The norm of a frame is the
Euclidean norm of its C = 3J values, not a mean over joints: with 16 joints, numbers are about 4 times a mean per-joint error.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.kinematics import bones_of
from mwlib.body.skeleton import Skeleton
from mwlib.metrics.table import Column
from mwlib.settings import of_kind

Samples = Float[Tensor, "N S F C"]  # predictions, S of each window
Truths = Float[Tensor, "N F C"]
PerWindow = Float[Tensor, " N"]
Sets = Sequence[Float[Tensor, "_M F C"]]  # multimodal sets, one of each window


@dataclass(frozen=True)
class MultimodalFutures(Sequence):
    """Multimodal sets of many windows, kept as indices: a list of (M_i, F, C) tensors that is gathered on demand.

    Args:
        futures: (N, F, C) metres, the futures that the sets share.
        members: for each set the indices of its futures.

    Raises:
        ValueError: a set is empty; the message names the window.
    """

    futures: Truths
    members: Sequence[Int[Tensor, " _M"]]

    def __post_init__(self) -> None:
        for i, m in enumerate(self.members):
            if len(m) == 0:
                raise ValueError(f"multimodal set of window {i} is empty; expected at least the window itself")

    @classmethod
    def of(cls, gs: Sets) -> MultimodalFutures:
        """The same for sets that are already tensors, one for each window.

        Raises:
            ValueError: a set is empty or a value is not finite.
        """
        if isinstance(gs, cls):
            return gs
        futures = torch.cat(list(gs))
        check_finite("gs, laid end to end,", futures)
        return cls(futures, torch.arange(len(futures)).split([len(g) for g in gs]))

    def __len__(self) -> int:
        return len(self.members)

    def __getitem__(self, i: int) -> Float[Tensor, "_M F C"]:  # pyright: ignore[reportIncompatibleMethodOverride]  (see `take`)
        return self.futures[self.members[i]]

    def take(self, windows: Sequence[int]) -> MultimodalFutures:
        """The sets of these windows, in this order; the futures are not copied."""
        return MultimodalFutures(self.futures, [self.members[i] for i in windows])

    @property
    def sizes(self) -> Int[Tensor, " N"]:
        """M_i; 1 means that a window has no neighbour but itself."""
        return torch.tensor([len(m) for m in self.members])


_ROWS = 512  # of an N×N matrix of distances that are calculated at once


def multimodal_futures(last: Float[Tensor, "N C"], futures: Truths, threshold: float = 0.5) -> MultimodalFutures:
    """Futures of all windows whose last observed pose is close: ‖last_j - last_i‖ < threshold, i itself included.

    Args:
        last: last observed frame of each window, metres. Distances are taken in float64.
        futures: their futures, metres; used as they are, no bone length is changed.
        threshold: metres over the C values; the papers use 0.5 (Human3.6M, HumanEva-I) and 0.4 (AMASS).

    Source: DLow (Yuan and Kitani, 2020), as in HumanMAC's evaluation. Known answer for a correct Human3.6M file: 73 of
    the 5168 windows have no neighbour but themselves.

    Raises:
        ValueError: threshold is not positive, shapes do not fit or a value is not finite.

    >>> last, futures = torch.tensor([[0.0], [0.3], [2.0]]), torch.zeros(3, 4, 1)
    >>> multimodal_futures(last, futures, threshold=0.5).sizes
    tensor([2, 2, 1])
    """
    if not threshold > 0:
        raise ValueError(f"threshold is {threshold}; expected a positive distance in metres")
    if last.ndim != 2 or futures.ndim != 3 or len(last) != len(futures):
        raise ValueError(f"last {tuple(last.shape)} and futures {tuple(futures.shape)}; expected (N, C) and (N, F, C)")
    check_finite("last", last)
    check_finite("futures", futures)
    poses, members = last.double(), []
    for rows in poses.split(_ROWS):
        near = torch.cdist(rows, poses, compute_mode="donot_use_mm_for_euclid_dist") < threshold
        members.extend(near.nonzero()[:, 1].split(near.sum(1).tolist()))
    return MultimodalFutures(futures, members)


def multimodal_apd(gs: MultimodalFutures) -> PerWindow:
    """APD of each multimodal set, metres; 0 for a set of one. Holds an N×N matrix of the sequence distances.

    Source: BeLFusion (Barquero et al., 2023). Known answer for a correct Human3.6M file at 0.5 m: mean 7.971, or 8.085
    over the windows where it is not 0.

    >>> last, futures = torch.tensor([[0.0], [0.3], [2.0]]), torch.tensor([1.0, 4.0, 9.0]).reshape(3, 1, 1)
    >>> multimodal_apd(multimodal_futures(last, futures))
    tensor([3., 3., 0.])
    """
    flat = gs.futures.flatten(1).double()
    distance = torch.cat([torch.cdist(rows, flat).to(gs.futures.dtype) for rows in flat.split(_ROWS)])
    distance.fill_diagonal_(0)
    return torch.stack([distance[m][:, m].sum() / max(len(m) * (len(m) - 1), 1) for m in gs.members])


def check_finite(name: str, x: Float[Tensor, "N ..."], windows: Int[Tensor, " N"] | None = None) -> None:
    """Refuse NaN and infinity.

    Raises:
        ValueError: with the number of the first bad window: its row in x, or what `windows` calls that row.
    """
    # A sum is finite only if all its terms are; it is cheaper than a mask as big as x.
    bad = (~x.flatten(1).sum(1).isfinite()).nonzero()[:, 0].cpu()
    if len(bad):
        first = bad[0] if windows is None else windows[bad[0]]
        raise ValueError(f"{name} of window {int(first)} is not finite ({len(bad)} such of {len(x)}); expected finite metres")


# Differences, not the Gram matrix: coincident poses must come out as 0, also in float32.
_EXACT = "donot_use_mm_for_euclid_dist"
_TILE = 16  # members of a multimodal set that share one copy of the samples
_BUDGET = 2**23  # numbers held at once, 32 MiB in float32


def apd(p: Samples) -> PerWindow:
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


def ade(p: Samples, g: Truths) -> PerWindow:
    """Average displacement error of the best sample, metres over the C values of a frame: min_s mean_t ‖p_s,t - g_t‖.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> p, g = torch.tensor([[[1.0], [1.0]], [[0.0], [4.0]]]).reshape(1, 2, 2, 1), torch.zeros(1, 2, 1)
    >>> ade(p, g), fde(p, g)
    (tensor([1.]), tensor([1.]))
    """
    return sample_ade(p, g).amin(1)


def mean_ade(p: Samples, g: Truths) -> PerWindow:
    """ADE of a sample drawn blindly, metres: mean over the samples where `ade` takes the smallest.

    It does not fall with the number of samples. Source: own choice; the other reading where a paper says "ADE" only.

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> mean_ade(torch.tensor([1.0, 2.0]).reshape(1, 2, 1, 1), torch.zeros(1, 1, 1))
    tensor([1.5000])
    """
    return sample_ade(p, g).mean(1)


def sample_ade(p: Samples, g: Truths) -> Float[Tensor, "N S"]:
    """Average displacement error of each sample, metres over the C values of a frame: mean_t ‖p_s,t - g_t‖.

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.
    """
    check_shapes(p, g)
    return (p - g[:, None]).norm(dim=-1).mean(-1)


def fde(p: Samples, g: Truths) -> PerWindow:
    """Final displacement error, metres: min_s ‖p_s,F - g_F‖; the best sample may differ from that of `ade`.

    Source: DLow (Yuan and Kitani, 2020).

    Raises:
        ValueError: shapes do not fit or a value is not finite; the message names the window.

    >>> fde(torch.tensor([5.0, 2.0]).reshape(1, 1, 2, 1), torch.zeros(1, 2, 1))
    tensor([2.])
    """
    check_shapes(p, g)
    return ade(p[:, :, -1:], g[:, -1:])


def mmade(p: Samples, gs: Sets) -> PerWindow:
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
    # Sets are cut into tiles so that no loop runs over windows.
    tiles = [(i, tile) for i, m in enumerate(sets.members) for tile in m.split(_TILE)]
    _, samples, frames, channels = p.shape
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


def mmfde(p: Samples, gs: Sets) -> PerWindow:
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


def apde(predicted: PerWindow, multimodal: PerWindow) -> Float[Tensor, ""]:
    """APD error, metres: mean of |APD - APD of the multimodal set| over the windows where the latter is not 0.

    Args:
        predicted: from `apd`.
        multimodal: from `multimodal_apd`.

    Source: BeLFusion (Barquero et al., 2023).

    >>> apde(torch.tensor([1.0, 9.0]), torch.tensor([1.5, 0.0]))
    tensor(0.5000)
    """
    return (predicted - multimodal)[multimodal > 0].abs().mean()


def step_length(p: Samples) -> Float[Tensor, "N F-1"]:
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

    Raises:
        ValueError: the windows are not as many as the actions.

    >>> still, steady = torch.zeros(2, 3), torch.full((2, 3), 0.1)
    >>> cmd(still, steady, ["walk", "walk"])
    tensor(0.6000)
    """
    if not len(predicted) == len(truth) == len(actions):
        raise ValueError(f"{len(actions)} actions for {len(predicted)} and {len(truth)} windows; expected one each")
    weight = torch.arange(predicted.shape[1], 0, -1).to(predicted)
    total = predicted.new_zeros(())
    for rows in by_action(actions).values():
        total += len(rows) * (weight * (predicted[rows].mean(0) - truth[rows].mean()).abs()).sum()
    return total / len(predicted)


def bone_length_jitter(p: Samples, skeleton: Skeleton) -> PerWindow:
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
    return {action: [i for i, other in enumerate(actions) if other == action] for action in dict.fromkeys(actions)}


def check_shapes(p: Tensor, g: Tensor | None = None, *, windows: Tensor | None = None, frames: int = 1) -> None:
    """Refuse predictions, and truths, of other shapes than (N, S, F, C) and (N, F, C), and what is not finite.

    Raises:
        ValueError: the message has the shapes, or the number of the first bad window.
    """
    of_kind("p", p, Tensor, "a tensor (N, S, F, C)")
    if p.ndim != 4 or p.shape[1] < 1 or p.shape[2] < frames:
        raise ValueError(f"p has shape {tuple(p.shape)}; expected (N, S, F, C) with S >= 1 and F >= {frames}")
    if g is not None and g.shape != (p.shape[0], *p.shape[2:]):
        raise ValueError(f"g has shape {tuple(g.shape)}; expected {(p.shape[0], *p.shape[2:])} to fit p {tuple(p.shape)}")
    check_finite("p", p, windows)
    if g is not None:
        check_finite("g", g, windows)


class Metric(NamedTuple):
    """A metric of a test set: its column, its function, and the fewest frames that it needs at a rate; 0: it has none there."""

    column: Column
    function: Callable[..., Tensor]  # of some of what `of` is given
    fewest: Callable[[float], int] = lambda fps: 1
    past: int = 0  # and of the frames before

    def of(self, **windows: Any) -> PerWindow:
        """The metric of each window: the function of those arguments that it takes.

        Args:
            windows: p, g, gs, skeleton, fps and x_history, as the metrics name them.
        """
        wanted = inspect.signature(self.function).parameters
        return self.function(**{name: value for name, value in windows.items() if name in wanted})


ERRORS = {
    "apd": Metric(Column("APD"), apd),
    "ade": Metric(Column("ADE", "lower"), ade),
    "fde": Metric(Column("FDE", "lower"), fde),
    "mmade": Metric(Column("MMADE", "lower"), mmade),
    "mmfde": Metric(Column("MMFDE", "lower"), mmfde),
    "bone_length_jitter": Metric(Column("bone jitter (mm)", scale=1000.0), bone_length_jitter, lambda _: 2),
}
