"""Features of HumanML3D (263 numbers a frame) and KIT-ML (251): what stands where, their captions, and folders of them.

Sources: Guo et al. 2022, "Generating diverse and natural 3D human motions from text", and the code published with HumanML3D,
whose rules on lengths and time stamps are kept.
"""

import math
import posixpath
import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple, Self, TypeVar

import numpy as np
import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from mwlib.body.skeleton import HUMANML22, Skeleton
from mwlib.data.collections.humanml import KIT21
from mwlib.data.meaning import FORMAT, Hints, Reading, Stated

from mwlib.data.untrusted import (  # isort: skip
    SMALL_TEXT, BrokenFilesWarning, MotionFormatError, bounded, number, open_regular, read_array, read_text,
)  # fmt: skip


class TaggedCaption(str):
    """A caption that keeps the words that its collection made of it, each with its part of speech.

    It is the caption itself wherever a sentence is asked for. Collections write the base form of most words.

    Args:
        text: the caption.
        tagged: words and parts of speech, in order.

    >>> TaggedCaption("a man walks", [("a", "DET"), ("man", "NOUN"), ("walk", "VERB")]).tagged[2]
    ('walk', 'VERB')
    """

    tagged: tuple[tuple[str, str], ...]

    def __new__(cls, text: str, tagged: Iterable[tuple[str, str]] = ()) -> Self:
        made = super().__new__(cls, text)
        made.tagged = tuple(tagged)
        return made


@dataclass(frozen=True, eq=False)
class CaptionedClip:
    """One clip as features, with sentences that describe it."""

    features: Float[np.ndarray, "T D"]  # raw (not normalised) HumanML3D or KIT features, float32
    captions: tuple[str, ...]  # at least one; `TaggedCaption` where the collection tells the parts of speech
    name: str = ""
    split: str = "train"  # "train", "val" or "test"
    attributes: Mapping[str, str | float] = field(default_factory=dict)  # ground truth where known (synthetic people)


Array = TypeVar("Array", np.ndarray, Tensor)


@dataclass(frozen=True)
class FeatureLayout:
    """What the numbers of a frame mean: y is up, a frame's heading is seen along +z, left is +x.

    Args:
        name: of the data set.
        skeleton: J joints, the root among them.
        fps: frames per second.
        metres_per_unit: length of one unit of the features.
        contact_joints: left ankle and toe, right ankle and toe.
        face_joints: right hip, left hip, right shoulder, left shoulder; they tell where the body faces.
        contact_threshold: units squared; a joint that moves less from a frame to the next has contact.
        chains: rows of joints along which rotations follow each other; the first joint of a row is not turned by it.
        rest: for each joint the axis along which the published code lets its bone rest, from the joint before.
        bone_lengths: of the one body that the data set's people were given, units, joint by joint, the root's being 0; None:
            not known.
        shortest: a clip has at least so many frames.
    """

    name: str
    skeleton: Skeleton
    fps: float
    metres_per_unit: float
    contact_joints: tuple[int, int, int, int]
    face_joints: tuple[int, int, int, int]
    contact_threshold: float
    chains: tuple[tuple[int, ...], ...]
    rest: tuple[str, ...]
    bone_lengths: tuple[float, ...] | None
    shortest: int

    @property
    def width(self) -> int:
        """Features of a frame, 12 J - 1."""
        return 12 * len(self.skeleton) - 1

    @property
    def arm_joints(self) -> tuple[int, ...]:
        """Elbows and wrists.

        >>> HUMANML3D.arm_joints
        (18, 19, 20, 21)
        """
        return tuple(j for j, name in enumerate(self.skeleton.joints) if name.endswith(("elbow", "wrist")))

    @property
    def blocks(self) -> dict[str, slice]:
        """Where each kind of feature stands.

        "yaw_rate" is HALF the turn to the next frame (rad); "root_velocity" the step x, z to the next frame in the heading of
        that frame; "height" the root's; "positions" of the other joints, seen from the root's place on the floor in the frame's
        heading; "rotations" of the bones to them, six numbers each; "velocities" of all joints to the next frame, in this
        frame's heading; "contacts" 0 or 1, in the order of `contact_joints`.

        >>> HUMANML3D.blocks["velocities"], KIT.blocks["contacts"]
        (slice(193, 259, None), slice(247, 251, None))
        """
        others = len(self.skeleton) - 1
        sizes = {
            "yaw_rate": 1, "root_velocity": 2, "height": 1, "positions": 3 * others, "rotations": 6 * others,
            "velocities": 3 * others + 3, "contacts": 4,
        }  # fmt: skip
        ends = accumulate(sizes.values())
        return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    def rests(self, heading: str) -> Float[np.ndarray, "J 3"]:
        """Unit vectors along which bones rest, as `rest` has them; with heading "correct" left is +x for all.

        Own choice: KIT's published ones have left and right exchanged, so that hips are half a turn from rest, where the
        shortest rotation has no axis.
        """
        axes = np.array([[(word[1:] == axis) * (-1 if word[0] == "-" else 1) for axis in "xyz"] for word in self.rest], float)
        if heading == "correct":
            for joints, sign in ((self.skeleton.left, 1), (self.skeleton.right, -1)):
                axes[list(joints), 0] = sign * np.abs(axes[list(joints), 0])
        return axes


