"""Sentences as people type them, put into the words of the grammar: other forms of its verbs, other persons, figures.

Own choice: a model that has learnt the grammar's 175 words takes every other one for the same unknown word. People type "walk
forward" where the grammar says "a person walks forward". What stands in the tables below means the same, and is replaced; a word
that does not is left as it is, and the model tells that it does not know it. What the grammar cannot say at all, such as that
somebody does not walk, is refused.
"""

import re
import unicodedata
from functools import cache
from itertools import chain
from typing import Any, NamedTuple

from mwlib.networks.text import words_of
from mwlib.synthetic.sentences import PAIRS, RECIPES, RULES, SLOT, Attributes, actions_of, read_table, vocabulary

# The grammar's verbs by their action; the last, of no name, take part in several.
ACTIONS = read_table("""
walk: walks strolls ambles steps strides moves
run: runs jogs trots sprints dashes
jump: jumps hops leaps
turn: turns rotates veers curves
wave: waves greets
kick: kicks
box: boxes punches strikes
pick_up: picks grabs
reach: reaches stretches extends holds
sit: sits lowers
squat: squats crouches
bow: bows leans
stand: stands
: makes does takes throws raises lifts bends gets rises remains
""")
# Some of its nouns, and the like, by their action.
NOUNS = read_table("pick_up: something object item; squat: knee knees; bow: waist; sit: seat; stand: move motionless")
PAST = read_table("""
ran: runs; leapt: leaps; struck: strikes; held: holds; sat: sits; bent: bends; stood: stands; made: makes; did: does
took: takes; threw: throws; got: gets; rose: rises
""")
# What is typed: what the grammar says; nothing: it is left out.
SYNONYMS = read_table("""
1: one; 2: two; 3: three; 90 degrees: ninety degrees; 180 degrees: halfway around; an anticlockwise: a counterclockwise
anticlockwise: counterclockwise; counter clockwise: counterclockwise; anti clockwise: counterclockwise; upwards: upward
quick: quickly; please: ; will: ; he's: he is; she's: she is; they're: they are; i'm: i am; his: the; her: the; their: the
its: the; my: the; your: the
""")
# Who acts -> the grammar's nearest: a pronoun alone, a noun with an article or without.
PERSONS = read_table("""
he: a man; she: a woman; they: a person; i: a person; you: a person; someone: someone; somebody: somebody; person: a person
man: a man; guy: a man; boy: a man; woman: a woman; girl: a woman; lady: a woman; human: a human; figure: the figure
adult: an adult
""")
PRONOUNS, JOINED = "he she they i you".split(), "and then that afterwards".split()
ARTICLES, BEING = "a an the this that one some".split(), "is are was were am be".split()
DENIALS = "not never no nobody nothing without neither nor cannot dont doesnt isnt wont".split()
STILL = re.compile(r"\b(?:(?:does|do|did|is|are|was|were) not|(?:does|do|did|is|are|was|were)n't) (?:move|moving|moved)\b")
GOING = (*(ACTIONS["walk"] + " " + ACTIONS["run"]).split(), "walking", "running", "jogging")
HOW = "(?:slowly|unhurriedly|quickly|briskly|rapidly|fast)"
# Turns of speech -> the grammar's, unless the sentence has these letters: sides, a hand that is raised, how fast, where to.
PHRASES = (
    (r"(?<!the )\b(left|right) (hand|arm|foot|leg|fist|shoulder)\b", r"the \1 \2", ""),
    (r"\b(?:raises|lifts) (?=(?:the left|the right|both) (?:hand|arm))", "reaches up with ", "wav"),
    (r"\bslow\b(?! pace| speed)", "slowly", ""),
    (r"(?<!runs )(?<!ing )\bfast\b(?! pace| speed)", "quickly", ""),
    (rf"\b({'|'.join(GOING)}) back\b", r"\1 backward", ""),
    (rf"\b((?:{'|'.join(GOING)})(?: {HOW})?)(?= and\b| then\b|$)", r"\1 forward", "back"),
    (r"(?<!and )\b(turns|rotates) (?:to the )?(left|right)(?= and| then|$)", r"\1 ninety degrees to the \2", ""),
    (r"^(?!.*\b(?:hands?|arms?|left|right|both)\b)(.*\bwaves)\b", r"\1 with the right hand", ""),
    (r"^(?!.*\b(?:foot|feet|legs?|left|right|both)\b)(.*\bkicks?(?: high| low)?)\b(?! high| low)", r"\1 with the right foot", ""),
)
MOST = 2  # actions of a sentence
THEN = re.compile(r"\b(?:and )?(?:then|afterwards|after that)\b")
BEND = re.compile(r"\band (?:turns|veers|curves) (?:to the )?(?:left|right)\b")  # of a path, not an action of its own
# Words -> the value that they give an attribute; of a side, a pace and a circle: attributes of several names.
VALUES = {
    kind: read_table(rows)
    for kind, rows in {
        "side": "left: left counterclockwise anticlockwise; right: right clockwise; both: both",
        "count": "1: once one single punch; 2: twice two; 3: thrice three",
        "speed": "slow: slowly unhurriedly slow strolls ambles jogs trots jogging; normal: normal medium; "
        "fast: quickly briskly fast strides rapidly swiftly sprints dashes full",
        "round": "circle: circle loop",
        "ahead": "straight: forward forwards ahead straight",
        "direction": "in_place: place spot; forward: forward forwards ahead; backward: backward backwards",
        "target": "up: up upward overhead; forward: forward ahead front out",
        "degrees": "90: ninety quarter; 180: around half halfway",
        "height": "low: low near small little; high: high big",
        "ends": "standing: up again back",
    }.items()
}


