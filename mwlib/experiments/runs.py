"""Runs and their results: trained or measured once, and found again by settings, data and the code behind them."""

import json
import logging
import os
import platform
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch
from accelerate.state import PartialState
from accelerate.utils import broadcast_object_list, parse_flag_from_env
from tqdm import tqdm

from mwlib.data.doubts import some
from mwlib.experiments import results
from mwlib.experiments.grids import Data, code_of, read_config, system_of
from mwlib.files import sweep, write_atomic, write_json, write_together
from mwlib.hashing import digest, file_hash
from mwlib.paths import CONFIG, run_folder, shipped
from mwlib.settings import Settings, near, of_kind, shown
from mwlib.training import CHECKPOINT, CURVES, MODEL, TrainingStep, read_model, read_outcome, train
from mwlib.training.checkpoint import NOT_BY_EDITING, changes, check_trained, flat, read_curves

CODE = "code.json"  # in a run's folder: hashes of the modules that its training began with
PATIENCE = 60.0  # seconds after which waiting processes tell each other that they still wait, lest their connection expires
MOST_NAMES = 5  # modules that a message names

log = logging.getLogger(__name__)


class Run:
    """A configuration on its data: where its training and its result are kept, and what they depend on.

    Names of folder and file hold hashes of settings, data, other trained models that stand behind them, and code: every module
    that the system imports. So nothing is found again that today's code would not make.

    Args:
        cfg: configuration of any system.
        data: what the system's `load_data` gives, if already loaded.

    Attributes:
        folder: of the training.
        file: of the result.
        code: hash of each module behind the system, see `code_behind`.
    """

    def __init__(self, cfg: Settings, data: Data | None = None) -> None:
        self.cfg, self.system, self.key = cfg, system_of(cfg), cfg.training_hash()
        self.data = self.system.load_data(cfg) if data is None else data
        if not hasattr(self.data, "fingerprints"):
            raise ValueError(f"data is {shown(data)}; expected what the system's load_data gives, or None")
        self.code = code_of(self.system)
        self.training, self.test = self.data.fingerprints()
        built_on, judged_by = (_models(getattr(self.system, role, lambda _: [])(cfg)) for role in ("built_on", "judged_by"))
        code, others = digest(self.code), [digest(built_on + judged_by)] if built_on + judged_by else []
        self.folder = results.runs_folder() / f"{digest([self.key, *built_on])}-{self.training}-{code}"
        self.file = results.runs_folder() / "results" / f"{'-'.join([cfg.hash(), self.training, self.test, *others, code])}.json"

    def changed(self, depends: Mapping[str, Any]) -> list[str]:
        """The modules that are others today than when something was made that says what it depends on."""
        before = depends.get("code", self.code)
        others = {name for name in before | self.code if before.get(name) != self.code.get(name)}
        return sorted(others | {*depends.get("older_code", ())})

    def train(self, progress: bool = False) -> Path:
        """The folder of the finished training; what is missing of it is done.

        Of the processes that ``accelerate launch`` started the first holds the lock for all, and tells them what it found.
        """
        if self._state(mine=False) != "done" and not (self.folder / CHECKPOINT).exists():
            self.folder = self._place(self.folder, "training")
        self.folder = Path(_agreed(str(self.folder)))
        said = _agreed(self._state(mine=False))
        while said == "wait":
            with results.locked(self.folder / ".lock", PATIENCE) if _rank() == 0 else nullcontext(True) as mine:
                said = _agreed(self._state(mine))
                if said == "train":
                    self._train_to_end(progress)
                    _agreed("done")  # nobody goes on before the result is written
        depends = results.result_of(self.folder)["depends"]
        if _rank() == 0 and not (self.folder / CONFIG).exists():  # a run says what it is, in the words of whoever trained it
            write_atomic(self.folder / CONFIG, self.cfg.override(**depends.get("sampling", {})).to_yaml())
        results.older_code.update(self.changed(depends))
        return self.folder

    def _state(self, mine: bool) -> str:
        """ "done", or what there is to do: "train" for the holder of the lock, "wait" for others."""
        done = results.read_result(self.folder, self.key) is not None and not self._lost()
        return "done" if done else "train" if mine else "wait"

    def _lost(self) -> str:
        """What of a finished training is missing or not as its result says; curves only where a checkpoint has them."""
        model = results.result_of(self.folder)["depends"].get("model")
        if model and (not (self.folder / MODEL).exists() or file_hash(self.folder / MODEL) != model):
            return MODEL
        return CURVES if model and (self.folder / CHECKPOINT).exists() and read_curves(self.folder) is None else ""

    def _place(self, own: Path, doing: str) -> Path:
        """Its own place for something that is missing there; or, if that is wanted, the newest that other code left.

        If there is such a one, a sentence on stderr says which modules are others now.
        """
        same = own.parent.glob(own.name.replace(digest(self.code), "????????"))
        others = {place: made for place in same if place != own and (made := _made_with(place))}
        if not others:
            return own
        newest = max(others, key=lambda place: place.stat().st_mtime)
        told = some(self.changed(others[newest]), MOST_NAMES)
        if results.accepts_older_code():
            log.warning("%s is taken although the code has changed since: %s", newest.name, told)
            return newest
        log.warning(
            "%s anew, as the code has changed since %s was made: %s (--accept-older-code takes it)", doing, newest.name, told
        )
        return own

    def _train_to_end(self, progress: bool) -> None:
        hidden = not progress or _rank() > 0
        if _rank() == 0:
            sweep(self.folder)
            if results.result_of(self.folder) and (lost := self._lost()):
                way = f"from {CHECKPOINT}" if (self.folder / CHECKPOINT).exists() else "by another training"
                log.warning("%s is missing or not as it was written: made again %s", self.folder / lost, way)
        with tqdm(total=self.cfg.get("train_steps"), desc="training", disable=hidden, file=sys.stderr) as bar:
            for last in train_run(self.cfg, self.data, self.folder):
                bar.update(last.step - bar.n)
                if last.step % 20 == 0:
                    bar.set_postfix(loss=f"{last.loss:.4f}", lr=f"{last.lr:.2e}")
        if _rank() == 0:
            depends: dict[str, Any] = {"settings": self.key, "data": self.training, "model": file_hash(self.folder / MODEL)}
            depends |= {"sampling": read_config(self.folder / CONFIG).sampled(), "code": results.read_tree(self.folder / CODE)}
            if changed := self.changed(depends):
                depends["older_code"] = changed
            results.write_result(self.folder, read_outcome(self.folder) | {"machine": machine()}, self.key, depends)

    def model(self, progress: bool = False) -> Any:
        """The trained model; it samples as the configuration says."""
        return _opened(self.cfg, self.train(progress))

    def result(self, file: Path) -> dict[str, Any] | None:
        """What a file says, if it is a result that may be taken: made by today's code, or older code is accepted."""
        found = results.read_tree(file, mean=dict)
        depends = found.get("depends", {})
        changed = self.changed(depends)
        if not found or changed and not results.accepts_older_code():
            return None
        if changed:
            depends["older_code"] = changed
        results.models_used.update(depends.get("models", {}))
        results.older_code.update(changed)
        return found

    def measure(self, progress: bool = False) -> dict[str, Any]:
        """The result, made now and written to its file."""
        depends = {"settings": self.cfg.hash(), "data": [self.training, self.test], "code": self.code, "models": {}}
        found: dict[str, Any] = {"training": None}
        started = time.monotonic()

        def model() -> Any:
            """The trained model, on the device of the measurement; the clock starts anew."""
            nonlocal started
            opened = self.model(progress)
            of_run = results.result_of(self.folder)
            found["training"], depends["models"] = of_run["metrics"], {self.folder.name: of_run["depends"]["model"]}
            if changed := self.changed(of_run["depends"]):
                depends["older_code"] = changed
            started = time.monotonic()
            return opened.to("cuda" if torch.cuda.is_available() else "cpu")

        measured = self.system.evaluate(self.cfg, model, self.data, progress)
        seconds = round(time.monotonic() - started, 1)
        found = {**measured, "seconds": seconds, **found, "machine": machine(), "depends": depends}
        write_json(self.file, found)
        return json.loads(json.dumps(found))


