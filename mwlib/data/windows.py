"""Windows of motions: cut, drawn, augmented and varied."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from mwlib.body.kinematics import heading, horizontal, scale_bones, turn_heading
from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17, Skeleton, to_h36m17
from mwlib.data.collections import known_skeleton
from mwlib.data.mirroring import unmirrored
from mwlib.data.untrusted import LARGEST
from mwlib.settings import shown, whole

Batch = Float[Tensor, "B T C"]  # of windows


@dataclass(frozen=True)
class Bodies:
    """The form in which a model takes motions.

    Args:
        skeleton: of every clip.
        fps: frames per second.
        up: the up-axis.
    """

    skeleton: Skeleton
    fps: float
    up: str

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Bodies:
        """What these clips share.

        Raises:
            ValueError: there are none, or they differ; the message names two clips that do.
        """
        if not motions:
            raise ValueError("there are no motions")
        first = motions[0]
        for m in motions:
            for what in ("skeleton", "fps", "up"):
                if getattr(m, what) != getattr(first, what):
                    found, other = (_said(getattr(clip, what)) for clip in (m, first))
                    names = m.name or "a clip", first.name or "another"
                    raise ValueError(f"motions: {names[0]} has {what} {found}, {names[1]} has {other}; expected one and the same")
        return cls(first.skeleton, first.fps, first.up)

    def prepare(self, motions: Sequence[Motion]) -> list[Motion]:
        """Clips turned, carried over to the skeleton and resampled, as those were that the model was trained on.

        Raises:
            ValueError: a clip has another skeleton, and no way to this one is known.
        """
        return [self._fitted(m.with_up(self.up)).resample(self.fps) for m in motions]

    def _fitted(self, motion: Motion) -> Motion:
        if motion.skeleton == self.skeleton:
            return motion
        if self.skeleton == H36M17 and to_h36m17(motion.skeleton) is not None:
            return motion.retarget(H36M17)
        name = f"{motion.name}: " if motion.name else ""
        raise ValueError(
            f"{name}the skeleton is {_said(motion.skeleton)}; the model was trained on {_said(self.skeleton)}, and no way from "
            "one to the other is known"
        )

    def to_json(self) -> str:
        """As text that a model file carries."""
        skeleton = {name: getattr(self.skeleton, name) for name in ("name", "joints", "parents", "left", "right", "parts")}
        return json.dumps({"skeleton": skeleton, "fps": self.fps, "up": self.up})

    @classmethod
    def from_json(cls, text: str) -> Bodies:
        """Inverse of `to_json`."""
        tree = json.loads(text)
        skeleton = tree["skeleton"]
        parts = {name: tuple(joints) for name, joints in skeleton["parts"].items()}
        rows = {name: tuple(skeleton[name]) for name in ("joints", "parents", "left", "right")}
        return cls(known_skeleton(Skeleton(name=skeleton["name"], parts=parts, **rows)), tree["fps"], tree["up"])


def prepare(motions: Sequence[Motion], fps: float) -> list[Motion]:
    """Clips as a training takes them: z up, on the 17-joint skeleton wherever a correspondence is known, then at `fps`."""
    ready = [m.with_up("z") for m in motions]
    return [(m if to_h36m17(m.skeleton) is None else m.retarget(H36M17)).resample(fps) for m in ready]


def _said(value: object) -> str:
    """A value in a message; of a skeleton its name and number of joints."""
    return f"{value.name} ({len(value)} joints)" if isinstance(value, Skeleton) else str(value)


SLOWEST = 0.1  # share of its speed that a slowed window keeps at least
ARMS = ("left_arm", "right_arm")


@dataclass(frozen=True)
class Variation:
    """How drawn windows differ from the recorded ones. Own choice, all of it: new people are built otherwise, move at other
    speeds, stand still in other poses and do other things with their arms. By default nothing differs.

    Args:
        speeds: the clips are also drawn played at two speeds up to 1 + `speeds` and at their inverses.
        bones: deviation of one random factor for all bones of a window, and of one for each pair of bones, left and right.
        backwards: share of the windows that are played backwards.
        slowed: share of the windows that are played at a random speed, a tenth to the whole of their own.
        arms: share of the windows that get the arms of another one of the batch, turned to where the body faces.
        pivot: frame around which a window is slowed, and of whose pose the arms are turned: the last observed one.
    """

    speeds: float = 0.0
    bones: float = 0.0
    backwards: float = 0.0
    slowed: float = 0.0
    arms: float = 0.0
    pivot: int = 0

    def clips(self, motions: Sequence[Motion]) -> list[Motion]:
        """The clips, and the same faster and slower."""
        if not self.speeds:
            return list(motions)
        faster = 1 + self.speeds / 2, 1 + self.speeds
        factors = (1, *faster, *(1 / f for f in faster))
        return [replace(m.resample(m.fps / factor), fps=m.fps) for factor in factors for m in motions]

    def __call__(self, x: Batch, skeleton: Skeleton, up: str, generator: torch.Generator) -> Batch:
        """The windows, each changed or not."""
        if self.bones:
            x = other_bones(x, self.bones, skeleton, generator)
        if self.backwards:
            x = torch.where(_coins(x, self.backwards, generator), x.flip(1), x)
        if self.slowed:
            speed = SLOWEST + (1 - SLOWEST) * torch.rand((len(x), 1), generator=generator).to(x.device)
            x = torch.where(_coins(x, self.slowed, generator), slowed(x, speed, self.pivot), x)
        if self.arms:
            donors = x[torch.randperm(len(x), generator=generator).to(x.device)]
            x = torch.where(_coins(x, self.arms, generator), other_arms(x, donors, skeleton, up, self.pivot), x)
        return x


def other_bones(x: Batch, deviation: float, skeleton: Skeleton, generator: torch.Generator) -> Batch:
    """The same motions of other bodies: left and right alike, the root where it is."""
    pair = torch.from_numpy(skeleton.mirror).minimum(torch.arange(len(skeleton)))
    each = torch.randn((len(x), 1, len(skeleton)), generator=generator)[..., pair[1:]]
    factor = (1 + deviation * each) * (1 + deviation * torch.randn((len(x), 1, 1), generator=generator))
    return scale_bones(x, factor.clamp_min(0.1).to(x.device), skeleton)


def slowed(x: Batch, speed: Float[Tensor, "B 1"], pivot: int) -> Batch:
    """Windows played at a share of their speed, between frames on straight lines; the pose of the pivot stays where it is.

    >>> slowed(torch.arange(5.0)[None, :, None], torch.tensor([[0.5]]), pivot=2).flatten()
    tensor([1.0000, 1.5000, 2.0000, 2.5000, 3.0000])
    """
    frames = x.shape[1]
    place = pivot + (torch.arange(frames, device=x.device) - pivot) * speed
    before = place.floor().long().clamp(0, frames - 2)
    share = (place - before)[..., None]
    first, second = (x.gather(1, index[..., None].expand(-1, -1, x.shape[-1])) for index in (before, before + 1))
    return first + share * (second - first)


def other_arms(x: Batch, donors: Batch, skeleton: Skeleton, up: str, pivot: int) -> Batch:
    """Windows with the arms of others, hung where their own are, turned by how the bodies face at the pivot.

    Raises:
        ValueError: the skeleton does not say which joints are arms.
    """
    if missing := [name for name in ARMS if name not in skeleton.parts]:
        raise ValueError(
            f"{skeleton.name} has no parts {' and '.join(missing)}; expected them, to exchange arms: say other_arms=0"
        )
    turn = heading(x[:, pivot], skeleton, up) - heading(donors[:, pivot], skeleton, up)
    donors, out = turn_heading(donors, turn, up).unflatten(-1, (-1, 3)), x.unflatten(-1, (-1, 3)).clone()
    for arm in (list(skeleton.parts[name]) for name in ARMS):
        trunk, joints = skeleton.parents[arm[0]] - 1, [joint - 1 for joint in arm]
        apart = out[:, :, [trunk]] - donors[:, :, [trunk]] if trunk >= 0 else 0.0  # the root is at the origin of both
        out[:, :, joints] = donors[:, :, joints] + apart
    return out.flatten(-2)


def _coins(x: Batch, share: float, generator: torch.Generator) -> Tensor:
    """True for about this share of the windows."""
    return (torch.rand((len(x), 1, 1), generator=generator) < share).to(x.device)


PARTS, REMEDY = " (history + future)", "longer clips, a smaller history or future, or a smaller fps would do"
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
        """At most `count` windows, spread evenly; 0 keeps all.

        Raises:
            ValueError: `count` is no whole number, or below 0.
        """
        pick = spread(len(self), whole("count", count, 0))
        return self if len(pick) == len(self) else replace(self, x=self.x[pick], clip=self.clip[pick], start=self.start[pick])


def spread(size: int, count: int) -> Int[Tensor, " n"]:
    """At most `count` of the numbers below `size`, spread evenly; 0 keeps all."""
    if count == 0 or count >= size:
        return torch.arange(size)
    return torch.linspace(0, size - 1, count, dtype=torch.float64).round().long()


class JoinedClips:
    """Clips laid end to end, so that any number of windows is one look-up.

    Args:
        clips: the frames of each clip, (frames, C).
    """

    def __init__(self, clips: Sequence[Float[Tensor, "_ C"]]) -> None:
        self.flat = torch.cat(list(clips))
        self.lengths = torch.tensor([len(clip) for clip in clips])
        self.first = self.lengths.cumsum(0) - self.lengths

    def to(self, device: torch.device | str) -> Self:
        """Move the frames; windows are taken where they are."""
        self.flat = self.flat.to(device)
        return self

    def take(self, clip: Int[Tensor, " N"], start: Int[Tensor, " N"], frames: int) -> Float[Tensor, "N frames C"]:
        """The frames from `start` of these clips on; beyond a clip's end come those of the next one."""
        index = (self.first[clip] + start)[:, None] + torch.arange(frames)
        return self.flat[index.clamp_max(len(self.flat) - 1).to(self.flat.device)]

    def starts(self, frames: int, stride: int = 1) -> tuple[Int[Tensor, " N"], Int[Tensor, " N"]]:
        """Clip and first frame of every window, clip by clip: 0, stride, 2 stride, ... < L - T.

        A clip of exactly T frames has none, as in the protocols of DLow, HumanMAC and LaFAN1.
        """
        starts = [torch.arange(0, max(length - frames, 0), stride) for length in self.lengths.tolist()]
        return torch.repeat_interleave(torch.tensor([len(s) for s in starts])), torch.cat(starts)

    def require(self, frames: int, *, kind: str = "clip", parts: str = PARTS, remedy: str = REMEDY) -> None:
        """Refuse clips that give no window of so many frames.

        Args:
            frames: T.
            kind: of clip, in the message.
            parts: what the frames are made of, in the message.
            remedy: which settings to change, in the message.

        Raises:
            ValueError: no clip is longer than `frames`.
        """
        longest = int(self.lengths.max())
        if longest <= frames:
            raise ValueError(f"no {kind} is longer than {frames} frames{parts}; the longest has {longest}; {remedy}")


