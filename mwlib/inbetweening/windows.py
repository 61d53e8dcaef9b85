"""Windows from keyframe to keyframe, perhaps with a past, seen from the first keyframe; keyframes and the lines between them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.data.mirroring import unmirrored
from mwlib.data.windows import Bodies, JoinedClips, spread
from mwlib.inbetweening.space import UP, Placement, PositionSpace, RotationSpace, Space, States, Tracks, rooted_rig

Given = Bool[Tensor, " T"]  # True in frames that are given, of one window
Keyframes = Bool[Tensor, "*#lead T"]  # True at keyframes, for one window or each
Past = Float[Tensor, "*lead P C"]  # states before the first keyframe
Future = Float[Tensor, "*lead Q C"]  # and after the last


class PlacedWindows(NamedTuple):
    """Windows as seen from one of their frames, the offsets of their bodies, and where they come from."""

    x: Tracks
    offsets: Float[Tensor, "N rig 3"]
    clip: Int[Tensor, " N"]
    start: Int[Tensor, " N"]
    placement: Placement

    def pick(self, rows: Int[Tensor, " n"] | slice) -> PlacedWindows:
        """Some of the windows."""
        *parts, placement = self
        return PlacedWindows._make([*(part[rows] for part in parts), Placement._make(part[rows] for part in placement)])

    def thin(self, count: int) -> PlacedWindows:
        """At most `count` windows, spread evenly; 0 keeps all."""
        return self.pick(spread(len(self.x), count))


def make_space(motions: Sequence[Motion], state: str) -> Space:
    """The space of the states of some clips.

    Args:
        motions: z up, of one skeleton and rate.
        state: "positions" or "rotations".

    Raises:
        ValueError: the clips do not match each other, or rotations are asked for and the first has none.
    """
    bodies = Bodies.of(motions)
    return PositionSpace(bodies) if state == "positions" else RotationSpace.of(motions[0])


def ready(motions: Sequence[Motion], fps: float) -> list[Motion]:
    """Clips with their own skeletons and rotations, z up, at `fps`; `data.bodies.prepare` is the other way, onto 17 joints."""
    return [m.with_up(UP).resample(fps) for m in motions]


class Clips(JoinedClips):
    """Clips of one kind of body, from which windows are cut or drawn without a loop.

    Args:
        motions: z up, of one skeleton and rate.
        space: of their states.
        mirror: also their mirror images. Where left and right are not built alike this warns and leaves them out.
        dtype: of the states.

    Raises:
        ValueError: a clip has no rig, or another, where the space needs one.
    """

    def __init__(self, motions: Sequence[Motion], space: Space, mirror: bool = False, dtype: torch.dtype = torch.float32) -> None:
        self.space, self.motions = space, [*motions, *(mirror_images(motions, space) if mirror else [])]
        super().__init__([space.encode(m, dtype) for m in self.motions])
        self.offsets = torch.stack([space.offsets(m) for m in self.motions])

    def to(self, device: torch.device | str) -> Clips:
        """Move the states."""
        self.offsets = self.offsets.to(device)
        return super().to(device)

    def at(self, clip: Int[Tensor, " N"], start: Int[Tensor, " N"], frames: int, past: int = 1) -> PlacedWindows:
        """The windows that begin there, as seen from the last of their `past` first frames.

        Source: own choice. What is to be found begins there, and with whatever past it looks the same.
        """
        x, offsets = self.take(clip, start, frames), self.offsets[clip.to(self.offsets.device)]
        placement = self.space.placement(x, offsets, past - 1)
        return PlacedWindows(self.space.seen_from(x, placement), offsets, clip, start, placement)

    def check(self, frames: int) -> None:
        """Refuse clips none of which is longer than so many frames.

        Raises:
            ValueError: the message says how long the longest is, and what to change.
        """
        self.require(
            frames,
            parts=", the keyframes and what lies between",
            remedy="longer clips, fewer frames between or a smaller fps would do",
        )

    def windows(self, frames: int, stride: int, past: int = 1) -> PlacedWindows:
        """Every window of so many frames, see `starts` and `at`.

        Raises:
            ValueError: no clip is longer than that.
        """
        self.check(frames)
        return self.at(*self.starts(frames, stride), frames, past)

    def draw(self, batch: int, frames: int, generator: torch.Generator, past: int = 1) -> PlacedWindows:
        """Random windows, every one as likely as another; see `at`.

        Raises:
            ValueError: no clip is longer than that.
        """
        self.check(frames)
        room = (self.lengths - frames).clamp_min(0)
        last = room.cumsum(0)
        number = torch.randint(int(last[-1]), (batch,), generator=generator)
        clip = torch.searchsorted(last, number, right=True)
        return self.at(clip, number - (last - room)[clip], frames, past)


def mirror_images(motions: Sequence[Motion], space: Space) -> list[Motion]:
    """Mirror images of clips, if they have the same bodies; else none, and a warning."""
    reason = unmirrored([*motions])
    if not reason and isinstance(space, RotationSpace) and rooted_rig(motions[0]).across() is None:
        reason = f"left and right joints of {space.tree.name} are not turned alike"
    if reason:
        warnings.warn(f"training does not mirror: {reason}", stacklevel=2)
        return []
    return [m.mirror() for m in motions]


def given(frames: int, past: int = 1, future: int = 1) -> Given:
    """The task: the first `past` frames and the last `future` are given. With one of each it is the paper's."""
    frame = torch.arange(frames)
    return (frame < past) | (frame >= frames - future)


