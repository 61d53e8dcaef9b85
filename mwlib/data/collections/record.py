"""Records of data sets: what one is, how its files are understood, and how it is brought."""

import csv
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