def _chains(rows: str) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(map(int, row.split())) for row in rows.split("|"))


HUMANML3D = FeatureLayout(
    name="HumanML3D",
    skeleton=HUMANML22,
    fps=20.0,
    metres_per_unit=1.0,
    contact_joints=(7, 10, 8, 11),
    face_joints=(2, 1, 17, 16),
    contact_threshold=0.002,
    chains=_chains("0 2 5 8 11 | 0 1 4 7 10 | 0 3 6 9 12 15 | 9 14 17 19 21 | 9 13 16 18 20"),
    rest=tuple("0 +x -x +y -y -y +y -y -y +y +z +z +y +x -x +z -y -y -y -y -y -y".split()),
    # Measured from the example motion 012314 that was published with the code; every clip has them.
    bone_lengths=tuple(map(float, (
        "0.0 0.1031 0.1099 0.1316 0.3936 0.3902 0.1432 0.4324 0.4256 0.0574 0.1434 "
        "0.1494 0.2194 0.1375 0.1434 0.1030 0.1316 0.1230 0.2568 0.2631 0.2660 0.2699"
    ).split())),
    shortest=40,
)  # fmt: skip

# One unit is about a thousandth of the body's height, which is taken as 1.75 m (own choice; hips are then 0.98 m high).
KIT = FeatureLayout(
    name="KIT-ML",
    skeleton=KIT21,
    fps=12.5,
    metres_per_unit=0.00175,
    contact_joints=(19, 20, 14, 15),
    face_joints=(11, 16, 5, 8),
    contact_threshold=0.05,
    chains=_chains("0 11 12 13 14 15 | 0 16 17 18 19 20 | 0 1 2 3 4 | 3 5 6 7 | 3 8 9 10"),
    rest=tuple("0 +y +y +y +y +x -y -y -x -y -y +x -y -y +z +z -x -y -y +z +z".split()),
    bone_lengths=None,
    shortest=24,
)

LAYOUTS = {layout.width: layout for layout in (HUMANML3D, KIT)}


