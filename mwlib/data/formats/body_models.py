"""Body models: where the joints of SMPL, SMPL-H and SMPL-X are at rest, read from the user's own files.

Source: Loper et al. 2015 (SMPL), Romero et al. 2017 (SMPL-H), Pavlakos et al. 2019 (SMPL-X). The joints of a body with the shape
b are J (v + S b): regressor, template and directions of shape stand in a file that the owners give to whoever registers. Theirs
are pickles in part, which can run code; only .npz archives are read, and nothing in them is unpickled.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Num

from mwlib.body.skeleton import HUMANML22
from mwlib.data.untrusted import MotionFormatError, bounded, read_archive, read_array

GENDERS = ("male", "female", "neutral")
ENTRIES = ("v_template", "shapedirs", "J_regressor", "kintree_table")
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
        if betas.dtype.kind not in "fiu" or betas.ndim not in (1, 2) or betas.shape[0] == 0:
            raise MotionFormatError(source, "betas", found, "numbers of shape (B,)")
        rows = bounded(np.atleast_2d(betas), source, "betas").astype(np.float64)
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
    arrays = {name: read_array(stream, file, name) for name, stream in read_archive(file, ENTRIES).items()}
    if lost := [name for name in ENTRIES if name not in arrays]:
        raise MotionFormatError(file, "archive", f"no entry {lost[0]}", f"the entries {', '.join(ENTRIES)} of a body model")
    template, ways, regressor, tree = (arrays[name] for name in ENTRIES)
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
