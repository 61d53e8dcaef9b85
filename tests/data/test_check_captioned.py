"""What check-data says of small folders laid out as HumanML3D and KIT-ML."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mwlib.cli import main
from mwlib.data.captioned import captioned_people
from mwlib.data.check import captioned_folder, is_captioned
from mwlib.data.formats.humanml import KIT, LAYOUTS
from mwlib.data.normalisation import Statistics
from mwlib.text_to_motion.config import Config
from mwlib.text_to_motion.objective import statistics_files

LISTS = {"train": "000000 M000000 000001 000002", "val": "000003", "test": "000004 000005"}
TEXT = "A man walks.#a/DET man/NOUN walk/VERB#0.0#0.0\nHe is walking on, slowly.#he/PRON walk/VERB slowly/ADV#{times}\n"


def write_folder(folder: Path, clips: list[np.ndarray]) -> Path:
    """Clips by the names of the lists, two captions each; the second one of 000001 has times."""
    for name in ("new_joint_vecs", "texts"):
        (folder / name).mkdir(parents=True)
    for split, names in LISTS.items():
        (folder / f"{split}.txt").write_text("\n".join(names.split()))
    for name, features in zip(" ".join(LISTS.values()).split(), clips, strict=True):
        np.save(folder / "new_joint_vecs" / f"{name}.npy", features)
        times = "0.5#2.5" if name == "000001" else "0.0#0.0"
        (folder / "texts" / f"{name}.txt").write_text(TEXT.format(times=times))
    return folder


def write_statistics(folder: Path, **changes: np.ndarray) -> None:
    """Mean.npy and Std.npy of all clips, but for what is changed."""
    clips = [np.load(file) for file in sorted((folder / "new_joint_vecs").glob("*.npy"))]
    own = Statistics.measured(clips, LAYOUTS[clips[0].shape[1]])
    for name, numbers in {"Mean": own.mean.numpy(), "Std": own.deviation.numpy(), **changes}.items():
        np.save(folder / f"{name}.npy", numbers)


@pytest.fixture
def humanml3d(tmp_path) -> Path:
    people = [clip.features for clip in captioned_people(60) if len(clip.features) >= 60][:7]
    return write_folder(tmp_path / "HumanML3D", people)


@pytest.fixture
def kit(tmp_path) -> Path:
    rng = np.random.default_rng(0)
    lengths = (24, 30, 60, 196, 199, 40, 50)
    return write_folder(tmp_path / "KIT-ML", [rng.normal(size=(n, KIT.width)).astype(np.float32) for n in lengths])


def said(folder: Path) -> dict[str, str]:
    return dict(captioned_folder(folder).lines)


def test_a_whole_folder_is_told_by_its_captions_and_not_by_windows(humanml3d, capsys):
    write_statistics(humanml3d)
    assert main(["check-data", str(humanml3d)]) == 0
    found = capsys.readouterr().out
    for told in (
        "  splits    4 ids in train.txt, 1 ids in val.txt, 2 ids in test.txt; 1 are mirror images (M before the ID); "
        "published 23384, 1460, 4384",
        "  clips     8 of HumanML3D: 5 train, 1 val, 2 test; 1 of them stretches with times of their own",
        "  captions  14, 1 to 2 a clip; 3 to 5 words, 8 different",
        "  speech    parts of speech of all captions, as the published evaluator reads them",
        "  scale     Mean.npy and Std.npy: means at most ",
        "left out of training: nothing",
        "  text to motion: HumanML3D, 5 clips to train on, 2 to test on",
    ):
        assert told in found
    assert "windows" not in found and "50 Hz" not in found and "prediction:" not in found and "A column subject" not in found


def test_windows_are_told_where_they_are_asked_for(humanml3d, capsys):
    assert main(["check-data", str(humanml3d), "--history", "10", "--future", "20", "--fps", "20"]) == 0
    found = capsys.readouterr().out
    assert " of 10 + 20 frames at 20 Hz" in found and "  prediction: " in found and "  splits    4 ids" in found


def test_kit_has_shorter_clips_and_longer_ones_are_cut(kit):
    found = said(kit)
    assert "published" not in found["splits"]
    assert found["clips"] == "8 of KIT-ML: 5 train, 1 val, 2 test; 1 of them stretches with times of their own"
    assert found["frames"] == "24 to 199, 1.9 to 15.9 s at 12.5 Hz; 2 have 196 or more and are cut there"
    assert found["scale"] == "no Mean.npy, no Std.npy: training measures the clips (statistics=clips)"


def test_clips_that_are_too_short_are_left_out_and_broken_ones_are_wrong(kit):
    folder = kit / "new_joint_vecs"
    np.save(folder / "000002.npy", np.load(folder / "000002.npy")[:20])
    np.save(folder / "000004.npy", np.full((60, KIT.width), np.nan, np.float32))
    (folder / "000005.npy").unlink()
    (kit / "texts" / "000003.txt").write_text("a man walks\n")
    found = captioned_folder(kit)
    assert found.left_out == ["1 left out, shorter than 24 frames: 000002"]
    assert [fault.partition(kit.name)[2] or fault for fault in found.wrong] == [
        "/texts/000003.txt, line 1: found 'a man walks'; expected caption#word/POS word/POS ...#start#end",
        "1 left out, not finite: 000004",
        "1 left out, no features: 000005",
    ]
    assert "3 train, 0 val, 0 test" not in found.lines[1][1] and "0 val, 0 test" in found.lines[1][1]


@pytest.mark.parametrize(("line", "told"), [
    ("M000001", "test.txt, line 3: found M000001, as 000001 in train.txt, line 3; expected clips that no other list has"),
    ("000003", "test.txt, line 3: found 000003, as 000003 in val.txt, line 1; expected clips that no other list has"),
    ("000004", "test.txt, line 3: found 000004, as in line 1; expected every clip once"),
])  # fmt: skip
def test_a_clip_of_two_lists_or_its_mirror_image_is_refused(kit, capsys, line, told):
    (kit / "test.txt").write_text(f"000004\n000005\n{line}\n")
    assert any(told in fault for fault in captioned_folder(kit).wrong)
    assert main(["check-data", str(kit)]) == 1
    found = capsys.readouterr().out
    assert told in found and "text to motion: refused: " in found


def test_captions_without_parts_of_speech_are_named(kit):
    (kit / "texts" / "000004.txt").write_text("A man walks.##0.0#0.0\n")
    assert said(kit)["speech"] == "parts of speech lacking in 1 clips, which the published evaluator refuses: 000004"


def test_statistics_of_other_clips_are_doubted(kit):
    write_statistics(kit)
    assert captioned_folder(kit).wrong == []
    deviation = np.load(kit / "Std.npy")
    deviation[:4] /= 25
    write_statistics(kit, Std=deviation)
    (fault,) = captioned_folder(kit).wrong
    assert fault.startswith("Mean.npy and Std.npy are of other clips or another kind: ") and "deviations 0.04 to 1 " in fault
    write_statistics(kit, Mean=np.load(kit / "Mean.npy") + np.float32(0.8))
    assert "another kind: means at most 0.8" in captioned_folder(kit).wrong[0]
    write_statistics(kit, Mean=np.zeros(263, np.float32), Std=np.ones(263, np.float32))
    assert captioned_folder(kit).wrong[0].endswith("Std.npy are not of KIT-ML")
    (kit / "Std.npy").write_bytes(b"")
    assert "Std.npy, array: found" in captioned_folder(kit).wrong[0]
    (kit / "Std.npy").unlink()
    assert captioned_folder(kit).wrong == [] and said(kit)["scale"].startswith("no Std.npy: ")


def test_the_files_looked_at_are_those_that_training_reads(kit):
    cfg = Config.preset("tiny", data=str(kit), statistics="files")
    assert [file.name for file in statistics_files(cfg)] == ["Mean.npy", "Std.npy"]


def test_other_folders_have_no_captions(tmp_path, kit):
    assert is_captioned(kit) and not is_captioned(tmp_path) and not is_captioned(kit / "train.txt")
    for split in LISTS:
        (kit / f"{split}.txt").unlink()
    assert not is_captioned(kit)


def test_a_folder_without_a_clip_says_why(kit):
    for file in (kit / "new_joint_vecs").iterdir():
        file.unlink()
    found = captioned_folder(kit)
    assert [word for word, _ in found.lines] == ["splits"] and "7 left out, no features: 000000" in found.wrong[0]
