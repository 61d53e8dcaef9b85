"""Splits that keep people apart, clips as models take them, and fingerprints that see every frame."""

from __future__ import annotations

import json
import os
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mwlib import Motion, load_motions
from mwlib.body.skeleton import CMU, H36M17, Skeleton
from mwlib.data import sources
from mwlib.data.collections import acknowledgement
from mwlib.data.sources import SourceConfig, Split, data_fingerprint, fingerprint, split_motions
from mwlib.data.windows import Bodies, prepare, windows
from mwlib.paths import MODELS
from mwlib.prediction.config import Config
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_motions import BVH


def clip(subject: str, frames: int = 60) -> Motion:
    walk = np.random.default_rng(frames).normal(size=(frames, 17, 3))
    return Motion(walk, 50.0, H36M17, subject=subject, name=f"{subject}_{frames}")


def split_of(monkeypatch, motions, **changes) -> Split:
    """The split; every clip is in one part at most, and unless people are chosen to train on none is lost."""
    monkeypatch.setattr(sources, "load_motions", lambda source, **stated: motions)
    split = split_motions(SourceConfig(data="somewhere", **changes))
    if len(motions) > 1:  # else it is parted in time
        lost = Counter(m.name for m in motions)
        lost.subtract(m.name for part in split for m in part)
        assert min(lost.values()) == 0 and ("train_subjects" in changes or not any(lost.values())), changes
    return split


def test_people_are_kept_apart(monkeypatch):
    people = [clip(s) for s in "ABCDEFGHI" for _ in range(2)]
    split = split_of(monkeypatch, people)
    assert {m.subject for m in split.test} == {"H", "I"} and {m.subject for m in split.train} == set("ABCDEFG")
    split = split_of(monkeypatch, people, test_subjects=("B",), validation_subjects=("C",))
    assert {m.subject for m in split.test} == {"B"} and {m.subject for m in split.validation} == {"C"}
    assert {m.subject for m in split.train} == set("ADEFGHI")
    split = split_of(monkeypatch, people, train_subjects=("A",), test_subjects=("B",))
    assert {m.subject for m in split.train} == {"A"} and split.validation == []
    split = split_of(monkeypatch, people, validation_subjects=["I"])
    assert {m.subject for m in split.test} == {"G", "H"} and {m.subject for m in split.train} == set("ABCDEF")
    split_of(monkeypatch, people, validation_subjects=["B"], test_subjects=["C", "D"])


def test_one_person_is_split_by_clips(monkeypatch):
    split = split_of(monkeypatch, [clip("A", 60 + i) for i in range(9)])
    assert [m.name for m in split.test] == ["A_67", "A_68"] and len(split.train) == 7
    with pytest.raises(ValueError, match="no test clips: somewhere has 1 clips .*; give .* clips.csv"):
        split_of(monkeypatch, [clip("A", 3)])
    with pytest.raises(ValueError, match=r"test_subjects has \['Z'\]"):
        split_of(monkeypatch, [clip("A"), clip("B")], test_subjects=("Z",))


@pytest.mark.parametrize(("frames", "test"), [(60, 15), (61, 15), (4, 1)])
def test_one_clip_is_parted_in_time(monkeypatch, frames, test):
    whole = clip("P1", frames)
    train, validation, held_out = split_of(monkeypatch, [whole], fps=whole.fps)
    assert (len(train[0]), validation, len(held_out[0])) == (frames - test, [], test)
    assert np.array_equal(np.concatenate([train[0].positions, held_out[0].positions]), whole.positions)


def test_prepare_turns_resamples_and_retargets():
    y_up = Motion(np.random.default_rng(0).normal(size=(25, 31, 3)), 120.0, CMU, up="y")
    (ready,) = prepare([y_up], 60.0)
    assert (ready.up, ready.fps, ready.skeleton) == ("z", 60.0, H36M17) and len(ready) == 13
    np.testing.assert_allclose(ready.positions[:, 0, 2], y_up.positions[::2, 0, 1])


