"""Cutting motions into windows of history and future; drawing and augmenting training windows."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.kinematics import AXES
from mwlib.body.motion import Motion
from mwlib.data.bodies import Bodies
from mwlib.data.sides import unmirrored
from mwlib.data.variation import Variation

PAIRS = 'Names like left_hand and right_hand, or "left" and "right" in skeleton.json, pair them'


@dataclass(frozen=True)
class Windows:
    """Windows of T = H+F frames.

    Args:
        x: (N, T, C) float32, metres, root-relative, root dropped.
        clip: (N,) index into `motions`.
        start: (N,) first frame within the clip.
        history: H.
        motions: the clips.
    """

    x: Float[Tensor, "N T C"]
    clip: Int[Tensor, " N"]
    start: Int[Tensor, " N"]
    history: int
    motions: Sequence[Motion]

    def __len__(self) -> int:
        return len(self.x)

    @property
    def x_history(self) -> Float[Tensor, "N H C"]:
        """Observed frames."""
        return self.x[:, : self.history]

    @property
    def x_future(self) -> Float[Tensor, "N F C"]:
        """Frames to predict."""
        return self.x[:, self.history :]

    @property
    def actions(self) -> list[str]:
        """Action of each window's clip."""
        return [self.motions[i].action for i in self.clip.tolist()]

    def thin(self, count: int) -> Windows:
        """At most `count` windows, spread evenly; 0 keeps all."""
        if count == 0 or count >= len(self):
            return self
        pick = torch.linspace(0, len(self) - 1, count, dtype=torch.float64).round().long()
        return Windows(self.x[pick], self.clip[pick], self.start[pick], self.history, self.motions)


def windows(motions: Sequence[Motion], history: int, future: int, stride: int) -> Windows:
    """Every window of history + future frames, starts `stride` apart, clip by clip.

    Source: the test protocol of DLow and HumanMAC: starts 0, stride, 2 stride, ... < L - T, so a clip of exactly T
    frames yields none.

    Args:
        motions: clips of one skeleton, one up-axis and one frame rate.
        history, future: H and F, frames.
        stride: frames between starts.

    Raises:
        ValueError: the clips do not match each other, or none is longer than H+F frames.

    >>> motion = mw.Motion(np.zeros((60, 17, 3)), 25.0, mw.load_motions("synthetic")[0].skeleton)
    >>> cut = windows([motion], history=10, future=30, stride=10)
    >>> cut.x.shape, cut.x_history.shape, cut.start.tolist()
    (torch.Size([2, 40, 48]), torch.Size([2, 10, 48]), [0, 10])
    """
    flat, offset, lengths = _flatten(motions)
    frames = history + future
    starts = [np.arange(0, max(n - frames, 0), stride) for n in lengths]
    clip = np.repeat(np.arange(len(motions)), [len(s) for s in starts])
    start = np.concatenate(starts)
    if len(start) == 0:
        raise ValueError(_none_longer("clip", motions, frames))
    index = (offset[clip] + start)[:, None] + np.arange(frames)
    return Windows(flat[torch.from_numpy(index)], torch.from_numpy(clip), torch.from_numpy(start), history, motions)


def _flatten(motions: Sequence[Motion]) -> tuple[Tensor, np.ndarray, list[int]]:
    """All frames of all clips in one (frames, C) tensor, and where each clip begins."""
    Bodies.of(motions)
    lengths = [len(m) for m in motions]
    flat = torch.from_numpy(np.concatenate([m.root_relative() for m in motions]).astype(np.float32))
    return flat, np.concatenate([[0], np.cumsum(lengths)[:-1]]), lengths


def too_short(motions: Sequence[Motion], frames: int) -> list[Motion]:
    """Clips that give no window of this many frames (see `windows`)."""
    return [m for m in motions if len(m) <= frames]


def _none_longer(what: str, motions: Sequence[Motion], frames: int) -> str:
    longest = max(map(len, motions), default=0)
    remedy = "longer clips, a smaller history or future, or a smaller fps would do"
    return f"no {what} is longer than {frames} frames (history + future); the longest has {longest}; {remedy}"


