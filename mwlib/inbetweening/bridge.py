"""A trained model of in-betweening, and its samples as motions of a body in the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import count, pairwise
from math import ceil

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from tqdm import tqdm

from mwlib.body.following import on_rig
from mwlib.body.joining import aligned, check_one_body, joined, rig_of
from mwlib.body.motion import Motion
from mwlib.body.standing import legs, standing
from mwlib.data.meaning import check_people
from mwlib.data.windows import MOST_FRAMES, check_finite
from mwlib.diffusion import WindowNoise, alpha_bar, ddim_indices, keyframed, to_eps, with_keyframes
from mwlib.diffusion.samplers import Draw
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.objective import KeyframeNetwork, SizedNetwork, WienerNetwork, make_network
from mwlib.inbetweening.representation import Representation
from mwlib.inbetweening.space import Samples, Space, Track, Tracks, space_from_json
from mwlib.inbetweening.windows import Given, given
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
        representation = Representation.restore(cfg, learnt)
        net = with_weights(lambda: make_network(representation), weights)
        return cls(net, representation, space_from_json(about["space"]), cfg)

    def check(self, frames: int, mask: Given) -> None:
        """Refuse lengths and keyframes that the model was not made for."""
        task, model, count = self.cfg.task, self.cfg.model, int(mask.sum())
        if not task.fewest <= frames <= task.frames:
            raise ValueError(
                f"frames between is {frames - task.past - task.future}; expected {task.shortest or task.between} to "
                f"{task.between}, for which the model was trained"
            )
        if mask.shape != (frames,) or not count:
            raise ValueError(f"mask has shape {tuple(mask.shape)}, {count} keyframes; expected ({frames},), at least one")
        if not model.condition_on_keyframes:
            return
        if count > (most := task.past + task.future + model.more_keyframes):
            hidden = task.past + task.future - 2  # frames around the two keyframes
            raise ValueError(f"{count - hidden} keyframes; expected at most {most - hidden}, as in the model's training")
        if not (mask[: task.past].all() and mask[-task.future :].all()):
            raise ValueError(
                f"not all of the first {task.past} and last {task.future} frames are keyframes; expected all, as in the model's "
                "training"
            )

    @torch.inference_mode()
    def sample(
        self,
        x: Tracks,
        mask: Given | None = None,
        samples: int | None = None,
        seed: int | None = None,
        *,
        window_ids: Sequence[int] | None = None,
        progress: bool = False,
    ) -> Samples:
        """Whole motions as states, keyframes among them, on the CPU.

        Args:
            x: states seen from the last frame of the past; what is between the keyframes is not looked at. Of a model with
                `hide`, frames beyond the keyframes may be NaN where they are not known; these come back as the keyframe.
            mask: True at keyframes; None: the frames of the past and of the future.
            samples, seed: None = the settings'.
            window_ids: identity of each window (default 0..N-1): its noise depends on seed and identity only.
            progress: show a bar.

        Raises:
            ValueError: the length or the keyframes do not fit the model or are not finite, or no sample is asked for.
        """
        frames, task = x.shape[-2], self.cfg.task
        mask = given(frames, task.past, task.future) if mask is None else mask
        samples, seed = self.asked(samples, seed)
        self.check(frames, mask)
        x, ids = self._seen(x, mask), identities(window_ids, len(x))
        if not ids:
            raise ValueError("there are no windows; expected at least one")
        found, shape = [], (samples, *self.representation.transform(frames - task.steps).shape)
        for part in chunks(len(x), max(1, CHUNK // samples), progress):
            noise = WindowNoise(seed, ids[part], shape, self.device)
            found.append(self.finite(self._sample(x[part].to(self.device), mask.to(self.device), noise)).cpu())
        return torch.cat(found)

    @torch.inference_mode()
    def mean(self, x: Tracks) -> Tracks:
        """What the network of the mean says, without diffusion, one motion a window, see `sample`. Without one the curve."""
        mask = given(x.shape[-2], self.cfg.task.past, self.cfg.task.future)
        self.check(x.shape[-2], mask)
        return self.finite(self._sample(self._seen(x, mask).to(self.device), mask.to(self.device), None))[:, 0].cpu()

    def _seen(self, x: Tracks, mask: Given) -> Tracks:
        """The states as the network reads them, if it can."""
        task, needed = self.cfg.task, mask.clone()
        if self.cfg.model.hide:  # what lies beyond the two keyframes need not be known
            needed[: task.past - 1] = needed[len(mask) - task.future + 1 :] = False
        if not x[:, needed].isfinite().all():
            raise ValueError("x is not finite at a keyframe; expected numbers")
        return x.float()

    def _sample(self, x: Tracks, mask: Given, noise: WindowNoise | None) -> Samples:
        settings, form = self.cfg.sampling, self.representation
        gap = form.gap(x, mask)
        tf, inner = form.transform(gap.frames), gap.mask
        z, is_centred = torch.zeros_like(gap.line)[:, None], self.cfg.model.mean_width > 0
        if noise is not None:
            target = form.modelled(gap._replace(x=torch.where(inner[:, None], gap.x, gap.line)))
            indices = ddim_indices(self.cfg.diffusion.steps, settings.ddim_steps, settings.spacing)
            seen, warm = None, tempered(noise, settings.temperature)
            if self.cfg.model.condition_on_keyframes:
                seen = form.conditioning(gap)[:, None]
            warm = with_silence(warm) if is_centred else warm
            z = keyframed(partial(self._eps, seen), tf, target[:, None], inner, self.alpha_bar, indices, warm, self.cfg.imposing)
            z = z[:, :-1] - z[:, -1:] if is_centred else z
        if isinstance(self.net, SizedNetwork):
            ends, usual = form.ends(gap), form.usual(gap.frames).to(z)
            factor, mean = self.net.factor_of_samples(ends, tf.shape[0]), self.net.mean(ends, tf.shape[0])
            z = tf.inverse(tf(z) * (usual * factor)[:, None] + (usual * mean)[:, None])
        states = self.space.valid(form.states(z, gap))
        if settings.bones == "keyframes":
            last = torch.where(inner, torch.arange(len(inner), device=inner.device), 0).cummax(0).values
            states = self.space.with_bones(states, gap.x[:, None, last])  # in every frame those of the keyframe before it
        early, late = (
            torch.where(part.isfinite(), part, key)[:, None].expand(-1, states.shape[1], -1, -1)
            for part, key in ((gap.before, gap.x[:, :1]), (gap.after, gap.x[:, -1:]))
        )
        known = mask & x.isfinite().all(-1).all(0)
        return with_keyframes(torch.cat([early, states, late], dim=-2), x[:, None], known)

    def _eps(self, seen: Float[Tensor, "n 1 rows conditioning"] | None, y: Float[Tensor, "n S rows C"], t: int) -> Tensor:
        """The network's noise estimate of y_t."""
        items = y.flatten(0, 1)
        beside = None if seen is None else seen.expand(*y.shape[:2], -1, -1).flatten(0, 1)
        output = self.net(items, t, beside)
        return to_eps(self.cfg.diffusion.prediction, output, items, self.alpha_bar[t]).reshape(y.shape)


