"""Commands that sample: predict, export-bvh, export-onnx, loop, inbetween, generate."""

import io
import json
import re
import sys
import warnings
from collections.abc import Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any, Literal

import numpy as np
from tqdm import tqdm

from mwlib import plots
from mwlib.body.fitting import FitError
from mwlib.body.motion import Motion
from mwlib.cli.options import expect_ending
from mwlib.data import load_motions
from mwlib.data.collections import acknowledgement
from mwlib.data.doubts import some
from mwlib.data.formats.bvh import write_bvh
from mwlib.data.formats.glb_writing import write_glb
from mwlib.experiments import exported, sampling
from mwlib.experiments.results import of_older_code, rendered
from mwlib.files import write_atomic, write_together
from mwlib.networks.text import words_of
from mwlib.plots.loops import FILM, FORMATS
from mwlib.prediction.predictor import Predictor, predicted_motions
from mwlib.settings import whole
from mwlib.synthetic.sentences import RECIPES, examples
from mwlib.synthetic.sentences_typed import PERSONS, SYNONYMS
from mwlib.text_to_motion.model import TextToMotion
from mwlib.training import TrainedModel
from mwlib.version import __version__

# Entries of a file of futures, and arguments of NumPy that writes it: no clip can be called so.
RESERVED = "joints", "parents", "fps", "up", "history", "file", "allow_pickle"


def predict(*, out: Path = Path("predictions.npz"), **continued: Any) -> None:
    """Continue motions: sampled futures of each clip's last frames, as one .npz file.

    The file holds, by the clip's name, positions (samples, frames, joints, 3) in metres, observed frames first; joints, parents,
    fps, up and history say how to read them. They are of the model's body; export-bvh writes futures on the files' own skeletons.

    Args:
        out: the file.
    """
    expect_ending("out", out, ".npz")
    predictor, found = _continued(False, **continued)
    bodies, skeleton, buffer = predictor.bodies, predictor.bodies.skeleton, io.BytesIO()
    about: dict[str, Any] = {"joints": skeleton.joints, "parents": skeleton.parents, "fps": bodies.fps, "up": bodies.up}
    about["history"] = predictor.representation.history
    arrays = {name: np.stack([motion.positions for motion in row]) for name, row in found.items()}
    np.savez_compressed(buffer, allow_pickle=False, **about, **arrays)
    write_atomic(out, buffer.getvalue())
    row = next(iter(found.values()))
    print(f"{out}: {len(row)} futures of {len(found)} clips, {row[0].duration:.2f} s each")


def export_bvh(*, format: Literal["bvh", "glb"] = "bvh", out: Path = Path("build/bvh"), **continued: Any) -> None:
    """Write a run's predictions as BVH or GLB files, to be opened in Blender.

    One file per clip and sample: the observed frames, then the predicted ones. A clip that was read with rotations goes on with
    its own skeleton, channels, rate and unit; joints that the model does not know, like fingers, stay as they were last seen.
    One of positions gets bones of median lengths, and the distance of the written joints from the predicted ones is printed.
    The root stays where it was last seen: the model does not predict it.

    Args:
        format: of the files: bvh, or glb, which has a plain body around the skeleton, for viewers.
        out: folder.
    """
    _, found = _continued(True, **continued)
    files = {out / f"{name}_sample{i}.{format}": motion for name, row in found.items() for i, motion in enumerate(row, 1)}
    shown = tqdm(files.items(), "writing", disable=not sys.stderr.isatty())
    errors = [(away.mean, away.max) for file, motion in shown if (away := _written(motion, file))]
    if own := len(files) - len(errors):
        print(f"{out}: {own} files with the skeleton and rate of their clips")
    if errors:
        means, most = 1000 * np.transpose(errors)
        away = f"{means.mean():.1f} mm from the predicted ones, {most.max():.0f} mm at most"
        print(f"{out}: {len(errors)} files; joints are {away}")


def export_onnx(run: str, *, out: Path | None = None) -> None:
    """Write a trained network as an ONNX file, for other programs and for the browser.

    Beside it stands a JSON file with what its sampling needs besides: the noise schedule, the transform as matrices, scales or
    statistics, the skeleton, and the words. docs/howto/onnx.md says how they go together. Needs the packages onnx and onnxscript.

    Args:
        run: folder of a finished run, or the name of a model that comes with the package.
        out: the file (default: build/onnx/NAME.onnx).
    """
    model = sampling.model_of(run, TrainedModel, "prediction, inbetweening or text_to_motion")
    network, about = exported.export_onnx(model, out or Path("build/onnx") / f"{Path(run).name}.onnx")
    print(f"{network}: {network.stat().st_size} bytes, beside it {about.name}")


