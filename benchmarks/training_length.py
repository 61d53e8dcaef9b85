"""Do the paper's directions hang on how long a network was trained? One training a row, stopped at several lengths.

Scaling, manifold shaping, both guidances and the noise schedule after 500 to 16,000 steps, and the paper's own configuration
for as long as a clock allows. Needs CMU's files under MWLIB_DATA:
python benchmarks/training_length.py measure RAW ROW [--seconds S]   # ROW: scaled, unscaled, linear, published
python benchmarks/training_length.py table RAW figures/cmu           # published.csv, training_length_*.csv and a picture
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from accelerate import Accelerator

import mwlib as mw
from mwlib.data.collections import acknowledgement
from mwlib.experiments.grids import system_of
from mwlib.experiments.runs import machine
from mwlib.files import write_json, write_together
from mwlib.metrics import clustered_error
from mwlib.plots.look import LOOKS, OBSERVED, canvas, style
from mwlib.plots.saving import as_csv
from mwlib.prediction.config import Config
from mwlib.prediction.predictor import Predictor
from mwlib.training import MovingAverage, learning_rate, seeded

MARKS = 500, 1000, 4000, 16_000  # steps
METRICS = ("apd", "ade", "fde", "mmade", "mmfde")
COLUMNS = {**{name: name.upper() for name in METRICS}, "speed": "speed (m/s)", "jerk": "jerk (m/s³)"}
PLAIN: dict[str, Any] = dict(guidance_weight=0.0, tabg_scale=0.0, wmsg="off")
SAMPLED: dict[str, dict[str, Any]] = {
    "conditional": PLAIN,
    "WMSG": PLAIN | dict(wmsg="every_step"),
    "CFG": PLAIN | dict(guidance_weight=0.3),
    "CFG, TABG": PLAIN | dict(guidance_weight=0.3, tabg_scale=1.0, tabg_sigma=1.0),
}
# constant rate, so that each length is a training of its own
SHORT: dict[str, Any] = dict(
    lr_schedule="constant", train_steps=MARKS[-1], ema=0.998, ema_start=200, ddim_steps=10, guidance_form="eq7"
)
PEOPLE: dict[str, Any] = dict(data="cmu/asfamc", fps=50.0, validation_subjects=("1",), test_subjects=("2", "7", "29"))
ROWS: dict[str, Callable[[], Config]] = {
    "scaled": lambda: Config.preset("cmu_paper", **SHORT),
    "unscaled": lambda: Config.preset("cmu_paper", coefficient_scale="none", loss_weight="uniform", **SHORT),
    "linear": lambda: Config.preset("cmu_paper", schedule="linear", **SHORT),
    # Appendix A on these people: 12 layers of width 768, noise predicted, coefficients as they are, 100 leading steps
    "published": lambda: Config().override(**PEOPLE, mixed_precision="bf16", precision="tf32", test_windows=68),
}
RUN = "python benchmarks/training_length.py table RAW figures/cmu"
RESERVE = 150.0  # seconds of the clock that scoring the published configuration takes


def trained(cfg: Config, data: Any, seconds: float) -> Iterator[tuple[int, float, Callable[[Config], Predictor]]]:
    """After each step: its number, the loss, and what opens the averaged weights; ends after the steps or the seconds."""
    began, settings = time.monotonic(), cfg.training
    accelerator = Accelerator(mixed_precision=settings.mixed_precision)
    objective = system_of(cfg).make_objective(cfg, data, {})
    objective.to(accelerator.device)
    network = objective.network.to(accelerator.device)
    optimiser = torch.optim.AdamW(network.parameters(), lr=settings.lr, weight_decay=settings.weight_decay, fused=True)
    average = MovingAverage(network, settings.ema, settings.ema_start)
    network, optimiser = accelerator.prepare(network, optimiser)

    def opened(sampled: Config) -> Predictor:
        """The model as it stands, sampling as a configuration says."""
        weights = {name: tensor.float().cpu() for name, tensor in average.averaged().state_dict().items()}
        return Predictor.from_tensors(sampled, weights, objective.learnt(), objective.about()).to(accelerator.device)

    for step in range(settings.train_steps):
        if time.monotonic() - began > seconds:
            return
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(settings, step)
        with seeded(settings.seed, step + 1, 0) as generator:
            network.train()
            loss = objective.loss(network, objective.draw(settings.batch, generator), generator)
            accelerator.backward(loss)
            optimiser.step()
            optimiser.zero_grad()
        average.update(step + 1)
        yield step + 1, float(loss.detach()), opened


def measure(raw: Path, row: str, seconds: float) -> None:
    """Train one row, and sample and score it at every mark that it reaches, and at the end."""
    began, cfg, found = time.monotonic(), ROWS[row](), []
    data, published = system_of(cfg).load_data(cfg), row == "published"
    sampled = {"as published": {}, "conditional": PLAIN} if published else SAMPLED if row != "linear" else {"conditional": PLAIN}
    curve: list[float] = []

    def score(step: int, opened: Callable[[Config], Predictor], few: dict[str, Any]) -> None:
        for name, changes in sampled.items():
            if few and name != "conditional":
                continue
            asked = cfg.override(**changes, **few)
            made = system_of(cfg).evaluate(asked, lambda: opened(asked), data, False)  # noqa: B023  (called at once)
            kept = {key: made[key] for key in ("mean", "standard_error", "values", "clips", "windows")}
            found.append(
                {
                    "row": row,
                    "sampled": name,
                    "steps": step,
                    "settings": asked.hash(),
                    "seconds": time.monotonic() - began,
                    **kept,
                }
            )
            people = {motion.name: motion.subject for motion in data.test}
            write_json(
                raw / f"length_{row}.json",
                {"rows": found, "loss": curve[:: max(len(curve) // 500, 1)], "people": people, "machine": machine()},
            )
            print(
                row,
                step,
                name,
                {key: round(made["mean"][key], 3) for key in METRICS},
                f"{time.monotonic() - began:.0f} s",
                flush=True,
            )

    step, opened = 0, None
    for step, loss, opened in trained(cfg, data, seconds - (RESERVE if published else 0.0) - (time.monotonic() - began)):
        curve.append(loss)
        if not published and step in MARKS:
            score(step, opened, {})
        elif published and step in (1000, 4000, 16_000):
            score(step, opened, {"test_windows": 17, "samples": 10})
    if published and opened is not None:
        score(step, opened, {})


PAIRS = {  # title of a picture's column -> line -> row and sampling, and those that they are compared with
    "scale, schedule": {
        "as they are, less scaled": (("unscaled", "conditional"), ("scaled", "conditional")),
        "linear, less cosine schedule": (("linear", "conditional"), ("scaled", "conditional")),
    },
    **{
        title: {
            f"{name}, {words}": ((row, with_it), (row, without))
            for words, row in (("as they are", "unscaled"), ("scaled", "scaled"))
        }
        for title, name, with_it, without in (
            ("shaping", "WMSG", "WMSG", "conditional"),
            ("CFG", "CFG", "CFG", "conditional"),
            ("TABG", "TABG", "CFG, TABG", "CFG"),
        )
    },
}


def table(raw: Path, out: Path) -> None:
    """Write means and paired differences, and draw the differences over the steps."""
    found = {}
    for row in ROWS:
        for line in json.loads((raw / f"length_{row}.json").read_text(encoding="utf-8"))["rows"]:
            found[row, line["sampled"], line["steps"]] = line
    means = [
        {"row": row, "sampled": sampled, "steps": steps, "windows": line["windows"], **{m: line["mean"][m] for m in METRICS}}
        for (row, sampled, steps), line in found.items()
    ]
    paired = []
    for label, (one, other) in {k: v for lines in PAIRS.values() for k, v in lines.items()}.items():
        for steps in sorted({key[2] for key in found if key[:2] == one}):
            a, b = found[*one, steps], found[*other, steps]
            line: dict[str, Any] = {"compared": label, "steps": steps}
            for metric in METRICS:
                difference = np.array(a["values"][metric]) - np.array(b["values"][metric])
                line[metric], line[f"{metric}, standard error"] = (
                    float(difference.mean()),
                    clustered_error(difference, a["clips"]),
                )
            paired.append(line)
    about = {
        "data": "cmu/asfamc", "preset": "cmu_paper", "seeds_of": "training and sampling", "mwlib": mw.__version__,
        "command": RUN, **acknowledgement("cmu/asfamc"),
    }  # fmt: skip
    files = {f"training_length_{name}.csv": as_csv(lines) for name, lines in (("means", means), ("paired", paired))}
    last = max(steps for row, _, steps in found if row == "published")
    ends = {sampled: line for (row, sampled, steps), line in found.items() if (row, steps) == ("published", last)}
    files["published.csv"] = as_csv([
        {
            "row": sampled, "windows": line["windows"], "steps": last,
            **{column: line["mean"][m] for m, column in COLUMNS.items()},
            **{f"{column}, standard error": line["standard_error"][m] for m, column in COLUMNS.items()},
        }
        for sampled, line in ends.items()
    ])  # fmt: skip
    files["published.json"] = json.dumps(about | {"preset": "the paper's Appendix A"}, indent=1)
    write_together({out / name: content for name, content in files.items()})
    draw(paired, out)


@style()
def draw(paired: Sequence[dict[str, Any]], out: Path) -> None:
    """Differences over the length of the training, with twice their standard errors."""
    figure, axes = canvas(3, len(PAIRS), height=5.8, sharex=True)
    data: dict[str, Any] = {}
    metrics = ("apd", "APD (m)"), ("ade", "ADE (m)"), ("fde", "FDE (m)")
    for column, (title, labels) in zip(axes.T, PAIRS.items(), strict=True):
        for ax, (metric, _) in zip(column, metrics, strict=True):
            for number, label in enumerate(labels):
                lines = [line for line in paired if line["compared"] == label]
                at = np.array([line["steps"] for line in lines]) * 1.06 ** (number - 0.5)
                values, errors = (np.array([line[name] for line in lines]) for name in (metric, f"{metric}, standard error"))
                data[f"{label}, {metric}"] = values
                ax.errorbar(at, values, 2 * errors, label=label, **LOOKS[number])
            ax.axhline(0, color=OBSERVED, linewidth=1)
            ax.margins(y=0.15)
            ax.set(xscale="log", xticks=MARKS[:3], xticklabels=[f"{n / 1000:g}" for n in MARKS[:3]])
            ax.minorticks_off()
        column[0].set_title(title)
        column[-1].set_xlabel("1,000 steps")
    for ax, (_, unit) in zip(axes[:, 0], metrics, strict=True):
        ax.set_ylabel(unit)
    lines = [ax.get_legend_handles_labels()[0] for ax in axes[0, :2]]
    words = ["as they are, less scaled", "linear, less cosine schedule", "coefficients as they are", "scaled one by one"]
    figure.legend(lines[0], words[:2], title="first column", loc="outside upper left")
    figure.legend(lines[1], words[2:], title="others", loc="outside upper right")
    alt = (
        "Differences in APD, ADE and FDE after 500, 1,000 and 4,000 steps, with twice their errors. In APD unscaled less scaled "
        "and linear less cosine turn from below to above 0; attention guidance stays near 1; shaping stays above 0 when scaled."
    )
    mw.plots.save(figure, out, "training_length", data=data, alt=alt, provenance={"command": RUN})


def main(arguments: Sequence[str]) -> None:
    """The command."""
    match arguments:
        case ["measure", raw, row, *rest]:
            measure(Path(raw), row, float(rest[1]) if rest else 1e9)
        case ["table", raw, out]:
            table(Path(raw), Path(out))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
