"""Bandai-Namco's clips: named files, known byte by byte."""

from __future__ import annotations

import hashlib

import pytest

import mwlib as mw
from mwlib.data.fetching.bandai_namco import FOLDER, LICENCE, fetch_bandai_namco, wanted
from mwlib.data.fetching.errors import FetchError
from mwlib.data.fetching.lists import at, clips_of, listed
from mwlib.data.sources import fingerprint
from mwlib.data.untrusted import read_bytes
from tests.data.fetching.publisher import HASTY
from tests.sample_motions import BVH


@pytest.fixture
def files(publisher) -> list[tuple[str, str, str]]:
    bodies = {
        f"1/data/dataset-1_{action}_normal_001.bvh": BVH.replace("90 2", f"9{n} 2") for n, action in enumerate(("bow", "run"))
    }
    bodies["1/LICENSE"] = "CC BY-NC"
    publisher.files |= {path: text.encode() for path, text in bodies.items()}
    return [(path.split("/")[-1], path, hashlib.sha256(text.encode()).hexdigest()) for path, text in bodies.items()]


def test_named_files_come_once(publisher, files, tmp_path):
    folder = fetch_bandai_namco(tmp_path, publisher.url, HASTY, files)
    assert folder == tmp_path / "bandai_namco"
    assert {file.name for file in folder.iterdir()} == {"dataset-1_bow_normal_001.bvh", "dataset-1_run_normal_001.bvh", "LICENSE"}
    assert [m.action for m in mw.load_motions(folder)] == ["bow", "run"]
    fetch_bandai_namco(tmp_path, publisher.url, HASTY, files)
    assert publisher.paths() == [path for _, path, _ in files] and publisher.most_at_once == 1
    (folder / "LICENSE").write_text("half")
    (folder / "dataset-1_run_normal_001.bvh").unlink()
    fetch_bandai_namco(tmp_path, publisher.url, HASTY, files)
    assert publisher.paths()[3:] == ["1/data/dataset-1_run_normal_001.bvh", "1/LICENSE"]


@pytest.mark.parametrize("trick", ["drop", "stall", "more", "cut", "page", "empty", 503])
def test_every_file_may_fail_once(publisher, files, tmp_path, trick):
    for path in publisher.files:
        publisher.tricks[path] = [trick]
    folder = fetch_bandai_namco(tmp_path, publisher.url, HASTY, files)
    assert len(mw.load_motions(folder)) == 2 and len(publisher.asked) == 6


@pytest.mark.parametrize("body, message", [(BVH.encode(), "run_normal_001.bvh: its SHA-256 is"), (None, "run.*says 404")])
def test_other_bytes_are_refused(publisher, files, tmp_path, body, message):
    publisher.files["1/data/dataset-1_run_normal_001.bvh"] = body
    with pytest.raises(FetchError, match=message):
        fetch_bandai_namco(tmp_path, publisher.url, HASTY, files)
    assert {file.name for file in (tmp_path / FOLDER).iterdir()} == {"dataset-1_bow_normal_001.bvh"}


def test_the_places_are_those_of_the_repository():
    names = {name: place for name, place, _ in wanted()}
    assert len(names) == len(wanted()) == 83
    first = "dataset-2_walk_active_001.bvh"
    assert names[first] == f"Bandai-Namco-Research-Motiondataset-2/data/{first}"
    assert names["LICENSE_dataset-1.txt"] == "Bandai-Namco-Research-Motiondataset-1/LICENSE"


def test_the_list_agrees_with_the_clips_at_hand(data_folder, publisher, tmp_path):
    """And a folder that was brought is the one at hand, to the bit."""
    there = data_folder / FOLDER
    assert clips_of(there) == listed("bandai_namco")
    publisher.files |= {place: read_bytes(at(there, name), 10**8) for name, place, _ in wanted()}
    assert hashlib.sha256((there / "LICENSE_dataset-2.txt").read_bytes()).hexdigest() == LICENCE
    folder = fetch_bandai_namco(tmp_path, publisher.url, HASTY)
    assert len(publisher.asked) == 83 and fingerprint(mw.load_motions(folder)) == fingerprint(mw.load_motions(there))
