"""Actions of synthetic people with stated attributes: how fast, where to, with which hand or foot, how often, how high."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

from mwlib.data.synthetic.figure import Figure
from mwlib.data.synthetic.gestures import stand_pose
from mwlib.data.synthetic.person import AT, SIDES
from mwlib.data.synthetic.stage import Stage, air_time

Attributes = Mapping[str, str | float]

SPEEDS = {  # metres per second, from and to; the gaps keep the words apart
    ("walk", "slow"): (0.45, 0.68), ("walk", "normal"): (0.95, 1.25), ("walk", "fast"): (1.5, 1.8),
    ("run", "slow"): (1.95, 2.2), ("run", "normal"): (2.6, 2.95), ("run", "fast"): (3.4, 3.8),
}  # fmt: skip
BACKWARD = (0.5, 0.8)  # metres per second
TURN_RATES = {"slow": (45.0, 55.0), "normal": (80.0, 100.0), "fast": (145.0, 180.0)}  # degrees per second, mean over the turn
WAVE_RATES = {"slow": (1.0, 1.25), "normal": (1.8, 2.1), "fast": (2.9, 3.4)}  # hertz
JUMP_HEIGHTS = {"low": (0.07, 0.12), "normal": (0.22, 0.29), "high": (0.42, 0.5)}  # metres
KICK_SCALES = {"low": (0.46, 0.58), "normal": (0.88, 1.02), "high": (1.28, 1.4)}  # of a kick at hip height
_TO_THE = {"left": 1.0, "right": -1.0}


def act_out(attributes: Attributes, figure: Figure, rng: np.random.Generator) -> Float[np.ndarray, "T 22 3"]:
    """Positions of a person who does what the attributes say, and nothing more.

    Args:
        attributes: "action" and, for a second one, "then"; what else there is says how: see `recipes`.
        figure: who does it.
        rng: for everything the attributes leave open: exact speed, when it begins, how long it lasts.

    Returns:
        Positions, metres, y up, 20 frames a second, 41 to 121 frames, one more than a multiple of four.
    """
    stage = Stage(figure, rng)
    actions = [str(attributes[key]) for key in ("action", "then") if key in attributes]
    if len(actions) == 1 and actions[0] in ("walk", "run"):
        end = _travel(stage, attributes)
    else:
        end = 0.0
        for number, action in enumerate(actions):
            moving = action in ("walk", "run")
            if not moving:
                end += rng.uniform(0.2, 0.45)
            end = _ACTS[action](stage, end, attributes) if not moving else _leg(stage, end, action, attributes, number == 0)
        end += 0.0 if actions[-1] in ("walk", "run") else rng.uniform(0.15, 0.4)
    return stage.film(np.clip(4 * np.ceil(end * 5), 40, 120) / 20)


def _speed(stage: Stage, action: str, attributes: Attributes) -> float:
    """Metres per second within what the attributes claim."""
    claimed = (action, str(attributes.get("speed", "normal")))
    return stage.rng.uniform(*(BACKWARD if attributes.get("direction") == "backward" else SPEEDS[claimed]))


def _travel(stage: Stage, attributes: Attributes) -> float:
    """Walk or run all the time, along a path; returns when the clip ends."""
    rng, action, path = stage.rng, str(attributes["action"]), str(attributes.get("path", "straight"))
    speed = _speed(stage, action, attributes)
    stage.go(action, -0.6, speed, attributes.get("direction") == "backward")  # type: ignore[arg-type]
    side = _TO_THE.get(path.split("_")[0], 0.0)
    if path.endswith("circle"):
        seconds = rng.uniform(4.2, 5.8)
        stage.curve(side * np.deg2rad(rng.uniform(220.0, 350.0)) / seconds)
        return seconds
    seconds = rng.uniform(2.9, 5.0)
    if path.endswith("turn"):
        lasts = rng.uniform(0.8, 1.1)
        stage.turn(rng.uniform(0.7, seconds - lasts - 0.7), side * np.deg2rad(rng.uniform(60.0, 110.0)), lasts)
    return seconds


def _leg(stage: Stage, at: float, action: str, attributes: Attributes, first: bool) -> float:
    """Walk or run straight for a while before or after something else; returns when the person stands, or the clip ends."""
    seconds = stage.rng.uniform(1.7, 2.3)
    if first:
        stage.go(action, -0.6, _speed(stage, action, attributes))  # type: ignore[arg-type]
        return stage.halt(at + seconds)
    stage.go(action, at, _speed(stage, action, attributes))  # type: ignore[arg-type]
    return at + seconds


def _tempo(stage: Stage) -> float:
    """Factor on durations of this person, this time."""
    return stage.rng.uniform(0.92, 1.08) / stage.body.tempo


def _turn(stage: Stage, at: float, attributes: Attributes) -> float:
    degrees = float(attributes["degrees"]) * stage.rng.uniform(0.92, 1.08)
    seconds = degrees / stage.rng.uniform(*TURN_RATES[str(attributes.get("pace", "normal"))])
    stage.go("march", at)
    stage.turn(at + 0.1, _TO_THE[str(attributes["turn"])] * np.deg2rad(degrees), seconds)
    return stage.halt(at + seconds)


def _jump(stage: Stage, at: float, attributes: Attributes) -> float:
    """Crouch, fly as long as gravity has it, land; several jumps share their crouches."""
    rng, tempo, start = stage.rng, _tempo(stage), at
    height = rng.uniform(*JUMP_HEIGHTS[str(attributes.get("height", "normal"))])
    forward = rng.uniform(1.1, 1.6) if attributes.get("direction") == "forward" else 0.0
    keys, shares, flights = [at], [0.0], []
    for _ in range(int(attributes["count"])):
        flights.append(at + 0.55 * tempo)
        landing = flights[-1] + air_time(height)
        at = landing + 0.42 * tempo
        keys += [flights[-1], landing, at]
        shares += [len(flights) - 1 + share for share in (0.33, 0.667, 1.0)]
    scale = np.clip((height / 0.27) ** 0.4, 0.7, 1.15)
    share = np.interp(stage.time, keys, shares)
    share = np.where(share < shares[-1], share % 1.0, 1.0)
    limbs = ("hip_flex", "knee", "arm_flex", "pelvis_pitch", "spine_pitch")
    stage.gesture("jump", "left", start, at - start, 0.2, share, dict.fromkeys(limbs, scale))
    for flight in flights:
        stage.fly(flight, height, forward)
    return at


def _wave(stage: Stage, at: float, attributes: Attributes) -> float:
    """Raise a hand, or both, and swing it from the elbow at an even rate."""
    rng, hand = stage.rng, str(attributes["hand"])
    rate = rng.uniform(*WAVE_RATES[str(attributes.get("pace", "normal"))])
    seconds = max(rng.uniform(1.7, 2.2), 2.6 / rate)
    swing = np.deg2rad(86.0 + rng.uniform(20.0, 25.0) * np.sin(2 * np.pi * rate * (stage.time - at)))
    for side in _hands(hand):
        stage.gesture("wave", side, at, seconds, 0.4)
        stage.overlay([AT[f"{side}_elbow"]], swing[:, None], at, seconds, 0.4)
    return at + seconds


def _hands(hand: str) -> tuple[str, ...]:
    return tuple(SIDES) if hand == "both" else (hand,)


def _repeated(name: str, seconds: float, side: str = "", onset: float = 0.15) -> Callable:
    """An act that passes a gesture as often as claimed, on the side that the attribute of that name claims."""

    def act(stage: Stage, at: float, attributes: Attributes) -> float:
        count = int(attributes["count"])
        lasts = seconds * _tempo(stage) * count
        share = np.clip((stage.time - at) / lasts, 0.0, 1.0) * count
        share = np.where(share < count, share % 1.0, 1.0)
        scale = {"near_hip_flex": stage.rng.uniform(*KICK_SCALES[str(attributes["height"])])} if name == "kick" else None
        stage.gesture(name, str(attributes.get(side, "left")), at - onset, lasts + 2 * onset, onset, share, scale)
        return at + lasts + onset

    return act


def _once(name: str, seconds: float, side: str = "") -> Callable:
    """An act that passes a gesture once, on the side that the attribute of that name claims."""

    def act(stage: Stage, at: float, attributes: Attributes) -> float:
        lasts = seconds * _tempo(stage)
        stage.gesture(name, str(attributes.get(side, "left")), at, lasts, 0.25)
        return at + lasts

    return act


def _reach(stage: Stage, at: float, attributes: Attributes) -> float:
    up = attributes["target"] == "up"
    seconds = stage.rng.uniform(1.5, 1.9) * _tempo(stage)
    stage.gesture("reach" if up else "reach_forward", str(attributes["hand"]), at, seconds, 0.25)
    return at + seconds


def _sit(stage: Stage, at: float, attributes: Attributes) -> float:
    """Sit down; get up again or stay seated until the clip ends."""
    seconds = 3.2 * _tempo(stage)
    if attributes["ends"] == "standing":
        stage.gesture("sit", "left", at, seconds, 0.3)
        return at + seconds
    share = np.clip((stage.time - at) / seconds, 0.0, 0.5)
    stage.gesture("sit", "left", at, 20.0, 0.3, share)
    return at + stage.rng.uniform(0.42, 0.55) * seconds


def _stand(stage: Stage, at: float, attributes: Attributes) -> float:
    """Do nothing; the arms hang as they happen to."""
    hanging = [AT[f"{side}_{limb}"] for side in SIDES for limb in ("arm_flex", "arm_abd", "elbow")]
    arms = stand_pose()[hanging] + np.deg2rad(stage.rng.normal(0.0, 3.0, len(hanging)))
    seconds = stage.rng.uniform(1.4, 3.0)
    stage.overlay(hanging, np.tile(arms, (len(stage.time), 1)), at, seconds, 0.4)
    return at + seconds


_ACTS: dict[str, Callable[[Stage, float, Attributes], float]] = {
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