def tempered(noise: Draw, temperature: float) -> Draw:
    """Noise whose first draw, the start of sampling, has another deviation."""
    draws = count()
    return lambda: noise() * (temperature if next(draws) == 0 else 1.0)


def with_silence(noise: Draw) -> Draw:
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
            two or more frames of `start` at the model's rate. More than the model was trained with are filled one gap after the
            other: each leaves with the velocity with which the one before arrives.
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
    frames = None if frames is None else whole("frames", frames, 1, MOST_FRAMES)
    end = _checked(start, end)
    if isinstance(end, Motion) and align:
        end = aligned(end.with_up(start.up), start)
    if own_rig or join:
        rig_of(start)
    lead = 0 if bridge.cfg.model.hide else bridge.cfg.task.past - 1
    if isinstance(end, list) and len(end) > 2 + bridge.cfg.model.more_keyframes:
        samples, seed = bridge.asked(samples, seed)
        made = _chained(bridge, start, end, frames, range(samples), seed, feet, progress)
    else:
        made = _filled(bridge, start, end, frames, samples, seed, None, feet, progress)
    made = [each.with_up(start.up) for each in made]
    if own_rig or join:
        poses, at = _given_poses(start, end, len(made[0]), bridge, join, lead)
        made = [on_rig(each, poses, at) for each in made]
    return made


