"""A trained model beside interpolation and truth, at gaps of several lengths."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.body.standing import legs, standing
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.losses import STANDING, feet, floor_of
from mwlib.inbetweening.windows import Clips, given, interpolated, parted
from mwlib.metrics import Column, foot_contacts, summary

GAPS = 5, 10, 15, 30, 45, 60, 90  # frames between two keyframes
STRIDE = 15  # frames between the starts of windows, which are then thinned
COLUMNS = {
    "straight": Column("interpolation (mm)", scale=1000.0),
    "mean": Column("mean of ten (mm)", scale=1000.0),
    "single": Column("a sample (mm)", scale=1000.0),
    "best": Column("best of ten (mm)", scale=1000.0),
    "spread": Column("spread (mm)", scale=1000.0),
    "jerk": Column("jerk (m/s³)"),
    "true_jerk": Column("truth's"),
    "speed": Column("speed (m/s)"),
    "true_speed": Column("truth's"),
    "jump": Column("jump of velocity (m/s)"),
    "true_jump": Column("truth's"),
    "slide": Column("feet where the truth's stand (m/s)"),
    "straight_slide": Column("interpolation's"),
    "true_slide": Column("truth's"),
    "sunk": Column("below the floor (cm)", scale=100.0),
}
Straight = Callable[[int, int, int], Float[np.ndarray, "T joints 3"]]  # clip, first and last keyframe -> motion between them


def by_gap(
    bridge: Bridge, motions: Sequence[Motion], is_beyond_known: bool, most: int = 12, straight: Straight | None = None
) -> list[dict[str, Any]]:
    """Scores of a model at each of the `GAPS` that it is for, ten samples of each window, feet held as `filled` holds them.

    Args:
        bridge: a model of places, with one frame given beyond each keyframe (past and future 2).
        motions: clips as it takes them (`Bodies.prepare`).
        is_beyond_known: whether these frames are given, so that velocities are known; else they are hidden from the model.
        most: windows of each gap.
        straight: an interpolation to compare with; None: places on straight lines.

    Returns:
        A row for each gap: "gap", and "mean", "standard_error" and "windows" of `summary`, clustered by clip, metres.
        "gain" is by how much the mean of ten is nearer than the interpolation.
    """
    clips, rows = Clips([m for m in motions if len(m) > min(GAPS) + 4], bridge.space), []
    for gap in GAPS:
        if not bridge.cfg.task.shortest <= gap <= bridge.cfg.task.between or int(clips.lengths.max()) <= gap + 4:
            continue
        windows = clips.windows(gap + 4, STRIDE, 2).thin(most)
        truth = bridge.space.placed(windows.x, windows.placement)
        shown = windows.x.clone()
        if not is_beyond_known:
            shown[:, [0, -1]] = torch.nan
        x = bridge.sample(shown, samples=10)
        places = bridge.space.positions(bridge.space.placed(x, windows.placement.of_samples()), windows.offsets[:, None])
        true = bridge.space.positions(truth, windows.offsets)
        places = torch.stack([_held(bridge, p, g) for p, g in zip(places[:, :, 1:-1], true, strict=True)])
        inner = parted(true.flatten(-2), 2, 2)[1]
        line = interpolated(inner, given(gap + 2)).unflatten(-1, (-1, 3))
        if straight is not None:
            cut = zip(windows.clip.tolist(), windows.start.tolist(), strict=True)
            line = torch.from_numpy(np.stack([straight(c, s + 1, s + gap + 2) for c, s in cut])).to(line)
        found = summary(scores(places, true, line, bridge), windows.clip.tolist())
        rows.append({"gap": gap, **{name: found[name] for name in ("mean", "standard_error", "windows")}})
    return rows


def _held(bridge: Bridge, places: Float[Tensor, "S T J 3"], truth: Float[Tensor, "_T J 3"]) -> Float[Tensor, "S T J 3"]:
    """Samples with feet that stand; the floor is at the lowest foot of the four frames given."""
    bodies = bridge.space.bodies
    below = [foot for _, _, foot in legs(bodies.skeleton)]
    floor = float(truth[[0, 1, -2, -1]][:, below, 2].min())
    held = [standing(Motion(p.numpy(), bodies.fps, bodies.skeleton, up=bodies.up), floor).positions for p in places]
    return torch.from_numpy(np.stack(held))


def scores(
    p: Float[Tensor, "n S T J 3"], truth: Float[Tensor, "n _T J 3"], line: Float[Tensor, "n T J 3"], bridge: Bridge
) -> dict[str, Float[Tensor, " n"]]:
    """Errors over the frames between, and what each window is like; see `COLUMNS`.

    Args:
        p: samples from keyframe to keyframe, metres.
        truth: the same with one frame more at both ends.
        line: interpolation.
        bridge: says the frame rate and which joints are feet.
    """
    fps, below = bridge.space.bodies.fps, feet(bridge.space.bodies.skeleton)
    g, floor = truth[:, 1:-1], floor_of(truth, below)
    stand = foot_contacts(g, below, fps, floor=floor, fastest=STANDING).double()
    each, straight, mean = _error(p, g[:, None]), _error(line, g), _error(p.mean(1), g)

    def slide(x: Tensor) -> Tensor:
        """Mean speed of the feet that stand, metres per second."""
        moved = x[..., below, :2].diff(dim=-3).norm(dim=-1) * fps
        return (moved * stand).sum((-2, -1)) / stand.sum((-2, -1))  # NaN where no foot stands

    ends = truth[:, None, [0, -1]].expand(-1, p.shape[1], -1, -1, -1)
    whole, stand = torch.cat([ends[:, :, :1], p, ends[:, :, 1:]], 2), stand[:, None]
    return {
        "straight": straight, "gain": straight - mean, "mean": mean, "single": each.mean(1), "best": each.amin(1),
        "spread": _error(p, p.mean(1, keepdim=True)).mean(1), "jerk": _change(p, fps, 3).mean(1), "true_jerk": _change(g, fps, 3),
        "speed": _change(p, fps, 1).mean(1), "true_speed": _change(g, fps, 1), "jump": _jump(whole, fps).mean(1),
        "true_jump": _jump(truth, fps), "slide": slide(p).mean(1), "straight_slide": slide(line[:, None]).mean(1),
        "true_slide": slide(g[:, None]).mean(1),
        "sunk": (floor[:, None, None, None] - p[..., below, 2]).clamp_min(0).amax((-2, -1)).mean(1),
    }  # fmt: skip


def _error(x: Tensor, g: Tensor) -> Tensor:
    """Mean distance of joints over the frames between keyframes."""
    return (x - g)[..., 1:-1, :, :].norm(dim=-1).mean((-2, -1))


def _change(x: Tensor, fps: float, order: int) -> Tensor:
    """Mean size of a derivative of the joints' places."""
    return x.diff(n=order, dim=-3).norm(dim=-1).mean((-2, -1)) * fps**order