def joints_of(features: Array, layout: FeatureLayout) -> Array:
    """Joint positions (..., T, J, 3) that features (..., T, D) describe, y up, in the layout's units.

    The root starts at x = z = 0 and faces +z; its path is the sum of its steps. Only yaw rate, root velocity, height and
    positions are used, as in the published decoder; rotations, velocities and contacts change nothing. Gradients pass.

    Args:
        features: raw, not normalised; NumPy in, NumPy out; torch in, torch out.
        layout: of the features.

    Raises:
        ValueError: another width.

    A quarter turn to the right in the first frame, and steps of 1 ahead:

    >>> x = torch.zeros(3, 263)
    >>> x[0, 0], x[:, 2], x[:, 3] = torch.pi / 4, 1.0, 1.0
    >>> (joints_of(x, HUMANML3D)[:, 0].round(decimals=3) + 0.0).tolist()
    [[0.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    """
    if features.shape[-1] != layout.width:
        raise ValueError(f"features have width {features.shape[-1]}; expected {layout.width} for {layout.name}")
    if isinstance(features, np.ndarray):
        return joints_of(torch.from_numpy(np.array(features)), layout).numpy()
    back = -turned(features[..., 0])
    first = torch.zeros_like(features[..., :1, 1:3])
    steps = torch.cat([first, features[..., :-1, layout.blocks["root_velocity"]]], dim=-2)
    path = torch.stack(_about_up(steps[..., 0], steps[..., 1], back), dim=-1).cumsum(dim=-2)
    local = features[..., layout.blocks["positions"]].unflatten(-1, (-1, 3))
    x, z = _about_up(local[..., 0], local[..., 2], back[..., None])
    others = torch.stack([x + path[..., :1], local[..., 1], z + path[..., 1:]], dim=-1)
    root = torch.stack([path[..., 0], features[..., 3], path[..., 1]], dim=-1)
    return torch.cat([root[..., None, :], others], dim=-2)


def turned(yaw_rate: Float[Tensor, "*lead T"]) -> Float[Tensor, "*lead T"]:
    """The angle about y that makes the body of each frame face +z, radians; `yaw_rate` holds half its steps."""
    return 2 * torch.cat([torch.zeros_like(yaw_rate[..., :1]), yaw_rate[..., :-1].cumsum(dim=-1)], dim=-1)


