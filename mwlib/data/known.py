"""What is known about published data sets, to compare a converted file with."""

from __future__ import annotations

from pathlib import Path

# Sources by the names of the presets that use them: what load_motions reads, at which rate.
NAMED_SOURCES = {
    "tiny": ("synthetic", 25.0),
    "laptop": ("synthetic", 50.0),
    "cmu": ("cmu/asfamc", 50.0),
    "h36m": ("data_3d_h36m.npz", 50.0),
    "humaneva": ("data_3d_humaneva15.npz", 60.0),
}


def named_source(source: str | Path) -> tuple[str | Path, float | None]:
    """What a source stands for and the rate that goes with it: a preset's data by the preset's name; else itself.

    Raises:
        ValueError: a file or folder of the working folder has the same name.
    """
    if not isinstance(source, str) or source not in NAMED_SOURCES:
        return source, None
    if Path(source).exists():
        raise ValueError(f"{source!r} names a preset's data and {Path(source).absolute()}; for the latter say ./{source}")
    return NAMED_SOURCES[source]


# Windows per take at H, F, stride = 25, 100, 25: plain, "1", "2", ...; "-" where there is no such take. HumanMAC's protocol.
_H36M_TAKES = {
    "S9": "Directions 103/90 Discussion -/230/208 Eating 103/102 Greeting 53/104 Phoning 128/148 Posing 74/74 Purchases 57/45 "
    "Sitting 114/118 SittingDown 113/58 Smoking 169/171 Photo 89/53 Waiting 128/60 Walking 60/93 WalkDog 85/84 "
    "WalkTogether 64/63",
    "S11": "Directions -/58 Discussion -/103/83 Eating 84/86 Greeting 68/-/63 Phoning -/-/135/131 Posing 52/55 Purchases 37/37 "
    "Sitting 83/70 SittingDown 69/76 Smoking 92/-/106 Photo 75/57 Waiting 86/87 Walking 60/61 WalkDog 53/43 WalkTogether 50/67",
}
H36M_TEST_SUBJECTS = tuple(_H36M_TAKES)
H36M_SUBJECTS = ("S1", "S5", "S6", "S7", "S8", *H36M_TEST_SUBJECTS)
# Test windows that have no other within 0.5 m of their last observed frame, and that have at most nine others.
H36M_ALONE, H36M_FEW = 73, 1139
H36M_THRESHOLD = 0.5
HUMANEVA_MOST_WINDOWS = 385  # in the Validate parts, if no frame of any take were bad


def _takes(rows: str) -> dict[str, int]:
    words = rows.split()
    counts = {}
    for action, windows in zip(words[::2], words[1::2], strict=True):
        for take, count in enumerate(windows.split("/")):
            if count != "-":
                counts[f"{action} {take}" if take else action] = int(count)
    return counts


H36M_WINDOWS = {f"{subject} {take}": count for subject, rows in _H36M_TAKES.items() for take, count in _takes(rows).items()}


ACKNOWLEDGEMENTS = {
    "cmu": "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding from "
    "NSF EIA-0196217.",
    "lafan1": "Ubisoft La Forge Animation Dataset (LaFAN1), © 2018 Ubisoft Entertainment, CC BY-NC-ND 4.0: Harvey, Yurick, "
    "Nowrouzezahrai and Pal, Robust Motion In-Betweening, ACM Transactions on Graphics 39(4), 2020.",
    "bandai_namco": "Bandai-Namco Research Motiondataset 1 and 2, © Bandai Namco Research Inc., CC BY-NC 4.0: Kobayashi, Liao, "
    "Inoue, Yojima and Takahashi, Motion Capture Dataset for Practical Use of AI-based Motion Editing and Stylization, "
    "arXiv 2306.08861, 2023.",
}


def acknowledgement(data: str) -> dict[str, str]:
    """What the owners of a data source want said beside any result on it: one entry, or none.

    A source is theirs if it or any folder on its path begins with their name, in any case: "cmu", "/data/CMU/asfamc",
    "my/cmu_benchmark", "LaFAN1".
    """
    folders = Path(data).expanduser().resolve().parts if Path(data).exists() else Path(data).parts
    found = [text for name, text in ACKNOWLEDGEMENTS.items() if any(f.lower().startswith(name) for f in folders)]
    return {"acknowledgement": found[0]} if found else {}
