"""MotionWavelet as the experiments see it: data, training and evaluation on people whom the model has never seen."""

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.data.sources import Split, split_motions
from mwlib.data.windows import Bodies, Windows, too_short, windows
from mwlib.metrics import Column, MetricTable, multimodal_apd, multimodal_futures
from mwlib.metrics.evaluation import REALISM, SEAM
from mwlib.metrics.prediction import ERRORS
from mwlib.prediction import baselines
from mwlib.prediction.config import Config, EvaluationConfig, SamplingConfig, WindowConfig
from mwlib.prediction.objective import PredictionObjective
from mwlib.prediction.predictor import CHUNK, Predictor
from mwlib.training import chunks

MOST_NAMES = 12
METRICS = {name: metric.column for name, metric in ERRORS.items()}  # the columns of every table
# Beside them in a table of their own: is it a motion, and how does the error grow?
DETAILS = {name: metric.column for name, metric in (REALISM | SEAM).items()} | {
    "behind_still": Column("windows behind standing still (%)", "lower", scale=100.0),
    "worst": Column("worst window / still", "lower"),
}

Predict = Callable[[Tensor, list[int]], Tensor]  # histories (n, H, C), window numbers -> futures (n, S, F, C)


def test_windows(split: Split, cut: WindowConfig) -> Windows:
    """Every test window; `Windows.thin` picks some."""
    return windows(split.test, cut.history, cut.future, cut.test_stride)


test_windows.__test__ = False  # pyright: ignore[reportFunctionMemberAccess]  (no test, whatever pytest thinks)


def baseline(cfg: Config, split: Split) -> Predict:
    """The untrained predictor that `method` names."""
    cut, method = cfg.windows, cfg.sampling.method
    if method == "truth":
        future = test_windows(split, cut).x_future
        return lambda x_history, ids: future[ids][:, None]
    if method.startswith("nearest"):
        known, up = windows(split.train, cut.history, cut.future, cut.train_stride), split.train[0].up
        futures = "displacement" if method == "nearest_displacement" else "pose"
        nearest = baselines.NearestHistory(known.x, cut.history, min(cfg.sampling.samples, len(known)), futures=futures, up=up)
        return lambda x_history, ids: nearest.predict(x_history)
    return lambda x_history, ids: getattr(baselines, method)(x_history, cut.future)


def trained(predictor: Predictor, sampling: SamplingConfig) -> Predict:
    """A trained model at the settings of its sampling."""
    return lambda x_history, ids: predictor.predict(x_history, sampling.samples, sampling.sampling_seed, window_ids=ids)


def make_predict(cfg: Config, get_model: Callable[[], Predictor], split: Split) -> tuple[Predict, int]:
    """What `method` names, the trained model (asked for only here) or a baseline; and how many windows it should be given."""
    if cfg.sampling.method != "diffusion":
        return baseline(cfg, split), CHUNK
    model = get_model()
    return trained(model, cfg.sampling), model.chunk(cfg.sampling.samples)


def score(
    predict: Predict,
    test: Windows,
    all_test: Windows,
    options: EvaluationConfig,
    progress: bool = False,
    chunk: int = CHUNK,
) -> dict[str, Any]:
    """Metrics of one predictor over the test windows, streamed in chunks.

    Args:
        predict: (histories, window numbers) -> (n, S, F, C).
        test: the windows that are evaluated.
        all_test: every test window; multimodal sets are drawn from all of them.
        options: which windows share their futures.
        progress: show a bar on stderr.
        chunk: windows that `predict` is given at a time.

    Returns:
        `MetricTable.summary`.
    """
    every, some = ([*zip(part.clip.tolist(), part.start.tolist(), strict=True)] for part in (all_test, test))
    number = {window: i for i, window in enumerate(every)}
    ids = [number[window] for window in some]
    sets = multimodal_futures(all_test.x_history[:, -1], all_test.x_future, options.mm_threshold)
    body, clips = Bodies.of(all_test.motions), all_test.clip.tolist()
    table = MetricTable(sets, all_test.actions, body.skeleton, options.mm_singletons, body.fps, clips, all_test.x_history)
    for part in chunks(len(test), chunk, progress):
        table.update(predict(test.x_history[part], ids[part]), test.x_future[part], ids[part])
    found = table.summary()
    found["multimodal_apd"] = float(multimodal_apd(sets)[ids].mean())
    beside = _beside_still(table.values["ade"][ids], test)
    found["mean"]["behind_still"] = float((beside > 1).double().mean())
    found["mean"]["worst"] = float(beside.max())
    return found


def _beside_still(errors: Tensor, test: Windows) -> Tensor:
    """ADE of each window in units of that of standing still; of those who hardly move, in units of 5 cm."""
    return errors / (test.x_future - test.x_history[:, -1:]).norm(dim=-1).mean(-1).clamp_min(0.05)


def evaluate(cfg: Config, get_model: Callable[[], Predictor], split: Split, progress: bool = False) -> dict[str, Any]:
    """Metrics of a configuration on the test people of a split.

    Args:
        cfg: windows, method and settings of the sampling.
        get_model: the trained predictor, asked for only where the method needs one.
        split: the data.
        progress: show a bar on stderr.

    Returns:
        "mean" and "standard_error" (over clips) by metric, "windows", "cmd", "multimodal_apd", "actions" with the means of each
        action, and "values" of each window by metric with the "clips" that they come from.
    """
    every = test_windows(split, cfg.windows)
    test = every.thin(cfg.windows.test_windows)
    predict, chunk = make_predict(cfg, get_model, split)
    found = score(predict, test, every, cfg.evaluation, progress, chunk)
    return found | {"windows": len(test), "actions": {action: row["mean"] for action, row in found["actions"].items()}}


def load_data(cfg: Config, loaded: Sequence[Motion] | None = None) -> Split:
    """Clips for training, validation and test; a warning names those too short to give any window.

    Args:
        cfg: data and windows.
        loaded: the clips as they were read, if they are there already.

    Raises:
        ValueError: as in `split_motions`, or no clip of a part is longer than a window.
    """
    split, frames = split_motions(cfg.data, loaded=loaded, more=cfg.windows.more_data), cfg.windows.frames
    at = f"{frames} frames (history + future) at {cfg.data.fps:g} Hz"
    for name, part in split._asdict().items():
        short = [m.name or "a clip without a name" for m in too_short(part, frames)]
        if part and len(short) == len(part):
            longest = max(part, key=len)
            raise ValueError(
                f"no {name} clip is longer than {at}; the longest, {longest.name!r}, has {len(longest)}. "
                "Longer clips, a smaller history or future, or a smaller fps would do"
            )
        if short:
            names = ", ".join(short[:MOST_NAMES]) + " ..." * (len(short) > MOST_NAMES)
            warnings.warn(f"{len(short)} of {len(part)} {name} clips are left out, no longer than {at}: {names}", stacklevel=2)
    return split


make_objective, open_model = PredictionObjective, Predictor.from_tensors


def preview(cfg: Config, get_model: Callable[[], Predictor], data: Split) -> dict[str, Any]:
    """A true motion and at most two that the configuration's method gives for its history, as `plots.storyboard` takes them."""
    test = test_windows(data, cfg.windows).thin(3)
    history = test.x_history[1]
    predict, _ = make_predict(cfg.override(samples=2), get_model, data)
    futures = predict(history[None], [0])[0]
    rows = {"truth": test.x[1], **{f"sample {i}": torch.cat([history, future]) for i, future in enumerate(futures, 1)}}
    return {"rows": rows, "skeleton": data.test[0].skeleton, "fps": cfg.data.fps, "history": cfg.windows.history}
