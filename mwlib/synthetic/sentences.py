"""Attributes of captioned clips, a grammar of sentences about them, and synonyms.

The grammar is context-free, with several ways to say the same. A rule lists its alternatives, parted by bars. `<name>` stands
for an alternative of the rule of that name or, if there is none, of the rule "name-value" by the clip's value of an attribute;
`{attribute}` stands for the value itself. A clip's sentence is a subject and an alternative of the rule of its action.

Synonyms ask how far a small change of wording changes what a model makes of a sentence. Sides, numbers and negations are in no
list: a sentence with other words keeps its meaning.
"""

import re
from functools import cache
from typing import Any, NamedTuple

import numpy as np

Attributes = dict[str, Any]  # names to words or numbers


def read_table(text: str) -> dict[str, str]:
    """Entries "name: what is said of it", parted by line ends or semicolons; a line that ends with a bar goes on in the next."""
    entries = (entry.partition(":") for entry in re.split("\n|; ", text.strip().replace("|\n", "|")))
    return {name: said.strip() for name, _, said in entries}


# action: how likely it is, then attributes with their values, of which one is drawn; a value named twice is twice as likely
_ACTIONS = read_table("""
walk: 20 | path straight left_circle right_circle left_turn right_turn | speed slow normal fast
run: 14 | path straight left_circle right_circle left_turn right_turn | speed slow normal fast
backward: 2 | direction backward
jump: 9 | count 1 2 3 | height low normal high | direction in_place in_place forward
turn: 8 | turn left right | degrees 90 180 | pace slow normal fast
wave: 8 | hand left right left right both | pace slow normal fast
kick: 9 | foot left right | count 1 2 3 | height low normal high
box: 5 | hand left right | count 1 2 3
pick_up: 4 | hand left right
reach: 5 | hand left right | target up forward
sit: 4 | ends seated standing
squat: 4 | count 1 2 3
bow: 2
stand: 2
""")
WEIGHTS = {action: float(said.partition(" ")[0]) for action, said in _ACTIONS.items()}
RECIPES = {action: dict(drawn.split(" ", 1) for drawn in said.split(" | ")[1:]) for action, said in _ACTIONS.items()}
# One action, then another; at most one of them has a side.
PAIRS = [
    tuple(pair.split(">"))
    for pair in (
        "walk>wave walk>kick walk>jump walk>turn walk>pick_up walk>sit walk>squat walk>bow walk>reach walk>box walk>stand "
        "run>jump run>stand run>turn run>wave wave>walk kick>walk jump>walk turn>walk pick_up>walk squat>walk bow>walk "
        "turn>wave turn>jump turn>bow jump>wave squat>wave bow>wave wave>sit jump>kick wave>jump"
    ).split()
]
SHARE_OF_PAIRS = 0.25
_USUAL = read_table("count: 1; height: normal; direction: in_place; path: straight; pace: normal; ends: seated")


def draw_attributes(rng: np.random.Generator) -> Attributes:
    """What one clip shows: "action", perhaps "then", and how, by the names and values of `RECIPES`.

    In a clip of two actions everything is normal and happens once, but for the speed of walking.
    """
    if rng.random() < SHARE_OF_PAIRS:
        actions = PAIRS[rng.integers(len(PAIRS))]
    else:
        weights = np.array(list(WEIGHTS.values()))
        actions = (str(rng.choice(list(WEIGHTS), p=weights / weights.sum())),)
    return _drawn(actions, rng)


def actions_of(attributes: Attributes) -> tuple[str, ...]:
    """The action of a clip or a sentence, or both."""
    return tuple(attributes[name] for name in ("action", "then") if name in attributes)


def completed(said: Attributes, rng: np.random.Generator) -> Attributes:
    """What a sentence says of a clip, and for the rest what is usual, or drawn where nothing is."""
    actions = actions_of(said)
    if said.get("direction") == "backward":
        actions = ("backward", *actions[1:])
    return _drawn(actions, rng, usual=True) | said


