"""In-betweens as motions of a body in the world, to be shown or written to files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.inbetweening.bridge import Bridge, ends


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
        start: its last frame is the first keyframe. With frame numbers for `end`, it is the motion whose frames they are.
        end: its first frame is the last keyframe; or numbers of two or more frames of `start` at the model's rate.
        frames: N, frames between the first and the last keyframe at the model's rate; None: the model's own, or as many as lie
            between the numbered ones.
        samples, seed: None = the settings'.
        progress: show a bar.

    Returns:
        `samples` motions of N + 2 frames, with the up-axis of `start`. Those of a model of rotations have a rig.

    Raises:
        ValueError: bodies, length or keyframes do not fit the model; the message says why.
    """
    poses = [start] if not isinstance(end, Motion) else [start.cut(len(start) - 1, len(start)), end.cut(0, 1)]
    first, *last = bridge.space.bodies.prepare(poses)
    if isinstance(end, Motion):
        count = bridge.cfg.task.between if frames is None else frames
        like, x, mask = first, *_of_poses(bridge, first, last[0], count)
    else:
        like, x, mask = first, *_of_frames(bridge, first, end, frames)
    offsets = bridge.space.offsets(like)
    place = bridge.space.placement(x, offsets)
    sampled = bridge.sample(bridge.space.seen_from(x, place)[None], mask, samples, seed, progress=progress)[0]
    states = [bridge.space.placed(each, place) for each in sampled]
    states = [torch.where(mask[:, None], x, each) for each in states]  # turned there and back is not the same to the bit
    named = replace(like, name=f"{start.name} in between".strip())
    return [bridge.space.decode(each, named).with_up(start.up) for each in states]


def _of_poses(bridge: Bridge, start: Motion, end: Motion, count: int) -> tuple[Float[Tensor, "T C"], Bool[Tensor, " T"]]:
    """States that are the two poses at the ends, and the mask of these."""
    if count < 1:
        raise ValueError(f"frames is {count}; expected at least 1 between the keyframes")
    pair = torch.cat([bridge.space.encode(start)[-1:], bridge.space.encode(end)[:1]])
    mask = ends(count + 2)
    x = pair[:1].repeat(count + 2, 1)
    x[-1] = pair[1]
    return x, mask


def _of_frames(
    bridge: Bridge, motion: Motion, numbers: Sequence[int], count: int | None
) -> tuple[Float[Tensor, "T C"], Bool[Tensor, " T"]]:
    """The stretch of a motion from its first to its last keyframe, and the mask of these."""
    rising = [*numbers] == sorted({*numbers})
    if len(numbers) < 2 or not rising or numbers[0] < 0 or numbers[-1] >= len(motion):
        raise ValueError(
            f"keyframes are {[*numbers]} of a motion of {len(motion)} frames at {motion.fps:g} Hz; expected two or more, rising"
        )
    between = numbers[-1] - numbers[0] - 1
    if count is not None and count != between:
        raise ValueError(f"frames is {count}, but {between} lie between frames {numbers[0]} and {numbers[-1]}; expected None")
    mask = torch.zeros(between + 2, dtype=torch.bool)
    mask[[n - numbers[0] for n in numbers]] = True
    return bridge.space.encode(motion)[numbers[0] : numbers[-1] + 1], mask
