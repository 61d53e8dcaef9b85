"""What an evaluator learns from: disjoint halves, words as numbers, stretches of clips with their own captions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from mwlib.data.formats.humanml import HUMANML3D
from mwlib.data.normalisation import Statistics
from mwlib.matching.evaluators import Vocabulary
from mwlib.matching.objective import PairedClips, of_half
from tests.matching.sample import toy_clips


@pytest.fixture
def clips() -> PairedClips:
    chosen = toy_clips()
    unit = Statistics("mdm", torch.zeros(263), torch.ones(263), HUMANML3D)
    return PairedClips(chosen, unit, Vocabulary.of(chosen, 20))


def named(*names: str) -> list:
    return [replace(toy_clips()[0], name=name) for name in names]


def test_the_halves_have_no_clip_in_common_and_do_not_depend_on_the_others():
    evaluator, critic = (of_half(toy_clips(), half) for half in ("evaluator", "critic"))
    names = [{clip.name for clip in half} for half in (evaluator, critic)]
    assert not names[0] & names[1] and names[0] | names[1] == {clip.name for clip in toy_clips()}
    assert min(map(len, names)) > 0.35 * len(toy_clips())
    assert of_half(toy_clips(), "all") == [*toy_clips()]
    whole, part = (of_half(clips, "critic") for clips in (toy_clips(), toy_clips()[10:20]))
    assert part == [clip for clip in whole if clip in toy_clips()[10:20]]


def test_mirror_images_and_stretches_stay_with_their_clip():
    for number in range(20):
        family = named(f"{number:06d}", f"M{number:06d}", f"{number:06d} line 2, 0 to 3 s", f"M{number:06d} line 1, 1 to 3 s")
        counts = set()
        for half in ("evaluator", "critic"):
            try:
                counts.add(len(of_half(family, half)))
            except ValueError:
                counts.add(0)
        assert counts == {0, 4}
    assert len(of_half(named(*(f"Max{i}" for i in range(40))), "critic")) not in (0, 40)


def test_clips_that_cannot_be_learnt_from_are_refused(clips):
    with pytest.raises(ValueError, match="1 of 3 clips have no name"):
        of_half(named("a", "", "b"), "evaluator")
    with pytest.raises(ValueError, match="none of 0 clips is in the half of the critic"):
        of_half([], "critic")
    assert len(of_half(named("", ""), "all")) == 2
    statistics, words = Statistics("mdm", torch.zeros(263), torch.ones(263), HUMANML3D), Vocabulary([], 20)
    clip = toy_clips()[0]
    with pytest.raises(ValueError, match="there are 1 clips"):
        PairedClips([clip], statistics, words)
    for bad in (replace(clip, features=clip.features[:3]), replace(clip, captions=())):
        with pytest.raises(ValueError, match="expected at least 4 frames and a caption"):
            PairedClips([clip, bad], statistics, words)


def test_words_that_were_never_seen_are_one_number():
    words = Vocabulary(["a", "man", "walks"], longest=4)
    ids, counts = words.ids(["A dog walks", "a cat WALKS!", "", "a a a a a a"])
    assert torch.equal(ids[0], ids[1]) and counts.tolist() == [5, 5, 2, 6] and len(words) == 6
    assert ids.tolist() == [[1, 3, 0, 5, 2, 0], [1, 3, 0, 5, 2, 0], [1, 2, 0, 0, 0, 0], [1, 3, 3, 3, 3, 2]]


def test_batches_are_different_clips_with_their_own_captions(clips, generator):
    chosen, shortened, starts, captions = toy_clips(), 0, set(), set()
    frames = {row.tobytes(): (i, start) for i, clip in enumerate(chosen) for start, row in enumerate(clip.features)}
    for seed in range(20):
        words, counts, x, lengths = clips.draw(16, torch.Generator().manual_seed(seed))
        assert words.shape[1] == counts.max() and x.shape[1] == lengths.max() and len(x) == 16
        found = set()
        for row, n, sentence in zip(x.numpy(), lengths.tolist(), words.tolist(), strict=True):
            number, start = frames[row[0].tobytes()]
            clip = chosen[number]
            assert np.array_equal(row[:n], clip.features[start : start + n])
            captions.add([clips_ids(caption, words.shape[1]) for caption in clip.captions].index(sentence))
            whole = len(clip.features) // 4 * 4
            assert n in (whole, whole - 4)
            shortened += n < whole
            starts.add(start)
            found.add(number)
        assert len(found) == 16
    assert captions == {0, 1} and len(starts) > 4 and 0.25 < shortened / 320 < 0.42
    assert len(clips.draw(1000, generator).x) == len(toy_clips())


def clips_ids(caption: str, width: int) -> list[int]:
    ids = Vocabulary.of(toy_clips(), 20).ids([caption])[0][0].tolist()
    return ids + [0] * (width - len(ids))


def test_windows_are_drawn_from_clips_that_are_long_enough(clips):
    chosen = toy_clips()
    first = np.concatenate([clip.features[: max(len(clip.features) - 23, 0), 0] for clip in chosen])
    drawn = clips.windows(4000, 24, torch.Generator().manual_seed(0))
    assert drawn.shape == (4000, 24, 263)
    counts = [int((drawn[:, 0, 0] == value).sum()) for value in torch.from_numpy(first)]
    assert sum(counts) == 4000 and max(counts) < 3 * 4000 / len(first) and min(counts) > 0
    ends = {float(clip.features[-1, 0]) for clip in chosen}
    assert ends & {float(value) for value in drawn[:, -1, 0]}, "a window may end with its clip"
    with pytest.raises(ValueError, match="the longest clip has 30 frames; expected 32"):
        clips.windows(2, 32, torch.Generator())
