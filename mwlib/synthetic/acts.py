"""Actions of synthetic people with given attributes: how fast, where to, with which hand or foot, how often, how high."""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from mwlib.synthetic.movements import GAITS, PoseTrack, gait_pose, gesture_tracks, stand_pose
from mwlib.synthetic.person import AT, POSE, SIDES, Figure, PerFrame, Positions, draw_figure, figure_positions
from mwlib.synthetic.sentences import PAIRS, RECIPES, Attributes, actions_of, captions_of, completed, draw_attributes, read_table

RATE = 40.0  # frames per second at which poses are made; every second one is kept
LONGEST = 6.1  # seconds
GRAVITY = 9.81  # m/s2

_LARGEST_STEP = {"walk": 1.15, "run": 1.25, "march": 1.15}  # in usual steps: beyond it no leg reaches
_BEFORE = 12  # frames made before the clip and cut off


def air_time(height: float) -> float:
    """Seconds from take-off to landing of a jump that rises so many metres."""
    return float(2 * np.sqrt(2 * height / GRAVITY))


class Performance(PoseTrack):
    """What one person does in a clip, 40 frames a second, with nothing left to chance but what nobody does on purpose.

    Args:
        figure: who moves.
        rng: for what nobody does on purpose.
    """

    def __init__(self, figure: Figure, rng: np.random.Generator) -> None:
        super().__init__(figure.body, rng, int(LONGEST * RATE), _BEFORE, RATE)
        self.figure, self.travel = figure, np.zeros((len(self.time), 2))
        self._since, self._step = 0.0, 0.0  # when a foot swung past the other, and seconds until the other does

    def go(self, gait: str, at: float, speed: float | None = None, backward: bool = False) -> None:
        """Set off, or go on in another way, at this speed (m/s; None: steps of the usual size at the usual rate).

        Faster walkers take longer and more steps: both grow with a power of the speed, until the leg is too short.
        """
        kind, body = GAITS[gait], self.body
        usual = kind.cadence * kind.stride * body.leg * body.stride
        ratio = 1.0 if speed is None else speed / usual
        size = min(ratio**0.55, _LARGEST_STEP[gait] / body.stride)
        cadence = kind.cadence * ratio / size
        phase = kind.ahead + 0.5 * (self.rng.random() < 0.5) + (-1 if backward else 1) * cadence * (self.time - at)
        pose = gait_pose(kind, body, phase, size)
        self._since, self._step = at, 0.5 / cadence
        self.change_to(pose, at, self.rng.uniform(0.25, 0.4))

    def halt(self, at: float) -> float:
        """Stand from the next moment at which a foot swings past the other; returns when that is."""
        at = self._since + np.ceil((at - self._since) / self._step) * self._step
        self.change_to(stand_pose(), at, self.rng.uniform(0.25, 0.35))
        return at

    def turn(self, at: float, angle: float, seconds: float) -> None:
        """Change the heading by so many radians, to the left where positive."""
        self.heading += angle * self.rise(at, seconds)

    def gesture(
        self,
        name: str,
        near: str,
        at: float,
        seconds: float,
        onset: float,
        share: PerFrame | None = None,
        limbs: tuple[str, ...] = (),
        factor: float = 1.0,
    ) -> float:
        """Lay a gesture over whatever goes on; returns when it is over.

        Args:
            near: the acting side.
            seconds: until it is over.
            onset: seconds over which it takes over, and later lets go.
            share: how far it has come at every frame, 0 to 1; None: it passes once, evenly.
            limbs, factor: entries of the pose that end so, such as "hip_flex", and what to multiply them with.
        """
        entries, values = gesture_tracks(name, near, (self.time - at) / seconds if share is None else share)
        values[:, [POSE[entry].endswith(limbs) for entry in entries]] *= factor
        self.overlay(entries, values, at, seconds, onset)
        return at + seconds

    def fly(self, at: float, height: float, forward: float = 0.0) -> None:
        """Leave the floor at this moment, rise so high (metres), and go ahead at so many metres per second until it lands."""
        seconds = air_time(height)
        share = np.clip((self.time - at) / seconds, 0.0, 1.0)
        self.overlay([AT["lift"]], (4 * height * share * (1 - share))[:, None], at, seconds + 0.02, 0.02)
        ahead = np.stack([np.cos(self.heading), np.sin(self.heading)], axis=-1)
        self.travel += gaussian_filter1d(forward * seconds * share, 0.05 * RATE)[:, None] * ahead

    def film(self, seconds: float) -> Positions:
        """(T, 22, 3) metres from time 0 on, y up, 20 frames a second; the first frame stands over the origin and faces +z."""
        end = 2 * _BEFORE + int(round(seconds * RATE))
        pose = self.finished(end)
        heading = self.heading[:end] - self.heading[_BEFORE]
        positions = figure_positions(pose, heading, self.figure, RATE, self.travel[:end, None])[_BEFORE : end - _BEFORE + 1 : 2]
        return positions - positions[0, 0] * [1.0, 0.0, 1.0]


