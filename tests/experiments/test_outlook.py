"""What check-data says of each system's training, against what the systems do."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from mwlib import write_bvh
from mwlib.body.motion import Motion
from mwlib.body.skeleton import HUMANML22
from mwlib.cli import main
from mwlib.data.check import CaptionedFolder
from mwlib.data.formats.humanml import KIT
from mwlib.data.sources import SourceConfig
from mwlib.experiments.outlook import outlook
from mwlib.prediction import system as prediction
from mwlib.synthetic.acts import captioned_positions
from mwlib.synthetic.motions import synthetic_motions
from tests.sample_motions import BVH

WALKS = synthetic_motions(subjects=2, seconds=4.0)
ACTED = [
    Motion(clip.positions, 20.0, HUMANML22, subject=clip.name, name=clip.name, up="y")
    for clip in captioned_positions(20)
    if len(clip.positions) > 60
][:4]
NO_CAPTIONS = "text to motion: needs captions, as a folder laid out as HumanML3D or KIT has them: none found"


def own(motion: Motion, count: int) -> Motion:
    """The same with a skeleton of the first joints, which no system knows."""
    s = motion.skeleton
    skeleton = replace(s, name=f"own{count}", joints=s.joints[:count], parents=s.parents[:count], left=(), right=(), parts={})
    return replace(motion, positions=motion.positions[:, :count], skeleton=skeleton, rig=None)


def with_lists(folder, train: str, test: str) -> None:
    """A folder of three clips laid out as KIT-ML."""
    for name in ("new_joint_vecs", "texts"):
        (folder / name).mkdir()
    rng = np.random.default_rng(0)
    for name in "123":
        np.save(folder / "new_joint_vecs" / f"{name}.npy", rng.normal(size=(60, KIT.width)).astype(np.float32))
        (folder / "texts" / f"{name}.txt").write_text("a person walks#a/DET#0.0#0.0\n")
    (folder / "train.txt").write_text(train)
    (folder / "test.txt").write_text(test)


@pytest.mark.parametrize(
    ("motions", "fps", "found"),
    [
        (WALKS, None, "prediction: 17 joints kept, 50 Hz kept; 12 clips to train on, 12 to test on"),
        (WALKS, 25.0, "prediction: refused: no train clip is longer than 125 frames"),
        (
            [replace(m, fps=25.0 + 5 * (m.subject == "P2")) for m in WALKS],
            None,
            "prediction: 17 joints kept, 25 and 30 Hz → 50 Hz; 12 clips to train on, 12 to test on",
        ),
        (ACTED, None, "prediction: 22 joints carried to 17, 20 Hz → 50 Hz; 3 clips to train on, 1 to test on"),
        ([own(m, 9 + (m.subject == "P2")) for m in WALKS], None, "prediction: refused: .* has skeleton own10 .*, .* has own9"),
        (WALKS, None, "in-betweening, positions: 17 joints kept, 50 Hz "),
        (WALKS, None, "in-betweening, rotations: refused: .* has positions only; expected rotations, as BVH and AMC files have"),
        (WALKS, None, NO_CAPTIONS),
    ],
)  # fmt: skip
def test_a_line_says_what_training_makes_of_bodies(tmp_path, motions, fps, found):
    lines = outlook(tmp_path, motions, fps)
    (line,) = [line for line in lines if line.startswith(found.split(":")[0] + ":")]
    assert re.match(found, line), line


def test_bodies_are_carried_as_training_carries_them(tmp_path):
    write_bvh(WALKS[0], tmp_path / "a.bvh")
    data = prediction.load_data(prediction.Config().override(data=str(tmp_path)), WALKS)
    line = outlook(tmp_path, WALKS)[0]
    assert f"{len(data.train)} clips to train on, {len(data.test)} to test on" in line
    assert SourceConfig().fps == data.train[0].fps == 50.0


def test_captions_are_counted_or_refused_as_training_does(tmp_path, capsys):
    with_lists(tmp_path, "1\n2\n", "3\n")
    assert outlook(tmp_path, [])[-1] == "text to motion: KIT-ML, 2 clips to train on, 1 to test on"
    (tmp_path / "test.txt").write_text("3\nM2\n1\n3\n")
    (tmp_path / "texts" / "2.txt").write_text("walks\n")
    assert "text to motion: refused: " in outlook(tmp_path, [])[-1] and "test.txt, line 2: found M2" in outlook(tmp_path, [])[-1]
    assert main(["check-data", str(tmp_path)]) == 1
    wrong = capsys.readouterr().out.split("looks wrong:")[1]
    for told in (
        "test.txt, line 2: found M2, as 2 in train.txt, line 2; expected clips that no other list has",
        "test.txt, line 3: found 1, as 1 in train.txt, line 1",
        "test.txt, line 4: found 3, as in line 1; expected every clip once",
        "2.txt, line 1: found 'walks'; expected caption#word/POS",
        "1 left out, no features: M2",
    ):
        assert told in wrong


@pytest.mark.parametrize(("faults", "code"), [([], 0), (["test.txt, line 2: found 3, as in line 1"], 1)])
def test_a_fault_of_a_list_alone_is_a_fault(tmp_path, monkeypatch, capsys, faults, code):
    (tmp_path / "a.bvh").write_text(BVH)
    monkeypatch.setattr("mwlib.data.check.is_captioned", lambda path: True)
    monkeypatch.setattr("mwlib.data.check.captioned_folder", lambda path: CaptionedFolder([], [], faults))
    assert main(["check-data", str(tmp_path)]) == code
    assert all(fault in capsys.readouterr().out for fault in faults)


def test_check_data_ends_with_what_each_system_would_take(tmp_path, capsys):
    (tmp_path / "a.bvh").write_text(BVH)
    assert main(["check-data", str(tmp_path)]) == 0
    last = capsys.readouterr().out.split("training, at default settings:\n")[1].splitlines()
    assert [line.strip().partition(":")[0] for line in last] == [
        "prediction", "in-betweening, positions", "in-betweening, rotations", "text to motion",
    ]  # fmt: skip
    assert "prediction: refused: no test clips: " in last[0]
