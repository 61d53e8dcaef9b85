"""Multimodal sets: which futures count as plausible for a window, because another window's last observed pose is close."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor


@dataclass(frozen=True)
class MultimodalFutures(Sequence):
    """Multimodal sets of many windows, kept as indices: a list of (M_i, F, C) tensors that is gathered on demand.

    Args:
        futures: (N, F, C) metres, the futures that the sets share.
        members: for each set the indices of its futures.

    Raises:
        ValueError: a set is empty; the message names the window.
    """

    futures: Float[Tensor, "N F C"]
    members: Sequence[Int[Tensor, " _M"]]

    def __post_init__(self) -> None:
        for i, m in enumerate(self.members):
            if len(m) == 0:
                raise ValueError(f"multimodal set of window {i} is empty; expected at least the window itself")

    @classmethod
    def of(cls, gs: Sequence[Float[Tensor, "_M F C"]]) -> MultimodalFutures:
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

    def __getitem__(self, i: int | slice) -> Float[Tensor, "_M F C"] | MultimodalFutures:
        return MultimodalFutures(self.futures, self.members[i]) if isinstance(i, slice) else self.futures[self.members[i]]

    def take(self, windows: Sequence[int]) -> MultimodalFutures:
        """The sets of these windows, in this order; the futures are not copied."""
        return MultimodalFutures(self.futures, [self.members[i] for i in windows])

    @property
    def sizes(self) -> Int[Tensor, " N"]:
        """M_i; 1 means that a window has no neighbour but itself."""
        return torch.tensor([len(m) for m in self.members])


def multimodal_futures(
    last: Float[Tensor, "N C"], futures: Float[Tensor, "N F C"], threshold: float = 0.5, *, chunk: int = 512
) -> MultimodalFutures:
    """Futures of all windows whose last observed pose is close: ‖last_j - last_i‖ < threshold, i itself included.

    Args:
        last: last observed frame of each window, metres. Distances are taken in float64.
        futures: their futures, metres; used as they are, no bone length is changed.
        threshold: metres over the C values; the papers use 0.5 (Human3.6M, HumanEva-I) and 0.4 (AMASS).
        chunk: rows of the N×N distance matrix held at once.

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
    for rows in poses.split(chunk):
        near = torch.cdist(rows, poses, compute_mode="donot_use_mm_for_euclid_dist") < threshold
        members.extend(near.nonzero()[:, 1].split(near.sum(1).tolist()))
    return MultimodalFutures(futures, members)


def multimodal_apd(gs: MultimodalFutures, *, chunk: int = 512) -> Float[Tensor, " N"]:
    """APD of each multimodal set, metres; 0 for a set of one. Holds an N×N matrix of the sequence distances.

    Source: BeLFusion (Barquero et al., 2023). Known answer for a correct Human3.6M file at 0.5 m: mean 7.971, or 8.085
    over the windows where it is not 0.

    >>> last, futures = torch.tensor([[0.0], [0.3], [2.0]]), torch.tensor([1.0, 4.0, 9.0]).reshape(3, 1, 1)
    >>> multimodal_apd(multimodal_futures(last, futures))
    tensor([3., 3., 0.])
    """
    flat = gs.futures.flatten(1).double()
    distance = torch.cat([torch.cdist(rows, flat).to(gs.futures.dtype) for rows in flat.split(chunk)])
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
