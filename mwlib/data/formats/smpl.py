"""Poses of SMPL's bodies as AMASS and others keep them, and the body models that say where joints are at rest.

Source of the poses: Mahmood et al. 2019 (AMASS). Of the models: Loper et al. 2015 (SMPL), Romero et al. 2017 (SMPL-H), Pavlakos
et al. 2019 (SMPL-X). The joints of a body with the shape b are J (v + S b): regressor, template and directions of shape stand in
a file that the owners give to whoever registers. Theirs are pickles in part, which can run code; only .npz archives are read,
and nothing in them is unpickled.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Num, Shaped
from scipy.spatial.transform import Rotation

from mwlib.body.kinematics import fk
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.skeleton import HUMANML22, Skeleton
from mwlib.data.formats.frames import in_blocks, rotation_track
from mwlib.data.meaning import DEFAULT, ENTRY, FORMAT, Hints, Reading, Stated, hints_of
from mwlib.data.mirroring import rig_skeleton
from mwlib.data.untrusted import MotionFormatError, archive_names, bounded, label, numbers, read_archive, read_array, single

GENDERS = ("male", "female", "neutral")
OF_MODELS = ("v_template", "shapedirs", "J_regressor", "kintree_table")
SHAPES_OF_X = 300, 10  # directions of shape in SMPL-X's large and small models; those behind them move the face
_FINGERS = tuple(
    f"{side}_{finger}{bone}"
    for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb")
    for bone in (1, 2, 3)
)


class Family(NamedTuple):
    """A family of body models: its title, its joints, the first 22 of which are HumanML3D's, and where people get it."""

    title: str
    joints: tuple[str, ...]
    where: str


FAMILIES = {
    "smpl": Family("SMPL", (*HUMANML22.joints, "left_hand", "right_hand"), "https://smpl.is.tue.mpg.de"),
    "smplh": Family("SMPL-H", (*HUMANML22.joints, *_FINGERS), "https://mano.is.tue.mpg.de (the extended SMPL+H model of AMASS)"),
    "smplx": Family("SMPL-X", (*HUMANML22.joints, "jaw", "left_eye", "right_eye", *_FINGERS), "https://smpl-x.is.tue.mpg.de"),
}


class BodyModel(NamedTuple):
    """The joints of a family's bodies at rest.

    Args:
        mean: of the mean body, metres, y up.
        ways: what each number of a shape adds.
        parents: of the joints, -1 for the root.
        file: that it was read from.
    """

    mean: Float[np.ndarray, "joints 3"]
    ways: Float[np.ndarray, "joints 3 betas"]
    parents: tuple[int, ...]
    file: Path

    def rest(self, betas: Num[np.ndarray, "..."], source: Path) -> Float[np.ndarray, "joints 3"]:
        """The joints of one body at rest, metres.

        Args:
            betas: its shape; a row for each frame, too, if all are the same. What is missing at the end is 0.
            source: the file that says so.

        Raises:
            MotionFormatError: these are no such numbers, or more than the model knows.
        """
        found = f"{betas.dtype} of shape {betas.shape}"
        fits = betas.ndim in (1, 2) and len(betas) > 0
        rows = np.atleast_2d(numbers(betas, fits, source, "betas", "numbers of shape (B,)"))
        if np.any(rows != rows[0]):
            raise MotionFormatError(source, "betas", f"{found}, which change", "one shape of the body for all frames")
        count = self.ways.shape[-1]
        if np.any(rows[0, count:]):
            found = f"{rows.shape[1]} numbers, and {count} directions of shape in {self.file}"
            raise MotionFormatError(source, "betas", found, "a body model with as many")
        shape = rows[0, :count]
        return self.mean + self.ways[..., : len(shape)] @ shape


def body_model(family: str, gender: str, folders: Sequence[Path]) -> BodyModel:
    """The user's body model, named as its owners name it or the package smplx does.

    Of SMPL-H's male one these are smplh/male/model.npz, smplh/SMPLH_MALE.npz and SMPLH_MALE.npz. One that was read is kept until
    its file changes.

    Args:
        family: a key of `FAMILIES`.
        gender: one of `GENDERS`.
        folders: where it may lie, the likeliest first.

    Raises:
        MotionFormatError: there is none in any folder, or a pickle, and the message says what to do; or it is malformed.
    """
    name = f"{family.upper()}_{gender.upper()}"
    stems = f"{family}/{gender}/model", f"{family}/{name}", name
    places = [folder / stem for folder in folders for stem in stems]
    for file in (place.with_name(f"{place.name}.npz") for place in places):
        if file.is_file():
            state = file.stat()
            return _read(file, family, state.st_mtime_ns, state.st_size)
    pickled = [file for place in places if (file := place.with_name(f"{place.name}.pkl")).is_file()]
    title, _, where = FAMILIES[family]
    if pickled:
        expected = "the same as .npz; docs/howto/own-motions.md has the lines that convert it"
        raise MotionFormatError(pickled[0], "body model", "a pickle, which can run code", expected)
    there = f"{stems[0]}.npz or {stems[1]}.npz there, or in {folders[-1].name} beside the motions or above them"
    expected = f"{there}: it says where the joints are, and whoever registers gets it at {where}"
    raise MotionFormatError(folders[-1], "body model", f"no {gender} one of {title}", expected)


