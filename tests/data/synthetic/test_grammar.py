"""Captions: grammatical expansions that say the attributes and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.synthetic.sentences import RULES, captions_of, draw_attributes, vocabulary

NUMBERS = {1: {"once", "one", "single", "a"}, 2: {"twice", "two"}, 3: {"three", "thrice"}}


@pytest.fixture(scope="module")
def drawn():
    rng = np.random.default_rng(1)
    return [(attributes, captions_of(attributes, rng)) for attributes in (draw_attributes(rng) for _ in range(1500))]


def test_three_different_sentences_without_a_slot_left(drawn):
    for _, captions in drawn:
        assert len(set(captions)) == 3
        for caption in captions:
            assert not set("<>{}|") & set(caption) and caption == " ".join(caption.split()) == caption.lower()


def test_the_vocabulary_is_what_captions_use(drawn):
    used = {word for _, captions in drawn for caption in captions for word in caption.split()}
    assert used <= set(vocabulary()) and len(set(vocabulary()) - used) <= 3
    assert 100 <= len(vocabulary()) <= 250 and list(vocabulary()) == sorted(set(vocabulary()))


def test_sides_are_said(drawn):
    for attributes, captions in drawn:
        sides = {str(attributes[name]) for name in ("hand", "foot", "turn") if name in attributes}
        sides |= {str(attributes["path"]).split("_")[0]} if attributes.get("path", "straight") != "straight" else set()
        for caption in captions:
            words = set(caption.replace("counterclockwise", "left").replace("clockwise", "right").split())
            assert sides & {"left", "right"} == words & {"left", "right"}
            assert ("both" in sides) == ("both" in words)


def test_numbers_and_manner_are_said(drawn):
    slow, fast = (set(RULES[f"pace-{pace}"].split()) for pace in ("slow", "fast"))
    slow |= {"strolls", "ambles", "jogs", "trots", "jogging", "slow"}
    fast |= {"fast", "briskly", "sprints", "dashes", "full"}
    for attributes, captions in drawn:
        for words in (set(caption.split()) for caption in captions):
            if "count" in attributes:
                assert words & NUMBERS[int(attributes["count"])]
                assert not words & set.union(*(NUMBERS[n] - {"a"} for n in NUMBERS if n != attributes["count"]))
            manner = {attributes.get("speed"), attributes.get("pace")}
            assert bool(words & slow) == ("slow" in manner) and bool(words & fast) == ("fast" in manner)


def test_two_actions_are_told_in_order():
    attributes = {"action": "walk", "then": "bow", "speed": "normal", "path": "straight"}
    for caption in captions_of(attributes, np.random.default_rng(0)):
        walks = min(caption.find(word) % 1000 for word in ("walk", "steps"))
        assert walks < min(caption.find(word) % 1000 for word in ("bow", "bends", "leans"))


def test_walking_backward_is_said():
    for caption in captions_of({"action": "walk", "direction": "backward"}, np.random.default_rng(0)):
        assert "backward" in caption


def test_captions_tell_clips_apart(drawn):
    by_caption = {}
    for attributes, captions in drawn:
        for caption in captions:
            said = tuple(sorted((k, v) for k, v in attributes.items()))
            assert by_caption.setdefault(caption, said) == said
