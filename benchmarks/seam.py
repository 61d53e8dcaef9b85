"""The shipped `cmu`: how its futures begin, with and without `seam`, and how much of people's jerk it can have, by frequency.

The same drawn coefficients are decoded with each setting. The rows on the validation person are those among which it was chosen.
Samples of people whom the model was trained on stand beside those of strangers. Needs CMU's files under MWLIB_DATA;
half an hour of a core: python benchmarks/seam.py figures/cmu

With --temperatures instead: jerk below 3 Hz, errors and bands of each person by the temperature of the noise; ten minutes.
"""

from __future__ import annotations

import itertools
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.signal import butter, sosfiltfilt
from torch import Tensor

import mwlib as mw
from mwlib.data.collections import acknowledgement
from mwlib.files import write_together
from mwlib.metrics import clustered_error
from mwlib.plots.saving import as_csv
from mwlib.prediction.predictor import Predictor
from mwlib.prediction.system import DETAILS, METRICS, load_data, score, test_windows

WITHOUT, CHOSEN = 0.0, 0.045  # seconds
VALIDATION, TRAINED_ON = "1", "5, 9, 14, 16, 49"
PEOPLE = {VALIDATION: (WITHOUT, 0.025, 0.035, CHOSEN, 0.06), "2, 7, 29": (WITHOUT, CHOSEN), TRAINED_ON: (WITHOUT, CHOSEN)}
MOST = {TRAINED_ON: 120}  # windows, spread evenly
SHOWN = ("ade", "fde", "error_0.2s", "seam_jerk", "first_step", "median_jerk", "speed", "coverage_0.5", "coverage_0.9")
COLUMNS = {name: (METRICS | DETAILS)[name] for name in SHOWN}
EDGES = (3, 4, 6, 8, 10, 12.5)  # hertz
BATCH = 8  # windows
ONE_BY_ONE = {"1": "validation", "2": "test", "7": "test", "29": "test", "5": "trained on", "49": "trained on"}
TEMPERATURES = (
    (1.15, 0.25),
    (1.15, 0.0),
    (1.0, 0.25),
    (1.0, 0.0),
    (0.85, 0.0),
)  # with their spread; the first is the shipped one
FEW, FEW_WINDOWS, SLOW = 20, 32, 3.0  # samples and windows of each person; hertz
KEPT = ("ade", "fde", "speed", "coverage_0.5", "coverage_0.9")


ABOUT = {
    "data": "cmu/asfamc", "model": "cmu, as it comes with the package", "samples": "50; of jerk every fifth", "seed": 0,
    "mwlib": mw.__version__, "command": "python benchmarks/seam.py figures/cmu", **acknowledgement("cmu/asfamc"),
}  # fmt: skip


def jerk_below(x: Tensor, edge: float | None, fps: float, history: int) -> Tensor:
    """Jerk of predicted frames of whole windows, m/s³: (windows, 2), the mean and the median frame's, means over samples.

    A low-pass of fourth order comes first, forwards and backwards.
    """
    if edge is not None:
        x = torch.from_numpy(sosfiltfilt(butter(4, edge, fs=fps, output="sos"), x.double().numpy(), axis=-2).copy())
    each = (x.diff(n=3, dim=-2) * fps**3).unflatten(-1, (-1, 3)).norm(dim=-1).mean(-1)
    each = each[..., history - 2 :]
    return torch.stack([each.mean(-1), each.median(-1).values], -1).reshape(len(x), -1, 2).mean(1)


def measured(people: str) -> tuple[dict[float, dict[str, Any]], dict[str, np.ndarray], list[str]]:
    """Scores for each setting, jerk of each window below each edge, and whose the windows are."""
    model = mw.load_run("cmu")
    cfg = model.cfg.override(test_subjects=tuple(people.split(", ")), validation_subjects=())
    every = test_windows(load_data(cfg), cfg.windows)
    test = every.thin(MOST.get(people, 0))
    drawn, jerks = {}, {}
    settings = {seam: model.with_sampling(seam=seam) for seam in PEOPLE[people]}

    def draw(x_history: Tensor, ids: list[int]) -> Tensor:
        ((y, history),) = model.sampled(x_history, window_ids=ids, chunk=BATCH)
        drawn[tuple(ids)] = y, history
        return note(settings[CHOSEN].decode(y, history), x_history, ids)

    def note(futures: Tensor, x_history: Tensor, ids: list[int]) -> Tensor:
        some = futures[:, ::5]
        whole = torch.cat([x_history[:, None].expand(-1, some.shape[1], -1, -1), some], dim=-2)
        known = torch.stack([every.x[i] for i in ids])
        again = settings[CHOSEN].decode(model.representation.encode(known)[:, None], x_history)
        again = torch.cat([x_history, again[:, 0]], dim=-2)
        for edge in (*EDGES, None):
            for name, x in (("samples", whole), ("people", known), ("people, encoded and decoded", again)):
                jerks.setdefault((edge, name), []).append(jerk_below(x, edge, cfg.data.fps, cfg.windows.history))
        return futures

    def scored(seam: float) -> dict[str, Any]:
        draws = seam == CHOSEN
        return score(
            draw if draws else lambda _, ids: settings[seam].decode(*drawn[tuple(ids)]),
            test, every, cfg.evaluation, draws, BATCH,
        )  # fmt: skip

    with torch.inference_mode():
        found = {CHOSEN: scored(CHOSEN)}
        found |= {seam: scored(seam) for seam in PEOPLE[people] if seam != CHOSEN}
    whose = [every.motions[int(clip)].subject for clip in test.clip]
    return found, {key: torch.cat(values).numpy() for key, values in jerks.items()}, whose