class Typed(NamedTuple):
    """What is read of a sentence.

    Args:
        text: in the words of the grammar, as far as the tables go: lower case, without punctuation.
        actions: what it asks for, in order, by the names of `RECIPES`; walking backward is walking.
    """

    text: str
    actions: tuple[str, ...]

    @property
    def is_learnt(self) -> bool:
        """Whether the grammar has a sentence of these actions: one that it knows, or two that follow each other in it."""
        return len(self.actions) == 1 or self.actions in PAIRS


def as_learnt(sentence: str) -> Typed:
    """A sentence in the words of the grammar; one of the grammar stays as it is.

    Verbs are put into the form that the grammar has. The person who acts is one of the grammar's, and is added where nobody is
    named. Who walks or runs with no path goes forward; a turn to a side with no angle is a quarter turn; who waves or kicks
    with no limb uses the right one.

    Raises:
        ValueError: the sentence says what is not done, asks for more than two actions, or is written in another script.

    >>> as_learnt("He walked slow, then he's turning left!")
    Typed(text='a man walks slowly forward then turns ninety degrees to the left', actions=('walk', 'turn'))
    """
    if foreign := [letter for letter in sentence if letter.isalpha() and "LATIN" not in unicodedata.name(letter, "")]:
        raise ValueError(
            f"{sentence[:80]!r}, with {foreign[0]!r} of another script; expected English, which the model has learnt"
        )
    text = STILL.sub("does not move", " ".join(words_of(sentence)))
    denied = text.replace("does not move", "").split()
    if denial := [word for word in denied if word in DENIALS or word.endswith("n't")]:
        raise ValueError(f"{sentence[:80]!r}, with {denial[0]!r}; expected what a person does: the model has learnt no denial")
    for typed, said in SYNONYMS.items():
        text = re.sub(rf"(?<!\S){typed}(?!\S)", said, text)
    text = " ".join(_verbs(_somebody(text.split())))
    for typed, said, unless in PHRASES:
        if not unless or unless not in text:
            text = re.sub(typed, said, text)
    found = Typed(text, _actions(text))
    if len(found.actions) > MOST:
        raise ValueError(f"{sentence[:80]!r}, which asks for {', '.join(found.actions)}; expected at most {MOST} actions")
    return found


def claims(text: str) -> Attributes:
    """What a sentence says of the motion, by the names and values of `RECIPES`; what it leaves open is missing.

    Args:
        text: as `as_learnt` gives it.

    >>> claims("a man walks slowly forward then turns ninety degrees to the left")
    {'action': 'walk', 'then': 'turn', 'speed': 'slow', 'path': 'straight', 'degrees': 90, 'turn': 'left'}
    """
    clauses = list[str]()
    for clause in THEN.split(text):  # "sits down, then up": one action
        clauses += [clause] if _actions(clause) or not clauses else [f"{clauses.pop()} {clause}"]
    asked = [_actions(clause) for clause in clauses]
    asked = [_actions(BEND.sub("", c)) if a[:1] in (("walk",), ("run",)) else a for c, a in zip(clauses, asked, strict=True)]
    actions = [*chain(*asked)][:MOST]
    found: Attributes = dict(zip(("action", "then"), actions, strict=False))
    for clause, own in zip(clauses, asked, strict=True):
        if len(own) == 1:  # else nobody knows to which of them a side belongs
            found |= _manner(own[0], clause)
    if len(actions) == MOST:  # nor whose number it is, where both have one
        found = {n: v for n, v in found.items() if not (n in RECIPES[actions[0]] and n in RECIPES[actions[1]])}
    return found


def is_plain(text: str) -> bool:
    """Whether the grammar makes a sentence, or leaves out where and how often: then `claims` knows what each word means.

    Args:
        text: as `as_learnt` gives it.
    """
    subject = next((who for who in RULES["subject"].split(" | ") if text.startswith(f"{who} ")), "")
    clauses = [clause.strip() for clause in THEN.split(text.removeprefix(subject).strip().removeprefix("first "))]
    asked = actions_of(claims(text))
    return bool(subject) and len(asked) == len(clauses) and (len(asked) == 1 or asked in PAIRS) and _clauses().issuperset(clauses)


