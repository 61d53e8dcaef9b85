"""Bodies on paper: camera, board of rows and columns, storyboards, overlaid futures."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mwlib.body.kinematics import horizontal
from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.plots.look import CYCLE, FAINT, OBSERVED, TRUTH, WIDTH, Array, Look, Panel, Panels, array, canvas, style

AnyMotion = Float[Array, "..."]  # (..., C) about the root or (..., J+1, 3), metres
ELEVATION = 15.0  # degrees, as HumanMAC draws
THREE_QUARTER = -55.0  # degrees from the body's front, towards its right: it walks to the right of the page, both arms visible
# (middle, left, right) of a body; right limbs are dashed besides
COLOURS = {"observed": (OBSERVED,) * 3, "truth": (TRUTH,) * 3, "predicted": ("#5d6470", *CYCLE[:2])}
RIGHT_DASHES = (0, (2.2, 0.9))
TALLEST, LEAST, HIGHEST = 3.0, 0.85, 7.2  # inches for a row of bodies, at least, and for all of them unless rows need more
TITLE = 0.68  # inches that a time above a column takes


def placed(motion: AnyMotion, skeleton: Skeleton, label: str = "motion", axes: str = "...") -> tuple[np.ndarray, bool]:
    """Positions (..., J+1, 3), and whether their root was given; a model's motion (..., 3J) gets it back, at the origin.

    Args:
        motion: of any leading axes, or with `axes` "T" of some frames.
        label, axes: what an error calls the motion and its leading axes.

    Raises:
        ValueError: the shape fits neither.
    """
    motion, joints = array(motion), len(skeleton)
    rooted = motion.shape[-2:] == (joints, 3)
    leading = motion.shape[: -2 if rooted else -1]
    fits = rooted or motion.shape[-1:] == (3 * joints - 3,)
    if not fits or axes == "T" and (len(leading) != 1 or 0 in leading):
        takes = f"({axes}, {3 * joints - 3}) or ({axes}, {joints}, 3){' with T > 0' * (axes == 'T')}"
        raise ValueError(f"{label} has shape {motion.shape}; {skeleton.name} takes {takes}, metres")
    if rooted:
        return motion, True
    relative = motion.reshape(*leading, joints - 1, 3)
    return np.concatenate([np.zeros_like(relative[..., :1, :]), relative], axis=-2), False


def poses(motion: AnyMotion, skeleton: Skeleton) -> Float[np.ndarray, "... joints 3"]:
    """Positions (..., J+1, 3) about the root's place on the floor; a model's motion (..., 3J) gets its root back, at the origin.

    Raises:
        ValueError: the trailing shape fits neither.
    """
    positions, rooted = placed(motion, skeleton)
    return positions - positions[..., :1, :] * np.array([1.0, 1.0, 0.0]) if rooted else positions


def numbers_of(frames: Collection[int], total: int, what: str) -> dict[int, int]:
    """Numbers of frames, counted from the beginning, each with the one that was given: negative ones count from the end.

    Raises:
        ValueError: there is no such frame.
    """
    for frame in frames:
        if not -total <= frame < total:
            expected = f"0 to {total - 1}, or down to {-total} from the end"
            raise ValueError(f"keyframe {frame} is outside of {what}; expected {expected}")
    return {frame % total: frame for frame in frames}


def facing(pose: Float[np.ndarray, "joints 3"], skeleton: Skeleton) -> float:
    """Azimuth in degrees that the body faces, from its hips; 0 where the skeleton has no sides."""
    for left, right in zip(skeleton.left, skeleton.right, strict=True):
        if skeleton.parents[left] == 0:
            x, y, _ = pose[left] - pose[right]
            return float(np.degrees(np.arctan2(-x, y)))  # forward = left x up
    return 0.0


def camera(pose: Float[np.ndarray, "joints 3"], skeleton: Skeleton, azimuth: float | None = None) -> float:
    """Azimuth in degrees of a camera at the body's front right, or the given one."""
    return facing(pose, skeleton) + THREE_QUARTER if azimuth is None else azimuth