def _about_up(x: Tensor, z: Tensor, angle: Tensor) -> tuple[Tensor, Tensor]:
    """x and z turned about y, from z towards x."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    return cos * x + sin * z, cos * z - sin * x


FEATURES, JOINTS, TEXTS = "new_joint_vecs", "new_joints", "texts"
SPLITS = ("train", "val", "test")
TOO_LONG = 200  # frames; clips have fewer
STAMP_FPS = 20.0  # at which time stamps are turned into frames, for KIT too though it has 12.5: as published
FIELDS = 4  # of a line of text: caption, its words with their parts of speech, start and end in seconds
# What should not be; a wrong length is no fault.
BROKEN = ("no features", "no captions", "not finite", "no frame between its times")


class FolderContents(NamedTuple):
    """What a folder holds.

    Args:
        clips: those that training and evaluation see.
        left_out: name of a clip, or of a stretch of one -> why it is not among them.
    """

    clips: list[CaptionedClip]
    left_out: Mapping[str, str]

    def reasons(self) -> list[str]:
        """A line for each reason, the most frequent first."""
        names: dict[str, list[str]] = defaultdict(list)
        for name, reason in self.left_out.items():
            names[reason].append(name)
        frequent = sorted(names.items(), key=lambda item: -len(item[1]))
        return [f"{len(n)} left out, {reason}: {', '.join(n[:5])}{' ...' * (len(n) > 5)}" for reason, n in frequent]

    def broken(self) -> list[str]:
        """Those lines that say what should not be; a wrong length is no fault."""
        return FolderContents([], {name: reason for name, reason in self.left_out.items() if reason in BROKEN}).reasons()


def read_folder(path: Path) -> list[CaptionedClip]:
    """The captioned clips of a folder; see `folder_contents`, which also says what was left out.

    Warns (`BrokenFilesWarning`) of clips that the lists name but that are missing or hold numbers that are not finite, as
    000021 and 007975 of most copies of HumanML3D, and of captions whose times end before they begin, or begin after the clip.
    """
    contents = folder_contents(path)
    if broken := contents.broken():
        warnings.warn(f"{path}: {' '.join(broken)}", BrokenFilesWarning, 2)
    return contents.clips


def folder_contents(path: Path, faults: list[MotionFormatError] | None = None) -> FolderContents:
    """Read new_joint_vecs/ID.npy and texts/ID.txt of the IDs in train.txt, val.txt and test.txt. Nothing is unpickled.

    A clip has at least 40 frames (KIT: 24) and fewer than 200; others are left out with all their captions. Captions of a
    whole clip belong to one entry. A caption with times is an entry of its own, cut out at 20 frames per second. That is
    the published rule for KIT too, whose 12.5 frames per second make it cut later and longer stretches than were meant.
    Captions keep their words with parts of speech, see `TaggedCaption`.

    Args:
        path: of the folder.
        faults: what is wrong is added to it, and the rest is read; None: the first fault is raised.

    Raises:
        MotionFormatError: there is no list, one has a clip twice or one that another list has too, as it is or mirrored (M000001
            beside 000001), a text or an array is malformed, or features differ in width.
    """
    if not has_lists(path):
        raise MotionFormatError(path, "folder", "no list of clips", "one of train.txt, val.txt and test.txt, beside captions")
    clips: list[CaptionedClip] = []
    left_out: dict[str, str] = {}
    layout: FeatureLayout | None = None  # that of the first features
    for split, names in clip_lists(path, faults).items():
        for name in names:
            try:
                file, text = path / FEATURES / f"{name}.npy", path / TEXTS / f"{name}.txt"
                if not file.is_file() or not text.is_file():
                    left_out[name] = BROKEN[file.is_file()]
                    continue
                features, layout = _features(file, layout)
                whole = CaptionedClip(features, (), name)
                for clip in [whole] if _fault(whole, layout) else _entries(features, text, name, split):
                    if why := _fault(clip, layout):
                        left_out[clip.name] = why
                    else:
                        clips.append(clip)
            except MotionFormatError as error:
                if faults is None:
                    raise
                faults.append(error)
    return FolderContents(clips, left_out)


LONGEST_NAME = 200  # bytes of a clip's name: with a suffix most file systems take 255


def has_lists(path: Path) -> list[str]:
    """Those of "train", "val" and "test" of which a folder has a list."""
    return [split for split in SPLITS if (path / f"{split}.txt").is_file()]


def clip_lists(path: Path, faults: list[MotionFormatError] | None) -> dict[str, list[str]]:
    """The IDs of every list; arguments as in `folder_contents`."""
    lists: dict[str, dict[str, int]] = {split: {} for split in has_lists(path)}  # ID -> its line
    owner: dict[str, tuple[str, str]] = {}  # ID without M -> the list that has it, and where
    for split, lines in lists.items():
        file = path / f"{split}.txt"
        for line, row in enumerate(read_text(file, SMALL_TEXT).splitlines(), 1):
            for name in row.split():
                fits = len(name.encode()) <= LONGEST_NAME and posixpath.normpath(name) == name
                fits = fits and name[0] not in "/." and "\\" not in name
                whose, where = owner.setdefault(name.removeprefix("M"), (split, f"as {name} in {file.name}, line {line}"))
                found, expected = "", "every clip once"
                if not fits:
                    found, expected = repr(name[:40]), f"the name of a clip, at most {LONGEST_NAME} bytes, below the folder"
                elif name in lines:
                    found = f"{name}, as in line {lines[name]}"
                elif whose != split:
                    found = f"{name}, {where}"
                    expected = "clips that no other list has, as they are or mirrored (M before the ID)"
                if found:
                    error = MotionFormatError(file, f"line {line}", found, expected)
                    if faults is None:
                        raise error
                    faults.append(error)
                if fits:
                    lines.setdefault(name, line)
    return {split: [*lines] for split, lines in lists.items()}


def read_features(array: Shaped[np.ndarray, "*shape"], file: Path, hints: Hints) -> Reading:
    """A motion from features (T, 263 or 251) of new_joint_vecs, in metres, y up.

    Raises:
        MotionFormatError: another shape, or numbers that are not finite.
    """
    layout = _layout(array, file)
    joints = joints_of(bounded(array, file, "array").astype(np.float64), layout)
    unit = hints.unit or Stated(layout.metres_per_unit, FORMAT)
    up, fps = Stated("y", FORMAT), hints.fps or Stated(layout.fps, FORMAT)
    return hints.reading(file, joints * unit.value, layout.skeleton, unit, up, fps)


def is_features(shape: tuple[int, ...], file: Path) -> bool:
    """Whether an array in a folder is a motion as features: by its width and the folder's name."""
    return len(shape) == 2 and shape[-1] in LAYOUTS and file.parent.name == FEATURES


