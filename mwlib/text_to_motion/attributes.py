"""Attributes of a motion read off its joints: actions and their order, speed, path, hand, count; and its naturalness.

Own choice: rules with thresholds, fitted to synthetic people whose attributes are known, so that a motion made from a sentence
can be held against the sentence without another network.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from mwlib.body.kinematics import bones_of
from mwlib.body.skeleton import HUMANML22
from mwlib.data.formats.humanml import CaptionedClip, FeatureLayout, joints_of
from mwlib.metrics import foot_skate, jerk, path_length, speed

Frames = Bool[np.ndarray, " T"]  # in which something happens
PerFrame = Float[np.ndarray, " T"]
PerSide = Float[np.ndarray, "2 T"]
Places = Float[np.ndarray, "T 3"]
SIDES = ("left", "right")


class BodySignals:
    """Signals of one clip, each a row of T values or one per side (left, right).

    Args:
        positions: (T, 22, 3) metres, y up, on the joints of HumanML3D.
        fps: frames per second.

    Raises:
        ValueError: another shape, fewer than half a second, or positions that are not finite.
    """

    def __init__(self, positions: Float[np.ndarray, "T J 3"], fps: float) -> None:
        strange = np.size(positions) - np.isfinite(positions).sum()
        if positions.shape[1:] != (len(HUMANML22), 3) or len(positions) < fps / 2 or strange:
            found = f"positions have shape {positions.shape}, and {strange} values that are not finite"
            raise ValueError(f"{found}; expected metres, (T, 22, 3) with at least {fps / 2:g} frames")
        self.positions, self.fps = np.asarray(positions, float), fps

    def joint(self, name: str) -> Places:
        """Positions of one joint."""
        return self.positions[:, HUMANML22.joints.index(name)]

    def both(self, name: str) -> Float[np.ndarray, "2 T 3"]:
        """Positions of a joint of the left and of the right side."""
        return np.stack([self.joint(f"{side}_{name}") for side in SIDES])

    def smooth(self, values: np.ndarray, seconds: float) -> np.ndarray:
        """Gaussian average over time (the first axis) of this standard deviation."""
        return gaussian_filter1d(values, seconds * self.fps, axis=0, mode="nearest")

    def limb(self, *joints: str) -> PerSide:
        """Length of a chain of joints, metres."""
        return np.linalg.norm(np.diff([self.both(joint) for joint in joints], axis=0), axis=-1).sum(axis=0)

    @cached_property
    def leg(self) -> float:
        """Metres from hip to ankle with the knee straight."""
        return float(np.median(self.limb("hip", "knee", "ankle")))

    @cached_property
    def forward(self) -> Places:
        """Unit vector along the floor to where hips and shoulders face."""
        left = 0.0 + np.subtract(*self.both("hip")) + np.subtract(*self.both("shoulder"))
        ahead = np.cross(left, [0.0, 1.0, 0.0])
        return ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)

    @cached_property
    def facing(self) -> PerFrame:
        """Where hips and shoulders face, degrees, growing to the left, without jumps."""
        return np.rad2deg(np.unwrap(np.arctan2(self.forward[:, 0], self.forward[:, 2])))

    @cached_property
    def heading(self) -> PerFrame:
        """`facing`, smoothed over a step."""
        return self.smooth(self.facing, 0.2)

    @cached_property
    def velocity(self) -> Places:
        """Of the root along the floor, metres per second, smoothed over a tenth of a second."""
        root = self.smooth(self.joint("pelvis") * [1.0, 0.0, 1.0], 0.1)
        return np.gradient(root, axis=0) * self.fps

    @cached_property
    def ankles(self) -> PerSide:
        """Height of the ankles over where they are on the floor, metres."""
        height = self.both("ankle")[..., 1]
        return height - height.min()

    @cached_property
    def wrists(self) -> PerSide:
        """Height of the wrists over the shoulder of their side, metres."""
        return self.both("wrist")[..., 1] - self.both("shoulder")[..., 1]

    @cached_property
    def extension(self) -> PerSide:
        """Distance of the wrist from its shoulder as a share of the arm's length."""
        return self.limb("shoulder", "wrist") / np.maximum(self.limb("shoulder", "elbow", "wrist"), 1e-9)

    def ahead(self, joint: str) -> PerSide:
        """How far a joint of either side is ahead of the root, metres."""
        return np.sum((self.both(joint) - self.joint("pelvis")) * self.forward, axis=-1)

    def upright(self, joint: str) -> PerFrame:
        """Height of a joint over the lower ankle as a share of its height when the body stands."""
        height = self.joint(joint)[:, 1] - self.both("ankle")[..., 1].min(axis=0)
        return height / np.maximum(np.quantile(height, 0.95), 1e-9)

    @cached_property
    def moving(self) -> Frames:
        """Whether root and feet get somewhere within the second around."""
        places = np.stack([self.joint("pelvis"), self.both("ankle").mean(axis=0)])
        half, frames = int(self.fps / 2), np.arange(len(self.positions))
        first, end = np.maximum(frames - half, 0), np.minimum(frames + half, frames[-1])
        apart = (places[:, end] - places[:, first])[..., [0, 2]]
        root, feet = np.linalg.norm(apart, axis=-1) * 2 * half / (end - first)  # scaled up where the clip ends sooner
        return (root > 0.36) & (feet > 0.3)

    def spells(self, happens: Frames, shortest: float, gap: float = 0.0) -> list[slice]:
        """Runs of frames in which something happens for at least so many seconds; interruptions up to `gap` seconds count."""
        edges = np.flatnonzero(np.diff(happens, prepend=False, append=False))
        short = 2 * np.flatnonzero(np.diff(edges)[1::2] <= gap * self.fps)
        joined = np.delete(edges, [short + 1, short + 2]).reshape(-1, 2)  # without both ends of short interruptions
        return [slice(*spell) for spell in joined.tolist() if spell[1] - spell[0] >= shortest * self.fps]

    def around(self, events: Iterable[Event], seconds: float) -> Frames:
        """Frames within so many seconds of any of these events."""
        near, more = np.zeros(len(self.positions), bool), seconds * self.fps
        for _, spell, _ in events:
            near[max(0, int(spell.start - more)) : int(spell.stop + more)] = True
        return near

    def by_side(self, happens: Bool[np.ndarray, "2 T"], shortest: float, gap: float = 0.0) -> tuple[int, list[slice]]:
        """The side (0: left) on which something happens more often, and its `spells`."""
        spells = [self.spells(own, shortest, gap) for own in happens]
        side = int(len(spells[1]) > len(spells[0]))
        return side, spells[side]