# from and to; the gaps keep the words apart
RANGES = read_table("""
slow walk: 0.45 0.68; normal walk: 0.95 1.25; fast walk: 1.5 1.8; backward walk: 0.5 0.8
slow run: 1.95 2.2; normal run: 2.6 2.95; fast run: 3.4 3.8
slow turn: 45 55; normal turn: 80 100; fast turn: 145 180
slow wave: 1 1.25; normal wave: 1.8 2.1; fast wave: 2.9 3.4
low jump: 0.07 0.12; normal jump: 0.22 0.29; high jump: 0.42 0.5
low kick: 0.46 0.58; normal kick: 0.88 1.02; high kick: 1.28 1.4
""")  # metres per second, degrees per second as the mean over the turn, hertz, metres, and of a kick at hip height


def act_out(attributes: Attributes, figure: Figure, rng: np.random.Generator) -> Positions:
    """Positions of a person who does what the attributes say, and nothing more.

    Args:
        attributes: "action" and, for a second one, "then"; what else there is says how: see `recipes`.
        figure: who does it.
        rng: for everything the attributes leave open: exact speed, when it begins, how long it lasts.

    Returns:
        (T, 22, 3) metres, y up, 20 frames a second, 41 to 121 frames, one more than a multiple of four.
    """
    clip, end = Performance(figure, rng), 0.0
    actions = actions_of(attributes)
    for action in actions:
        end = _ACTS[action](clip, end + (0.0 if action in _GOING else rng.uniform(0.2, 0.45)), attributes)
    end += 0.0 if actions[-1] in _GOING else rng.uniform(0.15, 0.4)
    return clip.film(np.clip(4 * np.ceil(end * 5), 40, 120) / 20)


def usual_seconds(said: Attributes) -> float:
    """How long people take for what a sentence says: the median of eleven, who do the rest as usual.

    Args:
        said: "action", and what else a sentence says, by the names and values of `RECIPES`.

    >>> usual_seconds({"action": "kick", "count": 1}), usual_seconds({"action": "kick", "count": 3})
    (2.0, 4.4)
    """
    streams = [np.random.default_rng(np.random.SeedSequence(0, spawn_key=(4, person))) for person in range(11)]
    return float(np.median([(len(act_out(completed(said, rng), draw_figure(rng), rng)) - 1) / 20 for rng in streams]))


TIMED = ("count", "degrees", "ends", "pace", "path")  # attributes on which it depends how long an action takes


def usual_times() -> dict[str, float]:
    """`usual_seconds` of all that a sentence may say: of "kick", "kick 2", "turn 180 slow", "walk then kick"."""
    found = {f"{first} then {then}": usual_seconds({"action": first, "then": then}) for first, then in PAIRS}
    for action, recipe in RECIPES.items():
        options = [["", *dict.fromkeys(recipe[name].split())] if name in recipe else [""] for name in TIMED]
        for values in product(*options):
            said = {name: int(v) if v.isdigit() else v for name, v in zip(TIMED, values, strict=True) if v}
            own = {"action": "walk", "direction": "backward"} if action == "backward" else {"action": action}
            found[" ".join([action, *filter(None, values)])] = usual_seconds(own | said)
    return found


def _drawn(clip: Performance, action: str, word: str | float) -> float:
    """A number within what a word claims of an action."""
    least, most = map(float, RANGES[f"{word} {action}"].split())
    return clip.rng.uniform(least, most)


