"""Data sets that no program may or can download: where people get them, where they go, and what to run then."""

from __future__ import annotations

from typing import NamedTuple


class ByHand(NamedTuple):
    """One data set.

    Args:
        title: what it is.
        licence: in a few words.
        steps: how to obtain it.
        place: below the folder of data; what `check` looks at.
        check: source for `mwlib check-data`.
    """

    title: str
    licence: str
    steps: tuple[str, ...]
    place: str
    check: str


BY_HAND = {
    "human36m": ByHand(
        "Human3.6M, 7 people with positions, 50 Hz",
        "academic use, by registration",
        (
            "register at http://vision.imar.ro/human3.6m and wait for the account; a person has to agree to the licence",
            "follow https://github.com/facebookresearch/VideoPose3D/blob/main/DATASETS.md; its prepare_data_h36m.py writes "
            "data_3d_h36m.npz",
        ),
        "data_3d_h36m.npz",
        "h36m",
    ),
    "humaneva": ByHand(
        "HumanEva-I, 3 people with positions, 60 Hz",
        "academic use, by registration",
        (
            "register at http://humaneva.is.tue.mpg.de; a person has to agree to the licence",
            "follow https://github.com/facebookresearch/VideoPose3D/blob/main/DATASETS.md; its prepare_data_humaneva.py, "
            "for 15 joints, writes data_3d_humaneva15.npz",
        ),
        "data_3d_humaneva15.npz",
        "humaneva",
    ),
    "humanml3d": ByHand(
        "HumanML3D, 14,616 motions with 44,970 descriptions, 20 Hz",
        "texts MIT; motions under AMASS's licence, by registration",
        (
            "register at https://amass.is.tue.mpg.de; a person has to agree to the licences of its motions",
            "follow the README of https://github.com/EricGuo5513/HumanML3D; its notebooks write the folders new_joints and "
            "new_joint_vecs; texts.zip and the lists of the splits come with it",
            "put new_joints, new_joint_vecs, texts, Mean.npy, Std.npy, train.txt, val.txt and test.txt into one folder",
        ),
        "humanml3d",
        "humanml3d",
    ),
    "kit-ml": ByHand(
        "KIT motion-language, 3,911 motions with 6,278 descriptions",
        "research use, with citation",
        (
            "the original: https://motion-annotation.humanoids.kit.edu/dataset",
            "in the form that text-to-motion papers use (21 joints, folders new_joints and new_joint_vecs): the README of "
            "https://github.com/EricGuo5513/HumanML3D links it",
            "put the folders, Mean.npy, Std.npy and the lists of the splits into one folder, and beside them a skeleton.json "
            "with the names and parents of the 21 joints, fps, unit and up, which the arrays do not say",
        ),
        "kit_ml",
        "kit_ml",
    ),
}  # fmt: skip
