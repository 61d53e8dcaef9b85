"""Evaluators as the experiments see them: settings, data, training and scores."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from mwlib.data.captioned import Parts, load_clips
from mwlib.matching.config import Config
from mwlib.matching.evaluation import DETAILS, METRICS, evaluate
from mwlib.matching.evaluators import Matcher
from mwlib.matching.objective import MatchingObjective

__all__ = ["DETAILS", "METRICS", "Config", "evaluate", "load_data", "make_objective", "open_model"]


def load_data(cfg: Config) -> Parts:
    """Captioned clips for training, validation and test.

    Raises:
        ValueError: as in `load_clips`.
    """
    return load_clips(cfg.data)


def make_objective(cfg: Config, data: Parts, learnt: Mapping[str, Tensor]) -> MatchingObjective:
    """What is trained."""
    return MatchingObjective(cfg, data, learnt)


def open_model(cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]) -> Matcher:
    """The matcher that a training left."""
    return Matcher.from_tensors(cfg, weights, learnt, about)
