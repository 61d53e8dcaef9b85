"""Trained networks by name: those that come with the package, those of a run's folder, and the published evaluator."""

from __future__ import annotations

from pathlib import Path

from mwlib.data.formats.humanml import FeatureLayout
from mwlib.material import CONFIG, run_folder
from mwlib.text_to_motion.matching import Matcher
from mwlib.text_to_motion.matching_config import Config
from mwlib.text_to_motion.published import open_published, published_files
from mwlib.training import read_model

ADVICE = (
    "train one on your data with `mwlib train --system matching --set data=FOLDER` and name its folder, or name one with "
    "the files of the published evaluator"
)


def open_matcher(name: str, layout: FeatureLayout) -> Matcher:
    """A trained matching network, frozen, on the CPU.

    Args:
        name: folder of a finished run of "matching"; or one with the files of the published evaluator, see `open_published`; or
            "evaluator" or "critic", which come with the package and know the sentences and bodies of the synthetic people, or
            "cmu_evaluator" or "cmu_critic" for the CMU clips. A folder of that name comes first.
        layout: of the features that it is to judge.

    Raises:
        FileNotFoundError: there is no such model; the message says how to train one, or which published files are missing.
        MotionFormatError: a published file is malformed.
        ValueError: it judges other features, or is a run of another system.
    """
    if published_files(Path(name)):
        matcher = open_published(Path(name))
    else:
        folder = finished_run(name, ADVICE)
        matcher = Matcher.from_tensors(Config.from_yaml(folder / CONFIG), *read_model(folder))
    if matcher.statistics.layout != layout:
        raise ValueError(f"{name} judges {matcher.statistics.layout.name}; expected {layout.name}, as the clips have it")
    return matcher


def stands_on(name: str) -> list[str]:
    """What a judge's scores depend on: the files of the published evaluator, else the judge itself by its name."""
    return [str(file) for file in published_files(Path(name)).values()] or [name]


def finished_run(name: str, advice: str) -> Path:
    """The folder of a run, or of the model that comes with the package under this name.

    Args:
        name: of either.
        advice: what to do if there is neither.

    Raises:
        FileNotFoundError: there is neither.
    """
    folder = run_folder(name)
    if folder is None:
        raise FileNotFoundError(f"{name}/{CONFIG} is missing: no finished run there; {advice}")
    return folder
