"""Free-T2M as the experiments see it: settings, data, what is trained, and how it is scored."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from mwlib.data.captioned import Parts, load_clips
from mwlib.matching.evaluators import stands_on
from mwlib.text_to_motion.config import Config
from mwlib.text_to_motion.evaluation import DETAILS, METRICS, evaluate
from mwlib.text_to_motion.model import TextToMotion
from mwlib.text_to_motion.objective import TextObjective

__all__ = ["DETAILS", "METRICS", "Config", "built_on", "evaluate", "judged_by", "load_data", "make_objective", "open_model"]


def load_data(cfg: Config) -> Parts:
    """Clips for training, validation and test.

    Raises:
        ValueError, MotionFormatError: as `load_clips`.
    """
    return load_clips(cfg.data)


def make_objective(cfg: Config, data: Parts, learnt: Mapping[str, Tensor]) -> TextObjective:
    """What is trained."""
    return TextObjective(cfg, data, learnt)


def open_model(
    cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
) -> TextToMotion:
    """The model that a training left; it samples as `cfg` says."""
    return TextToMotion.from_tensors(cfg, weights, learnt, about)


def built_on(cfg: Config) -> list[str]:
    """Names, folders or files of the trained models that a training begins with or asks."""
    critic = stands_on(cfg.objective.critic) if cfg.objective.semantic_weight else []
    return ([cfg.model.start] if cfg.model.start else []) + critic


def judged_by(cfg: Config) -> list[str]:
    """Names, folders or files of the trained models that score the motions."""
    return stands_on(cfg.sampling.evaluator)
