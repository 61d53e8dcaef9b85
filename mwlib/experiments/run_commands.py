"""Commands about finished runs of the prediction system: predict, export-bvh."""

from __future__ import annotations

import io
import sys
from argparse import ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path

import numpy as np
from tqdm import tqdm

from mwlib.body.motion import Motion
from mwlib.data import load_motions
from mwlib.data.formats.bvh_writing import write_bvh
from mwlib.experiments.data_commands import add_statements, statements
from mwlib.experiments.runs import load_run
from mwlib.files import write_atomic
from mwlib.prediction.continuation import continued
from mwlib.prediction.predictor import Predictor


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register this module's commands."""
    text = "continue motions: sampled futures of each clip's last frames, as one .npz file"
    parser = subparsers.add_parser("predict", help=text, description=f"{text.capitalize()}. {_FORM}")
    _options(parser)
    parser.add_argument("--out", type=Path, default=Path("predictions.npz"), help="default: predictions.npz")
    parser.set_defaults(run=_predict)

    text = "write a run's predictions as BVH files, to be opened in Blender"
    parser = subparsers.add_parser("export-bvh", help=text, description=f"{text.capitalize()}. {_BVH}")
    _options(parser)
    parser.add_argument("--out", type=Path, default=Path("build/bvh"), help="folder; default: build/bvh")
    parser.set_defaults(run=_export)


_FORM = (
    "The file holds, by the clip's name, positions (samples, frames, joints, 3) in metres, observed frames first; joints, "
    "parents, fps, up and history say how to read them."
)
_BVH = (
    "One file per clip and sample: the observed frames, then the predicted ones; bones keep their median lengths, and the "
    "distance of the written joints from the predicted ones is printed. The root stays where it was last seen: the model does "
    "not predict it."
)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("run_folder", type=Path, metavar="RUN", help="folder of a finished training run, as train prints it")
    parser.add_argument("source", metavar="SOURCE", help="motions to continue: 'synthetic', a file or a folder")
    add_statements(parser)
    parser.add_argument("--samples", type=int, default=3, help="futures of each clip (default 3)")
    parser.add_argument("--seed", type=int, default=0, help="of the sampling (default 0)")
    parser.add_argument("--clips", type=int, default=0, metavar="N", help="only the first N clips (default: all)")


def _continuations(args: Namespace) -> tuple[Predictor, list[list[Motion]], list[str]]:
    if args.samples < 1:
        raise ValueError(f"samples is {args.samples}; expected at least 1")
    predictor = load_run(args.run_folder)
    if not isinstance(predictor, Predictor):
        raise ValueError(f"{args.run_folder} is a run of another system; expected one of prediction")
    motions = load_motions(args.source, **statements(args))
    motions = motions[: args.clips] if args.clips else motions
    found = continued(predictor, motions, args.samples, args.seed, progress=sys.stderr.isatty())
    return predictor, found, _names(motions)


def _names(motions: list[Motion]) -> list[str]:
    """A file name for each clip, all different."""
    names: list[str] = []
    for number, m in enumerate(motions):
        name = "".join(c if c.isalnum() or c in "-_." else "_" for c in m.name) or f"clip_{number + 1}"
        names.append(name if name not in names else f"{name}_{number + 1}")
    return names


def _predict(args: Namespace) -> int:
    predictor, found, names = _continuations(args)
    bodies = predictor.bodies
    arrays = {name: np.stack([m.positions for m in row]) for name, row in zip(names, found, strict=True)}
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, allow_pickle=False, joints=np.array(bodies.skeleton.joints), parents=np.array(bodies.skeleton.parents),
        fps=np.array(bodies.fps), up=np.array(bodies.up), history=np.array(predictor.representation.history), **arrays,
    )  # fmt: skip
    write_atomic(args.out, buffer.getvalue())
    print(f"{args.out}: {args.samples} futures of {len(found)} clips, {found[0][0].duration:.2f} s each")
    return 0


def _export(args: Namespace) -> int:
    _, found, names = _continuations(args)
    errors = []
    for name, row in tqdm(list(zip(names, found, strict=True)), "writing", unit="clip", disable=not sys.stderr.isatty()):
        errors += [write_bvh(m, args.out / f"{name}_sample{i + 1}.bvh") for i, m in enumerate(row)]
    mean, largest = np.mean([e.mean for e in errors]), max(e.max for e in errors)
    away = f"{1000 * mean:.1f} mm from the predicted ones, {1000 * largest:.0f} mm at most"
    print(f"{args.out}: {len(errors)} files; joints are {away}")
    return 0