def _go(clip: Performance, at: float, attributes: Attributes) -> float:
    """Walk or run: straight for a while before or after something else, or all the time along a path.

    Returns when the person stands, or the clip ends.
    """
    rng, first, path = clip.rng, at == 0.0, attributes.get("path", "straight")
    seconds = rng.uniform(1.7, 2.3) if "then" in attributes else 0.0
    action, backward = attributes["action" if first else "then"], attributes.get("direction") == "backward"
    speed = _drawn(clip, action, "backward" if backward else attributes.get("speed", "normal"))
    clip.go(action, -0.6 if first else at, speed, backward)
    if "then" in attributes:
        return clip.halt(at + seconds) if first else at + seconds
    side = SIDES.get(path.split("_")[0], 0.0)
    if path.endswith("circle"):
        seconds = rng.uniform(4.2, 5.8)
        clip.heading += side * np.deg2rad(rng.uniform(220.0, 350.0)) / seconds * clip.time
        return seconds
    seconds = rng.uniform(2.9, 5.0)
    if path.endswith("turn"):
        lasts = rng.uniform(0.8, 1.1)
        clip.turn(rng.uniform(0.7, seconds - lasts - 0.7), side * np.deg2rad(rng.uniform(60.0, 110.0)), lasts)
    return seconds


def _tempo(clip: Performance) -> float:
    """Factor on durations of this person, this time."""
    return clip.rng.uniform(0.92, 1.08) / clip.body.tempo


def _turn(clip: Performance, at: float, attributes: Attributes) -> float:
    degrees = attributes["degrees"] * clip.rng.uniform(0.92, 1.08)
    seconds = degrees / _drawn(clip, "turn", attributes.get("pace", "normal"))
    clip.go("march", at)
    clip.turn(at + 0.1, SIDES[attributes["turn"]] * np.deg2rad(degrees), seconds)
    return clip.halt(at + seconds)


def _jump(clip: Performance, at: float, attributes: Attributes) -> float:
    """Crouch, fly as long as gravity has it, land; several jumps share their crouches."""
    rng, tempo, start = clip.rng, _tempo(clip), at
    height = _drawn(clip, "jump", attributes.get("height", "normal"))
    forward = rng.uniform(1.1, 1.6) if attributes.get("direction") == "forward" else 0.0
    keys, shares, flights = [at], [0.0], []
    for _ in range(attributes["count"]):
        flights.append(at + 0.55 * tempo)
        landing = flights[-1] + air_time(height)
        at = landing + 0.42 * tempo
        keys += [flights[-1], landing, at]
        shares += [len(flights) - 1 + share for share in (0.33, 0.667, 1.0)]
    scale = np.clip((height / 0.27) ** 0.4, 0.7, 1.15)
    share = np.interp(clip.time, keys, shares)
    share = np.where(share < shares[-1], share % 1.0, 1.0)
    limbs = ("hip_flex", "knee", "arm_flex", "pelvis_pitch", "spine_pitch")
    clip.gesture("jump", "left", start, at - start, 0.2, share, limbs, scale)
    for flight in flights:
        clip.fly(flight, height, forward)
    return at


def _wave(clip: Performance, at: float, attributes: Attributes) -> float:
    """Raise a hand, or both, and swing it from the elbow at an even rate."""
    rng, hand = clip.rng, attributes["hand"]
    rate = _drawn(clip, "wave", attributes.get("pace", "normal"))
    seconds = max(rng.uniform(1.7, 2.2), 2.6 / rate)
    swing = np.deg2rad(86.0 + rng.uniform(20.0, 25.0) * np.sin(2 * np.pi * rate * (clip.time - at)))
    for side in SIDES if hand == "both" else (hand,):
        clip.gesture("wave", side, at, seconds, 0.4)
        clip.overlay([AT[f"{side}_elbow"]], swing[:, None], at, seconds, 0.4)
    return at + seconds


Act = Callable[[Performance, float, Attributes], float]  # who, from which second on, and how -> the second when it ends


def _repeated(name: str, seconds: float, side: str = "", onset: float = 0.15) -> Act:
    """An act that passes a gesture as often as claimed, on the side that the attribute of that name claims."""

    def act(clip: Performance, at: float, attributes: Attributes) -> float:
        """Act it from this second on; gives the second when it ends."""
        count = attributes["count"]
        lasts = seconds * _tempo(clip) * count
        share = np.clip((clip.time - at) / lasts, 0.0, 1.0) * count
        share = np.where(share < count, share % 1.0, 1.0)
        near = attributes.get(side, "left")
        factor = _drawn(clip, name, attributes["height"]) if name == "kick" else 1.0
        clip.gesture(name, near, at - onset, lasts + 2 * onset, onset, share, (f"{near}_hip_flex",), factor)
        return at + lasts + onset

    return act