def hasty(model: Predictor, person: str, temperature: float, spread: float) -> dict[str, Any]:
    """Jerk below 3 Hz of a person and of samples from noise of one temperature, errors and bands."""
    model = model.with_sampling(samples=FEW, temperature=temperature, temperature_spread=spread)
    cfg = model.cfg.override(test_subjects=(person,), validation_subjects=())
    every, jerks = test_windows(load_data(cfg), cfg.windows), list[Tensor]()
    test = every.thin(FEW_WINDOWS)

    def draw(x_history: Tensor, ids: list[int]) -> Tensor:
        futures = model.predict(x_history, window_ids=ids, chunk=BATCH)
        whole = torch.cat([x_history[:, None].expand(-1, FEW, -1, -1), futures], dim=-2)
        known = torch.stack([every.x[i] for i in ids])
        jerks.append(torch.stack([jerk_below(x, SLOW, cfg.data.fps, cfg.windows.history)[:, 0] for x in (whole, known)]))
        return futures

    mean = score(draw, test, every, cfg.evaluation, False, BATCH)["mean"]
    samples, people = torch.cat(jerks, dim=1).mean(1).tolist()
    row = {"person": person, "who": ONE_BY_ONE[person], "windows": len(test), "temperature": temperature, "spread": spread}
    row |= {"people (m/s³)": people, "samples (m/s³)": samples, "samples / people": samples / people}
    return row | {COLUMNS[name].heading: mean[name] * COLUMNS[name].scale for name in KEPT}


def main() -> None:
    """Write the scores, differences in pairs, also by person, and jerk by frequency."""
    torch.set_num_threads(1)
    out, means, pairs, bands = Path(sys.argv[1]), [], [], []
    if "--temperatures" in sys.argv:
        model = mw.load_run("cmu")
        rows = [hasty(model, person, *how) for person in ONE_BY_ONE for how in TEMPERATURES]
        about = ABOUT | {"samples": FEW, "jerk": f"below {SLOW:g} Hz", "command": f"{ABOUT['command']} --temperatures"}
        write_together({out / "haste.csv": as_csv(rows), out / "haste.json": json.dumps(about, indent=1)})
        return
    for people, tried in PEOPLE.items():
        found, jerks, whose = measured(people)
        means += [
            {"people": people, "seam": s}
            | {column.heading: found[s]["mean"][name] * column.scale for name, column in COLUMNS.items()}
            for s in tried
        ]
        clips = found[CHOSEN]["clips"]
        several = len({*clips}) > 1  # of one clip no error over clips can be given
        if several:
            changes = {
                column.heading: (np.array(found[CHOSEN]["values"][n]) - np.array(found[WITHOUT]["values"][n])) * column.scale
                for n, column in COLUMNS.items()
            }
            for person in ("all", *sorted({*whose}, key=int)):
                of = np.array([person in ("all", who) for who in whose])
                told = {heading: float(d[of].mean()) for heading, d in changes.items()}
                if person == "all":
                    told |= {f"{heading}, standard error": clustered_error(d, clips) for heading, d in changes.items()}
                pairs.append({"people": person, "windows": int(of.sum()), "seam": CHOSEN, "less": "0"} | told)
        persons = sorted({*whose}, key=int)
        for edge, person in itertools.product((*EDGES, None), persons if len(persons) == 1 else (people, *persons)):
            which = np.array([person in (people, who) for who in whose])
            for i, frame in enumerate(("mean", "median")):
                of = {name: values[which, i] for (below, name), values in jerks.items() if below == edge}
                ratio = of["samples"].mean() / of["people"].mean()
                row = {"whose": person, "windows": int(which.sum()), "below (Hz)": edge or "all", "frame": frame}
                row |= {name: float(values.mean()) for name, values in of.items()} | {"samples / people": float(ratio)}
                off = (
                    clustered_error(of["samples"] - ratio * of["people"], clips) / of["people"].mean() if person == people else ""
                )
                bands.append(row | {"standard error": off if several else ""})
    files = {"seam.csv": means, "seam_paired.csv": pairs, "jerk_bands.csv": bands}
    write_together({out / name: as_csv(rows) for name, rows in files.items()} | {out / "seam.json": json.dumps(ABOUT, indent=1)})


if __name__ == "__main__":
    main()
