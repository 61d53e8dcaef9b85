"""Batches of clips: pieces of the clips themselves, with their own captions, padded with zeros."""

from __future__ import annotations

import torch

from mwlib.data.captioned import Pool, one_caption_each
from tests.text_to_motion.sample import toy


def pool():
    """The toy's training clips, as they are."""
    clips = toy().train
    return Pool(clips, [torch.from_numpy(clip.features) for clip in clips])


def test_a_batch_is_made_of_pieces_of_clips_with_their_own_captions():
    one, generator = pool(), torch.Generator().manual_seed(0)
    seen, starts = set(), set()
    for _ in range(40):
        batch = one.draw(5, generator)
        assert batch.y.shape[:2] == batch.mask.shape and not batch.y[~batch.mask].any()
        assert torch.equal(batch.mask.sum(1), batch.lengths) and not (batch.lengths % 4).any()
        for y, n, caption in zip(batch.y, batch.lengths.tolist(), batch.captions, strict=True):
            places = [
                (i, o)
                for i, clip in enumerate(one.clips)
                for o in range(len(clip.features) - n + 1)
                if torch.equal(torch.from_numpy(clip.features[o : o + n]), y[:n])
            ]
            assert len(places) == 1 and caption in one.clips[places[0][0]].captions
            seen.add((places[0][0], len(one.clips[places[0][0]].features) - n, caption))
            starts.add(places[0][1])
    assert len({i for i, _, _ in seen}) == len(one.clips)  # every clip comes, and both captions, and cut ones
    assert {caption for _, _, caption in seen} == {caption for clip in one.clips for caption in clip.captions}
    assert {0, 1, 2, 3} <= starts  # anywhere
    assert any(cut >= 4 for _, cut, _ in seen) and any(cut < 4 for _, cut, _ in seen)


def test_one_in_three_is_four_frames_shorter():
    generator = torch.Generator().manual_seed(1)
    clips = [c for c in toy().train if len(c.features) == 20]
    alike = Pool(clips, [torch.from_numpy(c.features) for c in clips])
    lengths = torch.cat([alike.draw(50, generator).lengths for _ in range(40)])
    assert set(lengths.tolist()) == {16, 20} and abs(float((lengths == 16).float().mean()) - 1 / 3) < 0.04


def test_whole_clips_come_from_their_beginning():
    one = pool()
    batch = one.whole([3, 1], ["a", "b"])
    for y, i, n in zip(batch.y, (3, 1), batch.lengths.tolist(), strict=True):
        assert n == len(one.clips[i].features) // 4 * 4 and torch.equal(y[:n], torch.from_numpy(one.clips[i].features[:n]))
    assert batch.captions == ["a", "b"]


def test_one_caption_each_is_drawn_by_the_seed():
    clips = toy().train
    first = one_caption_each(clips, 0)
    assert first == one_caption_each(clips, 0) != one_caption_each(clips, 1)
    assert all(text in clip.captions for text, clip in zip(first, clips, strict=True))
    assert len({*first}) == 4
