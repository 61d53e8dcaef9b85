"""Every collection that `mwlib fetch` knows: what it is, whose, under which licence, and how much of it is there."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mwlib.data.fetching import bandai_namco, cmu, lafan1
from mwlib.data.fetching.by_hand import BY_HAND
from mwlib.data.fetching.errors import FetchError
from mwlib.data.fetching.lists import at, listed
from mwlib.data.known import ACKNOWLEDGEMENTS
from mwlib.data.load import data_folder


@dataclass(frozen=True)
class Collection:
    """Motions that a program can download.

    Args:
        title: what it is.
        size: of the download.
        licence: in a few words.
        folder: below the folder of data.
        terms: what somebody has to accept first; "" if nothing.
        asked: what the owners want said or cited.
        bring: downloads it below a folder and returns where it is.
        counts: files there, and files that belong to it; nothing is read.
    """

    title: str
    size: str
    licence: str
    folder: str
    terms: str
    asked: str
    bring: Callable[[Path], Path]
    counts: Callable[[Path], tuple[int, int]]


def _listed_counts(name: str) -> Callable[[Path], tuple[int, int]]:
    return lambda folder: (sum(at(folder, clip.file) is not None for clip in listed(name)), len(listed(name)))


def _lafan1_counts(folder: Path) -> tuple[int, int]:
    names = os.listdir(folder) if folder.is_dir() else ()
    return len({name.split(".")[0] for name in names if lafan1.CLIP.match(name)}), lafan1.Archive().clips


COLLECTIONS = {
    "cmu": Collection(
        "CMU motion capture: the clips behind figures/cmu, 134 of 9 people, 120 Hz",
        "76 MB", "free, also commercially; not for resale", cmu.FOLDER, "",
        ACKNOWLEDGEMENTS["cmu"], cmu.fetch_cmu, _listed_counts("cmu"),
    ),
    "lafan1": Collection(
        "Ubisoft LaFAN1: 77 clips of 5 people, 30 Hz",
        "144 MB", "CC BY-NC-ND 4.0", lafan1.FOLDER,
        "Ubisoft La Forge Animation Dataset, Creative Commons Attribution-NonCommercial-NoDerivatives 4.0.\n"
        "You may use and share it unchanged, for no commercial purpose, if you name its authors; you may not share changed or\n"
        "converted copies. The whole text: https://creativecommons.org/licenses/by-nc-nd/4.0/legalcode; a copy, license.txt, is\n"
        "laid beside the clips.",
        "Please cite: Harvey, Yurick, Nowrouzezahrai, Pal: Robust Motion In-betweening. ACM Transactions on Graphics 39(4),\n"
        "2020.",
        lafan1.fetch_lafan1, _lafan1_counts,
    ),
    "bandai-namco": Collection(
        "Bandai-Namco Research Motiondataset 1 and 2: 81 clips of them, 30 Hz",
        "18 MB", "CC BY-NC 4.0", bandai_namco.FOLDER,
        "Bandai-Namco-Research-Motiondataset 1 and 2, Creative Commons Attribution-NonCommercial 4.0.\n"
        "You may use, change and share them for no commercial purpose, if you name their authors and say what you changed.\n"
        "The whole text: https://creativecommons.org/licenses/by-nc/4.0/legalcode; copies are laid beside the clips.",
        "Please cite: Kobayashi, Liao, Inoue, Yojima, Takahashi: Motion Capture Dataset for Practical Use of AI-based Motion\n"
        "Editing and Stylization, arXiv 2306.08861, 2023.",
        bandai_namco.fetch_bandai_namco, _listed_counts("bandai_namco"),
    ),
}  # fmt: skip
NAMES = (*COLLECTIONS, *BY_HAND)


def fetch(name: str, to: str | Path | None = None, *, accepted: bool = False) -> Path:
    """Download a published collection of motions, checked; what is there already stays.

    Args:
        name: one of COLLECTIONS.
        to: the folder of data; None: MWLIB_DATA, or where data lie when it is not set.
        accepted: whoever calls has read and accepted the collection's `terms`.

    Returns:
        The folder with the motions, for `load_motions` and the setting `data`.

    Raises:
        ValueError: an unknown name, one that people have to get by hand, or terms that nobody accepted.
        FetchError: it cannot be had; the message says why, and nothing half-written is left under a file's name.
        PermissionError: nothing can be written there.
    """
    if name in BY_HAND:
        raise ValueError(f"{name} cannot be downloaded by a program; mwlib fetch {name} says how people get it")
    if name not in COLLECTIONS:
        raise ValueError(f"name is {name!r}; expected one of {', '.join(COLLECTIONS)}")
    collection = COLLECTIONS[name]
    if collection.terms and not accepted:
        raise ValueError(f"the licence of {name} has not been accepted:\n{collection.terms}")
    to = (data_folder() if to is None else Path(to).expanduser()).absolute()
    if to.exists() and not to.is_dir():
        raise FetchError(f"{to} is no folder; expected one to put the data into")
    return collection.bring(to)


def overview(to: Path) -> list[tuple[str, ...]]:
    """Rows of words, one for each collection, below a header: name, what, size, licence, what is there."""
    rows = [("name", "what", "download", "licence", "there")]
    for name, c in COLLECTIONS.items():
        there, all_of_it = c.counts(to / c.folder)
        rows.append((name, c.title, c.size, c.licence, f"{there} of {all_of_it} files"))
    for name, c in BY_HAND.items():
        rows.append((name, c.title, "by hand", c.licence, "yes" if (to / c.place).exists() else "no"))
    return rows