def _drawn(actions: tuple[str, ...], rng: np.random.Generator, usual: bool = False) -> Attributes:
    """How a clip shows one action, or two."""
    attributes: Attributes = {"action": "walk" if actions[0] == "backward" else actions[0]}
    if len(actions) > 1:
        attributes["then"] = actions[-1]
        usual = True
    for action in actions:
        for name, values in RECIPES[action].items():
            value = str(rng.choice((_USUAL.get(name, values) if usual else values).split()))
            attributes[name] = int(value) if value.isdigit() else value
    return attributes


RULES = read_table("""
subject: a person | someone | somebody | a man | a woman | a human | the person | the figure | an adult
two: <action> and then <then> | <action> then <then> | first <action> and afterwards <then> | <action> and after that <then>
walk-slow: walks slowly <path> | strolls <path> | ambles <path> | is walking slowly <path> | walks <path> at a slow pace |
    slowly walks <path> | walks unhurriedly <path>
walk-normal: walks <path> | is walking <path> | walks <path> at a normal pace | steps <path> | walks <path> at a medium speed
walk-fast: walks quickly <path> | walks briskly <path> | is walking fast <path> | strides quickly <path> |
    walks <path> at a fast pace | walks rapidly <path>
walk-backward: walks backward | walks backwards | steps backwards | is walking backward | moves backwards step by step
run-slow: jogs <path> | trots <path> | runs slowly <path> | is jogging <path> | runs <path> at a slow pace
run-normal: runs <path> | is running <path> | runs <path> at a normal pace | runs <path> at a medium speed
run-fast: sprints <path> | runs fast <path> | dashes <path> | is running very quickly <path> | runs <path> at full speed
path-straight: forward | ahead | straight ahead | straight forward | in a straight line | forwards
path-left_circle: <round> to the left | in a counterclockwise circle | around in a counterclockwise loop
path-right_circle: <round> to the right | in a clockwise circle | around in a clockwise loop
round: in a circle | in a loop | around in a circle
path-left_turn: <ahead> and <bends> left | <ahead> and <bends> to the left
path-right_turn: <ahead> and <bends> right | <ahead> and <bends> to the right
ahead: forward | ahead
bends: turns | veers | curves
turn: <pace> <angle>
angle-90: turns ninety degrees to the {turn} | rotates ninety degrees to the {turn} | makes a quarter turn to the {turn} |
    does a quarter turn {turn}
angle-180: turns around to the {turn} | makes a half turn to the {turn} | rotates halfway around to the {turn} |
    turns around over the {turn} shoulder
pace-slow: slowly | unhurriedly
pace-normal:
pace-fast: quickly | rapidly | swiftly
wave: <pace> waves with <hand> | <pace> waves <hand> | raises <hand> and waves <pace> | lifts <hand> and <pace> waves hello |
    is waving <pace> with <hand> | <pace> greets with <hand>
hand-left: the left hand | the left arm
hand-right: the right hand | the right arm
hand-both: both hands | both arms
box: punches <times> with the {hand} <fist> | throws <punches> with the {hand} <fist> | boxes with the {hand} <fist> <times> |
    strikes <times> with the {hand} <fist>
fist: hand | fist | arm
punches-1: a punch | one punch | a single punch
punches-2: two punches
punches-3: three punches
pick_up: picks up <thing> with the {hand} hand | picks <thing> up from the <floor> with the {hand} hand |
    bends down and grabs <thing> with the {hand} hand | lifts <thing> off the <floor> with the {hand} hand |
    takes <thing> from the <floor> with the {hand} hand
thing: something | an object | an item
floor: floor | ground
reach-up: reaches up with <hand> | stretches <hand> upward | reaches overhead with <hand> | extends <hand> up high |
    reaches upward with <hand>
reach-forward: reaches forward with <hand> | stretches <hand> out in front | extends <hand> forward | reaches ahead with <hand> |
    holds <hand> out forward
kick: kicks <height> with the {foot} <foot> <times> | kicks <height> <times> with the {foot} <foot> |
    makes <number> <size> <kicks> with the {foot} <foot> | does <number> <size> <kicks> with the {foot} <foot>
foot: foot | leg
kicks-1: kick
kicks-2: kicks
kicks-3: kicks
height-low: low | near the <floor>
height-normal:
height-high: high | up high
size-low: low | small
size-normal:
size-high: high | big
number-1: one
number-2: two
number-3: three
times-1: once | one time
times-2: twice | two times
times-3: three times | thrice
jump: <jumps> <along> <times>
jumps-low: jumps low | makes small jumps | hops a little | makes little hops
jumps-normal: jumps | is jumping | hops
jumps-high: jumps high | leaps high | makes big jumps | leaps up high
along-in_place: in place | on the spot
along-forward: forward | ahead | forwards
squat: squats <times> | crouches down <times> | does <number> <squats> | bends the knees deeply <times>
squats-1: squat | knee bend
squats-2: squats | knee bends
squats-3: squats | knee bends
sit-seated: sits down | takes a seat | sits down on a chair | lowers onto a chair | sits down and remains seated
sit-standing: sits down and stands up again | sits down and gets back up | takes a seat and gets up again |
    sits on a chair and rises again
bow: bows | takes a bow | bends forward at the waist | leans the upper body forward | bows down politely
stand: stands still | stands in place | remains standing | is standing still | does not move | stands motionless
""")
CAPTIONS = 3
# the attributes, the first that a clip has, by which a rule is chosen whose name is not that of the attribute
_CHOSEN_BY = read_table("""
walk: speed direction; run: speed; angle: degrees; reach: target; sit: ends; jumps: height; size: height; along: direction
times: count; number: count; punches: count; kicks: count; squats: count
""")
SLOT = re.compile(r"<(\w+)>")


