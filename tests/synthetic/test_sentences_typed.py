"""Sentences as people type them: what is read, which words stay unknown, what is refused; the grammar's own stay as they are."""

from __future__ import annotations

import re
from itertools import permutations

import numpy as np
import pytest

import mwlib as mw
from mwlib.cli import main
from mwlib.experiments import sampling
from mwlib.synthetic.sentences import captions_of, draw_attributes, vocabulary
from mwlib.synthetic.sentences_typed import ACTIONS, PERSONS, SYNONYMS, as_learnt, forms
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
    "wave": ("a person waves", ""),
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


def test_sentences_of_the_grammar_stay_as_they_are_with_their_actions():
    rng = np.random.default_rng(1)
    for _ in range(1500):
        attributes = draw_attributes(rng)
        turns = "turn" if str(attributes.get("path", "")).endswith("_turn") else ""
        actions = tuple(str(part) for part in (attributes["action"], attributes.get("then"), turns) if part)
        for caption in captions_of(attributes, rng):
            found = as_learnt(caption)
            assert (found.text, found.actions, found.is_learnt) == (caption, actions, True)


def test_two_actions_that_never_follow_each_other_are_not_learnt():
    learnt = {
        pair for pair in permutations(("walk", "run", "kick", "jump", "sit"), 2) if as_learnt(" then ".join(pair)).is_learnt
    }
    assert learnt == {("walk", "jump"), ("walk", "kick"), ("walk", "sit"), ("jump", "walk"), ("jump", "kick"), ("kick", "walk"),
                      ("run", "jump")}  # fmt: skip


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
    assert (
        main(["generate", "walk", "A person walks forward.", "--seconds", "0.6", "--run", "my/run", "--out", str(tmp_path)]) == 0
    )
    said = capsys.readouterr().out
    assert said.count(" is read as ") == 1 and "'walk' is read as 'a person walks forward'\n" in said
    assert main(["generate", "--words", "--run", "my/run"]) == 0
    said = capsys.readouterr().out
    assert "other forms: walk, walking, walked as walks, and" in said and "he as a man, she as a woman" in said
