"""Synonyms for the words of the captions, to ask how far a small change of wording changes what a model makes of a sentence.

Sides, numbers and negations are in no list: a sentence with other words keeps its meaning.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np

Kind = Literal["seen", "held_out", "nonsense"]


class Synonyms(NamedTuple):
    """What may stand in a word's place.

    Args:
        seen: words of the grammar: whoever learns from the captions meets them.
        held_out: words of the same meaning that no caption holds.
        nonsense: no word at all: a sentence that holds it says less.
    """

    seen: tuple[str, ...]
    held_out: tuple[str, ...]
    nonsense: tuple[str, ...]


_TABLE = """
person: human, figure, adult | individual, pedestrian | blenk
someone: somebody | anyone, anybody | trovul
somebody: someone | anyone, anybody | trovim
human: person, figure | individual, mortal | quabbin
man: person, human | guy, gentleman | dorvic
woman: person, human | lady, female | sarnel
figure: person, human | character, silhouette | plimber
adult: person, human | individual, citizen | wuggen
walks: steps | paces, marches, treads | flomps
steps: walks | paces, marches, treads | grindles
strolls: ambles | saunters, wanders | vunders
ambles: strolls | saunters, wanders | mardles
strides: walks | marches, paces | brastes
jogs: trots | lopes | morfs
trots: jogs | lopes | zelters
sprints: dashes | races, bolts, darts | kreels
dashes: sprints | races, bolts, darts | taffles
slowly: unhurriedly | leisurely, sluggishly | narbly
unhurriedly: slowly | leisurely, calmly | posterly
quickly: rapidly, swiftly | speedily, hastily | glanterly
rapidly: quickly, swiftly | speedily, hastily | fuskily
swiftly: quickly, rapidly | speedily, hurriedly | drennily
briskly: quickly, rapidly | energetically, hastily | yorbly
normal: medium | ordinary, regular | stendle
medium: normal | moderate, average | tolmic
pace: speed | rate, tempo | gurn
speed: pace | rate, velocity | plash
forward: ahead, forwards | onward, onwards | wexward
forwards: forward, ahead | onward, onwards | lomward
ahead: forward, forwards | onward, onwards | tunder
backward: backwards | rearward, rearwards | unkward
backwards: backward | rearward, rearwards | ostward
circle: loop | ring, orbit | brindle
loop: circle | ring, orbit | snarf
turns: rotates | pivots, swivels | yindles
veers: curves | swerves, bears | hosks
curves: veers | swerves, arcs | malders
rotates: turns | pivots, swivels | quenders
makes: does | performs, executes | bliffs
punches: strikes | jabs, hits | gronks
strikes: punches | jabs, hits | verbs
fist: hand, arm | knuckles | clorp
hand: arm | palm | dimmel
hands: arms | palms | dimmels
arm: hand | limb | stoob
foot: leg | heel, shoe | prask
leg: foot | limb, shin | tarb
object: item | article, artifact | wobble
item: object | article, artifact | krobe
grabs: takes, lifts | grasps, fetches | shlurms
floor: ground | flooring, surface | maglow
ground: floor | earth, surface | pelmer
raises: lifts | hoists, elevates | corvels
lifts: raises | hoists, elevates | jabbles
extends: stretches | straightens, unfolds | vimps
stretches: extends | straightens, unfolds | roffles
upward: up | skyward, upwards | gleever
jumps: hops | bounces, bounds, springs | snarks
hops: jumps | bounces, bounds, springs | brillets
still: motionless | immobile, unmoving | dabe
"""


def _read(table: str) -> dict[str, Synonyms]:
    """Lines of "word: seen | held out | nonsense", each a list parted by commas."""
    entries = (line.split(": ") for line in table.strip().splitlines())
    return {word: Synonyms(*(tuple(part.strip().split(", ")) for part in lists.split("|"))) for word, lists in entries}


SYNONYMS = _read(_TABLE)


def perturbed(text: str, replacements: int, kind: Kind, rng: np.random.Generator) -> str:
    """The sentence with some of its words replaced, one by one, by others; as many words in the same order.

    An article agrees with the word that follows it. Left and right, numbers and "not" stay (the synonym test of SATO, with
    its own table: its sentences are not free to pass on).

    Args:
        text: words parted by spaces.
        replacements: how many words at most; a sentence with fewer that have synonyms changes in all of these.
        kind: "seen", "held_out" or "nonsense", see `Synonyms`.
        rng: which words, and which of their synonyms.

    Raises:
        ValueError: no such kind, or a negative number.

    >>> perturbed("a person turns to the left", 2, "nonsense", np.random.default_rng(0))
    'a blenk yindles to the left'
    """
    if kind not in get_args(Kind) or replacements < 0:
        raise ValueError(f"kind is {kind!r} and replacements {replacements}; expected one of {get_args(Kind)} and at least 0")
    words = text.split()
    places = [place for place, word in enumerate(words) if word in SYNONYMS]
    for place in rng.permutation(places)[:replacements]:
        options = getattr(SYNONYMS[words[place]], kind)
        words[place] = options[rng.integers(len(options))]
        if place and words[place - 1] in ("a", "an"):
            words[place - 1] = "an" if words[place][0] in "aeiou" else "a"
    return " ".join(words)