def captions_of(attributes: Attributes, rng: np.random.Generator) -> tuple[str, ...]:
    """Three different sentences that describe a clip with these attributes: lower case, words parted by single spaces.

    Args:
        attributes: as `draw_attributes` gives them.
        rng: which alternatives are taken.
    """
    found: dict[str, None] = {}
    while len(found) < CAPTIONS:
        found[_sentence("<subject> <two>" if "then" in attributes else "<subject> <action>", attributes, rng)] = None
    return tuple(found)


def examples() -> dict[str, str]:
    """By the name of each action a sentence of the grammar that asks for it.

    >>> examples()["bow"]
    'an adult bends forward at the waist'
    """
    rng = np.random.default_rng(0)
    return {action: captions_of(_drawn((action,), rng), rng)[0] for action in RECIPES}


@cache
def vocabulary() -> tuple[str, ...]:
    """All words that a caption may hold, in alphabetical order."""
    words = {word for text in RULES.values() for word in SLOT.sub(" ", text).replace("|", " ").split()}
    return tuple(sorted({word for word in words if word[0] != "{"} | {"left", "right"}))  # sides alone are said as they are


def _sentence(text: str, attributes: Attributes, rng: np.random.Generator) -> str:
    """Replace slot after slot by one of its alternatives."""
    while slot := SLOT.search(text):
        options = RULES[_rule(slot[1], attributes)].split("|")
        text = text[: slot.start()] + options[rng.integers(len(options))] + text[slot.end() :]
    return " ".join(text.format(**attributes).split())


def _rule(slot: str, attributes: Attributes) -> str:
    """The rule that fills a slot."""
    slot = str(attributes[slot]) if slot in ("action", "then") else slot
    if slot in RULES:
        return slot
    value = next(attributes[name] for name in _CHOSEN_BY.get(slot, slot).split() if name in attributes)
    return f"{slot}-{value}"


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


_SYNONYMS = read_table("""
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
""")  # word: seen | held out | nonsense
SYNONYMS = {word: Synonyms(*(tuple(words.split(", ")) for words in lists.split(" | "))) for word, lists in _SYNONYMS.items()}


def perturbed(text: str, replacements: int, kind: str, rng: np.random.Generator) -> str:
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
    kinds = Synonyms._fields
    if kind not in kinds or replacements < 0:
        raise ValueError(f"kind is {kind!r} and replacements {replacements}; expected one of {kinds} and at least 0")
    words = text.split()
    places = [place for place, word in enumerate(words) if word in SYNONYMS]
    for place in rng.permutation(places)[:replacements]:
        options = getattr(SYNONYMS[words[place]], kind)
        words[place] = options[rng.integers(len(options))]
        if place and words[place - 1] in ("a", "an"):
            words[place - 1] = "an" if words[place][0] in "aeiou" else "a"
    return " ".join(words)
