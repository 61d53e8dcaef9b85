"""Commands about finished runs of the prediction system: predict, export-bvh, loop."""

from __future__ import annotations

import io
import json
import sys
from argparse import ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path

import numpy as np
from tqdm import tqdm

from mwlib import plots
from mwlib.body.motion import Motion
from mwlib.data import load_motions
from mwlib.data.collections import acknowledgement
from mwlib.data.formats.bvh_writing import write_bvh
from mwlib.experiments.data_commands import add_statements, statements
from mwlib.experiments.runs import load_run
from mwlib.files import write_atomic, write_together
from mwlib.prediction.predictor import Predictor, predicted_motions
from mwlib.version import __version__


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

    text = "write a looping picture of a clip: the truth, and sampled futures beside it"
    parser = subparsers.add_parser("loop", help=text, description=f"{text.capitalize()}. {_LOOP}")
    _options(parser, several=False)
    parser.add_argument("--clip", default="", metavar="NAME", help="which clip (default: the first)")
    parser.add_argument("--start", type=int, default=0, help="first observed frame, at the model's rate (default 0)")
    parser.add_argument("--width", type=int, default=900, help="pixels (default 900)")
    parser.add_argument("--out", type=Path, default=Path("loop.webp"), help=".webp, .gif or .png; default: loop.webp")
    parser.set_defaults(run=_loop)


_FORM = (
    "The file holds, by the clip's name, positions (samples, frames, joints, 3) in metres, observed frames first; joints, "
    "parents, fps, up and history say how to read them."
)
_BVH = (
    "One file per clip and sample: the observed frames, then the predicted ones; bones keep their median lengths, and the "
    "distance of the written joints from the predicted ones is printed. The root stays where it was last seen: the model does "
    "not predict it."
)

_LOOP = "Beside the picture stand its alternative text (.txt) and its provenance (.json)."


def _options(parser: ArgumentParser, several: bool = True) -> None:
    parser.add_argument("run_folder", type=Path, metavar="RUN", help="folder of a finished training run, as train prints it")
    parser.add_argument("source", metavar="SOURCE", help="motions to continue: 'synthetic', a file or a folder")
    add_statements(parser)
    parser.add_argument("--samples", type=int, default=3, help="futures of each clip (default 3)")
    parser.add_argument("--seed", type=int, default=0, help="of the sampling (default 0)")
    if several:
        parser.add_argument("--clips", type=int, default=0, metavar="N", help="only the first N clips (default: all)")


def _predictor(args: Namespace) -> Predictor:
    if args.samples < 1:
        raise ValueError(f"samples is {args.samples}; expected at least 1")
    predictor = load_run(args.run_folder)
    if not isinstance(predictor, Predictor):
        raise ValueError(f"{args.run_folder} is a run of another system; expected one of prediction")
    return predictor


def _continuations(args: Namespace) -> tuple[Predictor, list[list[Motion]], list[str]]:
    predictor = _predictor(args)
    motions = load_motions(args.source, **statements(args))
    motions = motions[: args.clips] if args.clips else motions
    found = predicted_motions(predictor, motions, args.samples, args.seed, progress=sys.stderr.isatty())
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


def _loop(args: Namespace) -> int:
    predictor = _predictor(args)
    motions = load_motions(args.source, **statements(args))
    clips = [m for m in motions if args.clip in ("", m.name)]
    if not clips:
        raise ValueError(f"clip is {args.clip!r}; {args.source} has {', '.join(_names(motions))}")
    (clip,), cut = predictor.bodies.prepare(clips[:1]), predictor.representation
    history, end = cut.history, args.start + cut.frames
    if not 0 <= args.start <= len(clip) - cut.frames:
        raise ValueError(f"start is {args.start}; {clip.name} has {len(clip)} frames, and {cut.frames} are shown")
    truth = clip.cut(args.start, end)
    (futures,), x = predictor.predict([truth.cut(0, history)], args.samples, args.seed), truth.root_relative()
    samples = {f"sample {n}": np.concatenate([x[:history], future]) for n, future in enumerate(futures, 1)}
    alt = (
        f"Stick figures side by side, moving in a loop: {clip.name} ({clip.action}), observed in grey for "
        f"{history / clip.fps:.1f} s, then the truth in black and {args.samples} futures sampled by the model in colour."
    )
    picture = plots.loop(
        {"truth": x, **samples},
        clip.skeleton,
        fps=clip.fps,
        history=history,
        alt=alt,
        pictures_per_second=25,
        width=args.width,
        most_bytes=4_000_000,
    )
    about = {
        "run": str(args.run_folder), "data": args.source, "clip": clip.name, "start_frame": args.start, "samples": args.samples,
        "seeds": {"sampling": args.seed}, "fps": clip.fps, "mwlib": __version__, **acknowledgement(args.source),
    }  # fmt: skip
    said = json.dumps(about, indent=2, sort_keys=True)
    content = picture.encoded(args.out.suffix)
    write_together({args.out: content, args.out.with_suffix(".txt"): f"{alt}\n", args.out.with_suffix(".json"): f"{said}\n"})
    print(f"{args.out}: {len(picture)} pictures of {picture.size[0]} x {picture.size[1]} pixels, {len(content)} bytes")
    return 0
