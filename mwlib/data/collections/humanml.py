"""AMASS, and what others made of it: HumanML3D and KIT motion-language, motions with descriptions."""

from mwlib.body.skeleton import HUMANML22, named_tree
from mwlib.data.collections import Collection

# KIT-ML as text-to-motion data have it. Right is the side of negative x where toes point to positive z and y is up.
KIT21 = named_tree(
    "KIT21",
    "pelvis -1 spine 0 thorax 1 lower_neck 2 upper_neck 3 right_shoulder 3 right_elbow 5 right_wrist 6 "
    "left_shoulder 3 left_elbow 8 left_wrist 9 right_hip 0 right_knee 11 right_ankle 12 right_foot 13 right_toe 14 "
    "left_hip 0 left_knee 16 left_ankle 17 left_foot 18 left_toe 19",
)

_README = "the README of https://github.com/EricGuo5513/HumanML3D"
RECORDS = (
    Collection(
        name="amass",
        title="AMASS, more than 11,000 motions of more than 300 people, 40 hours, as poses of SMPL-H or SMPL-X",
        licence="research use, by registration",
        place="amass",
        acknowledgement="AMASS: Mahmood, Ghorbani, Troje, Pons-Moll and Black, ICCV 2019.",
        steps=(
            "register at https://amass.is.tue.mpg.de; a person has to agree to the licences of its motions",
            "unpack the archives of the data sets that you want, of SMPL+H or of SMPL-X, into one folder; "
            "https://github.com/nghorbani/amass explains them",
            "register for the body model, at https://mano.is.tue.mpg.de (extended SMPL+H model) or https://smpl-x.is.tue.mpg.de, "
            "and put it into the folder body_models beside the motions or in the folder of data: smplh/male/model.npz, "
            "smplx/SMPLX_MALE.npz",
        ),
    ),
    Collection(
        name="humanml3d",
        title="HumanML3D, 14,616 motions with 44,970 descriptions, 20 Hz",
        licence="texts MIT; motions under AMASS's licence, by registration",
        place="humanml3d",
        skeleton=HUMANML22,
        steps=(
            "register at https://amass.is.tue.mpg.de; a person has to agree to the licences of its motions",
            f"follow {_README}; its notebooks write the folders new_joints and "
            "new_joint_vecs; texts.zip and the lists of the splits come with it",
            "put new_joints, new_joint_vecs, texts, Mean.npy, Std.npy, train.txt, val.txt and test.txt into one folder",
        ),
    ),
    Collection(
        name="kit-ml",
        title="KIT motion-language, 3,911 motions with 6,278 descriptions",
        licence="research use, with citation",
        place="kit_ml",
        skeleton=KIT21,
        steps=(
            "the original: https://motion-annotation.humanoids.kit.edu/dataset",
            f"in the form that text-to-motion papers use (21 joints, folders new_joints and new_joint_vecs): {_README} links it",
            "put the folders, Mean.npy, Std.npy and the lists of the splits into one folder, and beside them a skeleton.json "
            "with the names and parents of the 21 joints, fps, unit and up, which the arrays do not say",
        ),
    ),
)
