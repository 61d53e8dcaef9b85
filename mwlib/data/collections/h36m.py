"""Human3.6M and HumanEva-I as VideoPose3D stores them, and what is published of their test windows."""

import re

from mwlib.body.skeleton import H36M17, named_tree
from mwlib.data.collections import Collection, Protocol

HUMANEVA15 = named_tree(
    "HUMANEVA15",
    "pelvis -1 thorax 0 left_shoulder 1 left_elbow 2 left_wrist 3 right_shoulder 1 right_elbow 5 right_wrist 6 "
    "left_hip 0 left_knee 8 left_ankle 9 right_hip 0 right_knee 11 right_ankle 12 head 1",
    {
        "right_leg": "right_hip right_knee right_ankle",
        "left_leg": "left_hip left_knee left_ankle",
        "spine": "thorax head",
        "left_arm": "left_shoulder left_elbow left_wrist",
        "right_arm": "right_shoulder right_elbow right_wrist",
    },
)

TRAIN_SUBJECTS, TEST_SUBJECTS = ("S1", "S5", "S6", "S7", "S8"), ("S9", "S11")
# Windows per take at H, F, stride = 25, 100, 25: plain, "1", "2", ...; "-" where there is no such take. HumanMAC's protocol.
_TAKES = {
    "S9": "Directions 103/90 Discussion -/230/208 Eating 103/102 Greeting 53/104 Phoning 128/148 Posing 74/74 Purchases 57/45 "
    "Sitting 114/118 SittingDown 113/58 Smoking 169/171 Photo 89/53 Waiting 128/60 Walking 60/93 WalkDog 85/84 "
    "WalkTogether 64/63",
    "S11": "Directions -/58 Discussion -/103/83 Eating 84/86 Greeting 68/-/63 Phoning -/-/135/131 Posing 52/55 Purchases 37/37 "
    "Sitting 83/70 SittingDown 69/76 Smoking 92/-/106 Photo 75/57 Waiting 86/87 Walking 60/61 WalkDog 53/43 WalkTogether 50/67",
}
# Test windows that have no other within 0.5 m of their last observed frame, and that have at most nine others.
ALONE, FEW, THRESHOLD = 73, 1139, 0.5
HUMANEVA_MOST_WINDOWS = 385  # in the Validate parts, if no frame of any take were bad

WINDOWS = {
    f"{subject} {action}" + f" {take}" * (take > 0): int(count)
    for subject, rows in _TAKES.items()
    for action, counts in re.findall(r"(\w+) (\S+)", rows)
    for take, count in enumerate(counts.split("/"))
    if count != "-"
}

_FOLLOW = "follow https://github.com/facebookresearch/VideoPose3D/blob/main/DATASETS.md; its"
RECORDS = (
    Collection(
        name="human36m",
        title="Human3.6M, 7 people with positions, 50 Hz",
        licence="academic use, by registration",
        place="data_3d_h36m.npz",
        skeleton=H36M17,
        preset="h36m",
        fps=50.0,
        steps=(
            "register at http://vision.imar.ro/human3.6m and wait for the account; a person has to agree to the licence",
            f"{_FOLLOW} prepare_data_h36m.py writes data_3d_h36m.npz",
        ),
    ),
    Collection(
        name="humaneva",
        title="HumanEva-I, 3 people with positions, 60 Hz",
        licence="academic use, by registration",
        place="data_3d_humaneva15.npz",
        skeleton=HUMANEVA15,
        preset="humaneva",
        fps=60.0,
        protocol=Protocol(60.0, 15, 60, 15),
        steps=(
            "register at http://humaneva.is.tue.mpg.de; a person has to agree to the licence",
            f"{_FOLLOW} prepare_data_humaneva.py, for 15 joints, writes data_3d_humaneva15.npz",
        ),
    ),
)