CLAIMS = ("action", "then", "path", "speed", "hand", "foot", "turn", "count")  # of what a caption of synthetic people may say
SPEEDS = {"walk": (0.81, 1.37), "run": (2.4, 3.18)}  # metres per second: slow below the first, fast above the second
SWING = 0.02  # metres: a hand that goes less far to and fro does not wave
CIRCLE = 165.0  # degrees: a path that turns further is a circle, of less a turn
STRAIGHT = 35.0  # degrees: a path that turns less is straight


class Event(NamedTuple):
    """An action in a clip: when, and with which attributes."""

    action: str
    spell: slice
    attributes: dict[str, str | int]


def measured_attributes(positions: Float[np.ndarray, "T J 3"], fps: float = 20.0) -> dict[str, str | int]:
    """Attributes of a clip by the names of the synthetic people, those of `CLAIMS`.

    Args:
        positions: (T, 22, 3) metres, y up, on the joints of HumanML3D.
        fps: frames per second.

    Returns:
        What was found; an attribute that does not apply to the actions found is missing.

    Raises:
        ValueError: another shape, fewer than half a second, or positions that are not finite.
    """
    body = BodySignals(positions, fps)
    events = sorted(_events(body), key=lambda event: event.spell.start + event.spell.stop)
    actions = [event.action for event in events]
    end = max((event.spell.stop for event in events), default=-np.inf)
    if actions in ([], ["walk"], ["run"]) and len(positions) - end > 0.75 * fps:
        actions.append("stand")  # what is left when nothing happens at all, or for long after the way
    first_wins = ChainMap(*(event.attributes for event in events))
    return {**first_wins, **dict(zip(("action", "then"), actions, strict=False))}


