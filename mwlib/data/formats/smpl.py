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
from mwlib.body.rotation import continuous
from mwlib.body.skeleton import HUMANML22
from mwlib.data.formats.frames import blocks
from mwlib.data.meaning import DEFAULT, ENTRY, FORMAT, Hints, Reading, Stated, hints_of
from mwlib.data.mirroring import own_skeleton
from mwlib.data.untrusted import MotionFormatError, archive_names, label, numbers, read_archive, read_array, single

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
    there, pickled = (
        [file for folder in folders for stem in stems if (file := folder / f"{stem}.{ending}").is_file()]
        for ending in ("npz", "pkl")
    )
    if there:
        state = there[0].stat()
        return _read(there[0], family, state.st_mtime_ns, state.st_size)
    if pickled:
        expected = "the same as .npz; docs/howto/own-motions.md has the lines that convert it"
        raise MotionFormatError(pickled[0], "body model", "a pickle, which can run code", expected)
    title, _, where = FAMILIES[family]
    places = f"{stems[0]}.npz or {stems[1]}.npz there, or in {folders[-1].name} beside the motions or above them"
    expected = f"{places}: it says where the joints are, and whoever registers gets it at {where}"
    raise MotionFormatError(folders[-1], "body model", f"no {gender} one of {title}", expected)


@lru_cache(maxsize=8)
def _read(file: Path, family: str, *_state: int) -> BodyModel:
    """The joints of a body model; its file's time and size make an edited one be read again."""
    arrays = {name: read_array(stream, file, name) for name, stream in read_archive(file, OF_MODELS).items()}
    if lost := [name for name in OF_MODELS if name not in arrays]:
        raise MotionFormatError(file, "archive", f"no entry {lost[0]}", f"the entries {', '.join(OF_MODELS)} of a body model")
    title, joints, _ = FAMILIES[family]
    ways = np.atleast_1d(arrays["shapedirs"])
    points, count = arrays["v_template"].size // 3, ways.shape[-1]
    if family == "smplx":
        count = min(count, SHAPES_OF_X[0] if count > SHAPES_OF_X[0] else SHAPES_OF_X[1])
    arrays["shapedirs"] = ways[..., :count]
    shapes = {"v_template": (points, 3), "shapedirs": (points, 3, count), "J_regressor": (len(joints), points)}
    template, ways, regressor = (
        numbers(arrays[name], arrays[name].shape == shape and 0 not in shape, file, name, f"numbers of shape {shape} for {title}")
        for name, shape in shapes.items()
    )
    tree = arrays["kintree_table"]
    parents = (-1, *map(int, tree[0, 1:])) if tree.shape == (2, len(joints)) else ()
    if parents[: len(HUMANML22)] != HUMANML22.parents or any(not 0 <= p < j for j, p in enumerate(parents) if j):
        found = f"parents {str(parents)[:80]} in shape {tree.shape}"
        raise MotionFormatError(file, "kintree_table", found, f"those of {title}, of shape {(2, len(joints))}")
    return BodyModel(regressor @ template, np.einsum("jv,vcb->jcb", regressor, ways), parents, file)


Arrays = Mapping[str, Shaped[np.ndarray, "..."]]  # entries of an archive by their names
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
        expected = "an entry mocap_framerate, mocap_frame_rate or fps, a column fps in clips.csv, or file_fps="
        raise MotionFormatError(file, "frame rate", "none", expected)
    up = known.up or (Stated("y", DEFAULT) if {*OF_AMASS}.isdisjoint(said) else Stated("z", FORMAT))
    unit = known.unit or Stated(1.0, FORMAT)
    turns, family = _turns(arrays, said.get(MODEL, ""), file)
    path = _vectors(arrays, next((name for name in PATHS if name in arrays), PATHS[0]), file, len(turns))
    if (gender := said.get("gender", GENDERS[-1]).lower()) not in GENDERS:
        raise MotionFormatError(file, "gender", repr(gender)[:40], " or ".join(GENDERS))
    model = body_model(family, gender, folders)
    rest, joints = unit.value * model.rest(arrays.get("betas", np.zeros(1)), file), turns.shape[1]
    tree = own_skeleton(FAMILIES[family].joints[:joints], model.parents[:joints])
    offsets = np.concatenate([rest[:1], rest[1:joints] - rest[list(tree.parents[1:])]])
    points = tuple(range(len(HUMANML22)))
    root = rest[0] + unit.value * path[:, 0]
    scalar_last = Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat()
    quaternions = torch.from_numpy(np.roll(scalar_last, 1, axis=-1)).reshape(-1, joints, 4)
    positions = np.concatenate([
        fk(quaternions[part], torch.from_numpy(offsets), torch.from_numpy(root[part]), tree)[0].numpy().take(points, axis=1)
        for part in blocks(len(turns), joints)
    ])  # fmt: skip
    rotations = continuous(quaternions.float()).numpy()
    rig = Rig(tree, offsets, rotations, root, points, (MOVES + ANGLES, *[ANGLES] * (joints - 1)))
    return known.reading(file, positions, HUMANML22, unit, up, known.fps, rig=rig)


def _turns(arrays: Arrays, said: str, file: Path) -> tuple[Float[np.ndarray, "T joints 3"], str]:
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
        expected = f"as many as its model has: 24 (smpl), 52 (smplh), 55 (smplx); or 22, and {MODEL} smplh or smplx"
        raise MotionFormatError(file, name, found, expected)
    return turns, fitting[0]


def _vectors(arrays: Arrays, name: str, file: Path, frames: int = 0) -> Float[np.ndarray, "T vectors 3"]:
    """An entry of shape (T, 3 n) or (T, n, 3); only poses may have n > 1."""
    if name not in arrays:
        raise MotionFormatError(file, "archive", f"entries {', '.join(sorted(arrays))[:120]}", f"{name} among them")
    found, several = arrays[name], name in POSES
    fits = (
        found.size > 0 and (found.ndim == 2 or found.ndim == 3 and found.shape[2] == 3) and len(found) == (frames or len(found))
    )
    fits = fits and (found[0].size % 3 == 0 if several else found[0].size == 3)
    expected = f"numbers of shape ({frames or 'T'}, {'3 x joints' if several else 3})"
    return numbers(found, fits, file, name, expected).reshape(len(found), -1, 3)