@cache
def _clauses() -> frozenset[str]:
    """All that the grammar says of one action, also without where and how often."""
    rules = {name: said.split("|") for name, said in RULES.items()}

    def all_of(text: str) -> set[str]:
        """With each slot filled in all ways."""
        slot = SLOT.search(text)
        if not slot:
            sides = [text.replace("{" + name + "}", side) for name in ("hand", "foot", "turn") for side in ("left", "right")]
            return {" ".join(each.split()) for each in sides if "{" not in each}
        own = rules.get(slot[1]) or [said for name, many in rules.items() if name.startswith(f"{slot[1]}-") for said in many]
        own = [*own, ""] if slot[1] in ("along", "times", "path") else own
        return {whole for said in own for whole in all_of(text[: slot.start()] + said + text[slot.end() :])}

    said = ((action, clause) for action in RECIPES for clause in all_of(f"<{action}>"))
    return frozenset(clause for action, clause in said if action == "wave" or "both" not in clause.split())


def _manner(action: str, clause: str) -> Attributes:
    """How a clause says that its only action is done."""
    words, values = {*clause.split()}, dict[str, str]()
    for kind, rows in VALUES.items():
        said = [value for value, known in rows.items() if words & {*known.split()}]
        values[kind] = said[0] if len(said) == 1 else ""  # left and right: either
    side, way = values["side"], "turn" if BEND.search(clause) else values["round"]
    told = values | {"path": f"{side}_{way}" if way else values["ahead"], "pace": values["speed"]}
    told |= dict.fromkeys(("hand", "foot", "turn"), side)
    can = RECIPES["backward" if action == "walk" and told["direction"] == "backward" else action]
    return {name: int(v) if v.isdigit() else v for name, v in told.items() if v and v in can.get(name, "").split()}


@cache
def forms() -> dict[str, str]:
    """Other forms of the grammar's verbs -> the one that it has."""
    found = dict(PAST)
    for said in " ".join(ACTIONS.values()).split():
        base = re.sub(r"(?<=sh|ch)es$|(?<=x|o)es$|s$", "", said)
        stem = base.removesuffix("e")
        if re.fullmatch(r"(?:qu|[^aeiou])*[aeiou][^aeiouwxy]", base):  # one short vowel: running
            stem += base[-1]
        found |= {base: said, f"{stem}ing": said, f"{stem}ed": said}
    return found


def _somebody(words: list[str]) -> list[str]:
    """The same with a person of the grammar in front, and no pronoun further on."""
    start = int(bool(words) and words[0] in ARTICLES)
    if words[start : start + 1] and words[start] in PERSONS:
        named = " ".join(words[: start + 1])
        who = named if named == "the person" else PERSONS[words[start]]
        words = [*who.split(), *words[start + 1 :]]
    elif not start and any(word in forms() or word in forms().values() for word in words[:2]):
        words = ["a", "person", *words]
    return [word for before, word in zip(["", *words], words, strict=False) if not (before in JOINED and word in PRONOUNS)]


def _verbs(words: list[str]) -> list[str]:
    """The same with verbs as the grammar has them: "walks" and "is walking", but "kicks" for "is kicking"."""
    known, found = {*vocabulary()}, list[str]()
    for place, word in enumerate(words):
        before, said = (found[-1] if found else ""), forms().get(word)
        if word in BEING and any(next_.endswith("ing") for next_ in words[place + 1 : place + 3]):
            word = "is"
        elif said and word.endswith("ing"):
            helped = next((back for back in (-1, -2) if found[back:][:1] == ["is"]), 0)  # "is walking", "is slowly walking"
            if not (word in known and (helped or before == "remains")):
                word = said
                if helped:
                    del found[helped]
        elif said and before not in ARTICLES and (word not in known or _may_begin(before)):
            word = said
        found.append(word)
    return found


def _may_begin(before: str) -> bool:
    """Whether a verb may follow a word: a person, a word that joins two actions, or one that says how."""
    nouns = {said.split()[-1] for said in PERSONS.values()}
    return before in {"", "first", *JOINED, *nouns} or before.endswith("ly")


def _actions(text: str) -> tuple[str, ...]:
    """The actions that known words ask for; several words for one, one after the other, count once."""
    found: list[str] = []
    for word in text.replace("stands up", "rises").split():
        action = _named().get(word)
        if action and found[-1:] != [action]:
            found.append(action)
    return tuple(found)


@cache
def _named() -> dict[str, str]:
    """A word of the grammar -> the action that it belongs to."""
    rows = [*ACTIONS.items(), *NOUNS.items()]
    told = {word: action for action, words in rows for word in words.split() if action}
    return {form: told[said] for form, said in forms().items() if form in vocabulary() and said in told} | told


def tables() -> dict[str, Any]:
    """All that `as_learnt` and `claims` look up, as JSON values, for a program in another language that reads sentences, too."""
    return {
        "words": [*vocabulary()], "forms": forms(), "synonyms": SYNONYMS, "persons": PERSONS, "pronouns": PRONOUNS,
        "joined": JOINED, "articles": ARTICLES, "being": BEING, "denials": DENIALS, "still": STILL.pattern,
        "phrases": [*map(list, PHRASES)], "named": _named(), "pairs": [*map(list, PAIRS)], "most": MOST,
        "then": THEN.pattern, "bend": BEND.pattern, "values": VALUES, "recipes": RECIPES,
    }  # fmt: skip
