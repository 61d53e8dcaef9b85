"""Sentences about synthetic people: a small context-free grammar with several ways to say the same.

A rule lists its alternatives, parted by bars. `<rule>` stands for an alternative of that rule; `{attribute}` inside is the clip's
own value of it. A clip's sentence is an alternative of the rule of its action, after a subject.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np

RULES = {
    "subject": "a person | someone | somebody | a man | a woman | a human | the person | the figure | an adult",
    "two": "<first> and then <second> | <first> then <second> | first <first> and afterwards <second> | <first> and after that <second>",
    # walking and running
    "walk": "<walk-{speed}>",
    "walk-slow": "walks slowly <path-{path}> | strolls <path-{path}> | ambles <path-{path}> | is walking slowly <path-{path}> | "
    "walks <path-{path}> at a slow pace | slowly walks <path-{path}> | walks unhurriedly <path-{path}>",
    "walk-normal": "walks <path-{path}> | is walking <path-{path}> | walks <path-{path}> at a normal pace | steps <path-{path}> | "
    "walks <path-{path}> at a medium speed",
    "walk-fast": "walks quickly <path-{path}> | walks briskly <path-{path}> | is walking fast <path-{path}> | "
    "strides quickly <path-{path}> | walks <path-{path}> at a fast pace | walks rapidly <path-{path}>",
    "walk-backward": "walks backward | walks backwards | steps backwards | is walking backward | moves backwards step by step",
    "run": "<run-{speed}>",
    "run-slow": "jogs <path-{path}> | trots <path-{path}> | runs slowly <path-{path}> | is jogging <path-{path}> | runs <path-{path}> at a slow pace",
    "run-normal": "runs <path-{path}> | is running <path-{path}> | runs <path-{path}> at a normal pace | "
    "runs <path-{path}> at a medium speed",
    "run-fast": "sprints <path-{path}> | runs fast <path-{path}> | dashes <path-{path}> | is running very quickly <path-{path}> | "
    "runs <path-{path}> at full speed",
    "path-straight": "forward | ahead | straight ahead | straight forward | in a straight line | forwards",
    "path-left_circle": "<round> to the left | in a counterclockwise circle | around in a counterclockwise loop",
    "path-right_circle": "<round> to the right | in a clockwise circle | around in a clockwise loop",
    "round": "in a circle | in a loop | around in a circle",
    "path-left_turn": "<ahead> and <bends> left | <ahead> and <bends> to the left",
    "path-right_turn": "<ahead> and <bends> right | <ahead> and <bends> to the right",
    "ahead": "forward | ahead",
    "bends": "turns | veers | curves",
    # turning on the spot
    "turn": "<pace-{pace}> <turn-{degrees}>",
    "turn-90": "turns ninety degrees to the {turn} | rotates ninety degrees to the {turn} | makes a quarter turn to the {turn} | "
    "does a quarter turn {turn}",
    "turn-180": "turns around to the {turn} | makes a half turn to the {turn} | rotates halfway around to the {turn} | "
    "turns around over the {turn} shoulder",
    "pace-slow": "slowly | unhurriedly",
    "pace-normal": "",
    "pace-fast": "quickly | rapidly | swiftly",
    # hands
    "wave": "<pace-{pace}> waves with <hand-{hand}> | <pace-{pace}> waves <hand-{hand}> | raises <hand-{hand}> and waves <pace-{pace}> | "
    "lifts <hand-{hand}> and <pace-{pace}> waves hello | is waving <pace-{pace}> with <hand-{hand}> | <pace-{pace}> greets with <hand-{hand}>",
    "hand-left": "the left hand | the left arm",
    "hand-right": "the right hand | the right arm",
    "hand-both": "both hands | both arms",
    "box": "punches <times-{count}> with the {hand} <fist> | throws <punches-{count}> with the {hand} <fist> | "
    "boxes with the {hand} <fist> <times-{count}> | strikes <times-{count}> with the {hand} <fist>",
    "fist": "hand | fist | arm",
    "punches-1": "a punch | one punch | a single punch",
    "punches-2": "two punches",
    "punches-3": "three punches",
    "pick_up": "picks up <thing> with the {hand} hand | picks <thing> up from the <floor> with the {hand} hand | "
    "bends down and grabs <thing> with the {hand} hand | lifts <thing> off the <floor> with the {hand} hand | "
    "takes <thing> from the <floor> with the {hand} hand",
    "thing": "something | an object | an item",
    "floor": "floor | ground",
    "reach": "<reach-{target}>",
    "reach-up": "reaches up with <hand-{hand}> | stretches <hand-{hand}> upward | reaches overhead with <hand-{hand}> | "
    "extends <hand-{hand}> up high | reaches upward with <hand-{hand}>",
    "reach-forward": "reaches forward with <hand-{hand}> | stretches <hand-{hand}> out in front | extends <hand-{hand}> forward | "
    "reaches ahead with <hand-{hand}> | holds <hand-{hand}> out forward",
    # legs
    "kick": "kicks <height-{height}> with the {foot} <foot> <times-{count}> | <times-{count}> kicks <height-{height}> with the {foot} <foot> | "
    "makes <number-{count}> <size-{height}> <kicks-{count}> with the {foot} <foot> | "
    "does <number-{count}> <size-{height}> <kicks-{count}> with the {foot} <foot>",
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
    "jump": "<jump-{height}> <along-{direction}> <times-{count}>",
    "jump-low": "jumps low | makes small jumps | hops a little | makes little hops",
    "jump-normal": "jumps | is jumping | hops",
    "jump-high": "jumps high | leaps high | makes big jumps | leaps up high",
    "along-in_place": "in place | on the spot",
    "along-forward": "forward | ahead | forwards",
    "squat": "squats <times-{count}> | crouches down <times-{count}> | does <number-{count}> <squats-{count}> | "
    "bends the knees deeply <times-{count}>",
    "squats-1": "squat | knee bend",
    "squats-2": "squats | knee bends",
    "squats-3": "squats | knee bends",
    # the whole body
    "sit": "<sit-{ends}>",
    "sit-seated": "sits down | takes a seat | sits down on a chair | lowers onto a chair | sits down and remains seated",
    "sit-standing": "sits down and stands up again | sits down and gets back up | takes a seat and gets up again | "
    "sits on a chair and rises again",
    "bow": "bows | takes a bow | bends forward at the waist | leans the upper body forward | bows down politely",
    "stand": "stands still | stands in place | remains standing | is standing still | does not move | stands motionless",
}
CAPTIONS = 3
_SLOT = re.compile(r"<([^>]+)>")


def _rule(name: str, attributes: Mapping[str, str | float]) -> str:
    """The rule of an action; walking backward has its own."""
    backward = name == "walk" and attributes.get("direction") == "backward"
    return "walk-backward" if backward else name


def _filled(text: str, attributes: Mapping[str, str | float]) -> str:
    values = {key: f"{value:g}" if isinstance(value, float | int) else value for key, value in attributes.items()}
    if "then" in attributes:
        first, second = (_rule(str(attributes[key]), attributes) for key in ("action", "then"))
        text = text.replace("<first>", f"<{first}>").replace("<second>", f"<{second}>")
    return text.format(**values)


def _sentence(text: str, attributes: Mapping[str, str | float], rng: np.random.Generator) -> str:
    """Replace slot after slot by one of its alternatives."""
    while slot := _SLOT.search(text):
        options = [option.strip() for option in RULES[slot[1]].split("|")]
        text = text[: slot.start()] + _filled(options[rng.integers(len(options))], attributes) + text[slot.end() :]
    return " ".join(text.split())


def captions_of(attributes: Mapping[str, str | float], rng: np.random.Generator) -> tuple[str, str, str]:
    """Three different sentences that describe a clip with these attributes: lower case, words parted by single spaces.

    Args:
        attributes: as `draw_attributes` gives them.
        rng: which alternatives are taken.
    """
    rule = "two" if "then" in attributes else _rule(str(attributes["action"]), attributes)
    found: dict[str, None] = {}
    while len(found) < CAPTIONS:
        found[_sentence(f"<subject> <{rule}>", attributes, rng)] = None
    first, second, third = found
    return first, second, third


def vocabulary() -> tuple[str, ...]:
    """All words that a caption may hold, in alphabetical order."""
    return tuple(sorted({word for text in RULES.values() for word in _words(text)}))


def _words(text: str) -> Iterator[str]:
    """Words of a rule; an attribute in braces stands for the two sides, the only values that are said as they are."""
    sides = ("left", "right")
    bare = _SLOT.sub(" ", text).replace("|", " ").split()
    for word, side in product(bare, sides):
        yield side if word.startswith("{") else word
