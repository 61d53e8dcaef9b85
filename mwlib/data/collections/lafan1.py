"""Ubisoft's LaFAN1, whole."""

import re

from mwlib.body.skeleton import named_tree
from mwlib.data.collections import Archive, Collection, Download

LAFAN1 = named_tree(
    "LAFAN1",
    "Hips -1 LeftUpLeg 0 LeftLeg 1 LeftFoot 2 LeftToe 3 RightUpLeg 0 RightLeg 5 RightFoot 6 RightToe 7 "
    "Spine 0 Spine1 9 Spine2 10 Neck 11 Head 12 LeftShoulder 11 LeftArm 14 LeftForeArm 15 LeftHand 16 "
    "RightShoulder 11 RightArm 18 RightForeArm 19 RightHand 20",
    h36m17="Hips RightUpLeg RightLeg RightFoot LeftUpLeg LeftLeg LeftFoot Spine1 Spine2 Neck Head "
    "LeftArm LeftForeArm LeftHand RightArm RightForeArm RightHand",
    humanml22="Hips LeftUpLeg RightUpLeg Spine LeftLeg RightLeg Spine1 LeftFoot RightFoot Spine2 LeftToe RightToe Neck "
    "LeftShoulder RightShoulder Head LeftArm RightArm LeftForeArm RightForeArm LeftHand RightHand",
)

_REPOSITORY = "ubisoft/ubisoft-laforge-animation-dataset/94084601bacdf9cc3764b5c73daaeccae6035fac"
_OWNERS = (
    "Ubisoft La Forge Animation Dataset (LaFAN1), © 2018 Ubisoft Entertainment, CC BY-NC-ND 4.0: Harvey, Yurick, "
    "Nowrouzezahrai and Pal, Robust Motion In-Betweening, ACM Transactions on Graphics 39(4), 2020."
)
_CITE = (
    "Please cite: Harvey, Yurick, Nowrouzezahrai, Pal: Robust Motion In-betweening. ACM Transactions on Graphics 39(4),\n2020."
)
_TERMS = (
    "Ubisoft La Forge Animation Dataset, Creative Commons Attribution-NonCommercial-NoDerivatives 4.0.\n"
    "You may use and share it unchanged, for no commercial purpose, if you name its authors; you may not share changed or\n"
    "converted copies. The whole text: https://creativecommons.org/licenses/by-nc-nd/4.0/legalcode; a copy, license.txt, is\n"
    "laid beside the clips."
)
RECORDS = (
    Collection(
        name="lafan1",
        title="Ubisoft LaFAN1: 77 clips of 5 people, 30 Hz",
        licence="CC BY-NC-ND 4.0",
        place="lafan1",
        skeleton=LAFAN1,
        unit="cm",
        file_name=re.compile(r"(?P<action>[A-Za-z]+?)\d*_subject(?P<subject>\d+)"),  # walk4_subject1.bvh
        acknowledgement=_OWNERS,
        download=Download(
            size="144 MB",
            url=f"https://raw.githubusercontent.com/{_REPOSITORY}",
            asked=_CITE,
            terms=_TERMS,
            files=lambda: {"license.txt": ("license.txt", "e11244310739afea404794c9405967a13abdbe7e2492052e94d7c81fe27c8b66")},
            archive=Archive(  # Git LFS keeps it, so that the repository's own address gives a pointer to it
                f"https://media.githubusercontent.com/media/{_REPOSITORY}/lafan1/lafan1.zip",
                "ea918082b500a5d158e9d3aa39039df04cd42e25f5c02fe8f7e88e8e9365a977",
                144_051_503,
                re.compile(r"[A-Za-z]+\d+_subject\d\.bvh"),
                77,
            ),
        ),
    ),
)