def windows(motions: Sequence[Motion], history: int, future: int, stride: int) -> Windows:
    """Every window of history + future frames, starts `stride` apart, clip by clip.

    Source: the test protocol of DLow and HumanMAC: starts 0, stride, 2 stride, ... < L - T, so a clip of exactly T
    frames yields none.

    Args:
        motions: clips of one skeleton, one up-axis and one frame rate. Own choice: of any size, as nothing is sampled here.
        history, future: H and F, frames, at least 1.
        stride: frames between starts, at least 1.

    Warns:
        UserWarning: some clips are too short to give a window; the message names them.

    Raises:
        ValueError: there are no motions, poses are not finite, a number is no whole one or below 1, the clips do not match each
            other, or none is longer than H+F frames.

    >>> motion = mw.Motion(np.zeros((60, 17, 3)), 25.0, mw.load_motions("synthetic")[0].skeleton)
    >>> cut = windows([motion], history=10, future=30, stride=10)
    >>> cut.x.shape, cut.x_history.shape, cut.start.tolist()
    (torch.Size([2, 40, 48]), torch.Size([2, 10, 48]), [0, 10])
    """
    history, future, stride = (
        whole(name, n, 1, MOST_FRAMES) for name, n in (("history", history), ("future", future), ("stride", stride))
    )
    motions = clips_given("motions", motions)
    clips, frames = _joined(motions), history + future
    clips.require(frames)
    if short := too_short(motions, frames):
        names = ", ".join(f"{m.name or 'a clip'} ({len(m)} frames)" for m in short[:5]) + ", ..." * (len(short) > 5)
        found = f"{len(short)} of {len(motions)} clips give no window, as none is longer than {frames} frames{PARTS}: {names}"
        warnings.warn(f"{found}; {REMEDY}", stacklevel=2)
    clip, start = clips.starts(frames, stride)
    return Windows(clips.take(clip, start, frames), clip, start, history, motions)


