"""MotionWavelet as the experiments see it: settings, data, what is trained, and how it is scored."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor

from mwlib.data.sources import Split, split_motions
from mwlib.data.windowing import too_short
from mwlib.prediction.config import Config
from mwlib.prediction.evaluation import DETAILS, METRICS, evaluate, make_predict, test_windows
from mwlib.prediction.objective import PredictionObjective
from mwlib.prediction.predictor import Predictor

MOST_NAMES = 12

__all__ = ["DETAILS", "METRICS", "Config", "evaluate", "load_data", "make_objective", "open_model", "preview"]


def load_data(cfg: Config) -> Split:
    """Clips for training, validation and test; a warning names those too short to give any window.

    Raises:
        ValueError: as in `split_motions`, or no clip of a part is longer than a window.
    """
    split, frames = split_motions(cfg.data), cfg.windows.frames
    for name, part in split._asdict().items():
        if part and max(map(len, part)) <= frames:
            longest = max(part, key=len)
            raise ValueError(
                f"no {name} clip is longer than {frames} frames (history + future) at {cfg.data.fps:g} Hz; the longest, "
                f"{longest.name!r}, has {len(longest)}. Longer clips, a smaller history or future, or a smaller fps would do"
            )
    for name, part in split._asdict().items():
        if short := [m.name or "a clip without a name" for m in too_short(part, frames)]:
            names = ", ".join(short[:MOST_NAMES]) + " ..." * (len(short) > MOST_NAMES)
            at = f"{frames} frames (history + future) at {cfg.data.fps:g} Hz"
            warnings.warn(f"{len(short)} of {len(part)} {name} clips are left out, no longer than {at}: {names}", stacklevel=2)
    return split


def make_objective(cfg: Config, data: Split, learnt: Mapping[str, Tensor]) -> PredictionObjective:
    """What is trained."""
    return PredictionObjective.of_split(cfg, data, learnt)


def open_model(cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]) -> Predictor:
    """The predictor that a training left; it samples as `cfg` says."""
    return Predictor.from_tensors(cfg, weights, learnt, about)


def preview(cfg: Config, get_model: Callable[[], Predictor], data: Split) -> dict[str, Any]:
    """A true motion and at most two that the configuration's method gives for its history, as `plots.storyboard` takes them."""
    test = test_windows(data, cfg.windows).thin(3)
    history = test.x_history[1]
    predict, _ = make_predict(cfg.override(samples=2), get_model, data)
    futures = predict(history[None], [0])[0]
    rows = {"truth": test.x[1], **{f"sample {i}": torch.cat([history, future]) for i, future in enumerate(futures, 1)}}
    return {"rows": rows, "skeleton": data.test[0].skeleton, "fps": cfg.data.fps, "history": cfg.windows.history}