def test_fingerprint_sees_every_frame():
    motions = synthetic_motions(subjects=1, seconds=1.0)
    changed = motions[3].positions.copy()
    changed[-1, 5, 2] += 1e-3
    others = [*motions[:3], replace(motions[3], positions=changed), *motions[4:]]
    assert fingerprint(motions) == fingerprint(synthetic_motions(subjects=1, seconds=1.0))
    assert fingerprint(motions) != fingerprint(others)
    assert fingerprint(motions) != fingerprint([replace(motions[0], action="else"), *motions[1:]])
    renamed = replace(H36M17, joints=("pelvis", *H36M17.joints[1:]))
    assert fingerprint(motions) != fingerprint([replace(motions[0], skeleton=renamed), *motions[1:]])
    assert Split(motions, others, []).fingerprints() == (fingerprint(motions), fingerprint([]))


ARM = Skeleton("own", ("hips", "left_hand", "right_hand"), (-1, 0, 0), (1,), (2,), {"left_arm": (1,), "right_arm": (2,)})


@pytest.mark.parametrize("change", [
    {"parts": {"left_arm": (2,), "right_arm": (1,)}}, {"parts": {}}, {"name": "other"}, {"left": (2,), "right": (1,)},
    {"left": (), "right": ()}, {"parents": (-1, 0, 1)}, {"joints": ("hips", "right_hand", "left_hand")},
])  # fmt: skip
def test_fingerprint_sees_whatever_of_a_skeleton_a_training_reads(change):
    one = Motion(np.random.default_rng(0).normal(size=(9, 3, 3)), 50.0, ARM)
    assert fingerprint([one]) != fingerprint([replace(one, skeleton=replace(ARM, **change))])
    assert fingerprint([one]) == fingerprint([replace(one, name="other", skeleton=replace(ARM, parts=dict(ARM.parts)))])


def test_other_parts_in_a_skeleton_file_are_other_data(tmp_path):
    np.save(tmp_path / "a.npy", np.random.default_rng(0).normal(size=(9, 3, 3)))
    tree = {"name": "own", "joints": ARM.joints, "parents": ARM.parents, "fps": 50, "unit": "m", "up": "z"}
    found = set()
    for parts in ({}, {"left_arm": [1], "right_arm": [2]}, {"left_arm": [2], "right_arm": [1]}):
        (tmp_path / "skeleton.json").write_text(json.dumps(tree | {"parts": parts}))
        found.add(fingerprint(load_motions(tmp_path)))
    assert len(found) == 3


def test_fingerprint_sees_rotations_that_move_no_joint(tmp_path):
    """A hand that turns about its own bone stays where it is, and in-betweening by rotations trains on it."""
    clips = []
    for one, other in (("", ""), ("6 7 8 9 10 3 40", "6 7 8 9 11 3 40"), ("OFFSET 0 -5 12", "OFFSET 0 -5 13")):
        (tmp_path / "a.bvh").write_text(BVH.replace(one, other) if one else BVH)
        clips += load_motions(tmp_path)
    for other in clips[1:]:
        np.testing.assert_array_equal(other.positions, clips[0].positions)
    assert len({fingerprint([m]) for m in clips}) == 3
    assert len({fingerprint([replace(m, rig=None)]) for m in clips}) == 1


def test_the_embedded_people_are_known_by_the_fingerprint_that_their_models_name():
    shipped = json.loads((MODELS / "synthetic" / "metrics.json").read_text())
    split = split_motions(Config.from_yaml(MODELS / "synthetic" / "config.yaml").data)
    assert [*split.fingerprints()] == shipped["about"]["data"]


def test_nobody_stands_in_two_lists(monkeypatch):
    people = [clip(s) for s in "ABCDEFGH" for _ in range(2)]
    with pytest.raises(ValueError, match=r"\['B'\] stand in .* and in .*; expected every subject in one list"):
        split_of(monkeypatch, people, train_subjects=["A", "B"], test_subjects=["B"])
    split = split_of(monkeypatch, people, train_subjects=["E", "F", "H"])
    assert not {m.subject for m in split.train} & {m.subject for m in split.test}