MOST_FRAMES = 1_000_000  # of a history, a future, a stride: own choice, hours of motion


def clips_given(name: str, source: object, others: str = "") -> list[Motion]:
    """An argument as clips; a single one is a list of one.

    Args:
        name: of the argument.
        source: what was given.
        others: what else is accepted there, in the message.

    Raises:
        ValueError: there are none, something else is among them, or a pose is not finite.
    """
    accepted = f"Motions{others and ', '}{others}"
    clips = [source] if isinstance(source, Motion) else list(source) if isinstance(source, Sequence) else None
    if clips is None or isinstance(source, str):
        raise ValueError(f"{name} is {shown(source)}; expected {accepted}")
    if not clips or not all(isinstance(m, Motion) for m in clips):
        raise ValueError(f"{name} holds {sorted({type(m).__name__ for m in clips}) or 'nothing'}; expected {accepted}")
    for number, m in enumerate(clips):
        check_finite(f"{name}[{number}]", m)
    return clips


def check_finite(name: str, motion: Motion) -> None:
    """Refuse a clip whose places are not all numbers of a sensible size.

    Raises:
        ValueError: some are not; the message names the first frame.
    """
    if not (good := np.abs(motion.positions) <= np.float64(LARGEST)).all():  # False for nan
        frame = int(np.argmin(good.all(axis=(1, 2))))
        called = f" ({motion.name})" if motion.name else ""
        what = f"holds places over {LARGEST:g} m" if np.isfinite(motion.positions[frame]).all() else "is not finite"
        raise ValueError(f"{name}{called} {what} in frame {frame}; expected metres")


