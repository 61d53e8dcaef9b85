"""Baselines without training: standing still, going on, and looking up what is known."""

import torch
from jaxtyping import Complex, Float, Int
from torch import Tensor

from mwlib.body.kinematics import AXES, horizontal, turn_heading
from mwlib.settings import choice

FUTURES = ("pose", "displacement")
_BUDGET = 2**23  # distances held at once, 64 MiB


def zero_velocity(x_history: Float[Tensor, "N H C"], future: int) -> Float[Tensor, "N 1 F C"]:
    """The last observed pose, held: one sample, so APD is 0. Metres.

    Source: Martinez et al. 2017, "zero-velocity".

    >>> zero_velocity(torch.tensor([[[1.0], [2.0]]]), 3).flatten()
    tensor([2., 2., 2.])
    """
    return x_history[:, None, -1:].repeat(1, 1, future, 1)


def constant_velocity(x_history: Float[Tensor, "N H C"], future: int) -> Float[Tensor, "N 1 F C"]:
    """The last observed step, x_H - x_{H-1}, repeated for ever: one sample. Metres; bones stretch.

    Own choice: two frames, no smoothing, as the plainest reading of the name.

    Raises:
        ValueError: fewer than two observed frames.

    >>> constant_velocity(torch.tensor([[[1.0], [2.0]]]), 3).flatten()
    tensor([3., 4., 5.])
    """
    if x_history.shape[1] < 2:
        raise ValueError(f"the history has {x_history.shape[1]} frame; expected at least 2 for a velocity")
    ahead = torch.arange(1, future + 1).to(x_history)[:, None]
    return (x_history[:, -1:] + ahead * (x_history[:, -1:] - x_history[:, -2:-1]))[:, None]


class NearestHistory:
    """Futures of the training windows whose observed histories are nearest; nothing is learned.

    Args:
        x: (M, T, C) training windows, metres.
        history: H, observed frames.
        samples: S, number of neighbours.
        up: the up-axis, "y" or "z".
        futures: "pose" gives the neighbours' poses, "displacement" what they do after the query's last pose.

    Own choice: plain retrieval by all H frames flattened. Every training window is turned about the up-axis to where its history
    fits the query best, and its future with it, because a motion's heading is arbitrary and training turns motions, too. That is
    Procrustes in the plane: θ = arg Σ conj(h) q over horizontal coordinates h, q read as complex numbers.

    Raises:
        ValueError: unknown option, a history that leaves no future, or fewer windows than samples.

    >>> x = mw.windows(mw.load_motions("synthetic", fps=25)[:12], history=10, future=30, stride=10).x
    >>> futures = NearestHistory(x, history=10, samples=5).predict(x[:2, :10])
    >>> futures.shape, torch.allclose(futures[:, 0], x[:2, 10:], atol=1e-5)  # a window is its own nearest
    (torch.Size([2, 5, 30, 48]), True)
    """

    def __init__(
        self,
        x: Float[Tensor, "M T C"],
        history: int,
        samples: int = 50,
        *,
        up: str = "z",
        futures: str = "pose",
    ) -> None:
        choice("up", up, AXES)
        choice("futures", futures, FUTURES)
        if not 1 <= history < x.shape[1]:
            raise ValueError(f"history is {history}; expected 1 to {x.shape[1] - 1} for windows of {x.shape[1]} frames")
        if not 1 <= samples <= len(x):
            raise ValueError(f"samples is {samples}; expected 1 to {len(x)}, the number of training windows")
        self.history, self.samples, self.up = history, samples, up
        self.relative = futures == "displacement"
        self.future = x[:, history:] - x[:, history - 1 : history] if self.relative else x[:, history:]
        self._plane, self._height = self._features(x[:, :history])
        self._energy = self._plane.abs().square().sum(1) + self._height.square().sum(1)

    def predict(self, x_history: Float[Tensor, "N H C"]) -> Float[Tensor, "N S F C"]:
        """The S nearest windows' futures, nearest first, turned like their histories. Metres.

        Raises:
            ValueError: the history has another length than the training windows' histories.
        """
        if x_history.shape[1] != self.history:
            raise ValueError(f"the history has {x_history.shape[1]} frames; expected {self.history}")
        chunk = max(1, _BUDGET // len(self.future))
        found = [self._nearest(rows) for rows in x_history.split(chunk)]
        index, turn = (torch.cat(part) for part in zip(*found, strict=True))
        found = turn_heading(self.future[index], turn, self.up)
        return found + x_history[:, None, -1:] if self.relative else found

    def _features(self, x: Float[Tensor, "M H C"]) -> tuple[Complex[Tensor, "M plane"], Float[Tensor, "M height"]]:
        """Horizontal coordinates as complex numbers, and heights; float64, as squared distances are differences."""
        a, b, height = (x[..., axis::3].double().flatten(1) for axis in horizontal(self.up))
        return torch.complex(a, b), height

    def _nearest(self, x_history: Float[Tensor, "n H C"]) -> tuple[Int[Tensor, "n S"], Float[Tensor, "n S"]]:
        """Indices of the S nearest training windows and the angle by which each is turned, radians."""
        plane, height = self._features(x_history)
        product = plane @ self._plane.mH  # Σ q conj(h): its argument is the best angle, its modulus what that angle gains
        agreement = product.abs() + height @ self._height.T
        # ‖q - h‖² without ‖q‖², which is the same for every h.
        index = (self._energy - 2 * agreement).topk(self.samples, largest=False).indices
        return index, product.gather(1, index).angle()
