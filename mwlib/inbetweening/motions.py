"""In-betweens as motions of a body in the world, to be shown or written to files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.windows import given


def filled(
    bridge: Bridge,
    start: Motion,
    end: Motion | Sequence[int],
    frames: int | None = None,
    samples: int | None = None,
    seed: int | None = None,
    progress: bool = False,
) -> list[Motion]:
    """Motions that leave one pose and arrive at another, at the model's frame rate, in the world of the poses.

    Args:
        bridge: a trained model. What it is given is turned, resampled and, if need be, carried over to its skeleton.
        start: its last frame is the first keyframe. With frame numbers for `end`, it is the motion whose frames they are. A model
            that is given a past looks at the frames before the first keyframe, too.
        end: its first frame is the last keyframe; or numbers of two or more frames of `start` at the model's rate.
        frames: N, frames between the first and the last keyframe at the model's rate; None: the model's own, or as many as lie
            between the numbered ones.
        samples, seed: None = the settings'.
        progress: show a bar.

    Returns:
        `samples` motions of past + N + 1 frames (N + 2 where two poses are all that is given), with the up-axis of `start`. Those
            of a model of rotations have a rig.

    Raises:
        ValueError: bodies, length or keyframes do not fit the model; the message says why.
    """
    poses = [start] if not isinstance(end, Motion) else [_end_of(start, bridge), end.cut(0, 1)]
    first, *last = bridge.space.bodies.prepare(poses)
    if isinstance(end, Motion):
        count = bridge.cfg.task.between if frames is None else frames
        like, x, mask = first, *_of_poses(bridge, first, last[0], count)
    else:
        like, x, mask = first, *_of_frames(bridge, first, end, frames)
    offsets = bridge.space.offsets(like)
    place = bridge.space.placement(x, offsets, bridge.cfg.task.past - 1)
    sampled = bridge.sample(bridge.space.seen_from(x, place)[None], mask, samples, seed, progress=progress)[0]
    states = [bridge.space.placed(each, place) for each in sampled]
    states = [torch.where(mask[:, None], x, each) for each in states]  # turned there and back is not the same to the bit
    named = replace(like, name=f"{start.name} in between".strip())
    return [bridge.space.decode(each, named).with_up(start.up) for each in states]


def _end_of(motion: Motion, bridge: Bridge) -> Motion:
    """The last frames of a motion, as many as the model's past takes; where the rates do not fit, the last but a part of one."""
    steps = ceil((bridge.cfg.task.past - 1) * motion.fps / bridge.space.bodies.fps - 1e-6)
    return motion.cut(max(len(motion) - 1 - steps, 0), len(motion))


def _of_poses(bridge: Bridge, start: Motion, end: Motion, count: int) -> tuple[Float[Tensor, "T C"], Bool[Tensor, " T"]]:
    """States that are given at both ends, in between the last of the past, and the mask of what is given."""
    past = bridge.cfg.task.past
    if count < 1:
        raise ValueError(f"frames is {count}; expected at least 1 between the keyframes")
    if len(start) < past:
        raise ValueError(_short(len(start), bridge))
    before, last = bridge.space.encode(start)[-past:], bridge.space.encode(end)[:1]
    return torch.cat([before, before[-1:].repeat(count, 1), last]), given(past + count + 1, past)


def _of_frames(
    bridge: Bridge, motion: Motion, numbers: Sequence[int], count: int | None
) -> tuple[Float[Tensor, "T C"], Bool[Tensor, " T"]]:
    """The stretch of a motion from its first to its last keyframe, with the past before, and the mask of what is given."""
    lead = bridge.cfg.task.past - 1
    rising = [*numbers] == sorted({*numbers})
    if len(numbers) < 2 or not rising or numbers[0] < 0 or numbers[-1] >= len(motion):
        raise ValueError(
            f"keyframes are {[*numbers]} of a motion of {len(motion)} frames at {motion.fps:g} Hz; expected two or more, rising"
        )
    if numbers[0] < lead:
        raise ValueError(_short(numbers[0] + 1, bridge))
    between = numbers[-1] - numbers[0] - 1
    if count is not None and count != between:
        raise ValueError(f"frames is {count}, but {between} lie between frames {numbers[0]} and {numbers[-1]}; expected None")
    mask = given(lead + between + 2, lead + 1)
    mask[[n - numbers[0] + lead for n in numbers]] = True
    return bridge.space.encode(motion)[numbers[0] - lead : numbers[-1] + 1], mask


def _short(found: int, bridge: Bridge) -> str:
    """What is wrong with a past that is too short."""
    fps, past = bridge.space.bodies.fps, bridge.cfg.task.past
    return f"{found} frames at {fps:g} Hz up to the first keyframe; expected at least {past}, the past that the model was given"
