"""Configured motions: loading, people held out, and fingerprints."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Annotated, Literal, NamedTuple

import numpy as np

from mwlib.body.motion import Motion
from mwlib.data.collections import SKELETONS, named_source
from mwlib.data.load import load_motions, source_files
from mwlib.data.meaning import UNITS
from mwlib.data.windows import Bodies, prepare
from mwlib.hashing import file_hash, sha256
from mwlib.settings import NotNegative, OneOf, Positive


@dataclass(frozen=True)
class SourceConfig:
    """Which motions, at which rate, and who is held out."""

    data: str = "synthetic"  # "synthetic", or a path that load_motions reads
    fps: Positive = 50.0  # frames per second after resampling
    unit: Annotated[str, OneOf(("", *UNITS))] = ""  # of the files; empty: as clips.csv or the file says, or inferred
    up: Literal["", "y", "z"] = ""  # the up-axis of the files; empty: as clips.csv or the file or its format says
    file_fps: NotNegative = 0.0  # the rate of the files, where clips.csv and they do not say it or are wrong; 0: they say
    train_subjects: tuple[str, ...] = ()  # empty: everyone who is in neither other list
    validation_subjects: tuple[str, ...] = ()  # for the loss on people not trained on, and for choosing settings
    test_subjects: tuple[str, ...] = ()  # empty: the last quarter of the subjects; of the clips if there is one subject


REMEDY = (
    "people left over for training and test. Name other people in train_subjects and test_subjects; give clips of several "
    "people their subject in clips.csv"
)


class Split(NamedTuple):
    """Clips by what they may be used for; no frame is in two parts."""

    train: list[Motion]
    validation: list[Motion]
    test: list[Motion]

    def fingerprints(self) -> tuple[str, str]:
        """Of the clips that a model is trained on, and of those that it is tested on."""
        return fingerprint(self.train), fingerprint(self.test)


def load_source(source: SourceConfig) -> list[Motion]:
    """The configured data as `load_motions` gives them, at their own rate; nobody is held out."""
    return load_motions(source.data, unit=source.unit or None, up=source.up or None, file_fps=source.file_fps or None)


def split_motions(
    source: SourceConfig,
    ready: Callable[[Sequence[Motion], float], list[Motion]] = prepare,
    loaded: Sequence[Motion] | None = None,
    more: Sequence[str] = (),
) -> Split:
    """Load the configured data and part it by subject, so that nobody in the test set was ever trained on.

    Test data: `test_subjects`; else the last quarter of the subjects that no list names; with one subject in the data, the last
    quarter of the clips; with one clip, its last quarter in time. No frame ends up in two parts.

    Args:
        source: which clips.
        ready: what makes clips at their own rate, given `source.fps`, into what a training takes.
        loaded: the clips as `load_source` gives them; None: they are loaded.
        more: sources as `load_motions` takes them, whose people are trained on besides, but for those who are held out. A
            source that does not name its people is taken whole: look who they are.

    Raises:
        FileNotFoundError: as `load_motions`.
        ValueError: a named subject does not occur or stands in two lists, the clips differ in skeleton, or nothing is left to
            train or to test on.
    """
    motions = ready(load_source(source) if loaded is None else loaded, source.fps)
    Bodies.of(motions)
    present = sorted({m.subject for m in motions})
    lists = {name: getattr(source, name) for name in ("train_subjects", "validation_subjects", "test_subjects")}
    _check_lists(lists, present, source.data)
    found = f"{source.data} has {len(motions)} clips of the subjects {', '.join(map(repr, present))}"
    if len(present) == 1 and not any(lists.values()):
        whole = motions[0]
        if len(motions) == 1 and len(whole) > 3:
            cut = len(whole) - len(whole) // 4
            motions = [whole.cut(0, cut), whole.cut(cut, len(whole))]
        cut = max(1, len(motions) - max(1, len(motions) // 4))
        parts = Split(motions[:cut], [], motions[cut:])
    else:
        unnamed = [subject for subject in present if not any(subject in people for people in lists.values())]
        test = source.test_subjects or unnamed[-max(1, len(present) // 4) :]
        train = source.train_subjects or [subject for subject in unnamed if subject not in test]
        chosen = (train, source.validation_subjects, test)
        parts = Split(*([m for m in motions if m.subject in people] for people in chosen))
    for name, part in (("training", parts.train), ("test", parts.test)):
        if not part:
            raise ValueError(f"no {name} clips: {found}; expected {REMEDY}")
    held_out = {m.subject for m in (*parts.validation, *parts.test)}
    added = [m for each in more for m in ready(load_motions(each), source.fps) if m.subject not in held_out]
    Bodies.of([*parts.train, *added])
    return parts._replace(train=parts.train + added)


def _check_lists(lists: dict[str, tuple[str, ...]], present: Sequence[str], data: str) -> None:
    """Refuse people who are not there, and people in two lists."""
    for name, people in lists.items():
        if missing := sorted({*people} - {*present}):
            raise ValueError(f"{name} has {missing}; expected some of {present}, the subjects of {data}")
    for name, other in combinations(lists, 2):
        if both := sorted({*lists[name]} & {*lists[other]}):
            raise ValueError(f"{both} stand in {name} and in {other}; expected every subject in one list at most")


def fingerprint(motions: Sequence[Motion]) -> str:
    """Eight hex digits over all of the clips that a training reads: people, skeletons with their parts, places and rotations."""
    return sha256(_contents(motions))[:8]


def _contents(motions: Sequence[Motion]) -> Iterator[bytes | str]:
    for m in motions:
        s = m.skeleton
        yield f"{m.subject}/{m.action}/{m.fps}/{m.up}/{s.joints}/{s.parents}/{s.left}/{s.right}"
        if s not in SKELETONS.values():  # the parts of known ones follow from their joints
            yield f"{s.name}/{sorted(s.parts.items())}"
        yield np.ascontiguousarray(m.positions, dtype=np.float32).tobytes()
        if m.rig is not None:  # how a hand turns about its own bone shows in no position
            yield f"{m.rig.skeleton.joints}/{m.rig.skeleton.parents}/{m.rig.points}/{m.rig.channels}"
            parts = (m.rig.offsets, m.rig.rotations, m.rig.root, m.rig.moves)
            yield from (np.ascontiguousarray(part).tobytes() for part in parts if part is not None)


def data_fingerprint(source: str) -> str:
    """Sixteen hex digits over the files behind a data source: their names, sizes and contents.

    They change with every file that `load_motions` may read: added, removed, renamed or edited; not with one that is touched.
    Data that are no files, like the built-in motions, have the hash of none: they come from the library's own sources.

    Args:
        source: as `load_motions` takes it.
    """
    files = source_files(named_source(source)[0])
    return sha256(f"{name}\0{file.stat().st_size}\0{file_hash(file)}\n" for name, file in files)[:16]