class TrainingWindows:
    """Random windows, drawn and augmented without a loop.

    Args:
        motions: training clips.
        frames: T.
        sampling: "uniform" over all windows, or "subject_action" (DLow, GSPS, HumanMAC): subject, then clip of
            that subject, then start in [0, L-T), each uniformly, so short clips are over-represented.
        augment: "none"; "humanmac" (three coins per batch: turn about the up-axis, negate each horizontal axis,
            labels not swapped); "heading" (each window turned by its own angle); "heading_mirror" (also mirrored with
            probability 1/2, left and right joints exchanged). The latter two are our own choice: they keep bodies bodies.
            Where left and right joints do not pair up, "heading_mirror" warns and does what "heading" does.
        variation: how the drawn windows differ from the recorded ones beyond that; by default they do not.

    Raises:
        ValueError: no clip is longer than `frames`, or the clips do not match each other.

    >>> source = TrainingWindows(mw.load_motions("synthetic", fps=25)[:12], 40, "uniform", "heading_mirror")
    >>> source.draw(8, torch.Generator().manual_seed(0)).shape
    torch.Size([8, 40, 48])
    """

    def __init__(
        self, motions: Sequence[Motion], frames: int, sampling: str, augment: str, variation: Variation | None = None
    ) -> None:
        self.variation = variation or Variation()
        long_enough = [m for m in self.variation.clips(motions) if len(m) > frames]
        if not long_enough:
            raise ValueError(_none_longer("training clip", motions, frames))
        flat, offset, lengths = _flatten(long_enough)
        self.frames, self.augment = frames, augment
        if augment == "heading_mirror" and (reason := unmirrored(long_enough)):
            warnings.warn(f"training does not mirror: {reason}. {PAIRS}", stacklevel=2)
            self.augment = "heading"
        self.flat = flat
        skeleton = long_enough[0].skeleton
        self.skeleton, self.mirror = skeleton, torch.from_numpy(skeleton.mirror[1:] - 1)
        self.up = long_enough[0].up
        self.level = [0, 3 - AXES[self.up]]  # the two horizontal axes
        self.first = torch.from_numpy(np.concatenate([o + np.arange(n - frames) for o, n in zip(offset, lengths, strict=True)]))
        self.weight = torch.from_numpy(_subject_action_weights(long_enough, frames)) if sampling == "subject_action" else None

    def to(self, device: torch.device | str) -> TrainingWindows:
        """Move the motions; windows are drawn where they are."""
        self.flat, self.mirror = self.flat.to(device), self.mirror.to(device)
        return self

    def draw(self, batch: int, generator: torch.Generator) -> Float[Tensor, "B T C"]:
        """A batch of augmented windows."""
        if self.weight is None:
            pick = torch.randint(len(self.first), (batch,), generator=generator)
        else:
            pick = torch.multinomial(self.weight, batch, replacement=True, generator=generator)
        index = self.first[pick][:, None] + torch.arange(self.frames)
        x = self.flat[index.to(self.flat.device)]
        x = x if self.augment == "none" else self._augment(x, generator)
        return self.variation(x, self.skeleton, self.up, generator)

    def _augment(self, x: Float[Tensor, "B T C"], generator: torch.Generator) -> Float[Tensor, "B T C"]:
        per_batch = self.augment == "humanmac"
        size = (1 if per_batch else len(x), 1, 1)
        angle = torch.rand(size, generator=generator) * (2 * math.pi)
        coins = torch.rand((3, *size), generator=generator) < 0.5
        if per_batch:
            angle = angle * coins[0]
        angle, coins = angle.to(x.device), coins.to(x.device)
        joints = x.unflatten(-1, (-1, 3))
        a, b = self.level
        p, q = joints[..., a], joints[..., b]
        turned = joints.clone()
        turned[..., a] = angle.cos() * p - angle.sin() * q
        turned[..., b] = angle.sin() * p + angle.cos() * q
        if per_batch:
            turned[..., a] *= torch.where(coins[1], -1.0, 1.0)
            turned[..., b] *= torch.where(coins[2], -1.0, 1.0)
        elif self.augment == "heading_mirror":
            other = turned[:, :, self.mirror]
            other[..., a] *= -1
            turned = torch.where(coins[1][..., None], other, turned)
        return turned.flatten(-2)


def _subject_action_weights(motions: Sequence[Motion], frames: int) -> np.ndarray:
    """Probability of each window when subject, clip and start are drawn uniformly one after the other."""
    subjects = [m.subject for m in motions]
    per_clip = [1.0 / (subjects.count(m.subject) * (len(m) - frames)) for m in motions]
    return np.concatenate([np.full(len(m) - frames, w) for m, w in zip(motions, per_clip, strict=True)])
