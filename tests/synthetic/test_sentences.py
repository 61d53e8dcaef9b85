"""Captions say the attributes and nothing else; synonyms change as many words as asked for."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.synthetic.sentences import RULES, SYNONYMS, captions_of, draw_attributes, perturbed, vocabulary

NUMBERS = {1: {"once", "one", "single", "a"}, 2: {"twice", "two"}, 3: {"three", "thrice"}}


@pytest.fixture(scope="module")
def drawn():
    rng = np.random.default_rng(1)
    return [(attributes, captions_of(attributes, rng)) for attributes in (draw_attributes(rng) for _ in range(1500))]


def test_three_different_sentences_of_the_vocabulary(drawn):
    for _, captions in drawn:
        assert len(set(captions)) == 3
        for caption in captions:
            assert not set("<>{}|") & set(caption) and caption == " ".join(caption.split()) == caption.lower()
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


def test_order_and_direction_are_said():
    attributes = {"action": "walk", "then": "bow", "speed": "normal", "path": "straight"}
    for caption in captions_of(attributes, np.random.default_rng(0)):
        walks = min(caption.find(word) % 1000 for word in ("walk", "steps"))
        assert walks < min(caption.find(word) % 1000 for word in ("bow", "bends", "leans"))
    for caption in captions_of({"action": "walk", "direction": "backward"}, np.random.default_rng(0)):
        assert "backward" in caption


def test_captions_tell_clips_apart(drawn):
    by_caption = {}
    for attributes, captions in drawn:
        for caption in captions:
            said = tuple(sorted((k, v) for k, v in attributes.items()))
            assert by_caption.setdefault(caption, said) == said


KEPT = {"left", "right", "clockwise", "counterclockwise", "not", "both", "first", "half", "quarter", "ninety", "single"}
KEPT |= {"one", "two", "three", "once", "twice", "thrice"}


@pytest.fixture(scope="module")
def sentences():
    rng = np.random.default_rng(5)
    return [caption for _ in range(150) for caption in captions_of(draw_attributes(rng), rng)]


def test_the_three_sets_are_where_they_belong():
    words = set(vocabulary())
    assert 40 <= len(SYNONYMS) <= 60 and set(SYNONYMS) <= words
    for word, (seen, held_out, nonsense) in SYNONYMS.items():
        assert seen and set(seen) <= words and word not in seen
        assert held_out and not set(held_out) & words
        assert nonsense and not set(nonsense) & words
    every = [word for entry in SYNONYMS.values() for words in entry for word in words]
    assert not KEPT & {*SYNONYMS, *every} and all(" " not in word for word in every)
    nonsense = [entry.nonsense[0] for entry in SYNONYMS.values()]
    assert len(set(nonsense)) == len(nonsense) and not set(nonsense) & {w for e in SYNONYMS.values() for w in e.held_out}


@pytest.mark.parametrize("kind", ["seen", "held_out", "nonsense"])
@pytest.mark.parametrize("replacements", [0, 1, 2])
def test_as_many_words_change_as_asked_for(sentences, kind, replacements):
    rng = np.random.default_rng(0)
    for sentence in sentences:
        before, after = sentence.split(), perturbed(sentence, replacements, kind, rng).split()
        assert len(before) == len(after)
        changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b and {a, b} != {"a", "an"}]
        assert len(changed) == min(replacements, sum(word in SYNONYMS for word in before))
        assert all(b in getattr(SYNONYMS[a], kind) for a, b in changed)


def test_articles_agree_and_the_generator_decides(sentences):
    rng = np.random.default_rng(0)
    said = {perturbed("a person grabs an object", 3, kind, rng) for kind in ("seen", "held_out", "nonsense") for _ in range(20)}
    for words in (sentence.split() for sentence in said):
        assert all((a == "an") == (b[0] in "aeiou") for a, b in zip(words, words[1:], strict=False) if a in ("a", "an"))
    assert any(words.startswith("an ") for words in said)
    first, again = ([perturbed(s, 2, "seen", np.random.default_rng(3)) for s in sentences[:20]] for _ in range(2))
    assert first == again != [perturbed(s, 2, "seen", np.random.default_rng(4)) for s in sentences[:20]]


@pytest.mark.parametrize("kind, replacements", [("other", 1), ("seen", -1)])
def test_impossible_requests_are_refused(kind, replacements):
    with pytest.raises(ValueError, match="expected one of .* at least 0"):
        perturbed("a person walks", replacements, kind, np.random.default_rng(0))