def without_features(files: Sequence[Path]) -> list[Path]:
    """The files but for features whose joints are among them."""
    there = {*files}
    return [file for file in files if file.parent.name != FEATURES or file.parent.parent / JOINTS / file.name not in there]


def _features(file: Path, wanted: FeatureLayout | None) -> tuple[Float[np.ndarray, "T D"], FeatureLayout]:
    with open_regular(file) as stream:
        array = read_array(stream, file, "array")
    found = _layout(array, file)
    if wanted and found != wanted:
        raise MotionFormatError(file, "array", f"shape {array.shape}", f"(T, {wanted.width}) for {wanted.name}")
    return array.astype(np.float32), found


def _layout(array: Shaped[np.ndarray, "*shape"], file: Path) -> FeatureLayout:
    """The layout whose width an array has."""
    if array.ndim != 2 or array.shape[-1] not in LAYOUTS or array.dtype.kind != "f" or len(array) == 0:
        expected = " or ".join(f"(T, {width}) for {layout.name}" for width, layout in LAYOUTS.items())
        raise MotionFormatError(file, "array", f"{array.dtype} of shape {array.shape}", f"numbers of shape {expected}")
    return LAYOUTS[array.shape[-1]]


def _fault(clip: CaptionedClip, layout: FeatureLayout) -> str:
    """Why a clip is left out; "" if it is not."""
    frames = len(clip.features)
    if not np.isfinite(clip.features).all():
        return BROKEN[2]
    if frames == 0:
        return BROKEN[3]
    if frames < layout.shortest:
        return f"shorter than {layout.shortest} frames"
    return f"{TOO_LONG} frames or longer" if frames >= TOO_LONG else ""


def _tagged(text: str, words: str) -> str:
    """The caption with its "word/POS word/POS"; the caption alone where these are not all so."""
    pairs = [(word, part) for word, _, part in (token.rpartition("/") for token in words.split())]
    return TaggedCaption(text, pairs) if pairs and all(word and part for word, part in pairs) else text


def _entries(features: Float[np.ndarray, "T D"], file: Path, name: str, split: str) -> list[CaptionedClip]:
    """The whole clip with all captions that have no times, then one entry for each other caption; nan is 0."""
    whole: list[str] = []
    parts: list[CaptionedClip] = []
    for n, line in enumerate(read_text(file, SMALL_TEXT).splitlines(), 1):
        if not line.strip():
            continue
        fields = line.strip().split("#")
        if len(fields) != FIELDS or not fields[0].strip():
            raise MotionFormatError(file, f"line {n}", repr(line[:80]), "caption#word/POS word/POS ...#start#end")
        caption = _tagged(fields[0].strip(), fields[1])
        start, end = (0.0 if f.strip().lower() == "nan" else number(f, file, f"line {n}") for f in fields[2:])
        if start == end == 0:
            whole.append(caption)
        else:
            first, last = (max(math.trunc(seconds * STAMP_FPS), 0) for seconds in (start, end))
            parts.append(CaptionedClip(features[first:last], (caption,), f"{name} line {n}, {start:g} to {end:g} s", split))
    if not whole and not parts:
        raise MotionFormatError(file, "text", "no line", "at least one caption")
    return [CaptionedClip(features, tuple(whole), name, split), *parts] if whole else parts
