"""Folders of HumanML3D and KIT-ML: which clips are seen, with which captions, and what is left out."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from mwlib import MotionFormatError, load_motions
from mwlib.body.skeleton import HUMANML22
from mwlib.data.captioned import fingerprint
from mwlib.data.collections.humanml import KIT21
from mwlib.data.formats.humanml import (
    HUMANML3D,
    KIT,
    CaptionedClip,
    FeatureLayout,
    TaggedCaption,
    folder_contents,
    joints_of,
    read_folder,
)
from mwlib.data.formats.humanml_encoding import features_of
from mwlib.data.untrusted import BrokenFilesWarning
from tests.data.formats.sample_features import wandering

WHOLE = "a person walks#a/DET person/NOUN walk/VERB#0.0#0.0\n"


def clip(frames: int, layout: FeatureLayout = HUMANML3D) -> np.ndarray:
    """Features whose numbers are those of their frames."""
    return np.tile(np.arange(frames, dtype=np.float32)[:, None], (1, layout.width))


@pytest.fixture
def folder(tmp_path) -> Path:
    """Five clips, one of them with times, and lists that name one more."""
    for name in ("new_joint_vecs", "texts"):
        (tmp_path / name).mkdir()
    for name, frames in {"000001": 100, "M000001": 100, "000002": 39, "000003": 200, "000004": 199, "007975": 50}.items():
        np.save(tmp_path / "new_joint_vecs" / f"{name}.npy", clip(frames))
        (tmp_path / "texts" / f"{name}.txt").write_text(WHOLE)
    (tmp_path / "texts" / "000001.txt").write_text(
        WHOLE + "then stops#then/ADV stop/VERB#1.0#4.5\n\nruns #run/VERB#nan#nan\nfalls#fall/VERB#3.0#4.0\n"
    )
    broken = clip(50)
    broken[7, 3] = np.nan
    np.save(tmp_path / "new_joint_vecs" / "007975.npy", broken)
    (tmp_path / "train.txt").write_text("000001\n000021\nM000001\n000002\n007975\n")
    (tmp_path / "test.txt").write_text("000003\n000004\n")
    (tmp_path / "all.txt").write_text("000001\n")
    return tmp_path


def alone(folder: Path, split: str = "test") -> Path:
    """The folder with one of its lists."""
    (folder / {"test": "train.txt", "train": "test.txt"}[split]).unlink()
    return folder


def test_clips_have_their_captions_and_stretches_are_clips_of_their_own(folder):
    clips, left_out = folder_contents(folder)
    assert [(c.name, c.split, len(c.features)) for c in clips] == [
        ("000001", "train", 100), ("000001 line 2, 1 to 4.5 s", "train", 70), ("M000001", "train", 100), ("000004", "test", 199),
    ]  # fmt: skip
    assert clips[0].captions == ("a person walks", "runs") and clips[1].captions == ("then stops",)
    np.testing.assert_array_equal(clips[1].features[:, 5], np.arange(20, 90))
    assert clips[0].features.dtype == np.float32
    assert left_out == {
        "000001 line 5, 3 to 4 s": "shorter than 40 frames", "000021": "no features", "000002": "shorter than 40 frames",
        "007975": "not finite", "000003": "200 frames or longer",
    }  # fmt: skip


def test_captions_keep_their_words_with_parts_of_speech(folder):
    text = "walks up/down #walk/VERB up/down/ADV#0#0\nruns#run#0#0\nfalls#fall/#0#0\nstops##0#0\nturns#turn/VERB#1.0#4.5\n"
    (folder / "texts" / "000004.txt").write_text(text)
    whole, piece = read_folder(alone(folder))
    first, *others = whole.captions
    assert whole.captions == ("walks up/down", "runs", "falls", "stops")
    assert isinstance(first, TaggedCaption) and first.tagged == (("walk", "VERB"), ("up/down", "ADV"))
    assert not any(isinstance(caption, TaggedCaption) for caption in others), "not all of their words have a tag"
    assert isinstance(piece.captions[0], TaggedCaption) and piece.captions[0].tagged == (("turn", "VERB"),)
    again = pickle.loads(pickle.dumps(first))
    assert again == first and again.tagged == first.tagged
    other = CaptionedClip(whole.features, (TaggedCaption(first, [("walk", "NOUN"), ("up/down", "ADV")]), *others), whole.name)
    plain = CaptionedClip(whole.features, tuple(map(str, whole.captions)), whole.name)
    assert len({fingerprint([clip]) for clip in (whole, other, plain)}) == 3, "what a score may depend on is part of the data"


def test_it_is_said_what_was_left_out_and_why(folder):
    first, *others = folder_contents(folder).reasons()
    assert first == "2 left out, shorter than 40 frames: 000001 line 5, 3 to 4 s, 000002"
    assert {*others} == {
        "1 left out, no features: 000021", "1 left out, not finite: 007975", "1 left out, 200 frames or longer: 000003",
    }  # fmt: skip


def test_of_what_is_broken_the_reader_warns_and_of_lengths_it_does_not(folder):
    with pytest.warns(BrokenFilesWarning, match=r"(?s)1 left out, no features: 000021.*1 left out, not finite: 007975") as found:
        clips = read_folder(folder)
    assert len(clips) == 4 and "frames" not in str(found[0].message)
    assert [c.name for c in read_folder(alone(folder))] == ["000004"]


def test_kit_is_cut_at_20_frames_per_second_too(tmp_path):
    for name in ("new_joint_vecs", "texts"):
        (tmp_path / name).mkdir()
    np.save(tmp_path / "new_joint_vecs" / "00001.npy", clip(24 + 20, KIT).astype(np.float64))
    (tmp_path / "texts" / "00001.txt").write_text(WHOLE + "stops#stop/VERB#1.0#9.0\n")
    (tmp_path / "val.txt").write_text("00001")
    whole, part = read_folder(tmp_path)
    assert (len(whole.features), whole.split, part.features[0, 0], len(part.features)) == (44, "val", 20, 24)
    np.save(tmp_path / "new_joint_vecs" / "00000.npy", clip(44))
    (tmp_path / "texts" / "00000.txt").write_text(WHOLE)
    (tmp_path / "val.txt").write_text("00000 00001")
    with pytest.raises(MotionFormatError, match=r"00001.npy, array: found shape \(44, 251\); expected \(T, 263\) for HumanML3D"):
        read_folder(tmp_path)


@pytest.mark.parametrize(
    "text, message",
    [
        ("walks\n", r"000004.txt, line 1: found 'walks'; expected caption#word/POS word/POS ...#start#end"),
        (WHOLE + "#a/DET#0#0\n", "000004.txt, line 2: found '#a/DET#0#0'"),
        (WHOLE + "walks#walk/VERB#0#soon\n", "000004.txt, line 2: found 'soon'; expected a finite number"),
        ("\n", "000004.txt, text: found no line; expected at least one caption"),
    ],
)
def test_a_malformed_text_is_refused(folder, text, message):
    (folder / "texts" / "000004.txt").write_text(text)
    with pytest.raises(MotionFormatError, match=message):
        read_folder(alone(folder))


@pytest.mark.parametrize(
    "array, message",
    [
        (
            np.zeros((50, 260), np.float32),
            r"float32 of shape \(50, 260\); expected .*263\) for HumanML3D or \(T, 251\) for KIT-ML",
        ),
        (np.zeros((50, 263), int), r"array: found int64 of shape \(50, 263\); expected numbers"),
        (np.zeros((263,), np.float32), r"array: found float32 of shape \(263,\)"),
        (np.array([{}], object), "dtype object"),
    ],
)
def test_malformed_features_are_refused(folder, array, message):
    np.save(folder / "new_joint_vecs" / "000003.npy", array, allow_pickle=True)
    with pytest.raises(MotionFormatError, match=message):
        read_folder(alone(folder))


SHARED = "expected clips that no other list has, as they are or mirrored"
LISTS = [
    ("000001\n000002 000002", "000003", ["train.txt, line 2: found 000002, as in line 2; expected every clip once"]),
    ("000001\n\n000002\n000001\n", "000003", ["train.txt, line 4: found 000001, as in line 1; expected every clip once"]),
    ("000001\n000002", "000002", [f"test.txt, line 1: found 000002, as 000002 in train.txt, line 2; {SHARED}"]),
    (" 000001\t\n", "\n M000001 \n", [f"test.txt, line 2: found M000001, as 000001 in train.txt, line 1; {SHARED}"]),
    (
        "000001\n" + 201 * "7",
        "000003",
        [f"train.txt, line 2: found '{40 * '7'}'; expected the name of a clip, at most 200 bytes"],
    ),
    *(
        (
            f"000001\n{name}",
            "000003",
            [f"train.txt, line 2: found {name!r}; expected the name of a clip, at most 200 bytes, below"],
        )
        for name in ("./000001", "a//b", "../new_joint_vecs/000001", "/etc/passwd", "a\\b", "a/../b")
    ),
    ("M000001", "000001", [f"test.txt, line 1: found 000001, as M000001 in train.txt, line 1; {SHARED}"]),
    (
        "000001\nM000001\n000003\n000003",
        "M000001\n000004\n000001\n000004",
        [
            "train.txt, line 4: found 000003, as in line 3; expected every clip once",
            f"test.txt, line 1: found M000001, as 000001 in train.txt, line 1; {SHARED}",
            f"test.txt, line 3: found 000001, as 000001 in train.txt, line 1; {SHARED}",
            "test.txt, line 4: found 000004, as in line 2; expected every clip once",
        ],
    ),
]


@pytest.mark.parametrize(("train", "test", "messages"), LISTS)
def test_training_and_test_share_no_clip_nor_its_mirror_image(folder, train, test, messages):
    (folder / "train.txt").write_text(train)
    (folder / "test.txt").write_text(test)
    with pytest.raises(MotionFormatError, match=re.escape(messages[0])):
        folder_contents(folder)
    faults: list[MotionFormatError] = []
    folder_contents(folder, faults)
    assert len(faults) == len(messages) and all(m in str(fault) for m, fault in zip(messages, faults, strict=True))


def test_a_clip_beside_its_mirror_image_in_one_list_is_fine(folder):
    (folder / "train.txt").write_text("000001\nM000001\n")
    assert [c.name for c in read_folder(alone(folder, "train"))][::2] == ["000001", "M000001"]


@pytest.mark.parametrize("times", ["4.0#2.0", "2.0#2.0", "2.0#nan", "20.0#25.0"])
def test_times_without_a_frame_between_them_are_told(folder, times):
    (folder / "texts" / "000004.txt").write_text(WHOLE + f"stops#stop/VERB#{times}\n")
    with pytest.warns(BrokenFilesWarning, match=r"1 left out, no frame between its times: 000004 line 2, [\d.]+ to [\d.]+ s"):
        assert [c.name for c in read_folder(alone(folder))] == ["000004"]


def test_a_start_that_is_not_known_is_the_beginning(folder):
    (folder / "texts" / "000004.txt").write_text(" stops # stop/VERB # nan # 3.0 \n")
    ((name, captions, length),) = [(c.name, c.captions, len(c.features)) for c in read_folder(alone(folder))]
    assert (name, captions, length) == ("000004 line 1, 0 to 3 s", ("stops",), 60)


def test_all_that_is_wrong_with_a_folder_is_found_at_once(folder):
    (folder / "texts" / "000001.txt").write_text("walks\n")
    (folder / "texts" / "M000001.txt").write_text(WHOLE + " #a/DET#0#0\n")
    np.save(folder / "new_joint_vecs" / "000002.npy", clip(50)[:, :200])
    faults: list[MotionFormatError] = []
    found = folder_contents(folder, faults=faults)
    assert [Path(fault.file).name for fault in faults] == ["000001.txt", "M000001.txt", "000002.npy"]
    assert [c.name for c in found.clips] == ["000004"]
    assert found.broken() == ["1 left out, no features: 000021", "1 left out, not finite: 007975"]


def test_missing_lists_and_texts(folder):
    (folder / "texts" / "000004.txt").unlink()
    assert folder_contents(alone(folder)).left_out["000004"] == "no captions"
    (folder / "test.txt").unlink()
    with pytest.raises(MotionFormatError, match=r"folder: found no list of clips; expected one of train.txt.*, beside captions"):
        read_folder(folder)


@pytest.mark.parametrize("layout, metres", [(HUMANML3D, 1.0), (KIT, 0.00175)], ids=["HumanML3D", "KIT"])
def test_features_and_joints_are_read_as_motions(tmp_path, layout, metres):
    x = features_of(wandering(20, layout), layout)
    (tmp_path / "new_joint_vecs").mkdir()
    np.save(tmp_path / "new_joint_vecs" / "a.npy", x)
    np.save(tmp_path / "Mean.npy", x[0])
    (motion,) = load_motions(tmp_path, unit=metres)  # stated, as this body is no human
    assert (motion.skeleton, motion.fps, motion.up, motion.name) == (layout.skeleton, layout.fps, "y", "a")
    np.testing.assert_allclose(motion.positions, joints_of(x.astype(float), layout) * metres, atol=1e-4)
    (tmp_path / "new_joints").mkdir()
    np.save(tmp_path / "new_joints" / "a.npy", joints_of(x, layout))
    (same,) = load_motions(tmp_path, unit=metres)  # of the two only the joints
    np.testing.assert_allclose(same.positions, motion.positions, atol=1e-4)
    assert same.skeleton == layout.skeleton and same.fps == layout.fps


def test_the_published_example_is_a_motion_either_way(data_folder):
    there, here = (load_motions(data_folder / "humanml3d" / kind)[0] for kind in ("new_joints", "new_joint_vecs"))
    np.testing.assert_allclose(here.positions, there.positions, atol=3e-7)
    assert here.skeleton == there.skeleton == HUMANML22 and KIT.skeleton == KIT21
    assert len(load_motions(data_folder / "humanml3d")) == 1


def test_features_that_are_not_finite_are_no_motion(folder):
    with pytest.raises(MotionFormatError, match=r"007975.npy, array, entry \(7, 3\): found nan"):
        load_motions(folder / "new_joint_vecs" / "007975.npy")
    with pytest.raises(MotionFormatError, match="found float32 of shape"):
        np.save(folder / "new_joint_vecs" / "b.npy", np.zeros((5, 7), np.float32))
        load_motions(folder / "new_joint_vecs" / "b.npy")
