"""Bodies over time: storyboards, overlaid futures. Z points up; `Motion.with_up("z")` turns other motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mwlib.body.skeleton import Skeleton
from mwlib.plots.bodies import THREE_QUARTER, AnyMotion, Array, Board, facing, poses, project
from mwlib.plots.look import named, style


@style()
def storyboard(
    rows: Mapping[str, AnyMotion] | AnyMotion,
    skeleton: Skeleton,
    *,
    fps: float,
    history: int = 0,
    frames: int | Sequence[int] = 8,
    azimuth: float | None = None,
) -> tuple[Figure, Axes]:
    """Rows of poses over time: grey while observed, black in a row called "truth", coloured in every other row.

    Args:
        rows: name -> motion, (T, C) root-relative or (T, J+1, 3) in metres; a row shorter than the longest is its end, so
            predictions of the future alone fit below the whole truth.
        fps: frames per second; times are printed in seconds, 0 at the last observed frame.
        history: observed frames H; 0 = none, and time starts at the first frame.
        frames: how many frames, or which.
        azimuth: of the camera, degrees; None looks at the body from its front right.

    Raises:
        ValueError: a motion does not fit the skeleton.
    """
    flat, total = _flat(rows, skeleton, azimuth)
    frames = _spread(frames, history, total) if isinstance(frames, int) else [frame % total for frame in frames]
    times = [seconds_text(frame, history, fps) for frame in frames]
    board = Board(skeleton, list(flat.values()), list(flat), times, sum(frame < history for frame in frames))
    for row, (name, points) in enumerate(flat.items()):
        for column, frame in enumerate(frames):
            at = frame - (total - len(points))
            if at >= 0:
                board.draw(row, column, points[at : at + 1], body_kind(name, frame, history))
    return board.fig, board.ax


@style()
def overlay_futures(
    futures: Float[Array, "S F ..."],
    skeleton: Skeleton,
    *,
    fps: float,
    truth: Float[Array, "F ..."] | None = None,
    last: AnyMotion | None = None,
    frames: Sequence[int] = (-1,),
    azimuth: float | None = None,
) -> tuple[Figure, Axes]:
    """All sampled futures at a few moments, thin and translucent, the true pose on top in black.

    Args:
        futures: (S, F, C) or (S, F, J+1, 3), metres.
        fps: frames per second; the first future frame is at +1/fps.
        truth: the true future, (F, C) or (F, J+1, 3).
        last: the last observed pose, (C,) or (J+1, 3), drawn first, in grey.
        frames: future frames to show, counted from 0; negative ones count from the end.
        azimuth: of the camera, degrees; None looks at the body from its front right.

    Raises:
        ValueError: a motion does not fit the skeleton.
    """
    bodies = {"last": last, "truth": truth, "futures": futures}
    bodies = {name: poses(motion, skeleton) for name, motion in bodies.items() if motion is not None}
    first = next(iter(bodies.values())).reshape(-1, len(skeleton), 3)[0]
    flat = {name: project(motion, _camera(azimuth, first, skeleton)) for name, motion in bodies.items()}
    frames = [frame % len(futures[0]) for frame in frames]
    times = ["0.00 s"] * ("last" in flat) + [f"+{(frame + 1) / fps:.2f} s" for frame in frames]
    sure = [points.reshape(-1, 2) for name, points in flat.items() if name != "futures"]
    motions = [flat["futures"], *([np.concatenate(sure)] if sure else [])]
    board = Board(skeleton, motions, [""], times, len(times) - len(frames))
    if "last" in flat:
        board.draw(0, 0, flat["last"][None], "observed")
    for column, frame in enumerate(frames, start=len(times) - len(frames)):
        board.draw(0, column, flat["futures"][:, frame], "predicted", max(0.15, 1 / len(futures)), 1.5)
        if "truth" in flat:
            board.draw(0, column, flat["truth"][None, frame], "truth", width=2.4)
    return board.fig, board.ax


@style()
def end_poses(
    windows: Mapping[str, tuple[Float[Array, "S F ..."], Float[Array, "F ..."]]], skeleton: Skeleton
) -> tuple[Figure, Axes]:
    """Last frames of all sampled futures of several windows, one place per window, the true pose on top in black.

    Args:
        windows: title -> (futures (S, F, C) or (S, F, J+1, 3), truth (F, C) or (F, J+1, 3)), metres.
        skeleton: of all of them; each window is seen from the front right of its own true pose.

    Raises:
        ValueError: a motion does not fit the skeleton.
    """
    flat = []
    for futures, truth in windows.values():
        last = poses(truth, skeleton)[-1]
        view = _camera(None, last, skeleton)
        flat.append((project(poses(futures, skeleton)[:, -1], view), project(last, view)[None]))
    board = Board(skeleton, [np.concatenate(pair) for pair in flat], [""], list(windows))
    for column, (points, true) in enumerate(flat):
        board.draw(0, column, points, "predicted", max(0.15, 1 / len(points)), 1.5)
        board.draw(0, column, true, "truth", width=2.4)
    return board.fig, board.ax


def _flat(rows, skeleton: Skeleton, azimuth: float | None) -> tuple[dict[str, np.ndarray], int]:
    bodies = {name: poses(motion, skeleton) for name, motion in named(rows).items()}
    view = _camera(azimuth, next(iter(bodies.values()))[0], skeleton)
    return {name: project(motion, view) for name, motion in bodies.items()}, max(map(len, bodies.values()))


def _camera(azimuth: float | None, pose: np.ndarray, skeleton: Skeleton) -> float:
    return facing(pose, skeleton) + THREE_QUARTER if azimuth is None else azimuth


def body_kind(name: str, frame: int, history: int) -> str:
    """How a body is drawn: observed, truth or predicted."""
    return "observed" if frame < history else "truth" if name == "truth" else "predicted"


def seconds_text(frame: int, history: int, fps: float) -> str:
    """The time of a frame, 0 at the last observed one."""
    time = (frame - max(history - 1, 0)) / fps
    return f"{time:+.2f} s".replace("-", "\N{MINUS SIGN}") if time else "0.00 s"


def _spread(count: int, history: int, total: int) -> list[int]:
    """Evenly spread frames; with a history, its first and last frame and the very last one are always among them."""
    past = min(max(2, round(count * history / total)), history) if history else 0
    seen = np.linspace(0, history - 1, past)
    coming = np.linspace(history - 1, total - 1, count - past + 1)[1:] if history else np.linspace(0, total - 1, count)
    return np.unique(np.round(np.concatenate([seen, coming])).astype(int)).tolist()