def test_unit_axis_and_rate_of_the_files_are_settings(tmp_path):
    walks = [m.with_up("y") for m in synthetic_motions(subjects=2, seconds=1.0)]
    (tmp_path / "skeleton.json").write_text('{"name": "H36M17"}')
    for number, walk in enumerate(walks[:3] + walks[-3:]):
        np.save(tmp_path / f"{number % 2 + 1}_{number:02}.npy", walk.positions / 0.0254)
    said = {"unit": "inch", "up": "y", "file_fps": 50.0}
    split = split_motions(SourceConfig(data=str(tmp_path), fps=25.0, **said))
    assert {(m.fps, m.up, m.skeleton) for m in (*split.train, *split.test)} == {(25.0, "z", H36M17)}
    np.testing.assert_allclose(split.train[0].positions, walks[0].with_up("z").resample(25.0).positions, atol=1e-5)
    for left_out, word in (("unit", "body size"), ("up", "up-axis"), ("file_fps", "frame rate")):
        given = {name: value for name, value in said.items() if name != left_out}
        with pytest.raises(ValueError, match=f"1_00.npy, {word}"):
            split_motions(SourceConfig(data=str(tmp_path), **given))


@pytest.mark.parametrize(("changes", "message"), [
    ({"unit": "inches"}, "unit is 'inches'; expected one of .*inch.*did you mean 'inch'"),
    ({"up": "x"}, "up is 'x'; expected one of"), ({"unti": "cm"}, "did you mean 'unit'"), ({"file_fps": -1}, "file_fps is -1"),
])  # fmt: skip
def test_a_misspelt_statement_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Config.preset("tiny", **changes)
    assert "unit: ''" in Config.preset("tiny").to_yaml()


def test_clips_that_differ_are_named():
    other = replace(clip("B"), up="y")
    for made in (lambda: Bodies.of([clip("A"), other]), lambda: windows([clip("A"), other], 10, 10, 5)):
        with pytest.raises(ValueError, match="B_60 has up y, A_60 has z; expected one and the same"):
            made()


@pytest.mark.parametrize("path", ["cmu", "cmu/asfamc", "CMU", "/home/me/data/cmu/asfamc", "data/cmu_benchmark/train"])
def test_cmu_is_acknowledged_wherever_it_lies(path):
    assert "NSF EIA-0196217" in acknowledgement(path)["acknowledgement"]


def test_others_and_links_are_acknowledged_as_what_they_are(tmp_path, monkeypatch):
    assert acknowledgement("synthetic") == acknowledgement("/home/acmu/abandai_namco") == {}
    assert "CC BY-NC-ND" in acknowledgement("/home/acmu/LaFAN1")["acknowledgement"]
    assert "arXiv 2306.08861" in acknowledgement("Bandai_Namco/more")["acknowledgement"]
    (tmp_path / "cmu" / "asfamc").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "cmu" / "asfamc")
    assert acknowledgement(".")


def test_clips_are_made_ready_as_the_system_wants_them(monkeypatch):
    """By default turned, carried over and resampled; otherwise whatever the given function makes of them."""
    asked = []

    def halved(motions, fps):
        asked.append((len(motions), fps))
        return [replace(m, fps=fps, positions=m.positions[:30]) for m in motions]

    monkeypatch.setattr(sources, "load_motions", lambda source, **stated: [clip(s) for s in "ABCD"])
    given = SourceConfig(data="somewhere", fps=25.0)
    split = split_motions(given, halved)
    assert asked == [(4, 25.0)] and {(len(m), m.fps) for part in split for m in part} == {(30, 25.0)}
    assert [m.subject for m in split.train] == [m.subject for m in split_motions(given).train]
    assert {len(m) for m in split_motions(given).train} == {30} and split_motions(given).train[0].fps == 25.0
    assert not np.array_equal(split_motions(given).train[0].positions, split.train[0].positions)
    with pytest.raises(ValueError, match="has fps"):
        split_motions(given, lambda motions, fps: [replace(m, fps=fps + i) for i, m in enumerate(motions)])