def _chained(
    bridge: Bridge,
    start: Motion,
    keys: list[int],
    frames: int | None,
    numbers: Sequence[int],
    seed: int,
    feet: bool,
    progress: bool,
) -> list[Motion]:
    """`_filled` one gap after the other; samples by their numbers."""
    _asked(bridge, start, keys, frames)  # refuses what does not fit before anything is sampled
    past, future = bridge.cfg.task.past, bridge.cfg.task.future
    for a, b in pairwise(keys):
        bridge.check(size := b - a - 1 + past + future, given(size, past, future))
    [motion] = bridge.space.bodies.prepare([start])
    made: list[Motion] = []
    for number in tqdm(numbers, "in-betweens", disable=not progress):
        whole = motion.cut(0, keys[1] + 1)
        for n, (a, b) in enumerate(pairwise(keys)):
            own = int(np.random.SeedSequence((seed, n)).generate_state(1)[0])
            [part] = _filled(bridge, whole, [a, b], None, 1, own, [number], feet, False)
            lead = len(part) - (b - a + 1)
            whole = _together(whole.cut(0, a - lead), part) if a > lead else part
            if b < keys[-1]:
                following = keys[n + 2]
                stop = len(motion) if following == keys[-1] else following + 1
                whole = _together(whole, motion.cut(b + 1, stop))
        made.append(replace(whole.cut(keys[0] - lead, len(whole)), name=f"{start.name} in between".strip()))
    return made


def _together(first: Motion, second: Motion) -> Motion:
    """All frames of both, of one body."""
    if first.rig and second.rig:
        return joined(first, second)
    return replace(first, positions=np.concatenate([first.positions, second.positions]), rig=None)


def _filled(
    bridge: Bridge,
    start: Motion,
    end: Motion | list[int],
    frames: int | None,
    samples: int | None,
    seed: int | None,
    ids: Sequence[int] | None,
    feet: bool,
    progress: bool,
) -> list[Motion]:
    """Samples from the first keyframe to the last, as the model's bodies in the world."""
    before, after, x, mask = _asked(bridge, start, end, frames)
    space, task = bridge.space, bridge.cfg.task
    place = space.placement(x, space.offsets(before), task.past - 1)
    sampled = bridge.sample(space.seen_from(x, place)[None], mask, samples, seed, window_ids=ids, progress=progress)[0]
    lead, known = 0 if bridge.cfg.model.hide else task.past - 1, (mask & x.isfinite().all(-1))[:, None]
    shown, named = slice(task.past - 1 - lead, len(x) - task.future + 1), f"{start.name} in between".strip()
    # What is given is put back: turned there and back it is not the same to the bit.
    states = (torch.where(known, x, space.placed(each, place))[shown] for each in sampled)
    made = [space.decode(each, replace(before, name=named)) for each in states]
    if feet and not space.rigid:
        keys, floor = mask[shown].nonzero().flatten().tolist(), _floor(before, after)
        made = [_on_feet(each, keys, floor) for each in made]
    return made


