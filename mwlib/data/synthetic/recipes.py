"""Which action a captioned clip shows, and its attributes."""

from __future__ import annotations

import numpy as np

# attribute -> values it may have, of which one is drawn; a value named twice is twice as likely
_WALK = {"path": "straight left_circle right_circle left_turn right_turn", "speed": "slow normal fast"}
RECIPES: dict[str, dict[str, str]] = {
    "walk": _WALK,
    "run": _WALK,
    "backward": {"direction": "backward"},
    "jump": {"count": "1 2 3", "height": "low normal high", "direction": "in_place in_place forward"},
    "turn": {"turn": "left right", "degrees": "90 180", "pace": "slow normal fast"},
    "wave": {"hand": "left right left right both", "pace": "slow normal fast"},
    "kick": {"foot": "left right", "count": "1 2 3", "height": "low normal high"},
    "box": {"hand": "left right", "count": "1 2 3"},
    "pick_up": {"hand": "left right"},
    "reach": {"hand": "left right", "target": "up forward"},
    "sit": {"ends": "seated standing"},
    "squat": {"count": "1 2 3"},
    "bow": {},
    "stand": {},
}
WEIGHTS = dict(
    walk=20, run=14, backward=2, jump=9, turn=8, wave=8, kick=9, box=5, pick_up=4, reach=5, sit=4, squat=4, bow=2, stand=2
)
PAIRS = (  # one action, then another; at most one of them has a side
    *(("walk", then) for then in ("wave", "kick", "jump", "turn", "pick_up", "sit", "squat", "bow", "reach", "box", "stand")),
    *(("run", then) for then in ("jump", "stand", "turn", "wave")),
    *((first, "walk") for first in ("wave", "kick", "jump", "turn", "pick_up", "squat", "bow")),
    *(("turn", then) for then in ("wave", "jump", "bow")),
    *((first, "wave") for first in ("jump", "squat", "bow")),
    ("wave", "sit"), ("jump", "kick"), ("wave", "jump"),
)  # fmt: skip
SHARE_OF_PAIRS = 0.25
_IN_A_PAIR = {"count": "1", "height": "normal", "direction": "in_place", "path": "straight", "pace": "normal", "ends": "seated"}
_NUMBERS = {"count": int, "degrees": float}


def draw_attributes(rng: np.random.Generator) -> dict[str, str | float]:
    """What one clip shows: "action", perhaps "then", and how, by the names and values of `RECIPES`.

    In a clip of two actions everything is normal and happens once, but for the speed of walking.
    """
    pair = rng.random() < SHARE_OF_PAIRS
    if pair:
        actions = PAIRS[rng.integers(len(PAIRS))]
    else:
        weights = np.array(list(WEIGHTS.values()), float)
        actions = (str(rng.choice(list(WEIGHTS), p=weights / weights.sum())),)
    attributes: dict[str, str | float] = {"action": "walk" if actions[0] == "backward" else actions[0]}
    if pair:
        attributes["then"] = actions[-1]
    for action in actions:
        for name, values in RECIPES[action].items():
            value = str(rng.choice((_IN_A_PAIR.get(name, values) if pair else values).split()))
            attributes[name] = _NUMBERS.get(name, str)(value)
    return attributes
