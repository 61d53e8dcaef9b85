"""The run contract: parameters in, a folder with a result file out; a finished run is found again by its hash."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from .checkpoint import write_json
from .config import Config
from .data import load_motions
from .motion import Motion
from .predictor import Predictor
from .skeleton import H36M17, TO_H36M17
from .training import load_run, train

RESULT = "metrics.json"


class Split(NamedTuple):
    """Clips by what they may be used for; no clip is in two parts."""

    train: list[Motion]
    validation: list[Motion]
    test: list[Motion]


def runs_folder() -> Path:
    """Where training runs are kept: MWLIB_RUNS, else `runs` in the checkout around the working folder, else in it."""
    if "MWLIB_RUNS" in os.environ:
        return Path(os.environ["MWLIB_RUNS"])
    here = Path.cwd()
    home = next((p for p in (here, *here.parents) if (p / "mwlib").is_dir() and (p / "pyproject.toml").exists()), here)
    return home / "runs"


def prepare(motions: Sequence[Motion], fps: float) -> list[Motion]:
    """Clips as the models take them: `fps`, z up, on the 17-joint skeleton wherever a correspondence is known."""
    ready = [m.with_up("z").resample(fps) for m in motions]
    return [m.retarget(H36M17) if m.skeleton.name in TO_H36M17 else m for m in ready]


def split_motions(cfg: Config) -> Split:
    """Load the configured data and part it by subject, so that nobody in the test set was ever trained on.

    With no test subjects named, the last quarter of the sorted subjects is held out; if there is one subject only, the
    last quarter of the clips. Windows of one clip never end up in two parts.

    Raises:
        ValueError: a named subject does not occur, or nothing is left to train or to test on.
    """
    d = cfg.data
    motions = prepare(load_motions(d.data), d.fps)
    present = sorted({m.subject for m in motions})
    missing = {*d.train_subjects, *d.validation_subjects, *d.test_subjects} - {*present}
    if missing:
        raise ValueError(f"{d.data} has no subjects {sorted(missing)}; it has {present}")
    if not d.test_subjects and len(present) == 1:
        cut = len(motions) - max(1, len(motions) // 4)
        parts = [motions[:cut], [], motions[cut:]]
    else:
        test = d.test_subjects or present[-max(1, len(present) // 4) :]
        train_on = d.train_subjects or {*present} - {*d.validation_subjects, *test}
        parts = [[m for m in motions if m.subject in chosen] for chosen in (train_on, d.validation_subjects, test)]
    for name, part in (("training", parts[0]), ("test", parts[2])):
        if not part:
            raise ValueError(f"no {name} clips: {d.data} has {len(motions)} clips of the subjects {present}")
    return Split(*parts)


def fingerprint(motions: Sequence[Motion]) -> str:
    """Eight hex digits over subjects and positions of the clips."""
    digest = hashlib.sha256()
    for m in motions:
        digest.update(f"{m.subject}/{m.action}/{m.fps}/{m.positions.shape}".encode())
        digest.update(np.ascontiguousarray(m.positions, dtype=np.float32).tobytes())
    return digest.hexdigest()[:8]


def run_path(cfg: Config, split: Split) -> Path:
    """Folder of the training run with this configuration and data."""
    return runs_folder() / f"{cfg.training_hash()}-{fingerprint(split.train)}"


def get_run(cfg: Config, split: Split | None = None, progress: bool = False) -> Path:
    """Folder of the finished training run with this configuration and data, trained once if missing.

    Two processes that ask for the same run train it once: the second waits. A run that was killed goes on from its
    last checkpoint.

    Args:
        cfg: configuration; sampling settings do not matter.
        split: the data if already loaded.
        progress: show a bar on stderr.
    """
    split = split or split_motions(cfg)
    folder = run_path(cfg, split)
    if read_result(folder, cfg.training_hash()) is None:
        # of the processes that `accelerate launch` started, the first holds the lock for all
        with locked(folder / ".lock") if _rank() == 0 else nullcontext():
            if read_result(folder, cfg.training_hash()) is None:
                _train(cfg, split, folder, progress)
    return folder


def get_predictor(cfg: Config, split: Split | None = None, progress: bool = False) -> Predictor:
    """The trained model of a configuration, trained once if missing; it samples as `cfg` says.

    Configurations that differ in sampling only share a run, and the run's own file knows the one that trained it.

    Args:
        cfg, split, progress: as in `get_run`.
    """
    predictor = load_run(get_run(cfg, split, progress))
    predictor.cfg = cfg
    return predictor


def _train(cfg: Config, split: Split, folder: Path, progress: bool) -> None:
    started, last = time.time(), None
    hidden = not progress or _rank() > 0
    with tqdm(total=cfg.training.train_steps, desc="training", disable=hidden, file=sys.stderr) as bar:
        for last in train(cfg, split.train, folder, split.validation):
            bar.update(last.step - bar.n)
            if last.step % 20 == 0:
                bar.set_postfix(loss=f"{last.loss:.4f}", lr=f"{last.lr:.2e}")
    values = {} if last is None else {"loss": last.loss, "validation": last.validation}
    values |= {"steps": cfg.training.train_steps, "clips": len(split.train), "seconds": round(time.time() - started, 1)}
    if _rank() == 0:
        write_result(folder, values, cfg.training_hash())


def _rank() -> int:
    """This process's number among those of one training."""
    return int(os.environ.get("RANK", "0"))


def write_result(folder: Path, metrics: Mapping[str, Any], digest: str) -> Path:
    """Declare a run done: the last thing it does, atomic."""
    write_json(folder / RESULT, {"status": "ok", "hash": digest, "metrics": dict(metrics)})
    return folder / RESULT


def read_result(folder: Path, digest: str) -> dict[str, Any] | None:
    """The metrics of a finished run with this hash; None if it is missing, half-written or of other parameters."""
    try:
        result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    if not isinstance(result, dict) or result.get("status") != "ok" or result.get("hash") != digest:
        return None
    return result["metrics"]


def parameters_hash(parameters: Mapping[str, Any]) -> str:
    """Eight hex digits over a notebook's parameters; `out`, the place of the results, does not count."""
    kept = {k: v for k, v in parameters.items() if k != "out"}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()[:8]


def finish(out: str, metrics: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """Last call of every notebook: write its result file into `out`; an empty `out` writes nothing."""
    if out:
        write_result(Path(out), metrics, parameters_hash(parameters))


@contextmanager
def locked(file: Path) -> Iterator[None]:
    """One process at a time; the lock dies with its holder, however it dies."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with open(file, "w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