def loop(
    run: Path,
    source: str,
    *,
    samples: int = 3,
    seed: int = 0,
    clip: str = "",
    start: int = 0,
    width: int = 900,
    out: Path = Path("loop.webp"),
    **meaning: Any,
) -> None:
    """Write a looping picture of a clip: the truth, and sampled futures beside it.

    Beside the picture stand its alternative text (.txt) and its provenance (.json).

    Args:
        run: folder of a finished training run, as train prints it.
        source: motions to continue: 'synthetic', a file or a folder.
        samples: futures of each clip.
        seed: of the sampling.
        clip: which clip (default: the first).
        start: first observed frame, at the model's rate.
        width: pixels.
        out: .webp, .gif, .png, or .mp4 where ffmpeg is installed.
    """
    whole("width", width, 16, 10_000)
    expect_ending("out", out, *FORMATS, FILM)
    predictor, motions = sampling.model_of(run, Predictor, "prediction"), load_motions(source, **meaning)
    named = [motion for motion in motions if clip in ("", motion.name)]
    if not named:
        raise ValueError(f"clip is {clip!r}; {source} has {', '.join(_names(motions))}")
    (shown,), frames = predictor.bodies.prepare(named[:1]), predictor.representation.frames
    if not 0 <= start <= len(shown) - frames:
        raise ValueError(f"start is {start}; {shown.name} has {len(shown)} frames, and {frames} are shown")
    truth, history = shown.cut(start, start + frames), predictor.representation.history
    (futures,), x = predictor.predict([truth.cut(0, history)], samples, seed), truth.root_relative()
    bodies = {f"sample {n}": np.concatenate([x[:history], future]) for n, future in enumerate(futures, 1)}
    alt = (
        f"Stick figures side by side, moving in a loop: {shown.name} ({shown.action}), observed in grey for "
        f"{history / shown.fps:.1f} s, then the truth in black and {samples} futures sampled by the model in colour."
    )
    picture = plots.loop(
        {"truth": x, **bodies}, shown.skeleton, fps=shown.fps, history=history, alt=alt, pictures_per_second=25, width=width,
        most_bytes=4_000_000,
    )  # fmt: skip
    about = {
        "run": str(run), "data": source, "clip": shown.name, "start_frame": start, "samples": samples,
        "seeds": {"sampling": seed}, "fps": shown.fps, "mwlib": __version__, **of_older_code(), **acknowledgement(source),
    }  # fmt: skip
    content, said = picture.encoded(out.suffix.lower()), json.dumps(about, indent=2, sort_keys=True)
    write_together({out: content, out.with_suffix(".txt"): f"{alt}\n", out.with_suffix(".json"): f"{said}\n"})
    print(f"{out}: {len(picture)} pictures of {picture.size[0]} x {picture.size[1]} pixels, {len(content)} bytes")


def inbetween(
    start: str,
    end: str | None = None,
    *,
    keyframes: Sequence[int] | None = None,
    between: int | None = None,
    run: str = sampling.INBETWEENING_MODEL,
    samples: int = 3,
    seed: int = 0,
    align: bool = False,
    join: bool = False,
    format: Literal["bvh", "glb"] = "bvh",
    out: Path = Path("build/bvh"),
    **meaning: Any,
) -> None:
    """Sample motions between given poses, as BVH files.

    Read one motion file, or two. Between two or more frames of the one (--keyframes), or the last frame of the first and the
    first frame of the second (--between), sample motions that meet these poses, and write each as a BVH file that Blender
    opens. Frames are counted at the model's rate. A model that was given a past also looks at those before the first pose.

    Files with rotations (BVH, AMC) come back with their own skeleton, channels, rate and unit. Their bones are turned so that
    the joints that the model knows lie as it says; others, like fingers, are interpolated between the poses, which stay as they
    were. Poses of two different bodies are refused, and poses that nobody gets to in time.

    Args:
        start: file of the motion whose frames are the keyframes, or that ends in the first.
        end: file of the motion that begins with the last keyframe.
        keyframes: frames of the one file, rising, from 0.
        between: frames between two files' poses (default: the model's own).
        run: folder of a finished run (default: the shipped model).
        samples: motions.
        seed: of their noise.
        align: turn the second file about the up-axis and move it along the floor to where the first one ends.
        join: write all frames of the files, and the motion between; else from the first pose to the last.
        format: of the files: bvh, or glb, which has a plain body around the skeleton, for viewers.
        out: folder.
    """
    if (end is None) != (keyframes is not None):
        raise ValueError("expected either one file and --keyframes, or two files")
    if align and end is None:
        raise ValueError("--align brings a second file to where the first one ends; expected two files")
    read = [_one(file, meaning) for file in (start, end) if file is not None]
    is_rigged, last = all(motion.rig for motion in read), keyframes or read[-1]
    found = sampling.inbetween(
        read[0], last, between, samples, seed, run, sys.stderr.isatty(), align=align, own_rig=is_rigged, join=join
    )
    name = _as_file(read[0].name) or "motion"
    _write({f"{name}_between_{number}": motion for number, motion in enumerate(found, 1)}, out, format)


