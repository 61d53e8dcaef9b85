"""The clips of Bandai-Namco's motion data set that our tests and tables use, from GitHub."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from mwlib.data.fetching.download import Patience, download
from mwlib.data.fetching.lists import at, byte_fault, listed
from mwlib.data.fetching.workplace import in_turn, progress, workplace
from mwlib.files import write_atomic

COMMIT = "74ead3ba1ae4696404e6086233779f60de8bf9ef"
URL = f"https://raw.githubusercontent.com/BandaiNamcoResearchInc/Bandai-Namco-Research-Motiondataset/{COMMIT}/dataset"
FOLDER = "bandai_namco"
LICENCE = "3711f963c05d0be80d53e5923308a6dee31b203da23435c9cfb7c7b6e4dd5e19"  # SHA-256, the same for both data sets
MOST = 40_000_000  # bytes of one file; the longest listed has 3 million

Wanted = tuple[str, str, str]  # name here, place there, SHA-256


def wanted() -> list[Wanted]:
    """Every file that is brought: the listed clips, and the licences."""
    place = "Bandai-Namco-Research-Motiondataset-{}/{}".format
    licences = [(f"LICENSE_dataset-{n}.txt", place(n, "LICENSE"), LICENCE) for n in (1, 2)]
    clips = listed("bandai_namco")
    return licences + [(c.file, place(c.file.removeprefix("dataset-")[0], f"data/{c.file}"), c.sha256) for c in clips]


def fetch_bandai_namco(
    to: Path,
    url: str = URL,
    patience: Patience = Patience(),  # noqa: B008
    files: Sequence[Wanted] | None = None,
) -> Path:
    """Bring the listed files into to/bandai_namco, one after another, each checked by its SHA-256.

    Args:
        to: where data lie.
        url: where the folders of the two data sets lie.
        files: other ones; for tests.

    Returns:
        The folder, which `load_motions` reads.

    Raises:
        FetchError: no connection, or the server sends something else.
        PermissionError: nothing can be written there.
    """
    files, folder = wanted() if files is None else files, to / FOLDER
    if _missing(folder, files):
        with workplace(to, "bandai-namco") as staging:
            missing = _missing(folder, files)  # another process may have been here
            with progress("Bandai-Namco clips", len(files), "file") as bar:
                bar.update(len(files) - len(missing))
                for name, place, sha256 in missing:
                    part = staging / name
                    download(f"{url}/{place}", part, lambda file, sha=sha256: byte_fault(file, sha), most=MOST, patience=patience)
                    write_atomic(folder / name, part.read_bytes())
                    part.unlink()
                    bar.update()
                    time.sleep(patience.between)
    return folder


def _missing(folder: Path, files: Sequence[Wanted]) -> list[Wanted]:
    """Files that are not there, or with other bytes."""
    return [
        file for file in in_turn(files, "checking files") if (there := at(folder, file[0])) is None or byte_fault(there, file[2])
    ]
