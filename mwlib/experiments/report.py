"""Pictures of a predictor on people never seen: storyboards beside the truth, end poses, and its loss curves."""

import json
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from mwlib import plots
from mwlib.data.collections import acknowledgement
from mwlib.data.sources import Split
from mwlib.data.windows import Windows
from mwlib.experiments.results import of_older_code
from mwlib.experiments.runs import get_run
from mwlib.prediction.config import Config
from mwlib.prediction.predictor import Predictor
from mwlib.prediction.system import baseline, test_windows
from mwlib.training import CURVES
from mwlib.version import __version__


def provenance(cfg: Config, split: Split) -> dict[str, Any]:
    """What a reader must know to trust a picture."""
    return {
        "data": cfg.data.data, "train_clips": len(split.train), "test_clips": len(split.test),
        "train_subjects": sorted({m.subject for m in split.train}), "test_subjects": sorted({m.subject for m in split.test}),
        "settings": cfg.changed_from(Config()), "training_hash": cfg.training_hash(),
        "seeds": {"training": cfg.training.seed, "sampling": cfg.sampling.sampling_seed},
        "mwlib": __version__, "torch": torch.__version__.split("+")[0], "machine": platform.machine(),
    } | of_older_code() | acknowledgement(cfg.data.data)  # fmt: skip


def _closest(futures: Tensor, truth: Tensor) -> Tensor:
    """The sample (F, C) of (S, F, C) with the smallest ADE."""
    return futures[(futures - truth).norm(dim=-1).mean(-1).argmin()]


def _picked(every: Windows, clips: Sequence[str], count: int) -> dict[str, int]:
    """Windows to draw, by the picture's name: the middle one of each clip; without clips `count`, spread evenly."""
    if not clips:
        return {str(n): int(i) for n, i in enumerate(torch.linspace(0, len(every) - 1, 2 * count + 1).long()[1::2], 1)}
    names = [every.motions[clip].name for clip in every.clip.tolist()]
    if missing := sorted({*clips} - {*names}):
        raise ValueError(f"clips are {', '.join(missing)}; expected some of the test people: {', '.join(sorted({*names}))}")
    return {clip: [i for i, name in enumerate(names) if name == clip][names.count(clip) // 2] for clip in clips}


def write_storyboards(
    cfg: Config, split: Split, predictor: Predictor, out: Path, clips: Sequence[str] = (), count: int = 3
) -> None:
    """Truth above predictions for a few test windows.

    Args:
        cfg, split, predictor: settings, people, and the model that was trained with them.
        out: folder.
        clips: names of test clips, of each of which the middle window is drawn.
        count: without them, how many windows, spread evenly over the test set.

    Raises:
        ValueError: no test window is of a clip of that name; the message lists those there are.
    """
    about, every = provenance(cfg, split), test_windows(split, cfg.windows)
    looked_up, still = (baseline(cfg.override(method=name), split) for name in ("nearest_history", "zero_velocity"))
    for picture, i in _picked(every, clips, count).items():
        past, truth = every.x_history[i : i + 1], every.x_future[i]
        futures = predictor.predict(past, window_ids=[i])[0]
        found = looked_up(past, [i])[0]
        ahead = {f"closest of {len(futures)}": _closest(futures, truth), "sample 1": futures[0], "sample 2": futures[1]}
        ahead |= {"looked up": _closest(found, truth), "held still": still(past, [i])[0, 0]}
        board = {"truth": every.x[i], **ahead}
        fig, _ = plots.storyboard(board, split.test[0].skeleton, fps=cfg.data.fps, history=cfg.windows.history, frames=10)
        clip = every.motions[int(every.clip[i])]
        alt = (
            f"Storyboard of test clip {clip.name} ({clip.action}), subject {clip.subject}: the true motion on top, below it the "
            f"future closest to it among {len(futures)} sampled by MotionWavelet, two samples taken blindly, the closest of "
            f"{len(found)} looked up in the training set, and the last pose held still."
        )
        where = about | {"clip": clip.name, "start_frame": int(every.start[i]), "window": i}
        data = {name.replace(" ", "_"): row for name, row in board.items()}
        plots.save(fig, out, f"storyboard_{picture}", data=data, alt=alt, provenance=where)


def write_ends(cfg: Config, split: Split, predictor: Predictor, out: Path, clips: Sequence[str] = (), count: int = 4) -> None:
    """Where the sampled futures of a few test windows end: laid over each other, and ten of one window side by side.

    Source: MotionWavelet, Fig. 10 and Fig. 4 (Sec. 4.1).

    Args:
        cfg, split, predictor, out, clips: as in `write_storyboards`; the ten are of the first window.
        count: without clips, how many windows.

    Raises:
        ValueError: as `write_storyboards`.
    """
    about, every = provenance(cfg, split), test_windows(split, cfg.windows)
    chosen = [*_picked(every, clips, count).values()]
    futures, truth = predictor.predict(every.x_history[chosen], window_ids=chosen), every.x_future[chosen]
    named = [every.motions[int(every.clip[i])] for i in chosen]
    titles = [f"{clip.action.replace('_', ' ')} ({clip.name})" for clip in named]
    skeleton, ten = split.test[0].skeleton, futures[0, :10]
    windows = about | {"clips": [clip.name for clip in named], "start_frames": [int(every.start[i]) for i in chosen]}

    fig, _ = plots.end_poses(dict(zip(titles, zip(futures, truth, strict=True), strict=True)), skeleton)
    shown = f"the last pose of {futures.shape[1]} futures sampled by MotionWavelet"
    alt = f"One panel for each of {', '.join(titles)}: {shown}, laid over each other, and the true pose in black."
    data = {f"truth_{n}": x[-1] for n, x in enumerate(truth, 1)}
    data |= {f"samples_{n}": f[:, -1].T for n, f in enumerate(futures, 1)}
    plots.save(fig, out, "end_poses", data=data, alt=alt, provenance=windows)

    fig, _ = plots.pose_grid({("", str(k)): future[None] for k, future in enumerate(ten, 1)}, skeleton, truth=truth[0])
    alt = f"{len(ten)} panels: the last pose of one future each of {titles[0]} by MotionWavelet, and the true pose in black."
    data = {"truth": truth[0, -1], "samples": ten[:, -1].T}
    plots.save(fig, out, "ten", data=data, alt=alt, provenance=windows | {"clip": named[0].name})


def write_curves(cfg: Config, split: Split, out: Path) -> None:
    """Training loss, and the loss of the averaged weights on people who are not trained on."""
    curves = json.loads((get_run(cfg, split) / CURVES).read_text(encoding="utf-8"))
    named, data = {"people seen in training": curves["loss"]}, {"loss": curves["loss"]}
    if curves["validation"]:
        named["people never seen"] = curves["validation"]
        data["validation_step"], data["validation_loss"] = map(list, zip(*curves["validation"], strict=True))
    fig, _ = plots.loss_curves(named)
    alt = "Loss against training step, for the people trained on and, where some were held out for it, for people never seen."
    plots.save(fig, out, "curves", data=data, alt=alt, provenance=provenance(cfg, split))
