"""How a configuration predicts people whom its model has never seen: futures sampled in chunks, metrics streamed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from torch import Tensor
from tqdm import tqdm

from mwlib.data.bodies import Bodies
from mwlib.data.sources import Split
from mwlib.data.windowing import Windows, windows
from mwlib.metrics import Column, MetricTable, multimodal_apd, multimodal_futures
from mwlib.prediction import baselines
from mwlib.prediction.config import Config, EvaluationConfig, SamplingConfig, WindowConfig
from mwlib.prediction.predictor import CHUNK, Predictor

METRICS = {  # the columns of every table
    "apd": Column("APD"),
    "ade": Column("ADE", "lower"),
    "fde": Column("FDE", "lower"),
    "mmade": Column("MMADE", "lower"),
    "mmfde": Column("MMFDE", "lower"),
    "bone_length_jitter": Column("bone jitter (mm)", scale=1000.0),
}

# Beside them in a table of their own: is it a motion, and how does the error grow?
DETAILS = {
    "speed": Column("speed (m/s)"),
    "pose_change": Column("change of pose (m)"),
    "jerk": Column("jerk (m/s³)"),
    "error_0.2s": Column("error at 0.2 s", "lower"),
    "error_0.4s": Column("error at 0.4 s", "lower"),
    "error_1s": Column("error at 1 s", "lower"),
    "coverage_0.5": Column("inside 50 %"),
    "coverage_0.9": Column("inside 90 %"),
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
    still = {"zero_velocity": baselines.zero_velocity, "constant_velocity": baselines.constant_velocity}[method]
    return lambda x_history, ids: still(x_history, cut.future)


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
    progress: str | None = None,
    chunk: int = CHUNK,
) -> dict[str, Any]:
    """Metrics of one predictor over the test windows, streamed in chunks.

    Args:
        predict: (histories, window numbers) -> (n, S, F, C).
        test: the windows that are evaluated.
        all_test: every test window; multimodal sets are drawn from all of them.
        options: which windows share their futures.
        progress: label of a bar; None shows none.
        chunk: windows that `predict` is given at a time.

    Returns:
        `MetricTable.summary`.
    """
    number = {(c, s): i for i, (c, s) in enumerate(zip(all_test.clip.tolist(), all_test.start.tolist(), strict=True))}
    ids = [number[key] for key in zip(test.clip.tolist(), test.start.tolist(), strict=True)]
    sets = multimodal_futures(all_test.x_history[:, -1], all_test.x_future, options.mm_threshold)
    body, clips = Bodies.of(all_test.motions), all_test.clip.tolist()
    table = MetricTable(sets, all_test.actions, body.skeleton, mm_singletons=options.mm_singletons, fps=body.fps, clips=clips)
    for first in tqdm(range(0, len(test), chunk), desc=progress, disable=progress is None, leave=False):
        part = slice(first, first + chunk)
        table.update(predict(test.x_history[part], ids[part]), test.x_future[part], ids[part])
    found = table.summary()
    found["multimodal_apd"] = float(multimodal_apd(sets)[ids].mean())
    found["mean"]["worst"] = _worst(table.values["ade"][ids], test)
    return found


def _worst(errors: Tensor, test: Windows) -> float:
    """The largest ADE in units of that of standing still; of those who hardly move, in units of 5 cm."""
    still = (test.x_future - test.x_history[:, -1:]).norm(dim=-1).mean(-1).clamp_min(0.05)
    return float((errors / still).max())


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
    found = score(predict, test, every, cfg.evaluation, cfg.sampling.method if progress else None, chunk)
    actions = {action: row["mean"] for action, row in found["actions"].items()}
    return {**{k: v for k, v in found.items() if k != "actions"}, "windows": len(test), "actions": actions}
