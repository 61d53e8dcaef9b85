"""How fast feet are where the true ones stand: those of the same people at other times.

These are real motions whose steps merely fall elsewhere: what a motion between keyframes can have that does not know when steps
are taken. The windows are those of `inbetweening_gaps.py`. Needs CMU's, Bandai-Namco's and LaFAN1's files under MWLIB_DATA;
a minute: python benchmarks/feet_at_other_times.py figures/lafan1
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch
from inbetweening_gaps import SETS, WINDOWS

import mwlib as mw
from mwlib.files import write_atomic
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.gaps import GAPS, STRIDE, scores
from mwlib.inbetweening.windows import Clips
from mwlib.metrics import summary
from mwlib.plots.saving import as_csv

TIMES = 10  # other windows of the same clip


def main() -> None:
    """Write the table, and print it."""
    model, rng, rows = mw.load_run("inbetween"), np.random.default_rng(0), []
    assert isinstance(model, Bridge)
    for name, (source, people) in SETS.items():
        motions = [m.with_up("z") for m in mw.load_motions(source, fps=30.0) if not people or m.subject in people]
        clips = Clips(model.space.bodies.prepare([m for m in motions if len(m) > min(GAPS) + 4]), model.space)
        for gap in GAPS:
            every = clips.windows(gap + 4, STRIDE, 2)
            windows = every.thin(WINDOWS)
            places, truth = (model.space.positions(model.space.placed(w.x, w.placement), w.offsets) for w in (every, windows))
            apart = (windows.start[:, None] - every.start[None]).abs() >= gap  # that do not overlap
            at_other_times = (windows.clip[:, None] == every.clip[None]) & apart
            kept = at_other_times.any(1)  # clips that are long enough
            chosen = [rng.choice(np.flatnonzero(row), TIMES) for row in at_other_times[kept].numpy()]
            others, truth = places[torch.from_numpy(np.stack(chosen))][:, :, 1:-1], truth[kept]
            found = summary(scores(others, truth, truth[:, 1:-1], model), windows.clip[kept].tolist())
            told = {"people": found["mean"]["true_slide"], "at other times": found["mean"]["slide"]}
            error = {"at other times, standard error": found["standard_error"]["slide"]}
            rows.append({"data": name, "frames between": gap, "windows": int(kept.sum()), **told, **error})
            print(rows[-1], flush=True)
    write_atomic(Path(sys.argv[1]) / "feet_at_other_times.csv", as_csv(rows))


if __name__ == "__main__":
    main()