def _jump(x: Tensor, fps: float) -> Tensor:
    """Change of velocity at the keyframes, the second frame and the last but one."""
    return x.diff(n=2, dim=-3)[..., [0, -1], :, :].norm(dim=-1).mean((-2, -1)) * fps


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Rows as Markdown: what the mean of ten, a sample and the best of ten are of the interpolation's error, and the rest."""
    heads = ["frames between", *(column.heading for column in COLUMNS.values())]
    lines = [f"| {' | '.join(heads)} |", f"|{'---:|' * len(heads)}"]
    for row in rows:
        cells = [_said(row["mean"], name, column.scale) for name, column in COLUMNS.items()]
        lines.append(f"| {' | '.join([str(row['gap']), *cells])} |")
    return "\n".join(lines)


def _said(mean: Mapping[str, float], name: str, scale: float) -> str:
    share = f" ({mean[name] / mean['straight']:.2f})" if name in ("mean", "single", "best") else ""
    return f"{scale * mean[name]:.3g}{share}"


def rows_by_gap(bridge: Bridge, motions: Sequence[Motion], found: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """`by_gap`, with velocities given and not, of a model that may do without; nothing of another."""
    return {word: by_gap(bridge, motions, word == "known") for word in ("known", "not known") if bridge.cfg.model.hide}


def card_of_gaps(rows: dict[str, list[dict[str, Any]]]) -> list[str]:
    """What a card says of them, as Markdown paragraphs."""
    told = (
        "in brackets the share of the interpolation's error. By how much the mean of ten is nearer, and the standard error of "
        "that over clips, is `gain` in `metrics.json`."
    )
    return [
        f"At gaps of several lengths, velocities at both keyframes {word}, {found[0]['windows']} windows each; {told}\n\n"
        f"{table(found)}"
        for word, found in rows.items()
    ]
