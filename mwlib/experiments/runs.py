"""Training runs: a folder each, found again by the hash of its settings and the fingerprint of its data."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Literal

from accelerate.state import PartialState
from accelerate.utils import broadcast_object_list
from tqdm import tqdm

from mwlib.experiments.origins import machine, models_used
from mwlib.experiments.store import locked, read_result, runs_folder, write_result
from mwlib.experiments.systems import Data, read_config, system_of
from mwlib.files import sweep, write_atomic
from mwlib.hashing import digest, file_hash, package_hash
from mwlib.paths import CONFIG, run_folder, shipped
from mwlib.settings import Settings
from mwlib.training import MODEL, TrainingStep, read_model, read_outcome, train
from mwlib.version import __version__

PATIENCE = 60.0  # seconds after which waiting processes tell each other that they still wait, lest their connection expires


def run_path(cfg: Settings, data: Data) -> Path:
    """Folder of the training run with this configuration, these data, these models behind it and this version of mwlib."""
    key = digest([cfg.training_hash(), __version__, *models_behind(cfg, "built_on")])
    return runs_folder() / f"{key}-{data.fingerprints()[0]}"


def models_behind(cfg: Settings, role: Literal["built_on", "judged_by"]) -> list[str]:
    """SHA-256 of the other trained models that a training is built on, or that its results are judged by; see `System`."""
    names = getattr(system_of(cfg), role, lambda _: [])(cfg)
    files = [Path(name) if Path(name).is_file() else (run_folder(name) or Path(name)) / MODEL for name in names]
    return [file_hash(file) for file in files if file.exists()]


def get_run(cfg: Settings, data: Data | None = None, progress: bool = False) -> Path:
    """Folder of the finished training run with this configuration and data, trained once if missing.

    Two processes that ask for the same run train it once: the second waits. A run that was killed goes on from its
    last checkpoint.

    Args:
        cfg: configuration of any system; settings that no model depends on do not matter.
        data: what the system's `load_data` gives, if already loaded.
        progress: show a bar on stderr.
    """
    data = data or system_of(cfg).load_data(cfg)
    folder = run_path(cfg, data)
    said = _agreed(_state(cfg, folder, mine=False))
    while said == "wait":
        # of the processes that `accelerate launch` started, the first holds the lock for all, and tells them what it found
        with locked(folder / ".lock", PATIENCE) if _rank() == 0 else nullcontext(True) as mine:
            said = _agreed(_state(cfg, folder, mine))
            if said == "train":
                _train_to_end(cfg, data, folder, progress)
                _agreed("done")  # nobody goes on before the result is written
    return folder


def _state(cfg: Settings, folder: Path, mine: bool) -> str:
    """ "done", or what there is to do: "train" for the holder of the lock, "wait" for others."""
    done = read_result(folder, cfg.training_hash()) is not None
    return "done" if done else "train" if mine else "wait"


def _agreed(said: str) -> str:
    """What the first of several processes says; alone, what this one says."""
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        return said
    PartialState()  # joins the processes
    words = [said]
    broadcast_object_list(words)
    return words[0]


def train_run(cfg: Settings, data: Data, folder: Path) -> Iterator[TrainingStep]:
    """Train into a folder, yielding every step; goes on where an earlier call was stopped.

    Args:
        cfg: configuration of any system.
        data: what the system's `load_data` gives.
        folder: for checkpoint, model, curves and configuration.

    Raises:
        ValueError: the folder holds a run with other settings.
    """
    system, settings = system_of(cfg), cfg.get_group("training")
    if not (folder / CONFIG).exists():
        write_atomic(folder / CONFIG, cfg.to_yaml())
    yield from train(lambda learnt: system.make_objective(cfg, data, learnt), settings, folder, cfg.training_hash())


def _train_to_end(cfg: Settings, data: Data, folder: Path, progress: bool) -> None:
    hidden = not progress or _rank() > 0
    if _rank() == 0:
        sweep(folder)
    with tqdm(total=cfg.get("train_steps"), desc="training", disable=hidden, file=sys.stderr) as bar:
        for last in train_run(cfg, data, folder):
            bar.update(last.step - bar.n)
            if last.step % 20 == 0:
                bar.set_postfix(loss=f"{last.loss:.4f}", lr=f"{last.lr:.2e}")
    if _rank() == 0:
        depends = {"settings": cfg.training_hash(), "data": data.fingerprints()[0], "mwlib": package_hash()}
        model = {"model": file_hash(folder / MODEL)}
        outcome = read_outcome(folder) | {"machine": machine()}
        write_result(folder, outcome, cfg.training_hash(), depends | model)


def get_model(cfg: Settings, data: Data | None = None, progress: bool = False) -> Any:
    """The trained model of a configuration, trained once if missing; it samples as `cfg` says.

    Configurations that differ in sampling only share a run, and the run's own file knows the one that trained it.

    Args:
        cfg, data, progress: as in `get_run`.
    """
    return _opened(cfg, get_run(cfg, data, progress))


def load_run(folder: str | Path) -> Any:
    """The trained model of a run folder, of whichever system, on the CPU (``.to(device)`` moves it).

    Args:
        folder: of a run; or "synthetic" or "cmu", the models that come with the package. A folder of that name comes first.

    Raises:
        FileNotFoundError: the folder holds no finished model; the message names the missing file.
        ValueError: the run was made by a version before 0.2, or its configuration is not valid.

    >>> history = mw.windows(mw.load_motions("synthetic", fps=50)[:2], history=25, future=100, stride=100).x_history
    >>> mw.load_run("synthetic").predict(history[:1], samples=2).shape
    torch.Size([1, 2, 100, 48])
    """
    found = run_folder(folder)
    if found is None:
        known = f"; models that come with mwlib: {', '.join(shipped())}"
        raise FileNotFoundError(f"{Path(folder) / CONFIG} is missing: no training run in this folder{known}")
    return _opened(read_config(found / CONFIG), found)


def _opened(cfg: Settings, folder: Path) -> Any:
    parts = read_model(folder)
    models_used[folder.name] = file_hash(folder / MODEL)
    return system_of(cfg).open_model(cfg, *parts)


def _rank() -> int:
    """This process's number among those of one training."""
    return int(os.environ.get("RANK", "0"))
