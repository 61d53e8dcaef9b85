"""Sentences as people type them: what is read, which words stay unknown, what is refused; the grammar's own stay as they are."""

from __future__ import annotations

import re
from itertools import permutations

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib.cli import main
from mwlib.experiments import sampling
from mwlib.synthetic import acts
from mwlib.synthetic.acts import TIMED, captioned_positions, usual_seconds
from mwlib.synthetic.sentences import captions_of, draw_attributes, vocabulary
from mwlib.synthetic.sentences_typed import ACTIONS, PERSONS, SYNONYMS, as_learnt, claims, forms, is_plain
from tests.text_to_motion.sample import untrained

# What is typed -> what is read, and its words that the grammar does not know.
READ = {
    "walk forward": ("a person walks forward", ""),
    "WALK!!!": ("a person walks forward", ""),
    "walk": ("a person walks forward", ""),
    "a person walks": ("a person walks forward", ""),
    "A man walked forward.": ("a man walks forward", ""),
    "he's walking": ("a man is walking forward", ""),
    "they were slowly walking": ("a person is slowly walking forward", ""),
    "walking slowly": ("a person walks slowly forward", ""),
    "he walks slow": ("a man walks slowly forward", ""),
    "walks fast": ("a person walks quickly forward", ""),
    "walk at a slow pace": ("a person walks at a slow pace", ""),
    "The man walks quickly ahead": ("a man walks quickly ahead", ""),
    "a person walks in a circle to the left": ("a person walks in a circle to the left", ""),
    "walk in an anticlockwise circle": ("a person walks in a counterclockwise circle", ""),
    "he will walk backwards": ("a man walks backwards", ""),
    "walk sideways": ("a person walks sideways", "sideways"),
    "a person walked and turned left": ("a person walks forward and turns left", ""),
    "run": ("a person runs forward", ""),
    "she ran fast": ("a woman runs fast forward", ""),
    "he is running fast in a circle to the left": ("a man is running fast in a circle to the left", ""),
    "jump": ("a person jumps", ""),
    "person jumps 2 times": ("a person jumps two times", ""),
    "jump twice": ("a person jumps twice", ""),
    "jumps four times": ("a person jumps four times", "four"),
    "I'm jumping": ("a person is jumping", ""),
    "she makes 3 big jumps in place": ("a woman makes three big jumps in place", ""),
    "turn left": ("a person turns ninety degrees to the left", ""),
    "turns to the right": ("a person turns ninety degrees to the right", ""),
    "turn around to the left": ("a person turns around to the left", ""),
    "make a quarter turn to the left": ("a person makes a quarter turn to the left", ""),
    "rotate 90 degrees to the right": ("a person rotates ninety degrees to the right", ""),
    "wave": ("a person waves with the right hand", ""),
    "waves both": ("a person waves both", ""),
    "kick": ("a person kicks with the right foot", ""),
    "kick high twice": ("a person kicks high with the right foot twice", ""),
    "kick left": ("a person kicks left", ""),
    "step back": ("a person steps backward", ""),
    "someone waves his right hand": ("someone waves the right hand", ""),
    "a person waving with left hand": ("a person waves with the left hand", ""),
    "raise your right hand": ("a person reaches up with the right hand", ""),
    "raise your right hand and wave": ("a person raises the right hand and waves", ""),
    "he kicked twice with his left foot": ("a man kicks twice with the left foot", ""),
    "the woman is kicking with the right leg": ("a woman kicks with the right leg", ""),
    "do two high kicks with the left foot": ("a person does two high kicks with the left foot", ""),
    "boxing with the left hand four times": ("a person boxes with the left hand four times", "four"),
    "sit": ("a person sits", ""),
    "she sat down on a chair": ("a woman sits down on a chair", ""),
    "he sits down and stands up again": ("a man sits down and stands up again", ""),
    "squatting three times": ("a person squats three times", ""),
    "take a bow": ("a person takes a bow", ""),
    "stand still": ("a person stands still", ""),
    "he does not move": ("a man does not move", ""),
    "the person isn't moving": ("the person does not move", ""),
    "pick it up with the left hand": ("a person picks it up with the left hand", "it"),
    "please walk forward, then wave with both hands": ("a person walks forward then waves with both hands", ""),
    "walk and then he turns left": ("a person walks forward and then turns ninety degrees to the left", ""),
    "a child walks": ("a child walks forward", "child"),
    "a person does a cartwheel": ("a person does a cartwheel", "cartwheel"),
    "crawl": ("crawl", "crawl"),
    "waltz": ("waltz", "waltz"),
    "a person goes for a walk": ("a person goes for a walk", "goes for walk"),
    "eine Person geht im Kreis nach links": ("eine person geht im kreis nach links", "eine geht im kreis nach links"),
}
REFUSED = {
    "a person does not walk": "with 'not'; expected what a person does",
    "a person doesn’t walk": 'with "doesn\'t"; expected what a person does',
    "never run": "with 'never'",
    "walks forward without waving": "with 'without'",
    "he walks, then he jumps, then he sits": "which asks for walk, jump, sit; expected at most 2 actions",
    "walk, run, jump, wave, kick, box, sit, squat and bow": "which asks for walk, run, jump, wave, kick, box, sit, squat, bow;",
    "一个人向前走": "with '一' of another script; expected English",
    "a person walks 一": "with '一' of another script",
    "он идёт": "with 'о' of another script",
}
UNLEARNT = {
    "a person does a cartwheel": "no action",
    "eine Person geht im Kreis nach links": "no action",
    "run and kick": "run and then kick",
}


