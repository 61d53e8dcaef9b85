"""The comparison on paper: table, per-action table, storyboards and curves, each with its provenance."""

from __future__ import annotations

import json
import platform
from argparse import Namespace, _SubParsersAction
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from . import __version__, plots
from .checkpoint import write_atomic
from .comparison import HEADS, METRICS, Row, acknowledgement, compare, row_predictor, rows
from .config import Config
from .data.windows import windows
from .experiment import parse_changes
from .presets import PRESETS
from .runs import Split, get_predictor, get_run, split_motions


def provenance(cfg: Config, split: Split, seeds: tuple[int, ...], device: str) -> dict[str, Any]:
    """What a reader must know to trust the numbers."""
    d, s = cfg.data, cfg.sampling
    about = {
        "data": d.data, "train_clips": len(split.train), "test_clips": len(split.test),
        "train_subjects": sorted({m.subject for m in split.train}), "test_subjects": sorted({m.subject for m in split.test}),
        "fps": d.fps, "history": d.history, "future": d.future, "joints": len(split.test[0].skeleton) - 1,
        "test_windows": d.test_windows or "all", "test_stride": d.test_stride, "multimodal_threshold_m": 0.5,
        "samples": s.samples, "ddim_steps": s.ddim_steps, "guidance": rows(cfg)[-1].sampling,
        "tabg_sigma": s.tabg_sigma, "tabg_space": s.tabg_space, "sampling_seeds": list(seeds), "training_seed": cfg.training.seed,
        "train_steps": cfg.training.train_steps, "training_hash": cfg.training_hash(), "mwlib": __version__,
        "torch": torch.__version__.split("+")[0], "device": device, "machine": platform.machine(),
    }  # fmt: skip
    return about | acknowledgement(d.data)


def results(table: list[dict]) -> plots.Table:
    """The table for people: metres (bone jitter in millimetres a frame), mean ± deviation over sampling seeds."""
    lines = []
    for row in table:
        line: dict[str, object] = {"method": row["name"]}
        for head, metric in zip(HEADS, METRICS, strict=True):
            value, spread = row["mean"][metric], row["seed_deviation"][metric]
            if metric == "bone_length_jitter":
                line["bone jitter (mm)"] = 1000 * value
            else:
                line[head] = value if spread is None else (value, spread)
        lines.append(line)
    return plots.results_table(lines, better={head: "lower" for head in HEADS[1:5]})


def write_tables(table: list[dict], out: Path, about: dict[str, Any]) -> None:
    """`table.csv` and `.md`, `table_actions.csv`, with provenance beside them."""
    flat, actions = [], []
    for row in table:
        line = {"method": row["name"], "seeds": row["seeds"], "windows": row["windows"]}
        for m in METRICS:
            line |= {
                m: row["mean"][m],
                f"{m}_seed_deviation": row["seed_deviation"][m],
                f"{m}_standard_error": row["standard_error"][m],
            }
        flat.append(line)
        actions += [{"method": row["name"], "action": a, **values} for a, values in row["actions"].items()]
    about = about | {"seconds": {row["name"]: row["seconds"] for row in table}}
    plots.save_table(flat, out, "table", provenance=about)
    plots.save_table(actions, out, "table_actions", provenance=about)
    write_atomic(out / "table.md", f"{results(table)}\n")


def _closest(futures: Tensor, truth: Tensor) -> Tensor:
    """The sample (F, C) of (S, F, C) with the smallest ADE."""
    return futures[(futures - truth).norm(dim=-1).mean(-1).argmin()]


