"""The clips of Bandai-Namco's motion data sets that our tests and tables use."""

from __future__ import annotations

import re

from mwlib.body.skeleton import BANDAI21
from mwlib.data.collections.record import Collection, Download, listed

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