@pytest.mark.parametrize("typed", READ)
def test_plain_forms_are_read_in_the_words_of_the_grammar(typed):
    text, unknown = READ[typed]
    assert as_learnt(typed).text == text
    assert [word for word in text.split() if word not in vocabulary()] == unknown.split()
    assert as_learnt(text).text == text, "what is read is read so again"


@pytest.mark.parametrize("typed", REFUSED)
def test_what_the_grammar_cannot_say_is_refused(typed):
    with pytest.raises(ValueError, match=re.escape(REFUSED[typed])):
        as_learnt(typed)


def test_sentences_of_the_grammar_stay_as_they_are_and_claim_what_their_person_does():
    rng, left_open = np.random.default_rng(1), set()
    for _ in range(600):
        attributes = draw_attributes(rng)
        turns = "turn" if str(attributes.get("path", "")).endswith("_turn") else ""
        actions = tuple(str(part) for part in (attributes["action"], attributes.get("then"), turns) if part)
        for caption in captions_of(attributes, rng):
            read, found = as_learnt(caption), claims(caption)
            assert (read.text, read.actions, read.is_learnt, is_plain(caption)) == (caption, actions, True, True)
            assert found == {name: attributes[name] for name in found}, caption
            left_open |= {(name, attributes[name]) for name in attributes.keys() - found.keys()}
    usual = {(name, "normal") for name in ("speed", "pace", "height")}
    assert left_open == {*usual, ("ends", "seated"), ("count", 1)}, "nobody says that somebody walks as people do"


@pytest.mark.parametrize("typed, expected", [
    ("wave", {"action": "wave", "hand": "right"}),
    ("sit down, then stand up", {"action": "sit", "ends": "standing"}),
    ("jump, then kick twice with the left foot", {"action": "jump", "then": "kick", "foot": "left"}),
    ("he jogs in a circle", {"action": "run", "speed": "slow"}),
    ("walk and wave with the left hand", {"action": "walk", "then": "wave"}),
    ("jumps and turns left", {"action": "jump", "then": "turn"}),
    ("wave the left hand, then kick twice with the right foot",
     {"action": "wave", "then": "kick", "hand": "left", "foot": "right", "count": 2}),
    ("punches left and right", {"action": "box"}),
    ("kicks with both feet", {"action": "kick"}),
    ("walks backwards quickly", {"action": "walk", "direction": "backward"}),
    ("sit down and stand up", {"action": "sit", "ends": "standing"}),
    ("does something", {"action": "pick_up"}),
    ("zxqv", {}),
])  # fmt: skip
def test_what_is_left_open_is_no_claim(typed, expected):
    assert claims(as_learnt(typed).text) == expected