def get_run(cfg: Settings, data: Data | None = None, progress: bool = False) -> Path:
    """Folder of the finished training run with this configuration and data, trained once if missing.

    Two processes that ask for the same run train it once: the second waits. A run that was killed goes on from its
    last checkpoint.

    Args:
        cfg: configuration of any system; settings that no model depends on do not matter.
        data: what the system's `load_data` gives, if already loaded.
        progress: show a bar on stderr.
    """
    return Run(cfg, data).train(progress)


def get_model(cfg: Settings, data: Data | None = None, progress: bool = False) -> Any:
    """The trained model of a configuration, trained once if missing; it samples as `cfg` says.

    Configurations that differ in sampling only share a run, and the run's own file knows the one that trained it.

    Args:
        cfg, data, progress: as in `get_run`.
    """
    return Run(cfg, data).model(progress)


def get_result(cfg: Settings, data: Data | None = None, progress: bool = False) -> dict[str, Any]:
    """Metrics of one configuration: its model is trained if missing, its test data are scored if missing.

    Seeds are part of the configuration (`seed` of the training, `sampling_seed`). Two processes that ask for the same
    result compute it once. A GPU is used where there is one. What the code gave before it changed is measured again, unless
    `accepts_older_code`.

    Args:
        cfg: configuration of any system.
        data: what the system's `load_data` gives, if already loaded.
        progress: show bars on stderr.

    Returns:
        What the system's `evaluate` gives: "mean" and "standard_error" by metric, "windows", and more; "seconds" of the
        sampling; "training" with loss and seconds of the run, None where no model was needed; "depends", hashes of settings,
        data, each module of the code and (by the name of its run) the model, and under "older_code" the modules that are others
        now. A file that is no result is measured again.
    """
    run = Run(cfg, data)
    found = run.result(run.file) or run.result(run._place(run.file, "measuring"))
    if found is None:
        with results.locked(run.file.with_suffix(".lock")):
            found = run.result(run.file) or run.measure(progress)
    return found


