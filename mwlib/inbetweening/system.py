"""FreqDiffusionBridge as the experiments see it: settings, data, what is trained, and how it is scored."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from mwlib.data.sources import Split, split_motions
from mwlib.data.windows import prepare
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.evaluation import DETAILS, METRICS, evaluate
from mwlib.inbetweening.objective import InbetweeningObjective
from mwlib.inbetweening.windows import ready

__all__ = ["DETAILS", "METRICS", "Config", "evaluate", "load_data", "make_objective", "open_model"]


def load_data(cfg: Config) -> Split:
    """Clips for training, validation and test: with their rotations, or on 17 joints where a correspondence is known.

    Raises:
        ValueError: as in `split_motions`.
    """
    return split_motions(cfg.data, ready if cfg.task.state == "rotations" else prepare)


def make_objective(cfg: Config, data: Split, learnt: Mapping[str, Tensor]) -> InbetweeningObjective:
    """What is trained."""
    return InbetweeningObjective(cfg, data, learnt)


def open_model(cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]) -> Bridge:
    """The bridge that a training left; it samples as `cfg` says."""
    return Bridge.from_tensors(cfg, weights, learnt, about)