NOT_PLAIN = [
    "kick left", "turn left then turn right", "jump with two feet", "jumps two meters forward", "walk forward to the left",
    "walk in a circle with the right hand up", "walk while waving", "box with the left hand then kick", "reach up with both arms",
    "stand with hands up", "gets up from the chair and walks", "wave to the left", "", "zxqv", "walks forward",
]  # fmt: skip


@pytest.mark.parametrize("typed", NOT_PLAIN)
def test_what_the_grammar_does_not_say_is_not_plain(typed):
    assert not is_plain(typed if typed == "walks forward" else as_learnt(typed).text), "nobody is named, or more is said"


@pytest.mark.parametrize("typed", [
    "wave", "Jump twice!", "walk, then kick twice", "sits down and gets back up", "walk backwards",
    "He ran fast in a circle to the left.", "turn right", "first walk and afterwards bow",
])  # fmt: skip
def test_plain_forms_are_plain(typed):
    assert is_plain(as_learnt(typed).text)


def test_two_actions_that_never_follow_each_other_are_not_learnt():
    pairs = [" then ".join(pair) for pair in permutations(("walk", "run", "kick", "jump", "sit"), 2)]
    learnt = {"walk then jump", "walk then kick", "walk then sit", "jump then walk", "jump then kick", "kick then walk",
              "run then jump"}  # fmt: skip
    assert {pair for pair in pairs if as_learnt(pair).is_learnt} == learnt


def test_verbs_have_all_their_forms():
    known = {*vocabulary()}
    assert {*forms().values()} == {*" ".join(ACTIONS.values()).split()} <= known
    of = {said: {form for form, other in forms().items() if other == said} for said in forms().values()}
    assert {"walk", "walking", "walked"} == of["walks"] and {"wave", "waving", "waved"} == of["waves"]
    assert {"run", "running", "ran"} < of["runs"] and {"do", "doing", "did"} < of["does"] and "dash" in of["dashes"]
    assert {"box", "boxing", "boxed"} == of["boxes"] and {"step", "stepping", "stepped"} == of["steps"]
    assert {"squat", "squatting"} < of["squats"] and {"lower", "lowering"} < of["lowers"] and {"lean", "leaning"} < of["leans"]


def test_what_stands_in_the_tables_is_of_the_grammar():
    pronouns = {word for word in " ".join(SYNONYMS).split() if "'" in word}
    assert pronouns == {"he's", "she's", "they're", "i'm"}
    for typed, said in (PERSONS | SYNONYMS).items():
        assert {*said.split()} - {"he", "she", "they", "i", "are", "am"} <= {*vocabulary()}, typed


@pytest.fixture(scope="module")
def people():
    """A model that is said to have learnt from the people; it knows eight words."""
    return untrained(data="people")


def test_motions_are_made_of_what_is_read_and_named_by_what_was_typed(people):
    told = r"does not know 'walks', 'forward': it takes each"
    for typed in ("walk", "A person walks forward!"):
        with pytest.warns(UserWarning, match=told):
            (found,) = mw.generate(typed, 0.6, run=people)
        assert found.name == typed
        (expected,) = people.sample(["a person walks forward"], [12], 0, ids=[0])
        np.testing.assert_allclose(found.positions, sampling.motion_of(expected, people.layout, "", True).positions, atol=2e-3)


