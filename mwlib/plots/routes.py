"""Bodies along their way through the world."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import camera, draw_bodies, numbers_of, project
from mwlib.plots.look import FAINT, INK, OBSERVED, WIDTH, Panel, style

SAME = 1e-3  # metres: first poses that differ less are one pose
GAP = 0.2  # metres along the way from body to body, on average, below which they would pile up
SIDE = 0.24  # inches left and right of everything
NAME, TIMES, FOOT = 0.24, 0.22, 0.46  # inches above a row, beneath it, and beneath all of them
TALLEST, HIGHEST = 1.7, 8.4  # inches, of a row's bodies and of the figure
LEAST = 3.7, 4.9  # inches that the words at the foot take, without and with those of bodies that are spread
LABEL = 0.32  # inches that the time beneath a body takes
CLOSEST, WIDEST = 0.42, 1.1  # metres from body to body where they are spread by time


class _Row(NamedTuple):
    """One row, flat, in metres from its own left end and floor: n bodies (n, joints, 2) at their frames, a path (T, 2)."""

    skeleton: Skeleton
    frames: list[int]
    given: Collection[int]
    seconds: np.ndarray
    bodies: np.ndarray
    path: np.ndarray
    spread: bool

    @property
    def width(self) -> float:
        """Metres."""
        return float(np.ptp(self.bodies[..., 0]))


@style()
def passages(
    rows: Mapping[str, Motion] | Motion, *, every: int = 5, keyframes: Sequence[int] = (0, -1), spread: bool | None = None
) -> Panel:
    """Motions in the world, a row each: bodies every few frames along the way, one scale and a floor for all rows.

    The camera stands beside the way, where the most of it is seen; rows that begin with the same pose share it. Keyframes are
    black and thick, what lies between is light: coloured, or grey in a row called "truth". Where the bodies of a row would pile
    up, they are seen from their front right and spread along the page by time; its title, or the foot of the page, says so.

    Args:
        rows: name -> motion, of any skeleton, length, rate and up-axis; a lone motion makes one row.
        every: frames from body to body.
        keyframes: numbers of the given frames; -1 is the last.
        spread: all rows by time (True) or all at their places, with the root's path on the floor (False); None: as needed.

    Raises:
        ValueError: no rows, `every` below 1, or a keyframe that is no frame; the message names the row.
    """
    motions = {name: motion.with_up("z") for name, motion in (rows if isinstance(rows, Mapping) else {"": rows}).items()}
    if not motions or every < 1:
        raise ValueError(f"{len(motions)} rows with a body every {every} frames; expected at least one row and one frame")
    flat: dict[str, _Row] = {}
    for group in _groups(motions):
        flat |= _flatten(group, every, keyframes, spread)
    return _sheet({name: flat[name] for name in motions})


def _frames(total: int, every: int, given: Collection[int]) -> list[int]:
    """Every few frames and all keyframes; nothing else so near to a keyframe that it would hide it."""
    between = [k for k in range(0, total, every) if all(abs(k - other) > every / 2 for other in given)]
    return sorted({*between, *given})


def _groups(motions: Mapping[str, Motion]) -> list[dict[str, Motion]]:
    """Motions by the pose that they begin with."""
    groups: list[dict[str, Motion]] = []
    for name, motion in motions.items():
        for group in groups:
            first, other = motion.positions[0], [*group.values()][0].positions[0]
            if other.shape == first.shape and np.abs(other - first).max() < SAME:
                group[name] = motion
                break
        else:
            groups.append({name: motion})
    return groups


def _flatten(motions: Mapping[str, Motion], every: int, keyframes: Sequence[int], spread: bool | None) -> dict[str, _Row]:
    """Rows of one group as their camera sees them; either all of them stand at their places or none."""
    given = {name: numbers_of(keyframes, len(motion), name or "the motion") for name, motion in motions.items()}
    frames = {name: _frames(len(motion), every, given[name]) for name, motion in motions.items()}
    first = next(iter(motions.values()))
    start = first.positions[0]
    floor = np.array([*start[0, :2], min(motion.positions[..., 2].min() for motion in motions.values())])
    angle = _way([motion.positions[:, 0, :2] - start[0, :2] for motion in motions.values()])
    if spread is None:
        along = np.array([np.cos(angle), np.sin(angle)])
        gaps = [np.ptp(m.positions[frames[n], 0, :2] @ along) / max(len(frames[n]) - 1, 1) for n, m in motions.items()]
        spread = bool(np.mean(gaps) < GAP)
    view = camera(start, first.skeleton) if spread else float(np.degrees(angle)) - 90
    rows = {}
    for name, motion in motions.items():
        places = motion.positions - floor
        ground = places[:, :1] * [1.0, 1.0, 0.0]
        bodies = project(places - ground if spread else places, view)[frames[name]]
        path = project(ground[:, 0] * (not spread), view)
        rows[name] = _Row(motion.skeleton, frames[name], given[name], np.array(frames[name]) / motion.fps, bodies, path, spread)
    return rows


def _way(paths: Sequence[np.ndarray]) -> float:
    """The direction, radians, along which roots (T, 2) travel the most; its sense is that in which they get on."""
    x, y = np.linalg.svd(np.concatenate(paths), full_matrices=False)[2][0]
    onward = np.sum([path[-1] - path[0] for path in paths], axis=0) @ [x, y]
    return float(np.arctan2(y, x) if onward >= 0 else np.arctan2(-y, -x))


def _sheet(rows: dict[str, _Row]) -> Panel:
    """All rows on one axes in metres, under each other."""
    room = WIDTH - 2 * SIDE
    low = min(0.0, *(points[..., 1].min() for row in rows.values() for points in (row.bodies, row.path)))
    high = max(row.bodies[..., 1].max() for row in rows.values())
    most = (HIGHEST - FOOT) / len(rows) - NAME - TIMES
    widest = max(_fitted(row, 0.0).width for row in rows.values())
    scale = min(room / widest, min(TALLEST, most) / (high - low))  # inches per metre
    pitch = (high - low) * scale + NAME + TIMES
    height = pitch * len(rows) + FOOT
    shown = {name: _fitted(row, room / scale) for name, row in rows.items()}
    spread = [row.spread for row in rows.values()]
    wide = max(max(row.width for row in shown.values()) * scale + 2 * SIDE, LEAST[all(spread)])  # no half of it empty
    fig = Figure(figsize=(wide, height))
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set(xlim=(-SIDE / scale, (wide - SIDE) / scale), ylim=(0, height / scale))
    for number, (name, fitted) in enumerate(shown.items()):
        floor = (height - number * pitch - NAME) / scale - high
        title = f"{name} (spread by time)" if fitted.spread and not all(spread) else name
        ax.text(0, floor + high + 0.05 / scale, title, ha="left", va="bottom")
        left = -float(fitted.bodies[..., 0].min())
        _draw(ax, fitted, np.array([left, floor]), "truth" if name == "truth" else "predicted", scale)
        _times(ax, fitted, left, floor + low - 0.04 / scale, scale)
    right, foot = (wide - 2 * SIDE) / scale, 0.12 / scale
    any_given = any(row.given for row in rows.values())
    said = "time (s)" + "; keyframes are black" * any_given + "; bodies spread by time" * all(spread)
    ax.text(0, foot, said, ha="left", va="bottom")
    if not all(spread):  # a metre
        ax.plot([right - 1.0, right], [foot] * 2, color=INK, linewidth=2.0)
        ax.text(right - 0.5, foot + 0.03 / scale, "1 m", ha="center", va="bottom", size=9)
    return fig, ax


def _fitted(row: _Row, room: float) -> _Row:
    """A row whose bodies are spread by time takes the room there is, metres, but is not pressed together nor falls apart."""
    if not row.spread or len(row.frames) == 1:
        return row
    gap = np.clip((room - row.width) / (len(row.frames) - 1), CLOSEST, WIDEST)
    since = row.seconds - row.seconds[0]
    along = since / since[-1] * gap * (len(row.frames) - 1)
    return row._replace(bodies=row.bodies + along[:, None, None] * [1.0, 0.0])


def _draw(ax: Axes, row: _Row, place: np.ndarray, kind: str, scale: float) -> None:
    """The bodies of one row, keyframes on top; beneath them the root's path on the floor, or the floor alone."""
    if row.spread:
        ax.axhline(place[1], color=FAINT, linewidth=2.0, zorder=0)
    else:
        ax.plot(*(row.path + place).T, color=OBSERVED, linewidth=1.5, zorder=1)
    size = float(np.clip(scale / 0.8, 0.65, 1.0))  # thinner where bodies are small
    for given in (False, True):
        shown = [body for frame, body in zip(row.frames, row.bodies + place, strict=True) if (frame in row.given) == given]
        role, alpha, width = ("truth", 1.0, 2.2) if given else (kind, 0.4 if kind == "truth" else 0.65, 1.4)
        if shown:
            *_, heads = draw_bodies(ax, np.stack(shown), row.skeleton, role, alpha, width * size)
            heads.set(markersize=5 * size)


def _times(ax: Axes, row: _Row, left: float, height: float, scale: float) -> None:
    """Seconds beneath the keyframes, and beneath as many other bodies as there is room for."""
    written: list[float] = []
    places = zip(row.frames, row.seconds, row.bodies[:, 0, 0] + left, strict=True)
    for _, seconds, x in sorted(places, key=lambda place: place[0] not in row.given):
        if all(abs(x - other) * scale >= LABEL for other in written):
            written.append(x)
            ax.text(x, height, f"{seconds:.2f}", ha="center", va="top", size=9)
