"""Which clips a configuration names."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.data.captioned import CaptionsConfig, load_clips
from mwlib.data.formats.humanml import KIT


def test_a_folder_is_looked_up_where_data_are(tmp_path, monkeypatch):
    for name in ("new_joint_vecs", "texts"):
        (tmp_path / "data" / "own" / name).mkdir(parents=True)
    for name, split, frames in (("1", "train", 30), ("2", "test", 60), ("3", "train", 26)):
        np.save(tmp_path / "data" / "own" / "new_joint_vecs" / f"{name}.npy", np.ones((frames, KIT.width), np.float32))
        (tmp_path / "data" / "own" / "texts" / f"{name}.txt").write_text("a person walks#a/DET#0.0#0.0\n")
        with (tmp_path / "data" / "own" / f"{split}.txt").open("a") as listed:
            listed.write(f"{name}\n")
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path / "data"))
    parts = load_clips(CaptionsConfig(data="own", shortest=28, longest=40))
    assert [[(clip.name, len(clip.features)) for clip in part] for part in parts] == [[("1", 30)], [], [("2", 40)]]
    assert parts.layout is KIT
    with pytest.raises(
        FileNotFoundError, match="data is .other., which is neither here nor in .*; expected people, cmu, or a folder"
    ):
        load_clips(CaptionsConfig(data="other"))