@pytest.fixture
def data(tmp_path) -> Path:
    """A folder of files in two levels, below another."""
    folder = tmp_path / "all" / "data"
    for name in ("a.bvh", "deep/b.amc", "deep/b.asf", "clips.csv"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    return folder


def swap(one: Path, other: Path) -> None:
    text = one.read_text()
    one.write_text(other.read_text())
    other.write_text(text)


CHANGES = {
    "edited": lambda folder: (folder / "a.bvh").write_text("A.bvh"),
    "edited at the same time": lambda folder: ((folder / "a.bvh").write_text("A.bvh"), os.utime(folder / "a.bvh", (1, 1))),
    "added": lambda folder: (folder / "deep" / "c.npz.xz").write_text(""),
    "removed": lambda folder: (folder / "a.bvh").unlink(),
    "renamed": lambda folder: (folder / "a.bvh").rename(folder / "b.bvh"),
    "moved": lambda folder: (folder / "a.bvh").rename(folder / "deep" / "a.bvh"),
    "swapped": lambda folder: swap(folder / "a.bvh", folder / "deep" / "b.amc"),
    "skeleton": lambda folder: (folder / "deep" / "b.asf").write_text("other"),
    "hints": lambda folder: (folder / "clips.csv").write_text("other"),
    "hints above": lambda folder: (folder.parent / "clips.csv").write_text("new"),
}
NO_CHANGES = {
    "nothing": lambda folder: None,
    "touched": lambda folder: os.utime(folder / "a.bvh", (1, 1)),
    "written again": lambda folder: (folder / "a.bvh").write_text("a.bvh"),
    "other files": lambda folder: (folder / "notes.md").write_text("x"),
    "hidden": lambda folder: (folder / ".a.bvh").write_text("x"),
    "pipe": lambda folder: os.mkfifo(folder / "pipe.bvh"),
    "broken link": lambda folder: (folder / "link.bvh").symlink_to("nowhere"),
}


@pytest.mark.parametrize("name", [*CHANGES, *NO_CHANGES])
def test_the_fingerprint_of_data_follows_their_files(data, name):
    before = data_fingerprint(str(data))
    {**CHANGES, **NO_CHANGES}[name](data)
    assert (data_fingerprint(str(data)) != before) == (name in CHANGES)


def test_a_single_file_counts_with_its_skeleton_and_hints_only(data):
    file = str(data / "deep" / "b.amc")
    before = data_fingerprint(file)
    (data / "a.bvh").unlink()
    assert data_fingerprint(file) == before
    (data / "deep" / "b.asf").write_text("other")
    after = data_fingerprint(file)
    (data / "clips.csv").unlink()
    assert len({before, after, data_fingerprint(file)}) == 3


def test_data_are_found_where_loading_finds_them(data, monkeypatch):
    monkeypatch.setenv("MWLIB_DATA", str(data.parent))
    assert data_fingerprint("data") == data_fingerprint(str(data)) != data_fingerprint("nowhere")
    assert data_fingerprint("synthetic") == data_fingerprint("tiny") == data_fingerprint("nowhere")


def test_whole_numbers_are_places_like_others():
    walk = np.arange(10)[:, None, None] * np.ones((10, 3, 3), int) * 5
    for kind in (np.int64, np.uint8):
        found = Motion(walk.astype(kind), 10.0, ARM)
        assert found.positions.dtype == np.float64
        np.testing.assert_allclose(found.resample(20.0).positions[:4, 0, 0], [0, 2.5, 5, 7.5])
        assert np.isfinite(found.turn(0.3).mirror().positions).all() and found.root_relative().min() >= 0
