"""The clips of Bandai-Namco's motion data sets that our tests and tables use."""

import re

from mwlib.body.skeleton import named_tree
from mwlib.data.collections import Collection, Download, listed

BANDAI21 = named_tree(
    "BANDAI21",
    "Hips -1 Spine 0 Chest 1 Neck 2 Head 3 Shoulder_L 2 UpperArm_L 5 LowerArm_L 6 Hand_L 7 "
    "Shoulder_R 2 UpperArm_R 9 LowerArm_R 10 Hand_R 11 UpperLeg_L 0 LowerLeg_L 13 Foot_L 14 Toes_L 15 "
    "UpperLeg_R 0 LowerLeg_R 17 Foot_R 18 Toes_R 19",
    h36m17="Hips UpperLeg_R LowerLeg_R Foot_R UpperLeg_L LowerLeg_L Foot_L Spine Chest Neck Head "
    "UpperArm_L LowerArm_L Hand_L UpperArm_R LowerArm_R Hand_R",
    humanml22="Hips UpperLeg_L UpperLeg_R Spine LowerLeg_L LowerLeg_R Spine:Chest:0.7 Foot_L Foot_R Chest Toes_L Toes_R Neck "
    "Shoulder_L Shoulder_R Head UpperArm_L UpperArm_R LowerArm_L LowerArm_R Hand_L Hand_R",
)

_REPOSITORY = "BandaiNamcoResearchInc/Bandai-Namco-Research-Motiondataset/74ead3ba1ae4696404e6086233779f60de8bf9ef"
_URL = f"https://raw.githubusercontent.com/{_REPOSITORY}/dataset"
_LICENCE = "3711f963c05d0be80d53e5923308a6dee31b203da23435c9cfb7c7b6e4dd5e19"  # SHA-256, the same for both data sets


def _files() -> dict[str, tuple[str, str]]:
    """The licences, and the listed clips: dataset-1_bow_normal_001.bvh lies in data set 1."""
    place = "Bandai-Namco-Research-Motiondataset-{}/{}".format
    clips = {clip.file: (place(clip.file[len("dataset-")], f"data/{clip.file}"), clip.sha256) for clip in listed("bandai_namco")}
    return {f"LICENSE_dataset-{number}.txt": (place(number, "LICENSE"), _LICENCE) for number in (1, 2)} | clips


_OWNERS = (
    "Bandai-Namco Research Motiondataset 1 and 2, © Bandai Namco Research Inc., CC BY-NC 4.0: Kobayashi, Liao, "
    "Inoue, Yojima and Takahashi, Motion Capture Dataset for Practical Use of AI-based Motion Editing and Stylization, "
    "arXiv 2306.08861, 2023."
)
_CITE = (
    "Please cite: Kobayashi, Liao, Inoue, Yojima, Takahashi: Motion Capture Dataset for Practical Use of AI-based Motion\n"
    "Editing and Stylization, arXiv 2306.08861, 2023."
)
_TERMS = (
    "Bandai-Namco-Research-Motiondataset 1 and 2, Creative Commons Attribution-NonCommercial 4.0.\n"
    "You may use, change and share them for no commercial purpose, if you name their authors and say what you changed.\n"
    "The whole text: https://creativecommons.org/licenses/by-nc/4.0/legalcode; copies are laid beside the clips."
)
RECORDS = (
    Collection(
        name="bandai-namco",
        title="Bandai-Namco Research Motiondataset 1 and 2: 81 clips of them, 30 Hz",
        licence="CC BY-NC 4.0",
        place="bandai_namco",
        skeleton=BANDAI21,
        unit="cm",
        # dataset-1_bow_normal_001.bvh names no person: its style stands for one, so that whole styles can be held out.
        file_name=re.compile(r"dataset-\d+_(?P<action>[^_]+)_(?P<subject>[^_]+)_\d+"),
        acknowledgement=_OWNERS,
        download=Download(
            size="18 MB",
            url=_URL,
            asked=_CITE,
            terms=_TERMS,
            files=_files,
        ),
    ),
)