def project(positions: Float[np.ndarray, "... 3"], azimuth: float) -> Float[np.ndarray, "... 2"]:
    """Orthographic picture from a camera at this azimuth (degrees): right and up, metres.

    Own choice: flat axes instead of matplotlib's 3-D ones: sharper, far faster, and many bodies share one scale.
    """
    a, e = np.radians([azimuth, ELEVATION])
    right = [-np.sin(a), np.cos(a), 0.0]
    up = [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]
    return positions @ np.stack([right, up], axis=-1)


def draw_bodies(
    ax: Axes, points: Float[np.ndarray, "n joints 2"], skeleton: Skeleton, kind: str, alpha: float = 1.0, width: float = 1.8
) -> list[Artist]:
    """Draw n flat bodies; `kind` is observed, truth or predicted. A dot marks the head."""
    artists: list[Artist] = []
    sides = sides_of(skeleton)
    for side, colour in zip("mlr", COLOURS[kind], strict=True):
        bones = [bone for bone in skeleton.bones if sides[bone[1]] == side]
        look: Look = {"linestyles": RIGHT_DASHES, "capstyle": "butt"} if side == "r" else {"capstyle": "round"}
        lines = LineCollection([*points[:, bones].reshape(-1, 2, 2)], colors=colour, alpha=alpha, linewidths=width, **look)
        artists.append(ax.add_collection(lines, autolim=False))
    dots = points[:, heads_of(skeleton)].reshape(-1, 2)
    return artists + ax.plot(*dots.T, "o", color=COLOURS[kind][0], alpha=alpha, markeredgewidth=0)


def sides_of(skeleton: Skeleton) -> str:
    """A letter for each joint: left, right or middle."""
    return "".join("l" if joint in skeleton.left else "r" if joint in skeleton.right else "m" for joint in range(len(skeleton)))


def heads_of(skeleton: Skeleton) -> list[int]:
    """Joints that are heads."""
    return [joint for joint, name in enumerate(skeleton.joints) if name.lower() == "head"]