def generate(
    texts: Sequence[str] = (),
    *,
    words: bool = False,
    seconds: float | None = None,
    samples: int = 1,
    seed: int = 0,
    run: str = sampling.SENTENCE_MODEL,
    plain: bool = False,
    attempts: int = 3,
    format: Literal["bvh", "glb"] = "bvh",
    out: Path = Path("build/bvh"),
) -> None:
    """Motions from sentences, as BVH files.

    Sample motions that do what a sentence says, and write each as a BVH file that Blender opens. The model that comes with the
    package has learnt from synthetic people: they walk, run, turn, jump, wave, kick, box, reach,
    pick up, sit, squat, bow and stand. It reads other forms of its
    words, too, such as "walk forward", and says how. Words that a model does not know are told. A sentence of which it knows no
    word is refused, and so are denials and more than two actions.

    Args:
        texts: sentences, each in quotes.
        words: list the actions and the words that the model knows, and make nothing.
        seconds: length of all motions, 2 to 6 of the shipped model (default: as people take for what each sentence says).
        samples: motions of each sentence.
        seed: of their noise.
        run: folder of a finished run (default: the shipped model).
        plain: read the joints' places alone, as the field does; the default reads their steps, too.
        attempts: at most so many for each motion, until rules see it do what its sentence says; 1 keeps what comes first.
        format: of the files: bvh, or glb, which has a plain body around the skeleton, for viewers.
        out: folder.
    """
    if bool(texts) == words:
        raise ValueError("expected either sentences or --words, which lists what the model knows")
    model = sampling.model_of(run, TextToMotion, "text_to_motion")
    if words:
        told = {"recipes": RECIPES, "examples": examples(), "forms": PERSONS | SYNONYMS, "words": model.net.text.vocabulary}
        told |= {"run": run, "data": model.cfg.data.data, "text": model.cfg.model.text}
        print(rendered("cli/known.txt.jinja", **told), end="")
        return
    found = sampling.generate(texts, seconds, samples, seed, model, sys.stderr.isatty(), not plain, attempts)
    for text, read in zip(texts, sampling.understood(model, texts), strict=True):
        if words_of(text) != words_of(read):
            print(f"{text!r} is read as {read!r}")
    stems = ("_".join(re.findall(r"[a-z0-9]+", motion.name.lower()))[:60] or "motion" for motion in found)
    _write({f"{n:02d}_{stem}": found[n - 1] for n, stem in enumerate(stems, 1)}, out, format)


def _continued(
    own_rig: bool, /, run: Path, source: str, *, samples: int = 3, seed: int = 0, clips: int = 0, **meaning: Any
) -> tuple[Predictor, dict[str, list[Motion]]]:
    """The model, and sampled continuations of each clip, by a file name, on their own rigs or not.

    Args:
        run: folder of a finished training run, as train prints it.
        source: motions to continue: 'synthetic', a file or a folder.
        samples: futures of each clip.
        seed: of the sampling.
        clips: only the first so many clips; 0 stands for all.
    """
    predictor = sampling.model_of(run, Predictor, "prediction")
    motions = load_motions(source, **meaning)[: whole("clips", clips) or None]
    needed, fps = predictor.representation.history, predictor.bodies.fps
    short = [m for m in motions if m.duration * fps < needed - 1 - 1e-6]
    if 0 < len(short) < len(motions):  # where all are, the model says so
        names = some([m.name or "a clip without a name" for m in short])
        left = f"{len(short)} of {len(motions)} clips are left out, shorter than the {needed} frames that the model continues"
        warnings.warn(f"{left}: {names}", stacklevel=2)
        motions = [m for m in motions if m.duration * fps >= needed - 1 - 1e-6]
    found = predicted_motions(predictor, motions, samples, seed, sys.stderr.isatty(), own_rig)
    return predictor, dict(zip(_names(motions), found, strict=True))


def _names(motions: list[Motion]) -> list[str]:
    """A file name for each clip, all different."""
    names, taken = [], {*RESERVED}
    for number, m in enumerate(motions, 1):
        name = _as_file(m.name) or f"clip_{number}"
        ways = chain([name], (f"{name}_{n}" for n in count(number)))
        names.append(next(way for way in ways if way not in taken))
        taken.add(names[-1])
    return names


def _as_file(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name)


def _one(path: str, meaning: Mapping[str, Any]) -> Motion:
    motions = load_motions(path, **meaning)
    if len(motions) != 1:
        raise ValueError(f"{path} holds {len(motions)} motions; expected a file with one")
    return motions[0]


def _write(motions: Mapping[str, Motion], out: Path, format: str) -> None:
    """A file for each motion."""
    for name, motion in motions.items():
        file = out / f"{name}.{format}"
        away = _written(motion, file)
        how = f"joints {1000 * away.mean:.1f} mm from the sampled ones" if away else "skeleton as it was read"
        print(f"{file}: {len(motion)} frames at {motion.fps:g} Hz; {how}")


def _written(motion: Motion, file: Path) -> FitError | None:
    """Write a motion: as BVH one with a rig in its file's unit; else get it a rig in centimetres, and say how far that is off."""
    if file.suffix == ".glb":
        away = write_glb(motion, file)
    else:
        away = write_bvh(motion, file, **({"unit": motion.rig.metres, "up": motion.up} if motion.rig else {}))
    return None if motion.rig else away