def _asked(bridge: Bridge, start: Motion, end: Motion | list[int], frames: int | None) -> tuple[Motion, Motion, Track, Given]:
    """What is given up to the first and from the last keyframe, as the model reads it; the states from the past to the future,
    NaN where a model may do without; and which of them are keyframes.
    """
    space, task = bridge.space, bridge.cfg.task
    if isinstance(end, Motion):
        nearest = _first_of(_picked(start, np.arange(len(start))[::-1]), bridge, task.past), _first_of(end, bridge, task.future)
        (before,), (after,) = (space.bodies.prepare([motion]) for motion in nearest)
        before = _picked(before, np.arange(len(before))[::-1])
        _check_size(start=before, end=after)
        check_one_body(*((start, end) if start.rig and end.rig else (before, after)))
        keys = [0, (task.between if frames is None else frames) + 1]
        roots = np.stack([before.positions[-1, 0], after.positions[0, 0]])
        inner = space.encode(before)[-1:].repeat(keys[1] - 1, 1)
    else:
        [motion], keys = space.bodies.prepare([start]), end
        _check_size(start=motion)
        if len(keys) < 2 or keys != sorted({*keys}) or keys[-1] >= len(motion):
            raise ValueError(
                f"keyframes are {keys} of a motion of {len(motion)} frames at {motion.fps:g} Hz; expected two or more, rising"
            )
        between = keys[-1] - keys[0] - 1
        if frames not in (None, between):
            raise ValueError(f"frames is {frames}, but {between} lie between frames {keys[0]} and {keys[-1]}; expected None")
        roots, before, after = motion.positions[keys, 0], motion.cut(0, keys[0] + 1), motion.cut(keys[-1], len(motion))
        inner = space.encode(motion)[keys[0] + 1 : keys[-1]]
    _check_speed(roots, keys, before.fps)
    early, late = space.encode(before)[-task.past :], space.encode(after)[: task.future]
    missing = task.past - len(early), task.future - len(late)
    if any(missing) and not bridge.cfg.model.hide:
        raise ValueError(
            f"{len(early)} frames at {before.fps:g} Hz up to the first keyframe and {len(late)} from the last; "
            f"expected at least {task.past} and {task.future}, the past and future that the model was given"
        )
    x = torch.nn.functional.pad(torch.cat([early, inner, late]), (0, 0, *missing), value=torch.nan)
    mask = given(len(x), task.past, task.future)
    mask[[key - keys[0] + task.past - 1 for key in keys]] = True
    return before, after, x, mask


def _check_size(**motions: Motion) -> None:
    """Refuse bodies of no human's size, by their names."""
    for name, m in motions.items():
        check_people(m.positions[None, :: max(1, len(m) // MOST_LOOKED_AT)], m.skeleton, [name])


def _floor(before: Motion, after: Motion) -> float:
    """Height of the lowest foot in the frames that are given, metres."""
    feet = [foot for _, _, foot in legs(before.skeleton)]
    return float(np.concatenate([before.positions, after.positions])[:, feet, 2].min()) if feet else 0.0


def _on_feet(motion: Motion, keys: Sequence[int], floor: float) -> Motion:
    """The motion, `standing` from keyframe to keyframe."""
    positions = motion.positions.copy()
    for a, b in pairwise(keys):
        positions[a : b + 1] = standing(motion.cut(a, b + 1), floor).positions
    return replace(motion, positions=positions)


def _given_poses(
    start: Motion, end: Motion | list[int], frames: int, bridge: Bridge, join: bool, lead: int
) -> tuple[Motion, Float[np.ndarray, " K"]]:
    """Frames of the user's motions that are given, at their rate, and for each which of the `frames` made it is at; of these
    `lead` are before the first keyframe.
    """
    ratio = start.fps / bridge.space.bodies.fps
    before = int(lead * ratio + 1e-6)
    if isinstance(end, Motion):
        end = end.with_up(start.up)
        after, first = (end.resample(start.fps), 0) if join else (end.cut(0, 1), len(start) - 1 - before)
        at = [lead - np.arange(len(start) - 1 - first, -1, -1) / ratio, frames - 1 + np.arange(len(after)) / ratio]
        return joined(start.cut(first, len(start)), after), np.concatenate(at)
    keys = np.minimum(np.rint(np.array(end) * ratio).astype(int), len(start) - 1)
    shown = np.arange(len(start)) if join else np.arange(keys[0] - before, keys[-1] + 1)
    kept = shown[(shown <= keys[0]) | (shown >= keys[-1]) | np.isin(shown, keys)]
    return _picked(start, kept), (kept - keys[0]) / ratio + lead


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
        raise ValueError(
            f"keyframes {n} and {n + 1} are {away[n]:.3g} m and {(frames[n + 1] - frames[n]) / fps:.3g} s apart, which needs "
            f"{speeds[n]:.3g} m/s; expected at most {FASTEST:g} m/s: more frames, or nearer poses; align brings a second motion "
            "to where the first ends"
        )


def _first_of(motion: Motion, bridge: Bridge, frames: int) -> Motion:
    """The first frames of a motion, as many as so many frames of the model take."""
    return motion.cut(0, 1 + ceil((frames - 1) * motion.fps / bridge.space.bodies.fps - 1e-6))


def _picked(motion: Motion, frames: Int[np.ndarray, " frames"]) -> Motion:
    return replace(motion, positions=motion.positions[frames], rig=motion.rig and motion.rig.pick(frames))