@pytest.mark.filterwarnings("ignore:the model does not know")
@pytest.mark.parametrize("typed", UNLEARNT)
def test_actions_that_are_not_learnt_are_told(people, typed):
    told = rf"texts\[1\] asks for {UNLEARNT[typed]}, which the model has not learnt; expected one of"
    with pytest.warns(UserWarning, match=told):
        assert len(mw.generate(["a person goes up and walks", typed], 0.6, run=people)) == 2


@pytest.mark.parametrize("typed", REFUSED)
def test_a_model_of_the_people_refuses_them_and_others_do_not(people, typed):
    with pytest.raises(ValueError, match=rf"texts\[1\] is .*{re.escape(REFUSED[typed])}"):
        mw.generate(["a person walks", typed], 0.6, run=people)
    others = untrained(), untrained(data="people", text="ngrams")
    assert [sampling.understood(model, [typed]) for model in others] == [[typed], [typed]]


@pytest.mark.parametrize("typed", ["...", "!!!"])
def test_a_sentence_without_a_word_is_refused_as_it_was_typed(people, typed):
    with pytest.raises(ValueError, match=rf"texts\[0\] is '{re.escape(typed)}', without a word"):
        mw.generate(typed, 0.6, run=people)


@pytest.mark.filterwarnings("ignore:the model does not know")
def test_the_command_says_what_it_reads(monkeypatch, tmp_path, capsys, people):
    monkeypatch.setattr(sampling, "load_run", {"my/run": people}.__getitem__)
    words = ["walk", "A person walks forward.", "--seconds", "0.6", "--run", "my/run", "--out", str(tmp_path)]
    assert main(["generate", *words]) == 0
    said = capsys.readouterr().out
    assert said.count(" is read as ") == 1 and "'walk' is read as 'a person walks forward'\n" in said
    assert main(["generate", "--words", "--run", "my/run"]) == 0
    said = capsys.readouterr().out
    assert "other forms: walk, walking, walked as walks, and" in said and "he as a man, she as a woman" in said


@pytest.fixture
def seen(monkeypatch):
    """What the rules are to see, motion after motion."""
    script: list[dict[str, str]] = []
    monkeypatch.setattr(sampling, "measured_attributes", lambda positions, fps: script.pop(0))
    return script


THEN_JUMPS = {"action": "walk", "path": "straight", "then": "jump"}
STRAIGHT, CIRCLE, STILL = {"action": "walk", "path": "straight"}, {"action": "walk", "path": "left_circle"}, {"action": "stand"}
unknown_words = pytest.mark.filterwarnings("ignore:the model does not know")


def drawn(people, attempt, samples, which, text="a person walks forward"):
    """A sample of one attempt."""
    (x,) = people.sample([text], [12], 0, ids=[which + attempt * sampling.AGAIN])
    return sampling.motion_of(x, people.layout, text, fused=True).positions


@unknown_words
def test_a_motion_that_misses_its_sentence_is_made_again_and_the_nearest_is_kept(people, seen, caplog):
    seen += [STRAIGHT, STILL, THEN_JUMPS, CIRCLE, STRAIGHT, STILL]  # three first, two seconds, one third attempt
    found = mw.generate("a person walks forward", 0.6, 3, run=people)
    assert not seen
    expected = [drawn(people, 0, 3, 0), drawn(people, 1, 3, 1), drawn(people, 1, 3, 2)]
    for motion, positions in zip(found, expected, strict=True):
        np.testing.assert_allclose(motion.positions, positions, atol=2e-3)
    (told,) = caplog.messages
    asked = "'a person walks forward' asks for in 0.6 s, where people take 4"
    assert told == f"motion 2 of 3 does not show what {asked}: path is left_circle, expected straight"


@unknown_words
def test_one_attempt_keeps_what_comes_first(people, seen, caplog):
    seen += [STILL]
    (found,) = mw.generate("a person walks forward", 0.6, run=people, attempts=1)
    np.testing.assert_allclose(found.positions, drawn(people, 0, 1, 0), atol=2e-3)
    (told,) = caplog.messages
    assert told.endswith("people take 4: action is stand, expected walk; path is nothing, expected straight")


