"""Sentences about synthetic people: a small context-free grammar with several ways to say the same.

A rule lists its alternatives, parted by bars. `<name>` stands for an alternative of the rule of that name or, if there is none,
of the rule "name-value" by the clip's value of an attribute; `{attribute}` stands for the value itself. A clip's sentence is a
subject and an alternative of the rule of its action.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

RULES = {
    "subject": "a person | someone | somebody | a man | a woman | a human | the person | the figure | an adult",
    "two": "<action> and then <then> | <action> then <then> | first <action> and afterwards <then> | "
    "<action> and after that <then>",
    # walking and running
    "walk-slow": "walks slowly <path> | strolls <path> | ambles <path> | is walking slowly <path> | "
    "walks <path> at a slow pace | slowly walks <path> | walks unhurriedly <path>",
    "walk-normal": "walks <path> | is walking <path> | walks <path> at a normal pace | steps <path> | "
    "walks <path> at a medium speed",
    "walk-fast": "walks quickly <path> | walks briskly <path> | is walking fast <path> | "
    "strides quickly <path> | walks <path> at a fast pace | walks rapidly <path>",
    "walk-backward": "walks backward | walks backwards | steps backwards | is walking backward | moves backwards step by step",
    "run-slow": "jogs <path> | trots <path> | runs slowly <path> | is jogging <path> | runs <path> at a slow pace",
    "run-normal": "runs <path> | is running <path> | runs <path> at a normal pace | runs <path> at a medium speed",
    "run-fast": "sprints <path> | runs fast <path> | dashes <path> | is running very quickly <path> | runs <path> at full speed",
    "path-straight": "forward | ahead | straight ahead | straight forward | in a straight line | forwards",
    "path-left_circle": "<round> to the left | in a counterclockwise circle | around in a counterclockwise loop",
    "path-right_circle": "<round> to the right | in a clockwise circle | around in a clockwise loop",
    "round": "in a circle | in a loop | around in a circle",
    "path-left_turn": "<ahead> and <bends> left | <ahead> and <bends> to the left",
    "path-right_turn": "<ahead> and <bends> right | <ahead> and <bends> to the right",
    "ahead": "forward | ahead",
    "bends": "turns | veers | curves",
    # turning on the spot
    "turn": "<pace> <angle>",
    "angle-90": "turns ninety degrees to the {turn} | rotates ninety degrees to the {turn} | "
    "makes a quarter turn to the {turn} | does a quarter turn {turn}",
    "angle-180": "turns around to the {turn} | makes a half turn to the {turn} | rotates halfway around to the {turn} | "
    "turns around over the {turn} shoulder",
    "pace-slow": "slowly | unhurriedly",
    "pace-normal": "",
    "pace-fast": "quickly | rapidly | swiftly",
    # hands
    "wave": "<pace> waves with <hand> | <pace> waves <hand> | raises <hand> and waves <pace> | "
    "lifts <hand> and <pace> waves hello | is waving <pace> with <hand> | <pace> greets with <hand>",
    "hand-left": "the left hand | the left arm",
    "hand-right": "the right hand | the right arm",
    "hand-both": "both hands | both arms",
    "box": "punches <times> with the {hand} <fist> | throws <punches> with the {hand} <fist> | "
    "boxes with the {hand} <fist> <times> | strikes <times> with the {hand} <fist>",
    "fist": "hand | fist | arm",
    "punches-1": "a punch | one punch | a single punch",
    "punches-2": "two punches",
    "punches-3": "three punches",
    "pick_up": "picks up <thing> with the {hand} hand | picks <thing> up from the <floor> with the {hand} hand | "
    "bends down and grabs <thing> with the {hand} hand | lifts <thing> off the <floor> with the {hand} hand | "
    "takes <thing> from the <floor> with the {hand} hand",
    "thing": "something | an object | an item",
    "floor": "floor | ground",
    "reach-up": "reaches up with <hand> | stretches <hand> upward | reaches overhead with <hand> | "
    "extends <hand> up high | reaches upward with <hand>",
    "reach-forward": "reaches forward with <hand> | stretches <hand> out in front | extends <hand> forward | "
    "reaches ahead with <hand> | holds <hand> out forward",
    # legs
    "kick": "kicks <height> with the {foot} <foot> <times> | kicks <height> <times> with the {foot} <foot> | "
    "makes <number> <size> <kicks> with the {foot} <foot> | "
    "does <number> <size> <kicks> with the {foot} <foot>",
    "foot": "foot | leg",
    "kicks-1": "kick",
    "kicks-2": "kicks",
    "kicks-3": "kicks",
    "height-low": "low | near the <floor>",
    "height-normal": "",
    "height-high": "high | up high",
    "size-low": "low | small",
    "size-normal": "",
    "size-high": "high | big",
    "number-1": "one",
    "number-2": "two",
    "number-3": "three",
    "times-1": "once | one time",
    "times-2": "twice | two times",
    "times-3": "three times | thrice",
    "jump": "<jumps> <along> <times>",
    "jumps-low": "jumps low | makes small jumps | hops a little | makes little hops",
    "jumps-normal": "jumps | is jumping | hops",
    "jumps-high": "jumps high | leaps high | makes big jumps | leaps up high",
    "along-in_place": "in place | on the spot",
    "along-forward": "forward | ahead | forwards",
    "squat": "squats <times> | crouches down <times> | does <number> <squats> | bends the knees deeply <times>",
    "squats-1": "squat | knee bend",
    "squats-2": "squats | knee bends",
    "squats-3": "squats | knee bends",
    # the whole body
    "sit-seated": "sits down | takes a seat | sits down on a chair | lowers onto a chair | sits down and remains seated",
    "sit-standing": "sits down and stands up again | sits down and gets back up | takes a seat and gets up again | "
    "sits on a chair and rises again",
    "bow": "bows | takes a bow | bends forward at the waist | leans the upper body forward | bows down politely",
    "stand": "stands still | stands in place | remains standing | is standing still | does not move | stands motionless",
}
CAPTIONS = 3
# the attributes, the first that a clip has, by which a rule is chosen whose name is not that of the attribute
_CHOSEN_BY = {
    "walk": ("speed", "direction"), "run": ("speed",), "angle": ("degrees",), "reach": ("target",), "sit": ("ends",),
    "jumps": ("height",), "size": ("height",), "along": ("direction",),
    **dict.fromkeys(("times", "number", "punches", "kicks", "squats"), ("count",)),
}  # fmt: skip
_SLOT = re.compile(r"<(\w+)>")


def captions_of(attributes: Mapping[str, str | float], rng: np.random.Generator) -> tuple[str, str, str]:
    """Three different sentences that describe a clip with these attributes: lower case, words parted by single spaces.

    Args:
        attributes: as `draw_attributes` gives them.
        rng: which alternatives are taken.
    """
    found: dict[str, None] = {}
    while len(found) < CAPTIONS:
        found[_sentence("<subject> <two>" if "then" in attributes else "<subject> <action>", attributes, rng)] = None
    first, second, third = found
    return first, second, third


def vocabulary() -> tuple[str, ...]:
    """All words that a caption may hold, in alphabetical order."""
    words = {word for text in RULES.values() for word in _SLOT.sub(" ", text).replace("|", " ").split()}
    return tuple(sorted({word for word in words if word[0] != "{"} | {"left", "right"}))  # sides alone are said as they are


def _sentence(text: str, attributes: Mapping[str, str | float], rng: np.random.Generator) -> str:
    """Replace slot after slot by one of its alternatives."""
    while slot := _SLOT.search(text):
        options = RULES[_rule(slot[1], attributes)].split("|")
        text = text[: slot.start()] + options[rng.integers(len(options))] + text[slot.end() :]
    return " ".join(text.format(**attributes).split())


def _rule(slot: str, attributes: Mapping[str, str | float]) -> str:
    """The rule that fills a slot."""
    slot = str(attributes[slot]) if slot in ("action", "then") else slot
    if slot in RULES:
        return slot
    value = next(attributes[name] for name in _CHOSEN_BY.get(slot, (slot,)) if name in attributes)
    return f"{slot}-{value:g}" if isinstance(value, float | int) else f"{slot}-{value}"