class Board:
    """One flat axes with a place for a body at every (row, column).

    A motion that has exploded is cut off at the edge of its place instead of shrinking all the others.

    Args:
        skeleton: of every body.
        motions: everything that will be drawn, one array (..., 2) of metres about the root per motion; they set the scale.
        labels: one per row; titles: one per column.
        observed: how many columns, from the first, lie in the past; they are shaded.
        below: room beneath the bodies, inches.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        motions: Sequence[np.ndarray],
        labels: Sequence[str],
        titles: Sequence[str],
        observed: int = 0,
        below: float = 0.0,
    ) -> None:
        self.skeleton = skeleton
        half, bottom, top = _extent(motions)
        self.spacing, self.height = 2.16 * half, 1.08 * (top - bottom)
        top += 0.04 * (top - bottom)
        margin, header = 0.3 if any(labels) else 0.0, 0.45  # inches
        row = min(TALLEST, max(LEAST, HIGHEST / len(labels)))
        scale = min((WIDTH - margin) / (self.spacing * len(titles)), row / self.height)  # inches per metre
        self.spacing = max(self.spacing, min(TITLE, (WIDTH - margin) / len(titles)) / scale)
        width = max(self.spacing * len(titles) * scale + margin, 2.4)
        height = self.height * len(labels) * scale
        whole = height + header + below
        self.fig = Figure(figsize=(width, whole))
        self.ax = self.fig.add_axes((margin / width, below / whole, 1 - margin / width, height / whole))
        self.ax.set_axis_off()
        middle, reach = (len(titles) - 1) * self.spacing / 2, (width - margin) / scale / 2
        self.ax.set(xlim=(middle - reach, middle + reach), ylim=(top - len(labels) * self.height, top), aspect="equal")
        self.top = top
        near = {"textcoords": "offset points", "annotation_clip": False}
        if observed:
            edge = (observed - 0.5) * self.spacing
            self.ax.axvspan(-0.5 * self.spacing, edge, color=FAINT, linewidth=0, zorder=0)
            self.ax.annotate("observed  ", (edge, self.top), (0, 19), ha="right", **near)
            if observed < len(titles):
                self.ax.annotate("  future", (edge, self.top), (0, 19), ha="left", **near)
        for column, title in enumerate(titles):
            self.ax.annotate(title, (column * self.spacing, self.top), (0, 5), ha="center", size=9, **near)
        for row, label in enumerate(labels):
            place = (-0.5 * self.spacing, self.top - (row + 0.5) * self.height)
            self.ax.annotate(label, place, (-5, 0), ha="right", va="center", rotation=90, **near)

    def draw(
        self, row: int, column: int, points: Float[np.ndarray, "n joints 2"], kind: str, alpha: float = 1.0, width: float = 1.8
    ) -> None:
        """Stand n bodies on one place."""
        x, y = column * self.spacing, -row * self.height
        corner = (x - self.spacing / 2, y + self.top - self.height)
        place = Rectangle(corner, self.spacing, self.height, transform=self.ax.transData)
        for artist in draw_bodies(self.ax, points + (x, y), self.skeleton, kind, alpha, width):
            artist.set_clip_path(place)


def _extent(motions: Sequence[np.ndarray]) -> tuple[float, float, float]:
    """Half width, bottom and top that hold every motion, or 1.8 times a small one where others are far larger.

    Small is the first quarter: the smallest may be a person who crouches among people who stand.
    """
    flat = [points.reshape(-1, 2) for points in motions]
    lows, highs = np.array([(points[:, 1].min(), points[:, 1].max()) for points in flat]).T
    quarter = (len(flat) - 1) // 4
    small = np.argsort(highs - lows)[quarter]
    spare = 0.4 * (highs - lows)[small]
    bottom, top = max(lows.min(), lows[small] - spare), min(highs.max(), highs[small] + spare)
    wide = sorted(np.quantile(np.abs(points[:, 0]), 0.999) for points in flat)
    return max(min(wide[-1], 1.8 * wide[quarter]), 0.22 * (top - bottom)), bottom, top


@style()
def storyboard(
    rows: Mapping[str, AnyMotion] | AnyMotion,
    skeleton: Skeleton,
    *,
    fps: float,
    history: int = 0,
    frames: int | Sequence[int] = 8,
    azimuth: float | None = None,
) -> Panel:
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
    bodies = {name: poses(motion, skeleton) for name, motion in (rows if isinstance(rows, Mapping) else {"": rows}).items()}
    view = camera(next(iter(bodies.values()))[0], skeleton, azimuth)
    flat = {name: project(motion, view) for name, motion in bodies.items()}
    total = max(map(len, flat.values()))
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
    truth: Float[Array, "F ..."],
    last: AnyMotion,
    frames: Sequence[int] = (-1,),
) -> Panel:
    """All sampled futures at a few moments, thin and translucent, the true pose on top in black.

    Args:
        futures: (S, F, C) or (S, F, J+1, 3), metres.
        fps: frames per second; the first future frame is at +1/fps.
        truth: the true future, (F, C) or (F, J+1, 3).
        last: the last observed pose, (C,) or (J+1, 3), drawn first, in grey.
        frames: future frames to show, counted from 0; negative ones count from the end.

    Raises:
        ValueError: a motion does not fit the skeleton.
    """
    view = camera(poses(last, skeleton), skeleton)
    seen, true, drawn = (project(poses(motion, skeleton), view) for motion in (last, truth, futures))
    frames = [frame % len(true) for frame in frames]
    times = ["0.00 s", *(f"+{(frame + 1) / fps:.2f} s" for frame in frames)]
    board = Board(skeleton, [drawn, np.concatenate([seen[None], true])], [""], times, observed=1)
    board.draw(0, 0, seen[None], "observed")
    for column, frame in enumerate(frames, start=1):
        board.draw(0, column, drawn[:, frame], "predicted", max(0.15, 1 / len(drawn)), 1.5)
        board.draw(0, column, true[None, frame], "truth", width=2.4)
    return board.fig, board.ax


@style()
def end_poses(windows: Mapping[str, tuple[Float[Array, "S F ..."], Float[Array, "F ..."]]], skeleton: Skeleton) -> Panel:
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
        view = camera(last, skeleton)
        flat.append((project(poses(futures, skeleton)[:, -1], view), project(last, view)[None]))
    board = Board(skeleton, [np.concatenate(pair) for pair in flat], [""], list(windows))
    for column, (points, true) in enumerate(flat):
        board.draw(0, column, points, "predicted", max(0.15, 1 / len(points)), 1.5)
        board.draw(0, column, true, "truth", width=2.4)
    return board.fig, board.ax


@style()
def pose_grid(futures: Mapping[tuple[str, str], Float[Array, "S F ..."]], skeleton: Skeleton, *, truth: AnyMotion) -> Panel:
    """The last frame of several predictions, one place for each pair of settings; the true pose on top in black.

    Args:
        futures: (row label, column title) -> samples.
        truth: (F, C) or (F, J+1, 3).
    """
    labels, titles = (list(dict.fromkeys(names)) for names in zip(*futures, strict=True))
    last = poses(truth, skeleton)[-1]
    view = camera(last, skeleton)
    flat = {place: project(poses(motion, skeleton)[:, -1], view) for place, motion in futures.items()}
    true = project(last, view)[None]
    board = Board(skeleton, [*flat.values(), true], labels, titles)
    for (row, column), points in flat.items():
        place = labels.index(row), titles.index(column)
        look = (0.6, 1.1) if len(points) > 1 else (1.0, 1.8)  # a single body is not to vanish under the true one
        board.draw(*place, points, "predicted", *look)
        board.draw(*place, true, "truth", width=1.1)
    return board.fig, board.ax


def body_kind(name: str, frame: int, history: int) -> str:
    """How a body is drawn: observed, truth or predicted."""
    return "observed" if frame < history else "truth" if name == "truth" else "predicted"


def seconds_text(frame: int, history: int, fps: float) -> str:
    """The time of a frame, 0 at the last observed one."""
    time = (frame - max(history - 1, 0)) / fps
    return f"{time:+.2f} s".replace("-", "\N{MINUS SIGN}") if time else "0.00 s"


def _spread(count: int, history: int, total: int) -> list[int]:
    """Evenly spread frames; with a history, its first and last frame and the very last one are always among them."""
    past = min(max(2, round(count * history / total)), history)
    seen = np.linspace(0, history - 1, past)
    coming = np.linspace(max(history - 1, 0), total - 1, count - past + bool(history))[bool(history) :]
    return np.unique(np.round([*seen, *coming]).astype(int)).tolist()


NARROWEST = 0.6  # metres from the middle to the edge of a picture, at least
SPARE = 0.08  # of the height, above and below


@style()
def filmstrip(motion: Motion, frames: int = 5) -> Panels:
    """A clip at a few moments, seen along both horizontal axes; left limbs and right limbs in two colours, right ones dashed.

    Nothing is turned: what the file calls up is up, and its height is the file's, in metres. Sideways the root is in the middle.
    A line marks the floor, height 0.

    Args:
        frames: how many moments, spread evenly over the clip.
    """
    at = np.unique(np.linspace(0, len(motion) - 1, frames).round().astype(int))
    across, along, up = horizontal(motion.up)
    places = motion.positions[at]
    low, high = float(places[..., up].min()), float(places[..., up].max())
    edge = SPARE * max(high - low, NARROWEST)
    sides = places - places[:, :1]
    half = max(NARROWEST, 1.08 * float(np.abs(sides[..., [across, along]]).max()))
    tall = 6.0 / len(at) * (high - low + 2 * edge) / (2 * half)
    fig, axes = canvas(2, len(at), height=2 * min(tall, 3.2) + 1.5, sharex=True, sharey=True)
    for row, axis in enumerate((across, along)):
        for column, frame in enumerate(at):
            ax, points = axes[row, column], np.stack([sides[column, :, axis], places[column, :, up]], axis=-1)
            ax.axhline(0.0, color=FAINT, linewidth=2.0, zorder=0)
            draw_bodies(ax, points[None], motion.skeleton, "predicted")
            ax.set(aspect="equal", xlim=(-half, half), ylim=(low - edge, high + edge))
            ax.set_xticks((-0.5, 0, 0.5), ("\N{MINUS SIGN}.5", "0", ".5"))
            ax.tick_params(labelbottom=True)
            if row == 0:
                ax.set_title(f"{frame / motion.fps:.2f} s")
        axes[row, 0].set_ylabel(f"{'xyz'[up]}, up (m)")
        axes[row, len(at) // 2].set_xlabel(f"{'xyz'[axis]} from the root (m)")
    fig.suptitle(f"{motion.name or 'clip'}: {motion.skeleton.name}, {len(motion)} frames at {motion.fps:g} Hz")
    return fig, axes