@lru_cache(maxsize=8)
def _read(file: Path, family: str, *_state: int) -> BodyModel:
    """The joints of a body model; its file's time and size make an edited one be read again."""
    arrays = {name: read_array(stream, file, name) for name, stream in read_archive(file, OF_MODELS).items()}
    if lost := [name for name in OF_MODELS if name not in arrays]:
        raise MotionFormatError(file, "archive", f"no entry {lost[0]}", f"the entries {', '.join(OF_MODELS)} of a body model")
    template, ways, regressor, tree = (arrays[name] for name in OF_MODELS)
    joints, points = len(FAMILIES[family].joints), len(template) if template.ndim else 0
    shapes = {
        "v_template": (points, 3),
        "shapedirs": (points, 3, ways.shape[-1] if ways.ndim else 0),
        "J_regressor": (joints, points),
    }
    for name, shape in {**shapes, "kintree_table": (2, joints)}.items():
        found = arrays[name]
        if found.shape != shape or found.dtype.kind not in "fiu" or 0 in shape:
            expected = f"numbers of shape {shape} for {FAMILIES[family].title}"
            raise MotionFormatError(file, name, f"{found.dtype} of shape {found.shape}", expected)
    parents = (-1, *(int(parent) for parent in tree[0, 1:]))
    if parents[: len(HUMANML22)] != HUMANML22.parents or any(not 0 <= p < j for j, p in enumerate(parents) if j):
        raise MotionFormatError(file, "kintree_table", f"parents {str(parents)[:80]}", f"those of {FAMILIES[family].title}")
    count = ways.shape[-1]
    if family == "smplx":
        count = min(count, SHAPES_OF_X[0] if count > SHAPES_OF_X[0] else SHAPES_OF_X[1])
    template, regressor = (
        bounded(a, file, n).astype(np.float64) for a, n in ((template, "v_template"), (regressor, "J_regressor"))
    )
    ways = bounded(ways[..., :count], file, "shapedirs").astype(np.float64)
    return BodyModel(regressor @ template, np.einsum("jv,vcb->jcb", regressor, ways), parents, file)


POSES = {"poses": "", "pose_body": "root_orient", "body_pose": "global_orient"}  # and the entry of the root, if it is apart
PATHS = ("trans", "transl")
RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
MODEL = "surface_model_type"
TEXTS = (*RATES, MODEL, "gender", "up")  # of one value
ENTRIES = (*POSES, "root_orient", "global_orient", *PATHS, *TEXTS, "betas")
OF_AMASS = (*RATES[:2], MODEL)
FACE = {"pose_jaw", "jaw_pose", "pose_eye", "leye_pose", "expression"}  # of SMPL-X alone


def is_smpl(names: Collection[str]) -> bool:
    """Whether an archive with these entries is meant to hold such poses; those of cameras are called poses, too."""
    has_poses, has_more = (not {*some}.isdisjoint(names) for some in (POSES, (*PATHS, *OF_AMASS, "betas", "gender")))
    return has_poses and has_more and {"positions", "positions_3d"}.isdisjoint(names)


def read_smpl(file: Path, hints: Hints, folders: Sequence[Path]) -> Reading:
    """Read one file of poses: the 22 joints of HumanML3D, metres, and the rig of all joints whose rotations it has.

    `poses` holds those of 24 (SMPL), 52 (SMPL-H) or 55 joints (SMPL-X); or `pose_body` and `root_orient`, or `body_pose` and
    `global_orient`, those of the body. `trans` or `transl` is the path; `betas` and `gender` say whose body it is, without them
    the mean neutral one. AMASS's files have z up; of others y up, as the models stand, is assumed. Own choice: the file's folder
    names the person, as in AMASS; hands, jaw and eyes stay in the rig alone.

    Args:
        file: an .npz archive.
        hints: what is known of it besides.
        folders: where body models may lie, see `body_model`.

    Raises:
        MotionFormatError: entries are missing or malformed, nobody says the rate, or the body model is missing or malformed.
    """
    arrays = {name: read_array(stream, file, name) for name, stream in read_archive(file, ENTRIES).items()}
    said = {name: label(str(single(arrays[name], file, name)), file, name) for name in TEXTS if name in arrays}
    inside = hints_of({"up": said.get("up"), "fps": next((said[n] for n in RATES if n in said), None)}, file, ENTRY)
    known = hints.over(inside).over(Hints(subject=file.resolve().parent.name))
    if known.fps is None:
        expected = f"an entry {', '.join(RATES)}, a column fps in clips.csv, or file_fps="
        raise MotionFormatError(file, "frame rate", "none", expected)
    is_amass = not {*OF_AMASS}.isdisjoint(said)
    up = known.up or (Stated("z", FORMAT) if is_amass else Stated("y", DEFAULT))
    unit = known.unit or Stated(1.0, FORMAT)
    turns, family = _turns(arrays, said.get(MODEL, ""), file)
    path = _vectors(arrays, next((name for name in PATHS if name in arrays), PATHS[0]), file, len(turns))
    if (gender := said.get("gender", GENDERS[-1]).lower()) not in GENDERS:
        raise MotionFormatError(file, "gender", repr(gender)[:40], " or ".join(GENDERS))
    model = body_model(family, gender, folders)
    rest, joints = unit.value * model.rest(arrays.get("betas", np.zeros(1)), file), turns.shape[1]
    tree = rig_skeleton(FAMILIES[family].joints[:joints], model.parents[:joints])
    rig, positions = _posed(turns, rest[:joints], rest[0] + unit.value * path[:, 0], tree)
    return known.reading(file, positions, HUMANML22, unit, up, known.fps, rig=rig)


