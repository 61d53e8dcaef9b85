"""Captioned clips: which a configuration names, and batches of their pieces with their own captions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from mwlib.data.captioned import CaptionsConfig, ClipBatches, captioned_people, fingerprint, load_clips, one_caption_each, thinned
from mwlib.data.formats.humanml import HUMANML3D, KIT, joints_of
from mwlib.data.normalisation import Statistics
from mwlib.synthetic.acts import captioned_positions
from tests.text_to_motion.sample import toy

UNIT = Statistics("mdm", torch.zeros(263), torch.ones(263), HUMANML3D)


def equal(clip, start, y):
    return np.array_equal(clip.features[start : start + len(y)], y)


def test_a_batch_is_made_of_pieces_of_clips_with_their_own_captions():
    one, generator = ClipBatches(toy().train, UNIT), torch.Generator().manual_seed(0)
    seen, starts = set(), set()
    for _ in range(40):
        batch = one.draw(5, generator)
        assert batch.y.shape[:2] == batch.mask.shape and not batch.y[~batch.mask].any()
        assert torch.equal(batch.mask.sum(1), batch.lengths) and not (batch.lengths % 4).any()
        for y, n, caption in zip(batch.y.numpy(), batch.lengths.tolist(), batch.captions, strict=True):
            places = [(i, o) for i, c in enumerate(one.clips) for o in range(len(c.features) - n + 1) if equal(c, o, y[:n])]
            assert len(places) == 1 and caption in one.clips[places[0][0]].captions
            seen.add((places[0][0], len(one.clips[places[0][0]].features) - n, caption))
            starts.add(places[0][1])
    assert len({i for i, _, _ in seen}) == len(one.clips)  # every clip comes, and both captions, and cut ones
    assert {caption for _, _, caption in seen} == {caption for clip in one.clips for caption in clip.captions}
    assert {0, 1, 2, 3} <= starts  # anywhere
    assert any(cut >= 4 for _, cut, _ in seen) and any(cut < 4 for _, cut, _ in seen)


def test_one_in_three_is_four_frames_shorter():
    generator = torch.Generator().manual_seed(1)
    alike = ClipBatches([c for c in toy().train if len(c.features) == 20], UNIT)
    lengths = torch.cat([alike.draw(50, generator).lengths for _ in range(40)])
    assert set(lengths.tolist()) == {16, 20} and abs(float((lengths == 16).float().mean()) - 1 / 3) < 0.04


def test_whole_clips_and_their_captions():
    clips = toy().train
    batch = ClipBatches(clips, UNIT, padded=24).whole([3, 1], ["a", "b"])
    assert batch.captions == ["a", "b"] and batch.y.shape[1] == 24
    for y, i, n in zip(batch.y, (3, 1), batch.lengths.tolist(), strict=True):
        assert n == len(clips[i].features) // 4 * 4 and equal(clips[i], 0, y[:n].numpy()) and not y[n:].any()
    first = one_caption_each(clips, 0)
    assert first == one_caption_each(clips, 0) != one_caption_each(clips, 1)
    assert all(text in clip.captions for text, clip in zip(first, clips, strict=True))
    assert len({*first}) == 4


def test_thinned_clips_are_spread_evenly():
    clips = toy().train
    assert thinned(clips, 0) == clips == thinned(clips, 99)
    assert [c.name for c in thinned(clips, 3)] == [clips[0].name, clips[14].name, clips[29].name]


def kit_folder(folder: Path, frames: tuple[int, ...], **lists: str) -> Path:
    """A folder with clips 1, 2, ... of so many frames, and lists of them."""
    for name in ("new_joint_vecs", "texts"):
        (folder / name).mkdir(parents=True)
    for name, many in enumerate(frames, 1):
        np.save(folder / "new_joint_vecs" / f"{name}.npy", np.ones((many, KIT.width), np.float32))
        (folder / "texts" / f"{name}.txt").write_text("a person walks#a/DET#0.0#0.0\n")
    for split, names in lists.items():
        (folder / f"{split}.txt").write_text(names)
    return folder


def test_a_folder_is_looked_up_where_data_are(tmp_path, monkeypatch):
    kit_folder(tmp_path / "data" / "own", (30, 60, 26), train="1\n3\n", test="2\n")
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path / "data"))
    monkeypatch.chdir(tmp_path)
    parts = load_clips(CaptionsConfig(data="own", shortest=28, longest=40))
    assert [[(clip.name, len(clip.features)) for clip in part] for part in parts] == [[("1", 30)], [], [("2", 40)]]
    assert parts.layout is KIT
    with pytest.raises(FileNotFoundError, match="data is 'other', which is neither here nor .*data.*; expected people, cmu, or"):
        load_clips(CaptionsConfig(data="other"))


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda folder: (folder / "train.txt").write_text("1\n3\n"), 0),
        (lambda folder: (folder / "test.txt").write_text("3\n"), 1),
        (lambda folder: (folder / "val.txt").write_text("3\n"), 0),
        (lambda folder: (folder / "texts" / "1.txt").write_text("a person waits#a/DET#0.0#0.0\n"), 0),
        (lambda folder: np.save(folder / "new_joint_vecs" / "2.npy", np.full((60, KIT.width), 2, np.float32)), 1),
        (lambda folder: np.save(folder / "new_joint_vecs" / "2.npy", np.ones((64, KIT.width), np.float32)), 1),
    ],
)
def test_a_folder_that_changed_is_read_again_and_is_other_data(tmp_path, change, part):
    captions = kit_folder(tmp_path, (60, 60, 60), train="1\n", test="2\n")
    source = CaptionsConfig(data=str(captions))
    before = load_clips(source)
    assert load_clips(source).train[0] is before.train[0], "what did not change is not read again"
    change(captions)
    after = load_clips(source)
    differ = [a != b for a, b in zip(before.fingerprints(), after.fingerprints(), strict=True)]
    assert differ == [part == 0, part == 1]


def test_people_are_parted_and_known_again():
    parts = load_clips(CaptionsConfig(clips=80))
    people = [{c.name.split("_")[0] for c in part} for part in parts]
    assert not (people[0] & people[1] or people[0] & people[2] or people[1] & people[2])
    assert parts.layout == HUMANML3D and parts.fingerprints() == load_clips(CaptionsConfig(clips=80)).fingerprints()
    few = load_clips(CaptionsConfig(clips=80, few=5, longest=60))
    kept = [clip for clip in parts.train if len(clip.features) >= 40]
    assert [clip.name for clip in few.train[::4]] == [kept[0].name, kept[-1].name]
    assert len(few.train) == 5 and max(len(c.features) for part in few for c in part) <= 60
    assert fingerprint(parts.train) != fingerprint(parts.train[1:])
    with pytest.raises(ValueError, match="people has 0 clips to train and 0 to test on, of 150 frames"):
        load_clips(CaptionsConfig(clips=80, shortest=150))


def test_a_clip_that_was_cut_claims_nothing():
    whole, cut = (load_clips(CaptionsConfig(clips=80, longest=n)).train for n in (120, 60))
    assert all(clip.attributes for clip in whole)
    assert all(bool(b.attributes) == (len(a.features) <= 60) for a, b in zip(whole, cut, strict=True))


def test_features_of_people_hold_their_positions():
    for acted, clip in zip(captioned_positions(4, seed=2), captioned_people(4, seed=2), strict=True):
        assert clip.features.dtype == np.float32 and clip.features.shape == (len(acted.positions) - 1, HUMANML3D.width)
        assert 40 <= len(clip.features) <= 120 and len(clip.features) % 4 == 0
        assert (clip.captions, clip.name, clip.split) == (acted.captions, acted.name, acted.split)
        assert dict(clip.attributes) == acted.attributes
        decoded = joints_of(clip.features, HUMANML3D)
        steps = [np.linalg.norm(np.diff(roots, axis=0), axis=-1) for roots in (decoded[:, 0], acted.positions[:-1, 0])]
        np.testing.assert_allclose(*steps, atol=1e-4)
        np.testing.assert_allclose(decoded[..., 1], acted.positions[:-1, :, 1], atol=2e-2)
