"""In-betweening as a system: data, objective, trained model, and scores on people whom the model has never seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from tqdm import tqdm

from mwlib.body.motion import Motion
from mwlib.data.sources import Split, split_motions
from mwlib.data.windows import prepare
from mwlib.inbetweening.baselines import GaussianBetween, between
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.gaps import card_of_gaps, rows_by_gap
from mwlib.inbetweening.losses import bone_lengths, feet, floor_of
from mwlib.inbetweening.objective import InbetweeningObjective
from mwlib.inbetweening.space import Samples, Space
from mwlib.inbetweening.windows import Clips, PlacedWindows, given, make_space, parted, ready
from mwlib.metrics.evaluation import REALISM

from mwlib.metrics import (  # isort: skip
    NPSS, Column, apd, bone_length_error, continued, foot_skate, jerk, keyframe_error, l2p, l2q, nearer_share, path_length,
    sample_ade, seam_ratio, speed, summary,
)  # fmt: skip

METRICS = {  # the columns of every table
    "l2p": Column("L2P", "lower"),
    "l2q": Column("L2Q", "lower"),
    "npss": Column("NPSS", "lower"),
    "ade": Column("ADE", "lower"),
    "ade_mean": Column("ADE, mean sample", "lower"),
    "apd": Column("APD"),
    "keyframe_error": Column("keyframe error (mm)", "lower", 1000.0),
}

# Beside them in a table of their own: is it a motion? To be read beside the truth's row.
DETAILS = {
    "seam": Column("seam ratio"),
    "speed": Column("speed (m/s)"),
    "path": Column("path of the root (m)"),
    "jerk": Column("jerk (m/s³)"),
    "skate": Column("foot skate (m/s)"),
    "bone_error": Column("bone length error (mm)", "lower", 1000.0),
    "nearer": Column("nearer than interpolation"),
    "l2p_best": Column("L2P, best sample", "lower"),
}

STATISTICS_STRIDE = 20  # frames between the windows behind the deviations of L2P, as in LaFAN1's protocol
CHUNK = 32  # windows scored together

make_objective, open_model = InbetweeningObjective, Bridge.from_tensors
more_rows, more_of_card = rows_by_gap, card_of_gaps  # what the card of a shipped model says beside the tables

PerWindow = Float[Tensor, " N"]
Fill = Callable[[PlacedWindows, list[int]], Tensor]  # windows, their numbers -> states (n, S, T, C)


def load_data(cfg: Config, loaded: Sequence[Motion] | None = None) -> Split:
    """Clips for training, validation and test: with their rotations, or on 17 joints where a correspondence is known.

    Args:
        cfg: data and task.
        loaded: the clips as they were read, if they are there already.

    Raises:
        FileNotFoundError: there is no such data.
        ValueError: as in `split_motions`.
    """
    as_taken = ready if cfg.task.state == "rotations" else prepare
    return split_motions(cfg.data, as_taken, loaded, cfg.task.more_data)


def make_fill(cfg: Config, get_model: Callable[[], Bridge], split: Split, space: Space) -> Fill:
    """The filling that `method` names: a trained model's, asked for only here, or a baseline's, which sees both ends alone."""
    method, past, future = cfg.sampling.method, cfg.task.past, cfg.task.future
    if method == "diffusion":
        model = get_model()
        return lambda windows, ids: model.sample(windows.x, window_ids=ids)
    if method == "truth":
        return lambda windows, ids: windows.x[:, None]
    if method != "gaussian":
        return inside(past, future, lambda x: between(space, x, method))
    seen = Clips(split.train, space).windows(cfg.task.frames, STATISTICS_STRIDE, past)
    gaussian = GaussianBetween(parted(seen.x, past, future)[1])
    return inside(past, future, lambda x: torch.where(given(x.shape[-2])[:, None], x, space.valid(gaussian(x))))


def inside(past: int, future: int, fill: Callable[[Tensor], Tensor]) -> Fill:
    """A filling of the frames from the first keyframe to the last, one sample of each window."""

    def filling(windows: PlacedWindows, ids: list[int]) -> Tensor:
        """Whole windows (n, 1, T, C), the frames given as they are."""
        before, x, after = parted(windows.x, past, future)
        return torch.cat([before, fill(x), after], dim=1)[:, None]

    return filling


class Score:
    """Metrics of filled windows, one number each.

    Args:
        space: what a state means.
        deviation: of each coordinate of the joints over the training windows, for L2P.
        past, future: frames given before and after those between. They are scored as keyframes; all else is of what lies from
            the last of the past to the first of the future.
    """

    def __init__(self, space: Space, deviation: Float[Tensor, " C"], past: int = 1, future: int = 1) -> None:
        self.space, self.deviation, self.past, self.future = space, deviation, past, future
        self.skeleton, self.fps = space.bodies.skeleton, space.bodies.fps
        self.feet = feet(self.skeleton)
        self.npss = NPSS()

    @classmethod
    def of(cls, split: Split, space: Space, frames: int, past: int = 1, future: int = 1) -> Score:
        """With the statistics of the training windows, each about the mean of its root on the floor."""
        seen = Clips(split.train, space).windows(frames, STATISTICS_STRIDE, past)
        places = space.positions(seen.x, seen.offsets)
        places[..., :2] -= places[:, :, :1, :2].mean(1, keepdim=True)
        return cls(space, places.flatten(-2).flatten(0, 1).std(0, correction=0).clamp_min(1e-4), past, future)

    def __call__(self, x: Samples, windows: PlacedWindows) -> dict[str, PerWindow]:
        """Every metric but NPSS, which is summed up over all windows."""
        p, g = (self.joints(states, windows.offsets) for states in (x, windows.x[:, None]))
        keyframes = (*range(self.past), *range(-self.future, 0))
        met = keyframe_error(p, g, keyframes=keyframes).amax(1)
        x, truth, p, g = (parted(part, self.past, self.future)[1] for part in (x, windows.x[:, None], p, g))
        errors = self.errors(x, truth, windows.offsets, p, g)
        straight = self.joints(between(self.space, truth[:, 0], "interpolation")[:, None], windows.offsets)[:, 0]
        lengths = bone_lengths(g[:, :, 0].unflatten(-1, (-1, 3)), self.skeleton)
        floor = floor_of(g[:, 0].unflatten(-1, (-1, 3)), self.feet or [0])
        inner, true = p[..., 1:-1, :], g[:, 0, 1:-1]
        apart = sample_ade(inner, true)
        return {
            **{name: error.mean(1) for name, error in errors.items()},
            "l2p_best": errors["l2p"].amin(1),
            "ade": apart.amin(1),
            "ade_mean": apart.mean(1),
            "apd": apd(inner) if p.shape[1] > 1 else met.new_full((len(p),), torch.nan),
            "keyframe_error": met,
            "nearer": nearer_share(inner, true, straight[:, 1:-1]),
            "bone_error": bone_length_error(p, lengths, self.skeleton).mean(1),
            **self._motion(p, floor),
        }

    def joints(self, x: Samples, offsets: Float[Tensor, "N rig 3"]) -> Float[Tensor, "N S T joints"]:
        """Places of the joints of states, all numbers of a frame in a row."""
        return self.space.positions(x, offsets[:, None]).flatten(-2)

    def errors(
        self, x: Samples, truth: Float[Tensor, "N 1 T C"], offsets: Float[Tensor, "N rig 3"], p: Tensor, g: Tensor
    ) -> dict[str, Float[Tensor, "N S"]]:
        """L2P of every sample from keyframe to keyframe and, of rotations, L2Q; NPSS is summed up.

        Args:
            x, truth: states from the first to the last keyframe.
            offsets: of their bodies.
            p, g: their joints, see `joints`.
        """
        p, g = p[..., 1:-1, :], g[..., 1:-1, :]
        found = {"l2p": l2p(p, g, torch.zeros_like(self.deviation), self.deviation)}
        p_turns, g_turns = (self.space.rotations(states, offsets[:, None]) for states in (x, truth))
        if p_turns is None or g_turns is None:
            self.npss.update(p, g)
        else:
            start = g_turns[:, :, 0]
            p_turns, g_turns = (continued(turns[..., 1:-1, :, :], start) for turns in (p_turns, g_turns))
            found["l2q"] = l2q(p_turns, g_turns)
            self.npss.update(p_turns.flatten(-2), g_turns.flatten(-2))
        return found

    def _motion(self, p: Samples, floor: PerWindow) -> dict[str, PerWindow]:
        joints = p.unflatten(-1, (-1, 3)).clone()
        joints[..., 2] -= floor[:, None, None, None]
        is_long = p.shape[2] >= REALISM["speed"].fewest(self.fps)
        return {
            "seam": seam_ratio(p).mean(1),
            "speed": speed(p, self.fps) if is_long else p.new_full((len(p),), torch.nan),
            "path": path_length(joints[..., 0, :2]).mean(1),
            "jerk": jerk(p, self.fps),
        } | ({"skate": foot_skate(joints.flatten(-2), self.feet, self.fps).nanmean(1)} if self.feet else {})


def evaluate(cfg: Config, get_model: Callable[[], Bridge], split: Split, progress: bool = False) -> dict[str, Any]:
    """Metrics of a configuration on the test people of a split.

    Args:
        cfg: task, method and settings of the sampling.
        get_model: the trained model, asked for only where the method needs one.
        split: the data.
        progress: show a bar on stderr.

    Returns:
        See `mwlib.metrics.summary`.
    """
    space = make_space(split.train, cfg.task.state)
    frames, past, future = cfg.task.frames, cfg.task.past, cfg.task.future
    windows = Clips(split.test, space).windows(frames, cfg.task.test_stride, past).thin(cfg.task.test_windows)
    fill, score = make_fill(cfg, get_model, split, space), Score.of(split, space, frames, past, future)
    parts = []
    for first in tqdm(range(0, len(windows.x), CHUNK), desc=cfg.sampling.method, disable=not progress, leave=False):
        part = windows.pick(slice(first, first + CHUNK))
        parts.append(score(fill(part, [*range(first, first + len(part.x))]), part))
    values = {name: torch.cat([part[name] for part in parts]).double() for name in parts[0]}
    values = {name: torch.where(value.isfinite(), value, torch.nan) for name, value in values.items()}  # still ones have no seam
    return summary(values, windows.clip.tolist(), mean={"npss": score.npss.value()})