@unknown_words
def test_motions_too_short_for_the_rules_those_of_other_models_and_of_sentences_that_are_not_plain_are_not_looked_at(
    people, seen
):
    assert len(mw.generate("a person walks forward", 0.4, run=people)) == 1
    assert len(mw.generate("a person walks forward to the left", 0.6, run=people)) == 1
    assert len(mw.generate("a person walks forward", 0.6, run=untrained())) == 1


@pytest.mark.parametrize("attempts", [0, -1, 1.5, True, "2", None])
def test_attempts_are_counted(people, attempts):
    with pytest.raises(ValueError, match=f"attempts is .*{attempts}"):
        mw.generate("a person walks forward", 0.6, run=people, attempts=attempts)


@unknown_words
@pytest.mark.filterwarnings("ignore:texts.2. asks for no action")
def test_a_motion_lasts_as_long_as_people_take_unless_told_otherwise(people, seen, monkeypatch):
    monkeypatch.setattr(type(people), "lengths", (40, 84))
    monkeypatch.setattr(type(people), "sample", lambda self, texts, frames, *_, **__: [torch.zeros(n, 263) for n in frames])
    seen += [{"action": "bow"}, {"action": "kick", "foot": "left", "count": 3}]
    bow, kicks, dance = mw.generate(
        ["a person bows", "kick three times with the left foot", "a person goes up"], run=people, attempts=1
    )
    usual = [20 * usual_seconds(claims(as_learnt(motion.name).text)) for motion in (bow, kicks)]
    assert len(bow) == usual[0] == 56 and len(kicks) == 84 < usual[1], "not beyond the longest"
    assert len(dance) == 80


def test_more_of_something_takes_longer():
    once, thrice = (usual_seconds(claims(f"a person kicks {times} with the left foot")) for times in ("once", "three times"))
    slow, fast = (usual_seconds(claims(f"a person turns {how} around to the left")) for how in ("slowly", "quickly"))
    alone, both = (usual_seconds(claims(text)) for text in ("a person bows", "a person bows and then walks forward"))
    assert 2.0 <= once < thrice - 1.5 and fast < slow - 1 and alone + 1 < both <= 6.0


def test_people_take_about_as_long_as_is_usual_for_their_sentence():
    clips = captioned_positions(60, seed=5)
    off = np.array([usual_seconds(claims(clip.captions[0])) - (len(clip.positions) - 1) / 20 for clip in clips])
    assert abs(off.mean()) < 0.15 and np.abs(off).mean() < 0.4 and np.quantile(np.abs(off), 0.95) <= 0.8
    true = np.array([len(clip.positions) / 20 for clip in clips])
    assert off.std() < 0.5 * true.std(), "a length for all would be as good"


def test_times_are_there_for_all_that_a_sentence_may_say(monkeypatch):
    monkeypatch.setattr(acts, "usual_seconds", dict)  # what is asked about in place of its time
    times, rng = acts.usual_times(), np.random.default_rng(3)
    assert times["kick 3"] == {"action": "kick", "count": 3} and times["walk then bow"] == {"action": "walk", "then": "bow"}
    assert times["backward"] == {"action": "walk", "direction": "backward"}
    for _ in range(300):
        said = claims(captions_of(draw_attributes(rng), rng)[0])
        action = "backward" if said.get("direction") == "backward" else said["action"]
        alone = " ".join([action, *(str(said[name]) for name in TIMED if name in said)])
        assert f"{action} then {said['then']}" in times if "then" in said else alone in times


@unknown_words
def test_many_that_miss_are_counted(people, seen, caplog):
    seen += [STILL] * 7
    mw.generate("a person walks forward", 0.6, 7, run=people, attempts=1)
    assert [text[:13] for text in caplog.messages] == [f"motion {n} of 7"[:13] for n in range(1, 6)] + ["nor do 2 more"]