def _events(body: BodySignals) -> list[Event]:
    """All that happens, in no order."""
    jumps = _jumps(body)
    flying = body.around(jumps, 0.45)
    travel = _travels(body, flying)
    going = body.around(travel, 0.0)
    busy = going & (np.linalg.norm(body.velocity, axis=-1) > 0.35)
    punches = _punches(body, flying | busy)
    boxing = body.around(punches, 0.5)
    low, kicks = _lows(body, flying | busy), _kicks(body, flying | busy)
    swinging = body.around([*low, *kicks], 0.3)  # arms keep the balance
    hands = _hands(body, flying | boxing | busy | swinging)
    return [*jumps, *travel, *kicks, *punches, *low, *hands, *_turns(body, going & busy)]


def _whole(spells: list[slice]) -> slice:
    return slice(spells[0].start, spells[-1].stop)


def _of(spells: list[slice], action: str, **attributes: str | int) -> list[Event]:
    """The event of all these spells together, if there are any."""
    return [Event(action, _whole(spells), attributes)] if spells else []


def _jumps(body: BodySignals) -> list[Event]:
    """Both feet off the floor, side by side."""
    level = np.abs(np.subtract(*body.ankles)) < 0.1
    beside = np.abs(np.subtract(*body.ahead("ankle"))) < 0.3 * body.leg
    spells = body.spells((body.ankles.min(axis=0) > 0.035) & level & beside, 0.1)
    return _of(spells, "jump", count=len(spells))


def _travels(body: BodySignals, flying: Frames) -> list[Event]:
    """Getting somewhere on foot; a run has moments without a foot on the floor."""
    found = []
    for spell in body.spells(body.moving & ~flying, 0.8, gap=0.8):
        margin = int(0.35 * body.fps)
        inner = slice(spell.start + margin * (spell.start > 0), spell.stop - margin * (spell.stop < len(body.positions)))
        heading, speed = body.heading[inner], np.linalg.norm(body.velocity[inner], axis=-1).mean()
        change = heading[-1] - heading[0]
        action = "run" if speed > 1.88 else "walk"
        side, kind = "left" if change > 0 else "right", "circle" if abs(change) > CIRCLE else "turn"
        path = "straight" if abs(change) < STRAIGHT else f"{side}_{kind}"
        pace = ("slow", "normal", "fast")[np.searchsorted(SPEEDS[action], speed)]
        found += _of([spell], action, speed=pace, path=path)
    return found


def _kicks(body: BodySignals, busy: Frames) -> list[Event]:
    """A foot far ahead and above the floor while the other stands."""
    out = (body.ahead("ankle") > 0.42 * body.leg) & (body.ankles > 0.06 * body.leg) & (body.ankles[::-1] < 0.12 * body.leg)
    foot, spells = body.by_side(out & ~busy, 0.1, gap=0.1)
    return _of(spells, "kick", foot=SIDES[foot], count=len(spells))


def _punches(body: BodySignals, busy: Frames) -> list[Event]:
    """One arm stretched forward while the other is held bent before the chest."""
    level = np.abs(body.wrists) < 0.2
    out = (body.extension > 0.88) & level & (body.extension[::-1] < 0.62) & (body.wrists[::-1] > -0.2)
    hand, spells = body.by_side(out & ~busy, 0.0, gap=0.1)
    return _of(spells, "box", hand=SIDES[hand], count=len(spells))


def _lows(body: BodySignals, busy: Frames) -> list[Event]:
    """The hips go down, or the head alone."""
    hips, head = body.upright("pelvis"), body.upright("head")
    spells = body.spells((hips < 0.78) & ~busy, 0.2)
    if not spells:
        return _of(body.spells((head < 0.85) & (hips > 0.85) & ~busy, 0.4), "bow")
    wrists = body.both("wrist")[:, _whole(spells), 1].min(axis=1)
    if wrists.min() - body.both("ankle")[..., 1].min() < 0.35 * body.leg:
        return _of(spells, "pick_up", hand=SIDES[wrists.argmin()])
    if max(spell.stop - spell.start for spell in spells) > 1.15 * body.fps or spells[-1].stop == len(hips):
        return _of(spells, "sit")
    return _of(spells, "squat", count=len(spells))


