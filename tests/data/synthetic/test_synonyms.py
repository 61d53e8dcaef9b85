"""Synonyms: three sets of words, and sentences changed as much as asked for and no more."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.synthetic.sentences import SYNONYMS, captions_of, draw_attributes, perturbed, vocabulary

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


def test_articles_agree():
    rng = np.random.default_rng(0)
    said = {perturbed("a person grabs an object", 3, kind, rng) for kind in ("seen", "held_out", "nonsense") for _ in range(20)}
    for words in (sentence.split() for sentence in said):
        assert all((a == "an") == (b[0] in "aeiou") for a, b in zip(words, words[1:], strict=False) if a in ("a", "an"))
    assert any(words.startswith("an ") for words in said)


def test_the_same_generator_gives_the_same_sentence(sentences):
    first, again = ([perturbed(s, 2, "seen", np.random.default_rng(3)) for s in sentences[:20]] for _ in range(2))
    assert first == again != [perturbed(s, 2, "seen", np.random.default_rng(4)) for s in sentences[:20]]


@pytest.mark.parametrize("kind, replacements", [("other", 1), ("seen", -1)])
def test_impossible_requests_are_refused(kind, replacements):
    with pytest.raises(ValueError, match="expected one of .* at least 0"):
        perturbed("a person walks", replacements, kind, np.random.default_rng(0))
