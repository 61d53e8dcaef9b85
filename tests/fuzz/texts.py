"""Small whole files of text that say what to train on and how: grids, a run's configuration, lists and captions of HumanML3D."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mwlib.experiments.grids import MODULES, system
from tests.fuzz.seeds import npy

GRIDS = b"""x-budgets:
  short: &short
    - { until: 1000, seeds: 1, share: 0.15, set: { test_windows: 24, ddim_steps: 10 } }
    - { until: 1.0e+6, seeds: 3, trains: true, set: { ddim_steps: 20 } }
grids:
  table_1:
    title: "Wavelets"
    paper: Table 1
    notebook: 04_wavelet_vs_phase
    budgets: *short
    base: { spacing: trailing }
    reference: bior2.8
    rows:
      - { name: bior2.8, paper: { apd: 6.506, ade: 0.376 } }
      - { name: haar, set: { wavelet: haar, level: 2, lr: 1e-3 }, seeds: 1 }
      - name: mean pose
        set: &zero { method: zero_velocity }
  sentences:
    title: Losses
    system: text_to_motion
    trains: true
    rows:
      - { name: both, set: { low_weight: 1.0, critic: some/folder } }
      - { name: truth, set: { method: truth } }
"""
CAPTIONS = b"""a person walks#a/DET person/NOUN walk/VERB#0.0#0.0
then stops.#then/ADV stop/VERB#0.2#1.9
runs #run/VERB#nan#nan
"""


def texts() -> Iterator[tuple[str, str, dict[str, bytes]]]:
    """As `tests.fuzz.seeds.seeds`; a folder is read where "." is named."""
    yield "grids.yaml", "grids.yaml", {"grids.yaml": GRIDS}
    for name in MODULES:
        config = system(name).Config.preset("tiny").to_yaml().encode()
        yield f"config.yaml {name}", "config.yaml", {"config.yaml": config}
    features = npy(np.zeros((40, 251), np.float16))
    lists = {"train.txt": b"00001\nM00001\n", "val.txt": b"", "test.txt": b"00002\n"}
    clips = {f"new_joint_vecs/{clip}.npy": features for clip in ("00001", "M00001", "00002")}
    folder = clips | lists | {f"texts/{clip}.txt": CAPTIONS for clip in ("00001", "M00001", "00002")}
    for spoilt in ("train.txt", "test.txt", "texts/00001.txt"):
        yield f"{spoilt} of captions", ".", {**{name: folder[name] for name in folder if name != spoilt}, spoilt: folder[spoilt]}