def write_storyboards(cfg: Config, split: Split, out: Path, about: dict[str, Any], count: int = 3) -> None:
    """Truth above predictions for a few test windows, spread evenly over the test set."""
    d = cfg.data
    known = {row.name: row for row in rows(cfg)}
    chosen: list[Row] = [known[n] for n in ("MotionWavelet + CFG + TABG + WMSG", "nearest history", "zero velocity")]
    loaded = {"wavelet": get_predictor(cfg, split)}
    every = windows(split.test, d.history, d.future, d.test_stride)
    for picture, i in enumerate(torch.linspace(0, len(every) - 1, 2 * count + 1).long()[1::2].tolist()):
        seed = cfg.sampling.sampling_seed
        model, looked_up, still = (row_predictor(r, seed, cfg, split, loaded)(every.past[i : i + 1], [i])[0] for r in chosen)
        board = {"truth": every.x[i], f"closest of {len(model)}": _closest(model, every.future[i])}
        board |= {"sample 1": model[0], "sample 2": model[1]}
        board |= {"looked up": _closest(looked_up, every.future[i]), "held still": still[0]}
        fig, _ = plots.storyboard(board, split.test[0].skeleton, fps=d.fps, history=d.history, frames=10)
        clip = every.motions[int(every.clip[i])]
        alt = (
            f"Storyboard of test clip {clip.name} ({clip.action}), subject {clip.subject}: the true motion on top, below it the "
            f"future closest to it among {len(model)} sampled by MotionWavelet, two samples taken blindly, the closest of "
            f"{len(looked_up)} looked up in the training set, and the last pose held still."
        )
        where = about | {"clip": clip.name, "start_frame": int(every.start[i]), "window": i}
        data = {name.replace(" ", "_"): row.numpy() for name, row in board.items()}
        plots.save(fig, out, f"storyboard_{picture + 1}", data=data, alt=alt, provenance=where)


def write_curves(cfg: Config, split: Split, out: Path, about: dict[str, Any]) -> None:
    """Training loss, and the loss of the averaged weights on people who are not trained on."""
    curves = json.loads((get_run(cfg, split) / "curves.json").read_text())
    named = {"people seen in training": curves["loss"]}
    if curves["validation"]:
        named["people never seen"] = curves["validation"]
    fig, _ = plots.loss_curves(named)
    alt = "Loss against training step, for the people trained on and, where some were held out for it, for people never seen."
    data = {"loss": curves["loss"], "validation_step": [p[0] for p in curves["validation"]]}
    data["validation_loss"] = [p[1] for p in curves["validation"]]
    plots.save(fig, out, "curves", data={k: v for k, v in data.items() if v}, alt=alt, provenance=about)


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register `train` and `compare`."""
    for name, run, text in (
        ("train", _train, "train a preset, or go on with a run that was stopped; prints the run's folder"),
        (
            "compare",
            _compare,
            "train what is missing, then write the table of all guidances and baselines, with pictures",
        ),
    ):
        parser = subparsers.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        parser.add_argument("--preset", default="laptop", help=f"one of {', '.join(PRESETS)} (default: laptop)")
        change = "change one field of the configuration, e.g. data=my/folder or test_windows=100; may be repeated"
        parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=change)
        if name == "compare":
            parser.add_argument("--out", type=Path, default=Path("build/compare"), help="default: build/compare")
            parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2], help="sampling seeds (default: 0 1 2)")
            parser.add_argument(
                "--device", default="cuda" if torch.cuda.is_available() else "cpu", help="default: a GPU if there is one"
            )
        parser.set_defaults(run=run)


def _config(args: Namespace) -> Config:
    return Config.preset(args.preset, **parse_changes(args.set))


def _train(args: Namespace) -> int:
    print(get_run(_config(args), progress=True))
    return 0


def _compare(args: Namespace) -> int:
    cfg, seeds = _config(args), tuple(args.seeds)
    table = compare(cfg, args.out, seeds, args.device, progress=True)
    split = split_motions(cfg)
    about = provenance(cfg, split, seeds, args.device)
    write_curves(cfg, split, args.out, about)
    write_storyboards(cfg, split, args.out, about)
    write_tables(table, args.out, about)
    print(results(table))
    return 0
