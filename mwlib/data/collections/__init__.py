"""Known data sets: what a record of one is, and the records themselves, a module each, found by lying in this folder."""

import csv
import importlib
import pkgutil
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mwlib.body.skeleton import Skeleton


class Protocol(NamedTuple):
    """How papers cut windows from the clips of a data set.

    Args:
        fps: frames per second.
        history, future: frames of a window.
        stride: frames between starts.
    """

    fps: float
    history: int
    future: int
    stride: int


class Listed(NamedTuple):
    """One published clip; a list of them holds no motion.

    Args:
        file: its place in the collection's folder, without packing.
        subject, action: who and what.
        fps: frames per second.
        frames: how many.
        motion: `fetching.motion_digest` of what is read from it.
        sha256: of the file's bytes, unpacked, as we have them; a publisher's may have other line ends or comments.
    """

    file: str
    subject: str
    action: str
    fps: float
    frames: int
    motion: str
    sha256: str


def list_file(name: str) -> Path:
    """Where the list of a collection's clips lies in the package."""
    return Path(__file__).with_name(f"{name}.csv")


def listed(name: str) -> list[Listed]:
    """The clips of a collection, in the order of their files."""
    with list_file(name).open(encoding="utf-8", newline="") as table:
        return [Listed(**{**row, "fps": float(row["fps"]), "frames": int(row["frames"])}) for row in csv.DictReader(table)]


class Archive(NamedTuple):
    """A zip that holds all clips.

    Args:
        url, sha256, size: of the zip; size in bytes.
        wanted: matches the names of its clips.
        count: how many clips it holds.
    """

    url: str
    sha256: str
    size: int
    wanted: re.Pattern[str]
    count: int


@dataclass(frozen=True)
class Download:
    """How a program brings a data set.

    Args:
        size: in words.
        url: of the folder below which `files` and `clips` lie.
        asked: what the owners want said or cited.
        terms: what somebody has to accept first; "" if nothing.
        files: name here -> place below `url`, SHA-256; of files that are known byte by byte.
        clips: those that are known by their motions, each with the skeleton of its folder.
        archive: of all clips.
    """

    size: str
    url: str
    asked: str
    terms: str = ""
    files: Callable[[], Mapping[str, tuple[str, str]]] = dict
    clips: Callable[[], Sequence[Listed]] = tuple
    archive: Archive | None = None


@dataclass(frozen=True)
class Collection:
    """The facts of one data set.

    Args:
        name: as `mwlib fetch` calls it.
        title, licence: in a few words.
        place: the folder or file below the folder of data.
        skeleton: of its files, if they have one of their own.
        unit: in which files of that skeleton usually are; "" if they say it.
        file_name: what the name of a file says: subject, action.
        preset, fps: the name by which presets and `load_motions` know it, and the rate that goes with that name.
        protocol: how papers cut it into windows, if otherwise than Human3.6M.
        acknowledgement: what its owners want said beside any result on it.
        steps: how people get it, where no program may download it.
        download: how a program does.
    """

    name: str
    title: str
    licence: str
    place: str
    skeleton: Skeleton | None = None
    unit: str = ""
    file_name: re.Pattern[str] | None = None
    preset: str = ""
    fps: float = 0.0
    protocol: Protocol | None = None
    acknowledgement: str = ""
    steps: tuple[str, ...] = ()
    download: Download | None = None


_MODULES = (importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__))
_RECORDS = (record for module in _MODULES for record in module.RECORDS)
COLLECTIONS: dict[str, Collection] = {c.name: c for c in sorted(_RECORDS, key=lambda c: (c.download is None, c.name))}
SKELETONS: dict[str, Skeleton] = {c.skeleton.name: c.skeleton for c in COLLECTIONS.values() if c.skeleton}

# Sources by the names of the presets that use them: what load_motions reads, at which rate.
NAMED_SOURCES = {"tiny": ("synthetic", 25.0), "laptop": ("synthetic", 50.0)} | {
    c.preset: (c.place, c.fps) for c in COLLECTIONS.values() if c.preset
}


def known_skeleton(skeleton: Skeleton) -> Skeleton:
    """The known skeleton that this one equals, which says more of its joints; else itself."""
    return next((known for known in SKELETONS.values() if known == skeleton), skeleton)


def named_source(source: str | Path) -> tuple[str | Path, float | None]:
    """What a source stands for and the rate that goes with it: a preset's data by the preset's name; else itself.

    Raises:
        ValueError: a file or folder of the working folder has the same name.
    """
    if not isinstance(source, str) or source not in NAMED_SOURCES:
        return source, None
    if Path(source).exists():
        raise ValueError(f"{source!r} names a preset's data and {Path(source).absolute()}; for the latter say ./{source}")
    return NAMED_SOURCES[source]


def acknowledgement(data: str) -> dict[str, str]:
    """What the owners of a data source want said beside any result on it: one entry, or none.

    A source is theirs if it or any folder on its path begins with the name of their folder, in any case: "cmu",
    "/data/CMU/asfamc", "my/cmu_benchmark", "LaFAN1".
    """
    folders = Path(data).expanduser().resolve().parts if Path(data).exists() else Path(data).parts
    for collection in COLLECTIONS.values():
        name = collection.place.split("/")[0]
        if collection.acknowledgement and any(folder.lower().startswith(name) for folder in folders):
            return {"acknowledgement": collection.acknowledgement}
    return {}
