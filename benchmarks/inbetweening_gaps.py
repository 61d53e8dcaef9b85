"""The in-betweening model that comes with the package beside slerp, its own curve and truth, at gaps of 5 to 90 frames.

The people are ones it never saw. Needs CMU's, Bandai-Namco's and LaFAN1's files under MWLIB_DATA:
python benchmarks/inbetweening_gaps.py figures
A run's folder after that measures another model: python benchmarks/inbetweening_gaps.py build/other RUN
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

import mwlib as mw
from mwlib.body.joining import rig_of
from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17
from mwlib.data.collections import acknowledgement
from mwlib.files import write_together
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.gaps import by_gap, table
from mwlib.inbetweening.windows import coasting
from mwlib.plots.look import LOOKS, OBSERVED, canvas, style

SETS = {  # folder of the figures -> data, and who is tested; nobody: everybody
    "cmu": ("cmu/asfamc", ("2", "7", "29")),
    "bandai_namco": ("bandai_namco", ()),
    "lafan1": ("lafan1", ()),
}
WINDOWS = 40  # of each gap
KINDS = ("known", "slerp"), ("not known", "slerp"), ("known", "curve")  # whether velocities are, and what stands beside
RUN = "python benchmarks/inbetweening_gaps.py figures"


def slerped(motions: list[Motion]):
    """Slerp of each joint's rotation and the root on a straight line, of the files' own rigs, as places of 17 joints."""

    def straight(clip: int, first: int, last: int) -> Float[np.ndarray, "T joints 3"]:
        motion = motions[clip]
        share = np.linspace(0, 1, last - first + 1)
        rig = rig_of(motion).between(np.full(len(share), first), np.full(len(share), last), share)
        between = Motion(rig.positions().astype(np.float32), motion.fps, motion.skeleton, up=motion.up)
        return between.retarget(H36M17).positions

    return straight


def curved(motions: list[Motion], frames: float):
    """The curve that the model departs from, without the model: it leaves and arrives with the velocities at the keyframes."""

    def curve(clip: int, first: int, last: int) -> Float[np.ndarray, "T joints 3"]:
        x = torch.from_numpy(motions[clip].positions[first - 1 : last + 2]).flatten(-2)
        ends = torch.zeros(last - first + 1, dtype=torch.bool)
        ends[[0, -1]] = True
        return coasting(x[1:-1], x[:1], ends, frames, x[-1:]).unflatten(-1, (-1, 3)).numpy()

    return curve


@style()
def draw(out: Path) -> None:
    """A picture of the tables: the errors of model and curve as shares of slerp's, over the gap."""
    figure, axes = canvas(1, len(SETS), height=2.7, sharey=True)
    found = {name: json.loads((out / name / "inbetweening_gaps.json").read_text(encoding="utf-8"))["rows"] for name in SETS}
    data, titles = {}, ("CMU, three people", "Bandai-Namco", "LaFAN1")
    for ax, (name, rows), title in zip(axes[0], found.items(), titles, strict=True):
        known, alone, curve = ([r["mean"] for r in rows if (r["velocities"], r["beside"]) == kind] for kind in KINDS)
        gaps, slerp = [r["gap"] for r in rows][: len(known)], np.array([mean["straight"] for mean in known])
        for number, (label, errors) in enumerate(
            {
                "model, two poses alone": [mean["mean"] for mean in alone],
                "model, velocities known": [mean["mean"] for mean in known],
                "its curve alone": [mean["straight"] for mean in curve],
            }.items()
        ):
            data[f"{name}: {label}"] = np.array(errors) / slerp
            ax.plot(gaps, data[f"{name}: {label}"], label=label, **LOOKS[number])
        ax.axhline(1, color=OBSERVED, linewidth=1)
        ax.set(title=title, xlabel="frames between", ylim=(0, 1.25), xlim=(0, 95))
    axes[0, 0].set_ylabel("error / slerp's")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    alt = (
        "Error of the mean of ten over slerp's for three sets of people. Where velocities are known it rises from 0.4 to 0.7 or "
        "0.9. The curve without the networks lies on this line in short gaps and above it in long ones. From two poses alone "
        "all lie near 1."
    )
    mw.plots.save(figure, out / "lafan1", "gaps", data={"between": np.array(gaps), **data}, alt=alt, provenance={"command": RUN})


def main() -> None:
    """Write a table for each set, print it, and draw all."""
    torch.set_num_threads(1)
    out, model = Path(sys.argv[1]), mw.load_run(*(sys.argv[2:] or ["inbetween"]))
    assert isinstance(model, Bridge)
    for name, (source, people) in SETS.items():
        motions = [m.with_up("z") for m in mw.load_motions(source, fps=30.0) if not people or m.subject in people]
        motions = [m for m in motions if len(m) > 9]
        prepared = model.space.bodies.prepare(motions)
        rows, line, curve = [], slerped(motions), curved(prepared, model.cfg.model.coast)
        for known, beside, straight in ((True, "slerp", line), (False, "slerp", line), (True, "curve", curve)):
            found = by_gap(model, prepared, known, WINDOWS, straight)
            against = {"velocities": "known" if known else "not known", "beside": beside}
            rows += [{**against, **row} for row in found]
            print(f"{name}, {against}\n{table(found)}", flush=True)
        about = {"rows": rows, "data": source, "samples": 10, **acknowledgement(source)}
        write_together({out / name / "inbetweening_gaps.json": json.dumps(about, indent=1)})
    draw(out)


if __name__ == "__main__":
    main()