def train_run(cfg: Settings, data: Data, folder: Path) -> Iterator[TrainingStep]:
    """Train into a folder, yielding every step; goes on where an earlier call was stopped.

    Args:
        cfg: configuration of any system.
        data: what the system's `load_data` gives.
        folder: for checkpoint, model, curves and configuration.

    Raises:
        ValueError: the folder holds a run with other settings, or its config.yaml is damaged; the message has the remedy.
    """
    system, settings, about = system_of(cfg), cfg.get_group("training"), {"settings": json.dumps(cfg.trained())}
    if (folder / CONFIG).exists():
        _check_begun(cfg, folder / CONFIG)
    elif _rank() == 0:
        write_together({folder / CODE: json.dumps(code_of(system), indent=1), folder / CONFIG: cfg.to_yaml()})
    yield from train(lambda learnt: system.make_objective(cfg, data, learnt), settings, folder, cfg.training_hash(), about)


def _check_begun(cfg: Settings, file: Path) -> None:
    """Refuse a run's configuration that is not the one to go on with."""
    try:
        found = read_config(file)
    except ValueError as error:
        raise ValueError(f"{error}. Delete {file.name}: going on with the run writes it again") from None
    if found.training_hash() != cfg.training_hash():
        others = changes(flat(cfg.trained()), flat(found.trained()))
        raise ValueError(
            f"{file} belongs to a run with other settings: {others}: use another folder; if the file was edited, delete it"
        )


def load_run(folder: str | Path) -> Any:
    """The trained model of a run folder, of whichever system, on the CPU (``.to(device)`` moves it).

    Args:
        folder: of a run; or "synthetic" or "cmu", the models that come with the package. A folder of that name comes first.

    Raises:
        FileNotFoundError: the folder holds no finished model; the message names the missing file.
        ValueError: the run was made by a version before 0.2, its configuration lacks a setting, is not valid, or is not the one
            that trained the model, or its settings of sampling are not those that the result knows.

    >>> history = mw.windows(mw.load_motions("synthetic", fps=50)[:2], history=25, future=100, stride=100).x_history
    >>> mw.load_run("synthetic").predict(history[:1], samples=2).shape
    torch.Size([1, 2, 100, 48])
    """
    of_kind("folder", folder, (str, Path), f"the folder of a run or one of {', '.join(shipped())}")
    found = run_folder(folder)
    if found is None:
        known = f"; models that come with mwlib: {', '.join(shipped())}{near(folder, shipped())}"
        raise FileNotFoundError(f"{Path(folder) / CONFIG} is missing: no training run in this folder{known}")
    cfg = read_config(found / CONFIG)
    model = _opened(cfg, found)
    _check_sampling(cfg, found)
    return model


def _check_sampling(cfg: Settings, folder: Path) -> None:
    """Refuse settings of sampling that are not those of the finished run, where its result has them."""
    result, now = results.read_tree(folder / results.RESULT), cfg.sampled()
    before = result.get("depends", {}).get("sampling", {})  # of another version, perhaps, which had other settings
    if others := changes({name: before.get(name, value) for name, value in now.items()}, now):
        raise ValueError(f"{folder / CONFIG} was edited: {others}. {NOT_BY_EDITING}")
    if (key := result.get("about", {}).get("settings", cfg.hash())) != cfg.hash():  # of a model that comes with the package
        raise ValueError(
            f"{folder / CONFIG} was edited: the hash of its settings is {cfg.hash()}; expected {key}. {NOT_BY_EDITING}"
        )


def _opened(cfg: Settings, folder: Path) -> Any:
    parts = read_model(folder)
    check_trained(cfg, parts[2], folder / CONFIG)
    results.models_used[folder.name] = file_hash(folder / MODEL)
    return system_of(cfg).open_model(cfg, *parts)


def _models(names: Sequence[str]) -> list[str]:
    """SHA-256 of other trained models, named as `System` says; of those that are there."""
    files = [Path(name) if Path(name).is_file() else (run_folder(name) or Path(name)) / MODEL for name in names]
    return [file_hash(file) for file in files if file.exists()]


def _made_with(place: Path) -> dict[str, Any] | None:
    """What a result, or a run that is finished or was stopped, depends on; None of what is neither."""
    if place.suffix == ".json":
        return results.read_tree(place, mean=dict, depends=dict).get("depends")
    begun = {"code": results.read_tree(place / CODE)} if (place / CHECKPOINT).exists() and (place / CODE).exists() else None
    return results.result_of(place).get("depends", begun)


def machine() -> dict[str, str]:
    """What numbers are computed on: processor or graphics card, and torch's version."""
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else f"{platform.machine()} CPU"
    return {"device": device, "torch": torch.__version__.split("+")[0]}


def _agreed(said: str) -> str:
    """What the first of several processes says; alone, what this one says."""
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        return said
    PartialState(cpu=parse_flag_from_env("ACCELERATE_USE_CPU") or not torch.cuda.is_available())  # joins them; else each is alone
    words = [said]
    broadcast_object_list(words)
    return words[0]


def _rank() -> int:
    """This process's number among those of one training."""
    return int(os.environ.get("RANK", "0"))
