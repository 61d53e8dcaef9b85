"""A trained model of in-betweening, and its samples as motions of a body in the world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count, pairwise
from math import ceil

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.body.following import on_rig
from mwlib.body.joining import aligned, check_one_body, joined, rig_of
from mwlib.body.motion import Motion
from mwlib.body.standing import legs, standing
from mwlib.data.meaning import check_people
from mwlib.data.windows import MOST_FRAMES, check_finite
from mwlib.diffusion import Denoise, WindowNoise, alpha_bar, ddim_indices, keyframed, to_eps, with_keyframes
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.objective import KeyframeNetwork, SizedNetwork, WienerNetwork, make_network
from mwlib.inbetweening.representation import Representation
from mwlib.inbetweening.space import Space, space_from_json
from mwlib.inbetweening.windows import given, parted
from mwlib.settings import of_kind, whole, wholes
from mwlib.training import TrainedModel, chunks, identities, with_weights

CHUNK = 64  # motions sampled together on a processor
FASTEST = 12.0  # metres per second of the root from one keyframe to the next: own choice, as fast as anybody ran
MOST_LOOKED_AT = 100  # frames of a clip, for the size of its body


class Bridge(TrainedModel):
    """A network with what it was trained for, and settings of the sampling.

    Args:
        net: trained weights (the moving average).
        representation: windows as what is diffused.
        space: what a state means.
        cfg: of the training; the groups `sampling` and `imposing` say how it samples.
    """

    sampling_groups = ("sampling", "imposing")

    def __init__(self, net: KeyframeNetwork | WienerNetwork, representation: Representation, space: Space, cfg: Config) -> None:
        super().__init__(net, cfg)
        self.representation, self.space = representation, space
        self.alpha_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> Bridge:
        """The bridge that a finished training left (see `mwlib.training.read_model`)."""
        representation = Representation.restore(cfg.model, cfg.task.gap, learnt)
        net = with_weights(lambda: make_network(cfg, representation), weights)
        return cls(net, representation, space_from_json(about["space"]), cfg)

    def check(self, frames: int, mask: Bool[Tensor, " T"]) -> None:
        """Refuse lengths and keyframes that the model was not made for."""
        task, model = self.cfg.task, self.cfg.model
        if not task.fewest <= frames <= task.frames:
            between = f"{task.shortest} to {task.between}" if task.shortest else f"{task.between}"
            found = frames - task.past - task.future
            raise ValueError(f"frames between is {found}; expected {between}, for which the model was trained")
        if mask.shape != (frames,) or not mask.any():
            raise ValueError(
                f"mask has shape {tuple(mask.shape)}, {int(mask.sum())} keyframes; expected ({frames},), at least one"
            )
        if not model.condition_on_keyframes:
            return
        if int(mask.sum()) > (most := task.past + task.future + model.more_keyframes):
            raise ValueError(f"{int(mask.sum())} keyframes; expected at most {most}, as in the model's training")
        if not (mask[: task.past].all() and mask[-task.future :].all()):
            first, all_ = ("first", "both") if task.past == 1 else (f"{task.past} first", "all")
            last = "last" if task.future == 1 else f"{task.future} last"
            raise ValueError(f"the {first} or {last} frame is no keyframe; expected {all_}, as in the model's training")

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
            x: states seen from the last frame of the past; what is between the keyframes is not looked at. Of a model with
                `hide`, frames beyond the keyframes may be NaN where they are not known; these come back as the keyframe.
            mask: True at keyframes; None: the frames of the past and of the future.
            samples, seed: None = the settings'.
            window_ids: identity of each window (default 0..N-1): its noise depends on seed and identity only.
            progress: show a bar.

        Raises:
            ValueError: the length or the keyframes do not fit the model, or no sample is asked for.
        """
        frames, past, future = x.shape[-2], self.cfg.task.past, self.cfg.task.future
        mask = given(frames, past, future) if mask is None else mask
        samples, seed = self.asked(samples, seed)
        self.check(frames, mask)
        ids = identities(window_ids, len(x))
        if not ids:
            raise ValueError("there are no windows; expected at least one")
        found, shape = [], (samples, *self.representation.transform(frames - past - future + 2).shape)
        for part in chunks(len(x), max(1, CHUNK // samples), progress):
            noise = WindowNoise(seed, ids[part], shape, self.device)
            found.append(self.finite(self._sample(x[part].to(self.device), mask.to(self.device), noise)).cpu())
        return torch.cat(found)

    @torch.inference_mode()
    def mean(self, x: Float[Tensor, "N T C"]) -> Float[Tensor, "N T C"]:
        """What the network of the mean says, without diffusion, one motion a window, see `sample`. Without one the curve."""
        mask = given(x.shape[-2], self.cfg.task.past, self.cfg.task.future)
        self.check(x.shape[-2], mask)
        return self.finite(self._sample(x.to(self.device), mask.to(self.device), None))[:, 0].cpu()

    def _sample(self, x: Float[Tensor, "n T C"], mask: Bool[Tensor, " T"], noise: WindowNoise | None) -> Float[Tensor, "n S T C"]:
        task, settings = self.cfg.task, self.cfg.sampling
        whole, (before, x, after) = x, parted(x, task.past, task.future)
        inner = mask[task.past - 1 :][: x.shape[-2]]
        line = self.representation.interpolation(x, before, inner, after)
        room, tf = self.representation.room(x, before, after), self.representation.transform(x.shape[-2])
        z, is_centred = torch.zeros_like(line)[:, None], self.cfg.model.mean_width > 0
        if noise is not None:
            target = self.representation.modelled(torch.where(inner[:, None], x, line), line, room)
            indices = ddim_indices(self.cfg.diffusion.steps, settings.ddim_steps, settings.spacing)
            warm, denoise = tempered(noise, settings.temperature), self._denoise(line, before, inner, after)
            warm = with_silence(warm) if is_centred else warm
            z = keyframed(denoise, tf, target[:, None], inner, self.alpha_bar, indices, warm, self.cfg.imposing)
            z = z[:, :-1] - z[:, -1:] if is_centred else z
        if isinstance(self.net, SizedNetwork):
            ends, usual = self.representation.ends(line, before, after), self.representation.usual(x.shape[-2]).to(z)
            factor, mean = self.net.factor_of_samples(ends, tf.shape[0]), self.net.mean(ends, tf.shape[0])
            z = tf.inverse(tf(z) * (usual * factor)[:, None] + (usual * mean)[:, None])
        states = self.space.valid(self.representation.states(z, line[:, None], room[:, None]))
        if settings.bones == "keyframes":
            states = self.space.with_bones(states, self._sized(x, inner)[:, None])
        early, late = (
            torch.where(part.isfinite(), part, key)[:, None].expand(-1, states.shape[1], -1, -1)
            for part, key in ((before, x[:, :1]), (after, x[:, -1:]))
        )
        known = mask & whole.isfinite().all(-1).all(0)
        return with_keyframes(torch.cat([early, states, late], dim=-2), whole[:, None], known)

    def _sized(self, x: Float[Tensor, "n T C"], mask: Bool[Tensor, " T"]) -> Float[Tensor, "n T C"]:
        """In every frame the body of the keyframe before it; it lends its bones only."""
        last = torch.where(mask, torch.arange(len(mask), device=mask.device), 0).cummax(0).values
        return x[:, last]

    def _denoise(
        self,
        line: Float[Tensor, "n T C"],
        before: Float[Tensor, "n P C"],
        mask: Bool[Tensor, " T"],
        after: Float[Tensor, "n Q C"],
    ) -> Denoise:
        """The network's noise estimate of (n, S, rows, C)."""
        seen = None
        if self.cfg.model.condition_on_keyframes:
            seen = self.representation.conditioning(line, before, mask.expand(line.shape[:-1]), after)[:, None]

        def denoise(y: Tensor, t: int) -> Tensor:
            """(y_t, t) -> eps."""
            items = y.flatten(0, 1)
            beside = None if seen is None else seen.expand(*y.shape[:2], -1, -1).flatten(0, 1)
            output = self.net(items, t, beside)
            return to_eps(self.cfg.diffusion.prediction, output, items, self.alpha_bar[t]).reshape(y.shape)

        return denoise


def tempered(noise: Callable[[], Tensor], temperature: float) -> Callable[[], Tensor]:
    """Noise whose first draw, the start of sampling, has another deviation."""
    draws = count()
    return lambda: noise() * (temperature if next(draws) == 0 else 1.0)


def with_silence(noise: Callable[[], Tensor]) -> Callable[[], Tensor]:
    """Noise of one more sample, which is 0: where a network says the mean, what comes of it is taken from the other samples.

    Own choice: what is diffused has mean 0 then, and what a denoiser makes of no noise is learnt from people in training. On
    people it never saw that adds error.
    """
    return lambda: torch.nn.functional.pad(noise(), (0, 0, 0, 0, 0, 1))


def filled(
    bridge: Bridge,
    start: Motion,
    end: Motion | Sequence[int],
    frames: int | None = None,
    samples: int | None = None,
    seed: int | None = None,
    progress: bool = False,
    *,
    align: bool = False,
    own_rig: bool = False,
    join: bool = False,
    feet: bool = True,
) -> list[Motion]:
    """Motions that leave one pose and arrive at another, at the model's frame rate, in the world of the poses.

    Args:
        bridge: a trained model. What it is given is turned, resampled and, if need be, carried over to its skeleton.
        start: its last frame is the first keyframe. With frame numbers for `end`, it is the motion whose frames they are. A model
            that is given a past looks at the frames before the first keyframe, too; one that may do without (`hide`) looks at
            those that there are.
        end: its first frame is the last keyframe, and those behind it are a future that is given, as the past is; or numbers of
            two or more frames of `start` at the model's rate.
        frames: N, frames between the first and the last keyframe at the model's rate; None: the model's own, or as many as lie
            between the numbered ones.
        samples, seed: None = the settings'.
        progress: show a bar.
        align: turn and move the motion `end`, so that it begins where `start` ends, facing as it does there.
        own_rig: give them on the rig of `start`, with all its joints and at its rate (see `on_rig`).
        join: with all frames of `start` and `end` outside, on their rig.
        feet: hold the feet that stand (see `standing`), and none below the lowest of the frames given; of a model of places.

    Returns:
        `samples` motions of past + N + 1 frames (N + 2 of a model that may do without a past), with the up-axis of `start`. Those
            of a model of rotations have a rig.

    Raises:
        ValueError: an argument is of another kind or out of range; poses are not finite, of no human's size, of two bodies, or so
            far apart that nobody gets from one to the next in time (own choice: 12 m/s); bodies, length or keyframes do not fit
            the model; a rig is asked for and there is none; or the settings of the sampling make numbers overflow. The message
            says which, and what is expected.
    """
    samples, seed = bridge.asked(samples, seed)
    frames = None if frames is None else whole("frames", frames, 1, MOST_FRAMES)
    end = _checked(start, end)
    if isinstance(end, Motion) and align:
        end = aligned(end.with_up(start.up), start)
    if own_rig or join:
        rig_of(start)
    task = bridge.cfg.task
    first, *last = _given(bridge, start, end)
    for name, m in zip(("start", "end"), (first, *last), strict=False):
        check_people(m.positions[None, :: max(1, len(m) // MOST_LOOKED_AT)], m.skeleton, [name])
    if isinstance(end, Motion):
        check_one_body(*((start, end) if start.rig and end.rig else (first, last[0])))
        count = task.between if frames is None else frames
        like, x, mask = first, *_of_poses(bridge, first, last[0], count)
    else:
        like, x, mask = first, *_of_frames(bridge, first, end, frames)
    states = _states(bridge, like, x, mask, samples, seed, progress)
    named, lead = replace(like, name=f"{start.name} in between".strip()), 0 if bridge.cfg.model.hide else task.past - 1
    shown = slice(task.past - 1 - lead, len(x) - task.future + 1)
    made = [bridge.space.decode(each[shown], named) for each in states]
    if feet and not bridge.space.rigid:
        keys, floor = mask[shown].nonzero().flatten().tolist(), _floor(first, last, end)
        made = [_on_feet(each, keys, floor) for each in made]
    made = [each.with_up(start.up) for each in made]
    if not (own_rig or join):
        return made
    poses, at = _given_poses(start, end, len(made[0]), bridge, join, lead)
    return [on_rig(each, poses, at) for each in made]


def _given(bridge: Bridge, start: Motion, end: Motion | Sequence[int]) -> list[Motion]:
    """What is given, as the model reads it: one motion and frames of it, or the end of one and the beginning of another."""
    if not isinstance(end, Motion):
        return bridge.space.bodies.prepare([start])
    nearest = _first_of(_reversed(start), bridge, bridge.cfg.task.past), _first_of(end, bridge, bridge.cfg.task.future)
    (first,), last = (bridge.space.bodies.prepare([motion]) for motion in nearest)
    return [_reversed(first), *last]


def _states(
    bridge: Bridge, like: Motion, x: Float[Tensor, "T D"], mask: Bool[Tensor, " T"], samples: int, seed: int, progress: bool
) -> list[Float[Tensor, "T D"]]:
    """Samples in the world of the given frames, which come back to the bit."""
    place = bridge.space.placement(x, bridge.space.offsets(like), bridge.cfg.task.past - 1)
    sampled = bridge.sample(bridge.space.seen_from(x, place)[None], mask, samples, seed, progress=progress)[0]
    known = mask & x.isfinite().all(-1)
    # turned there and back is not the same to the bit
    return [torch.where(known[:, None], x, bridge.space.placed(each, place)) for each in sampled]


def _floor(first: Motion, last: Sequence[Motion], end: Motion | Sequence[int]) -> float:
    """Height of the lowest foot in the frames that are given, metres."""
    feet = [foot for _, _, foot in legs(first.skeleton)]
    frames = [*last, first] if isinstance(end, Motion) else [first.cut(0, end[0] + 1), first.cut(end[-1], len(first))]
    return min((float(m.positions[:, feet, 2].min()) for m in frames if feet), default=0.0)


def _on_feet(motion: Motion, keys: Sequence[int], floor: float) -> Motion:
    """The motion, `standing` from keyframe to keyframe."""
    positions = motion.positions.copy()
    for a, b in pairwise(keys):
        positions[a : b + 1] = standing(motion.cut(a, b + 1), floor).positions
    return replace(motion, positions=positions)


def _given_poses(
    start: Motion, end: Motion | Sequence[int], frames: int, bridge: Bridge, join: bool, lead: int
) -> tuple[Motion, Float[np.ndarray, " K"]]:
    """Frames of the user's motions that are given, at their rate, and for each which of the `frames` made it is at; of these
    `lead` are before the first keyframe.
    """
    ratio = start.fps / bridge.space.bodies.fps
    before = int(lead * ratio + 1e-6)
    if isinstance(end, Motion):
        after = end.with_up(start.up).resample(start.fps) if join else end.with_up(start.up).cut(0, 1)
        first = 0 if join else len(start) - 1 - before
        at = [lead - np.arange(len(start) - 1 - first, -1, -1) / ratio, frames - 1 + np.arange(len(after)) / ratio]
        return joined(start.cut(first, len(start)), after), np.concatenate(at)
    keys = np.minimum(np.rint(np.array(end) * ratio).astype(int), len(start) - 1)
    shown = np.arange(0 if join else keys[0] - before, len(start) if join else keys[-1] + 1)
    kept = shown[(shown <= keys[0]) | (shown >= keys[-1]) | np.isin(shown, keys)]
    motion = replace(start, positions=start.positions[kept], rig=rig_of(start).pick(kept))
    return motion, (kept - keys[0]) / ratio + lead


def _checked(start: Motion, end: Motion | Sequence[int]) -> Motion | list[int]:
    """The last keyframe or the keyframes' numbers; poses are finite."""
    check_finite("start", of_kind("start", start, Motion))
    if isinstance(end, Motion):
        check_finite("end", end)
        return end
    try:
        return wholes("end", end)
    except ValueError as error:
        raise ValueError(f"{error}: the numbers of keyframes in start; or a Motion") from None


def _check_speed(keyframes: Float[np.ndarray, "K 3"], frames: Sequence[int], fps: float) -> None:
    """Refuse keyframes that nobody gets to in time: places of the root, and their frames."""
    away = np.linalg.norm(np.diff(keyframes, axis=0), axis=-1)
    speeds = away * fps / np.diff(frames)
    if not speeds.max() <= FASTEST:
        n = int(speeds.argmax())
        apart = f"keyframes {n} and {n + 1} are {away[n]:.3g} m and {(frames[n + 1] - frames[n]) / fps:.3g} s apart"
        raise ValueError(
            f"{apart}, which needs {speeds[n]:.3g} m/s; expected at most {FASTEST:g} m/s: more frames, or nearer poses; "
            "align brings a second motion to where the first ends"
        )


def _first_of(motion: Motion, bridge: Bridge, frames: int) -> Motion:
    """The first frames of a motion, as many as so many frames of the model take."""
    return motion.cut(0, 1 + ceil((frames - 1) * motion.fps / bridge.space.bodies.fps - 1e-6))


def _reversed(motion: Motion) -> Motion:
    backwards = np.arange(len(motion))[::-1]
    return replace(motion, positions=motion.positions[backwards], rig=motion.rig and motion.rig.pick(backwards))


def _of_poses(bridge: Bridge, start: Motion, end: Motion, count: int) -> tuple[Float[Tensor, "T C"], Bool[Tensor, " T"]]:
    """States that are given at both ends, in between the last of the past, and the mask of what is given."""
    task = bridge.cfg.task
    _check_speed(np.stack([start.positions[-1, 0], end.positions[0, 0]]), [0, count + 1], start.fps)
    before, after = bridge.space.encode(start)[-task.past :], bridge.space.encode(end)[: task.future]
    x = torch.cat([before, before[-1:].repeat(count, 1), after])
    return _filled_up(bridge, x, task.past - len(before), task.future - len(after)), given(
        task.past + count + task.future, task.past, task.future
    )


def _filled_up(bridge: Bridge, x: Float[Tensor, "t C"], early: int, late: int) -> Float[Tensor, "T C"]:
    """States with NaN for so many that are not there before and after them, if the model may do without."""
    task = bridge.cfg.task
    if not bridge.cfg.model.hide:
        for missing, asked, where, what in (
            (early, task.past, "up to the first", "past"), (late, task.future, "from the last", "future"),
        ):  # fmt: skip
            if missing:
                found = f"{asked - missing} frames at {bridge.space.bodies.fps:g} Hz {where} keyframe"
                raise ValueError(f"{found}; expected at least {asked}, the {what} that the model was given")
    return torch.nn.functional.pad(x, (0, 0, early, late), value=torch.nan)


def _of_frames(
    bridge: Bridge, motion: Motion, numbers: Sequence[int], count: int | None
) -> tuple[Float[Tensor, "T C"], Bool[Tensor, " T"]]:
    """The stretch of a motion from its first to its last keyframe, with the past before, and the mask of what is given."""
    task = bridge.cfg.task
    lead, trail = task.past - 1, task.future - 1
    rising = [*numbers] == sorted({*numbers})
    if len(numbers) < 2 or not rising or numbers[0] < 0 or numbers[-1] >= len(motion):
        raise ValueError(
            f"keyframes are {[*numbers]} of a motion of {len(motion)} frames at {motion.fps:g} Hz; expected two or more, rising"
        )
    between = numbers[-1] - numbers[0] - 1
    if count is not None and count != between:
        raise ValueError(f"frames is {count}, but {between} lie between frames {numbers[0]} and {numbers[-1]}; expected None")
    _check_speed(motion.positions[[*numbers], 0], numbers, motion.fps)
    mask = given(lead + between + 2 + trail, lead + 1, trail + 1)
    mask[[n - numbers[0] + lead for n in numbers]] = True
    early, late = max(0, lead - numbers[0]), max(0, numbers[-1] + trail + 1 - len(motion))
    x = bridge.space.encode(motion)[max(0, numbers[0] - lead) : numbers[-1] + trail + 1]
    return _filled_up(bridge, x, early, late), mask