def _once(name: str, seconds: float, side: str = "") -> Act:
    """An act that passes a gesture once, on the side that the attribute of that name claims."""

    def act(clip: Performance, at: float, attributes: Attributes) -> float:
        """Act it from this second on; gives the second when it ends."""
        return clip.gesture(name, attributes.get(side, "left"), at, seconds * _tempo(clip), 0.25)

    return act


def _reach(clip: Performance, at: float, attributes: Attributes) -> float:
    up = attributes["target"] == "up"
    seconds = clip.rng.uniform(1.5, 1.9) * _tempo(clip)
    return clip.gesture("reach" if up else "reach_forward", attributes["hand"], at, seconds, 0.25)


def _sit(clip: Performance, at: float, attributes: Attributes) -> float:
    """Sit down; get up again or stay seated until the clip ends."""
    seconds = 3.2 * _tempo(clip)
    if attributes["ends"] == "standing":
        return clip.gesture("sit", "left", at, seconds, 0.3)
    share = np.clip((clip.time - at) / seconds, 0.0, 0.5)
    clip.gesture("sit", "left", at, 20.0, 0.3, share)
    return at + clip.rng.uniform(0.42, 0.55) * seconds


def _stand(clip: Performance, at: float, attributes: Attributes) -> float:
    """Do nothing; the arms hang as they happen to."""
    hanging = [AT[f"{side}_{limb}"] for side in SIDES for limb in ("arm_flex", "arm_abd", "elbow")]
    arms = stand_pose()[hanging] + np.deg2rad(clip.rng.normal(0.0, 3.0, len(hanging)))
    seconds = clip.rng.uniform(1.4, 3.0)
    clip.overlay(hanging, arms, at, seconds, 0.4)
    return at + seconds


_GOING = ("walk", "run")
_ACTS: dict[str, Act] = {
    **dict.fromkeys(_GOING, _go),
    "turn": _turn,
    "jump": _jump,
    "wave": _wave,
    "kick": _repeated("kick", 1.15, "foot"),
    "squat": _repeated("squat", 1.3),
    "box": _repeated("punch", 0.62, "hand", 0.3),
    "bow": _once("bow", 2.0),
    "pick_up": _once("pick_up", 2.1, "hand"),
    "reach": _reach,
    "sit": _sit,
    "stand": _stand,
}


PEOPLE = 60
# people in turns of twenty: 80, 5 and 15 of 100 are for training, validation and test
_SPLITS = ("train",) * 16 + ("val",) + ("test",) * 3


class ActedClip(NamedTuple):
    """One clip of a synthetic person as joint positions, and what it shows.

    Args:
        positions: (T, 22, 3) metres, y up, 20 frames a second, 41 to 121 of them; starts above the origin and faces +z.
        captions: three sentences.
        attributes: as `draw_attributes` gives them.
        name: "P7_0127": the person, the number of the clip.
        split: "train", "val" or "test".
    """

    positions: Positions
    captions: tuple[str, ...]
    attributes: Attributes
    name: str
    split: str


def captioned_positions(clips: int = 2400, seed: int = 0) -> list[ActedClip]:
    """Clips of synthetic people with sentences and true attributes, as positions.

    Sixty people take turns. Nobody is in two splits; about 80, 5 and 15 of 100 clips are "train", "val" and "test". A clip
    depends on the seed and its number only, not on how many others are made.

    Own choice throughout: the papers use recorded motion, which cannot be redistributed.

    Raises:
        ValueError: fewer than one clip.
    """
    if clips < 1:
        raise ValueError(f"clips is {clips}; expected at least 1")
    return [_clip(number, seed) for number in range(clips)]


def _clip(number: int, seed: int) -> ActedClip:
    person = number % PEOPLE
    figure = draw_figure(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, person))))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, number)))
    attributes = draw_attributes(rng)
    captions = captions_of(attributes, rng)
    name = f"P{person + 1}_{number:04d}"
    return ActedClip(act_out(attributes, figure, rng), captions, attributes, name, _SPLITS[person % len(_SPLITS)])