def parted(x: States, past: int, future: int) -> tuple[Tensor, Tensor, Tensor]:
    """What is before the first keyframe, from it to the last one, and after that."""
    first, last = past - 1, x.shape[-2] - future + 1
    return x[..., :first, :], x[..., first:last, :], x[..., last:, :]


def draw_keyframes(
    batch: int, frames: int, most: int, generator: torch.Generator, past: int = 1, future: int = 1
) -> Bool[Tensor, "B T"]:
    """Masks of what is `given`, and in half of the windows of up to `most` random frames more from keyframe to keyframe."""
    mask = given(frames, past, future).repeat(batch, 1)
    if most:
        gap = frames - past - future + 2
        count = torch.randint(1, most + 1, (batch, 1), generator=generator)
        count = count * (torch.rand(batch, 1, generator=generator) < 0.5)
        mask[:, past - 1 : past - 1 + gap] |= torch.rand(batch, gap, generator=generator).argsort(dim=1).argsort(dim=1) < count
    return mask


def interpolated(x: States, mask: Keyframes) -> States:
    """Straight lines from keyframe to keyframe; before the first and after the last their states.

    Args:
        x: states; those that are not keyframes are not looked at.
        mask: True at keyframes, at least one.
    """
    frames = x.shape[-2]
    time = torch.arange(frames, device=mask.device)
    before = torch.where(mask, time, -1).cummax(-1).values
    after = torch.where(mask, time, frames).flip(-1).cummin(-1).values.flip(-1)
    low = torch.where(before < 0, after, before)
    high = torch.where(after >= frames, low, after)
    share = ((time - low).to(x) / (high - low).clamp_min(1).to(x)).clamp(0, 1)[..., None]
    low, high = (index[..., None].expand(x.shape).to(x.device) for index in (low, high))
    return torch.gather(x, -2, low) * (1 - share) + torch.gather(x, -2, high) * share


def coasting(
    x: States,
    before: Past,
    mask: Keyframes,
    frames: float,
    after: Future | None = None,
) -> States:
    """`interpolated`, that leaves the first keyframe with the velocity that the body has there, and arrives so at the last.

    Frame k departs from the straight line by (v - v_line) k exp(-(k / frames)^p) (1 - k / K)^p, K the next keyframe, v the last
    step of the past, p = 1. With frames after the last keyframe p = 2, as in Hermite's cubic, and the same holds backwards from
    there. Source: own choice, by measurement: the places are nearer to the truth than the line's.

    Args:
        x: states; those that are not keyframes are not looked at.
        before: the frames before them, at least one. Where they are not known (NaN), the line stays as it is.
        mask: True at keyframes, the first and the last among them.
        frames: in which the velocity is forgotten.
        after: the frames after them; None or none of them: nothing is known of the velocity there.
    """
    line = interpolated(x, mask)
    if after is None or not after.shape[-2]:
        return line + _coast(line, before[..., -1:, :], mask, frames, 1)
    there = _coast(line.flip(-2), after[..., :1, :], mask.flip(-1), frames, 2).flip(-2)
    return line + _coast(line, before[..., -1:, :], mask, frames, 2) + there


def _coast(line: Tensor, previous: Tensor, mask: Tensor, frames: float, power: int) -> Tensor:
    """What a velocity adds to a line, see `coasting`."""
    more = (line[..., :1, :] - previous - line.diff(dim=-2)[..., :1, :]).nan_to_num()
    k = torch.arange(line.shape[-2], device=mask.device)
    until = torch.where(mask & (k > 0), k, len(k)).amin(-1, keepdim=True)
    k, until = k.to(line), until.to(line)
    return more * (k * torch.exp(-((k / frames) ** power)) * (1 - k / until).clamp_min(0) ** power)[..., None]
