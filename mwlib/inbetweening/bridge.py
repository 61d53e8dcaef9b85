"""A trained model of in-betweening, and its samples as motions of a body in the world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count
from math import ceil
from typing import Any

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from tqdm import tqdm

from mwlib.body.motion import Motion
from mwlib.diffusion import Denoise, WindowNoise, alpha_bar, ddim_indices, keyframed, to_eps, with_keyframes
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.network import KeyframeNetwork, WienerNetwork
from mwlib.inbetweening.objective import make_network
from mwlib.inbetweening.representation import Representation
from mwlib.inbetweening.space import Space, space_from_json
from mwlib.inbetweening.windows import given

CHUNK = 64  # motions sampled together on a processor


class Bridge:
    """A network with what it was trained for, and settings of the sampling.

    Args:
        net: trained weights (the moving average).
        representation: windows as what is diffused.
        space: what a state means.
        cfg: of the training; the group `sampling` says how it samples.
    """

    def __init__(self, net: KeyframeNetwork | WienerNetwork, representation: Representation, space: Space, cfg: Config) -> None:
        self.net, self.representation, self.space, self.cfg = net.eval(), representation, space, cfg
        self.alpha_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> Bridge:
        """The bridge that a finished training left (see `mwlib.training.read_model`)."""
        space = space_from_json(about["space"])
        representation = Representation.restore(cfg.model, cfg.task.gap, learnt)
        with torch.random.fork_rng([]):  # initial weights are drawn and thrown away
            net = make_network(cfg, representation)
        net.load_state_dict(weights)
        return cls(net, representation, space, cfg)

    def to(self, device: torch.device | str) -> Bridge:
        """Move the network."""
        self.net.to(device)
        return self

    def with_sampling(self, **changes: Any) -> Bridge:
        """The same model with other settings of the sampling, e.g. ``bridge.with_sampling(repeats=5)``.

        Raises:
            ValueError: unknown settings, bad values, or settings of the trained model.
        """
        if others := [name for name in changes if Config.owners().get(name, "sampling") not in ("sampling", "imposing")]:
            raise ValueError(f"{', '.join(others)} belongs to the trained model; expected settings of the sampling")
        return Bridge(self.net, self.representation, self.space, self.cfg.override(**changes))

    def check(self, frames: int, mask: Bool[Tensor, " T"]) -> None:
        """Refuse lengths and keyframes that the model was not made for."""
        task, model = self.cfg.task, self.cfg.model
        if not task.fewest <= frames <= task.frames:
            between = f"{task.shortest} to {task.between}" if task.shortest else f"{task.between}"
            raise ValueError(f"frames between is {frames - task.past - 1}; expected {between}, for which the model was trained")
        if mask.shape != (frames,) or not mask.any():
            raise ValueError(
                f"mask has shape {tuple(mask.shape)}, {int(mask.sum())} keyframes; expected ({frames},), at least one"
            )
        told, most = model.keyframes == "told", task.past + 1 + model.more_keyframes
        if told and int(mask.sum()) > most:
            raise ValueError(f"{int(mask.sum())} keyframes; expected at most {most}, as the model was told")
        if told and not (mask[: task.past].all() and mask[-1]):
            first, all_ = ("first", "both") if task.past == 1 else (f"{task.past} first", "all")
            raise ValueError(f"the {first} or last frame is no keyframe; expected {all_}, as the model was told")

    @torch.inference_mode()
    def sample(
        self,
        x: Float[Tensor, "N T C"],
        mask: Bool[Tensor, " T"] | None = None,
        samples: int | None = None,
        seed: int | None = None,
        *,
        window_ids: Sequence[int] | None = None,
        progress: bool = False,
    ) -> Float[Tensor, "N S T C"]:
        """Whole motions as states, keyframes among them, on the CPU.

        Args:
            x: states seen from the last frame of the past; what is between the keyframes is not looked at.
            mask: True at keyframes; None: the frames of the past and the last.
            samples, seed: None = the settings'.
            window_ids: identity of each window (default 0..N-1): its noise depends on seed and identity only.
            progress: show a bar.

        Raises:
            ValueError: the length or the keyframes do not fit the model, or no sample is asked for.
        """
        settings, frames = self.cfg.sampling, x.shape[-2]
        mask = given(frames, self.cfg.task.past) if mask is None else mask
        samples = settings.samples if samples is None else samples
        if samples < 1:
            raise ValueError(f"samples is {samples}; expected at least 1")
        self.check(frames, mask)
        ids = [*range(len(x))] if window_ids is None else [*window_ids]
        if len(x) == 0 or len(ids) != len(x):
            raise ValueError(f"{len(ids)} window_ids for {len(x)} windows; expected one each, and at least one window")
        size = max(1, CHUNK // samples)
        found = []
        for first in tqdm(range(0, len(x), size), disable=not progress, desc="sampling", unit="chunk"):
            part = x[first : first + size].to(self.net.device)
            shape = (samples, *self.representation.transform(frames - self.cfg.task.past + 1).shape)
            noise = WindowNoise(
                settings.sampling_seed if seed is None else seed, ids[first : first + size], shape, self.net.device
            )
            found.append(self._sample(part, mask.to(self.net.device), noise).cpu())
        return torch.cat(found)

    def _sample(self, x: Float[Tensor, "n T C"], mask: Bool[Tensor, " T"], noise: WindowNoise) -> Float[Tensor, "n S T C"]:
        whole, lead = x, self.cfg.task.past - 1
        before, x, inner = x[:, :lead], x[:, lead:], mask[lead:]
        hint = self.representation.hint(x, before, inner)
        tf = self.representation.transform(x.shape[-2])
        target = self.representation.modelled(torch.where(inner[:, None], x, hint), hint)
        settings = self.cfg.sampling
        indices = ddim_indices(self.cfg.diffusion.steps, settings.ddim_steps, settings.spacing)
        warm, denoise = tempered(noise, settings.temperature), self._denoise(hint, before, inner)
        z = keyframed(denoise, tf, target[:, None], inner, self.alpha_bar, indices, warm, self.cfg.imposing)
        states = self.space.valid(self.representation.states(z, hint[:, None]))
        if settings.bones == "keyframes":
            states = self.space.with_bones(states, self._sized(x, inner)[:, None])
        early = before[:, None].expand(-1, states.shape[1], -1, -1)
        return with_keyframes(torch.cat([early, states], dim=-2), whole[:, None], mask)

    def _sized(self, x: Float[Tensor, "n T C"], mask: Bool[Tensor, " T"]) -> Float[Tensor, "n T C"]:
        """In every frame the body of the keyframe before it; it lends its bones only."""
        last = torch.where(mask, torch.arange(len(mask), device=mask.device), 0).cummax(0).values
        return x[:, last]

    def _denoise(self, hint: Float[Tensor, "n T C"], before: Float[Tensor, "n P C"], mask: Bool[Tensor, " T"]) -> Denoise:
        """The network's noise estimate of (n, S, rows, C)."""
        told = None
        if self.cfg.model.keyframes == "told":
            told = self.representation.told(hint, before, mask.expand(hint.shape[:-1]))

        def denoise(y: Tensor, t: int) -> Tensor:
            items = y.flatten(0, 1)
            beside = None if told is None else told[:, None].expand(*y.shape[:2], -1, -1).flatten(0, 1)
            output = self.net(items, t, beside)
            return to_eps(self.cfg.diffusion.prediction, output, items, self.alpha_bar[t]).reshape(y.shape)

        return denoise


def tempered(noise: Callable[[], Tensor], temperature: float) -> Callable[[], Tensor]:
    """Noise whose first draw, the start of sampling, has another deviation."""
    draws = count()
    return lambda: noise() * (temperature if next(draws) == 0 else 1.0)


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