def _turns(arrays: Mapping[str, Shaped[np.ndarray, "..."]], said: str, file: Path) -> tuple[Float[np.ndarray, "T joints 3"], str]:
    """Rotation vectors, the root's first, and the family of bodies that they are for."""
    name = next((name for name in POSES if name in arrays), "poses")
    turns = _vectors(arrays, name, file)
    if root := POSES[name]:
        turns = np.concatenate([_vectors(arrays, root, file, len(turns)), turns], axis=1)
    joints, word = turns.shape[1], re.sub("[^a-z]", "", said.lower())
    fitting = [family for family, known in FAMILIES.items() if joints == len(known.joints)]
    if joints == len(HUMANML22):  # of the body alone
        fitting = ["smplx"] if FACE & archive_names(file) else ["smplh", "smplx"]
    fitting = [family for family in fitting if word in ("", family)]
    if len(fitting) != 1:
        found = f"rotations of {joints} joints, {MODEL} {said[:40] or 'not said'}"
        widths = ", ".join(f"{len(known.joints)} ({family})" for family, known in FAMILIES.items())
        raise MotionFormatError(file, name, found, f"as many as its model has: {widths}; or 22, and {MODEL} smplh or smplx")
    return turns, fitting[0]


def _vectors(
    arrays: Mapping[str, Shaped[np.ndarray, "..."]], name: str, file: Path, frames: int = 0
) -> Float[np.ndarray, "T vectors 3"]:
    """An entry of shape (T, 3 n) or (T, n, 3); only poses may have n > 1."""
    if name not in arrays:
        raise MotionFormatError(file, "archive", f"entries {', '.join(sorted(arrays))[:120]}", f"{name} among them")
    found, several = arrays[name], name in POSES
    is_listed = found.size > 0 and (found.ndim == 2 or found.ndim == 3 and found.shape[2] == 3)
    width = found[0].size if is_listed else 0
    fits = width > 0 and (width % 3 == 0 if several else width == 3) and len(found) == (frames or len(found))
    expected = f"numbers of shape ({frames or 'T'}, {'3 x joints' if several else 3})"
    return numbers(found, fits, file, name, expected).reshape(len(found), -1, 3)


def _posed(
    turns: Float[np.ndarray, "T joints 3"], rest: Float[np.ndarray, "joints 3"], root: Float[np.ndarray, "T 3"], tree: Skeleton
) -> tuple[Rig, Float[np.ndarray, "T 22 3"]]:
    """The rig of a body that stands at `rest` before it turns, and where HumanML3D's joints come to be."""
    joints = len(tree)
    offsets = np.concatenate([rest[:1], rest[1:] - rest[list(tree.parents[1:])]])

    def rotations(part: slice) -> Float[np.ndarray, "n joints 4"]:
        """Quaternions of the joints in a part of the frames."""
        quaternions = Rotation.from_rotvec(turns[part].reshape(-1, 3)).as_quat()
        return np.roll(quaternions, 1, axis=-1).reshape(-1, joints, 4)

    def places(part: slice) -> Float[np.ndarray, "n 22 3"]:
        """The body's first 22 joints in a part of the frames, metres."""
        found, _ = fk(torch.from_numpy(rotations(part)), torch.from_numpy(offsets), torch.from_numpy(root[part]), tree)
        return found[:, : len(HUMANML22)].numpy()

    channels = (MOVES + ANGLES, *[ANGLES] * (joints - 1))
    track = rotation_track(rotations, len(turns), joints)
    rig = Rig(tree, offsets, track, root, tuple(range(len(HUMANML22))), channels)
    return rig, in_blocks(places, len(turns), joints).astype(np.float32)