def _joined(motions: Sequence[Motion]) -> JoinedClips:
    """Root-relative clips of one kind of body."""
    Bodies.of(motions)
    return JoinedClips([torch.from_numpy(m.root_relative().astype(np.float32)) for m in motions])


def too_short(motions: Sequence[Motion], frames: int) -> list[Motion]:
    """Clips that give no window of this many frames (see `windows`)."""
    return [m for m in motions if len(m) <= frames]


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
        played = self.variation.clips(motions)
        long_enough = [m for m in played if len(m) > frames]
        self.clips = _joined(long_enough or played)
        self.clips.require(frames, kind="training clip")
        self.frames, self.augment = frames, augment
        if augment == "heading_mirror" and (reason := unmirrored(long_enough)):
            warnings.warn(f"training does not mirror: {reason}. {PAIRS}", stacklevel=2)
            self.augment = "heading"
        skeleton = long_enough[0].skeleton
        self.skeleton, self.mirror = skeleton, torch.from_numpy(skeleton.mirror[1:] - 1)
        self.up = long_enough[0].up
        self.clip, self.start = self.clips.starts(frames)
        self.weight = torch.from_numpy(_subject_action_weights(long_enough, frames)) if sampling == "subject_action" else None

    def to(self, device: torch.device | str) -> TrainingWindows:
        """Move the motions; windows are drawn where they are."""
        self.clips, self.mirror = self.clips.to(device), self.mirror.to(device)
        return self

    def draw(self, batch: int, generator: torch.Generator) -> Batch:
        """A batch of augmented windows."""
        if self.weight is None:
            pick = torch.randint(len(self.start), (batch,), generator=generator)
        else:
            pick = torch.multinomial(self.weight, batch, replacement=True, generator=generator)
        x = self.clips.take(self.clip[pick], self.start[pick], self.frames)
        x = x if self.augment == "none" else self._augment(x, generator)
        return self.variation(x, self.skeleton, self.up, generator)

    def _augment(self, x: Batch, generator: torch.Generator) -> Batch:
        per_batch = self.augment == "humanmac"
        size = (1 if per_batch else len(x), 1, 1)
        angle = torch.rand(size, generator=generator) * (2 * math.pi)
        coins = torch.rand((3, *size), generator=generator) < 0.5
        if per_batch:
            angle = angle * coins[0]
        angle, coins = angle.to(x.device), coins.to(x.device)
        turned = turn_heading(x, angle.flatten().expand(len(x)), self.up)
        a, b, _ = horizontal(self.up)
        if per_batch:
            turned[..., a::3] *= torch.where(coins[1], -1.0, 1.0)
            turned[..., b::3] *= torch.where(coins[2], -1.0, 1.0)
        elif self.augment == "heading_mirror":
            other = turned.unflatten(-1, (-1, 3))[:, :, self.mirror]
            other[..., a] *= -1
            turned = torch.where(coins[1], other.flatten(-2), turned)
        return turned


def _subject_action_weights(motions: Sequence[Motion], frames: int) -> np.ndarray:
    """Probability of each window when subject, clip and start are drawn uniformly one after the other."""
    subjects = [m.subject for m in motions]
    per_clip = [1.0 / (subjects.count(m.subject) * (len(m) - frames)) for m in motions]
    return np.repeat(per_clip, [len(m) - frames for m in motions])