def _hands(body: BodySignals, busy: Frames) -> list[Event]:
    """A hand held up: waving if it goes to and fro, else reaching; or an arm stretched forward."""
    up = {side: spells for side in (0, 1) if (spells := body.spells((body.wrists[side] > 0.12) & ~busy, 0.3, gap=0.3))}
    if up:
        side = min(up)
        hand = "both" if len(up) == 2 else SIDES[side]
        return _of(up[side], "wave" if _waves(body, side, _whole(up[side])) else "reach", hand=hand)
    out = (body.extension > 0.88) & (body.wrists > -0.25) & (body.ahead("wrist") > 0.5 * body.leg)
    left, right = (body.spells(own & ~busy, 0.2, gap=0.1) for own in out)
    return _of(left or right, "reach", hand="left" if left else "right")


def _waves(body: BodySignals, side: int, spell: slice) -> bool:
    """Whether the raised hand goes to and fro."""
    elbow = body.limb("shoulder", "wrist")[side]
    swing = (elbow - body.smooth(elbow, 0.5))[spell]
    return bool(np.count_nonzero(np.diff(np.sign(swing[np.abs(swing) > SWING]))) > 2)


def _turns(body: BodySignals, going: Frames) -> list[Event]:
    """The heading changes while the body stays where it is."""
    rate = np.gradient(body.heading) * body.fps
    spells = body.spells((np.abs(rate) > 20.0) & ~going, 0.2, gap=0.15)
    spells = [spell for spell in spells if np.ptp(body.heading[spell][[0, -1]]) > 45.0]
    if not spells:
        return []
    spell = max(spells, key=lambda spell: spell.stop - spell.start)
    return _of([spell], "turn", turn="left" if body.heading[spell][-1] > body.heading[spell][0] else "right")


def movement(features: Float[Tensor, "T D"], layout: FeatureLayout) -> dict[str, float]:
    """Speed and jerk of the joints, way of the root, sliding of the toes, and how much bones change their lengths.

    Args:
        features: raw.
        layout: what a row means.

    Returns:
        "joint_speed" (m/s), "way" (m), "jerk" (m/s³), "skate" (m/s, NaN where no toe is on the floor; the floor is the lowest
        toe), "bone_jitter" (m, mean step of a bone's length from frame to frame).
    """
    joints = joints_of(features.float(), layout) * layout.metres_per_unit
    flat = joints.flatten(-2)[None, None]
    toes = layout.contact_joints[1::2]
    floor = float(joints[:, toes, 1].amin())
    lengths = bones_of((joints[:, 1:] - joints[:, :1]).flatten(-2), layout.skeleton).norm(dim=-1)
    values = {
        "joint_speed": speed(flat, layout.fps),
        "way": path_length(joints[:, 0, [0, 2]]),
        "jerk": jerk(flat, layout.fps),
        "bone_jitter": lengths.diff(dim=0).abs().mean(),
        "skate": foot_skate(joints.flatten(-2), toes, layout.fps, up="y", floor=floor),
    }
    return {name: float(value) for name, value in values.items()}


def claims_met(features: Float[Tensor, "T D"], clip: CaptionedClip, layout: FeatureLayout) -> dict[str, float]:
    """Which attributes of a clip's person a motion shows: 1 or 0 for each that its captions claim; none without attributes."""
    wanted = {name: clip.attributes[name] for name in CLAIMS if name in clip.attributes}
    if not wanted:
        return {}
    joints = joints_of(features.double(), layout).numpy() * layout.metres_per_unit
    found = measured_attributes(joints, layout.fps)
    return {name: float(found.get(name) == value) for name, value in wanted.items()}
