"""Data of the site's live pages: exported networks, observed windows, wavelet filters, schedules, empty players."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pywt

from mwlib.body.motion import Motion
from mwlib.body.skeleton import HUMANML22
from mwlib.data.collections import acknowledgement
from mwlib.data.load import load_motions
from mwlib.diffusion.process import SCHEDULES, alpha_bar
from mwlib.experiments.exported import export_onnx, of_skeleton
from mwlib.experiments.runs import load_run
from mwlib.files import write_atomic
from mwlib.inbetweening.bridge import Bridge
from mwlib.plots.bodies import camera
from mwlib.plots.playing import MILLIMETRE, player
from mwlib.prediction.predictor import Predictor
from mwlib.synthetic.acts import captioned_positions

NETWORKS = ("synthetic", "cmu", "sentences", "inbetween")
WAVELETS = ("haar", "db2", "db4", "db8", "sym5", "coif2", "bior2.2", "bior2.8", "bior6.8", "rbio2.8")
STEPS = 1000  # of the schedules: the paper's
SYNTHETIC = {  # clip of a test person -> first frame
    "P7_walk": 60, "P8_turn": 80, "P7_stop_and_go": 90, "P8_run": 40, "P7_sit": 30, "P8_jump": 50, "P7_kick": 40, "P8_wave": 60,
}  # fmt: skip
CMU = {"07_05": 20, "02_01": 5, "29_01": 200, "02_04": 30, "02_05": 150, "02_10": 300, "29_03": 400}

KEYED = {  # clip of a test person -> its frames at the rate of in-betweening
    "P7_walk": (0, 150), "P7_turn": (0, 180), "P8_sit": (0, 180), "P8_jump": (0, 150), "P7_kick": (0, 150),
    "P8_pick_up": (0, 150),
}  # fmt: skip
KEYED_CMU = {"07_05": (0, 90), "02_03": (0, 60), "02_04": (0, 120), "02_05": (0, 150)}


def write_networks(folder: Path) -> None:
    """Write the shipped networks as the browser fetches them: NAME.onnx.gz, and NAME.json.gz beside it.

    Raises:
        ImportError: as `export_onnx`.
    """
    with TemporaryDirectory() as place:
        for name in NETWORKS:
            for file in export_onnx(load_run(name), Path(place) / f"{name}.onnx"):
                write_atomic(folder / f"{file.name}.gz", gzip.compress(file.read_bytes(), 9, mtime=0))


def write_data(folder: Path, root: Path) -> None:
    """Write the JSON files that are bundled with the pages' scripts.

    Args:
        folder: gets people.json, clips.json, filters.json, schedules.json, players.json.
        root: a checkout, with docs/live/cmu.json: windows of real people, as `observed_windows` made them, and clips of them, as
            `placed_clips` did.
    """
    synthetic = observed_windows("synthetic", load_motions("synthetic"), SYNTHETIC)
    real = json.loads((root / "docs" / "live" / "cmu.json").read_text(encoding="utf-8"))
    bodies = keyed().space.bodies
    clips = {
        "fps": bodies.fps, "body": {"skeleton": of_skeleton(bodies.skeleton)}, "acknowledgement": real["acknowledgement"],
        "clips": placed_clips(load_motions("synthetic"), KEYED) + real.pop("clips"),
    }  # fmt: skip
    people = [{**one, "temperature": load_run(one["model"]).sampling.temperature} for one in (synthetic, real)]
    found = {
        "people": people, "clips": clips, "filters": filters(), "schedules": schedules(), "players": empty_players(),
    }  # fmt: skip
    for name, content in found.items():
        write_atomic(folder / f"{name}.json", json.dumps(content, separators=(",", ":")))


def observed_windows(run: str, motions: Sequence[Motion], starts: Mapping[str, int]) -> dict[str, Any]:
    """Windows of clips as a model of prediction sees them, with their truth, in whole millimetres.

    Args:
        run: the model's name.
        motions: clips, among them the wanted ones.
        starts: name of a clip -> first observed frame at the model's rate.

    Raises:
        KeyError: a clip is missing.
        ValueError: a clip ends before its window.
    """
    model, named = load_run(run), {motion.name: motion for motion in motions}
    assert isinstance(model, Predictor)
    frames, windows = model.representation.frames, []
    for name, start in starts.items():
        (motion,) = model.bodies.prepare([named[name]])
        if start + frames > len(motion):
            raise ValueError(f"{name} has {len(motion)} frames; expected at least {start + frames} for its window")
        part = motion.cut(start, start + frames)
        azimuth = camera(part.positions[model.representation.history - 1], part.skeleton)
        windows.append({"azimuth": azimuth, **_written(part, part.root_relative())})
    said = " ".join(acknowledgement(model.cfg.data.data).values())
    return {"model": run, "acknowledgement": said, "history": model.representation.history, "windows": windows}


def keyed() -> Bridge:
    """The shipped model of in-betweening."""
    model = load_run("inbetween")
    assert isinstance(model, Bridge)
    return model


def placed_clips(motions: Sequence[Motion], parts: Mapping[str, tuple[int, int]]) -> list[dict[str, str]]:
    """Parts of clips as the shipped model of in-betweening sees them, places of all joints in whole millimetres.

    Args:
        motions: clips, among them the wanted ones.
        parts: name of a clip -> its first frame and the one behind the last, at the model's rate.

    Raises:
        KeyError: a clip is missing.
    """
    bodies, named, found = keyed().space.bodies, {motion.name: motion for motion in motions}, []
    for name, (first, end) in parts.items():
        (motion,) = bodies.prepare([named[name]])
        part = motion.cut(first, end)
        found.append(_written(part, part.positions))
    return found


def _written(motion: Motion, places: np.ndarray) -> dict[str, str]:
    """A motion's name and action, and places in whole millimetres."""
    x = np.round(places / MILLIMETRE).astype("<i2")
    return {"clip": motion.name, "action": motion.action, "data": base64.b64encode(x.tobytes()).decode()}


def filters() -> dict[str, dict[str, list[float]]]:
    """Filters of PyWavelets by the wavelet's name."""
    kinds = ("dec_lo", "dec_hi", "rec_lo", "rec_hi")
    return {name: {kind: list(getattr(pywt.Wavelet(name), kind)) for kind in kinds} for name in WAVELETS}


def schedules() -> dict[str, list[float]]:
    """alpha_bar of every schedule, to six significant digits."""
    return {kind: [float(f"{a:.6g}") for a in alpha_bar(kind, STEPS).tolist()] for kind in SCHEDULES}


def empty_players() -> dict[str, Any]:
    """Payloads of players with one body of either skeleton, without its positions."""
    (acted,) = captioned_positions(clips=1)
    people = {"prediction": load_motions("synthetic")[0], "sentences": Motion(acted.positions, 20.0, HUMANML22, up="y")}
    found = {name: player(motion, layout="overlay", height=440).payload for name, motion in people.items()}
    for payload in found.values():
        del payload["bodies"][0]["data"]
    return found
