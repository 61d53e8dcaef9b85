"""Looping pictures of bodies in motion, and films of motions for them and for the player."""

from __future__ import annotations

import base64
import io
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Num
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

from mwlib.body.motion import Motion
from mwlib.body.skeleton import Skeleton
from mwlib.files import write_atomic
from mwlib.plots.bodies import Array, Board, body_kind, camera, draw_bodies, placed, poses, project, seconds_text
from mwlib.plots.look import FAINT, OBSERVED, PREDICTED, WIDTH, array, style
from mwlib.plots.saving import described
from mwlib.settings import Positive

Shown = Motion | Num[Array, "..."]
FLOOR_SHARE = 0.01  # of the frames may reach below the floor


@dataclass(frozen=True)
class Actor:
    """One body over time.

    Args:
        positions: (T, J+1, 3) metres, z up, the floor at height 0.
        skeleton: names and parents of the joints.
        start: frame of the film at which it begins.
        rooted: whether its path is known; without, the root stays on its spot.
        offset: what was subtracted from the given positions, metres.
    """

    positions: Float[np.ndarray, "T joints 3"]
    skeleton: Skeleton
    start: int
    rooted: bool
    offset: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Film:
    """All bodies of a film by name, with its rate in frames per second, its number of frames, and how many are observed."""

    actors: dict[str, Actor]
    fps: float
    frames: int
    history: int


def film(motions: object, skeleton: Skeleton | None, fps: float | None, history: int) -> Film:
    """Motions, or arrays with a skeleton and a rate, as bodies of one film.

    With a history a body that is shorter than the longest is its end, as in `storyboard`: a prediction fits beside the whole
    truth. Without, all begin together, and the shorter ones stay as they ended. Own choice: the floor is where the lowest joints
    of the first body are, one frame in a hundred aside; bodies without a root have a floor of their own.

    Args:
        motions: a `Motion`, a list of them, an array, or a mapping from names to these. An array is (T, 3J) about the root or
            (T, J+1, 3), metres, z up; with a further axis in front it is several motions. A film stays as it is.
        skeleton: of the arrays; a `Motion` has its own.
        fps: rate of the arrays, and of the film; None takes that of the first `Motion`. Motions of another rate are resampled.
        history: observed frames H.

    Raises:
        TypeError: something is neither a motion nor an array of numbers.
        ValueError: there are no motions, a shape does not fit the skeleton, a number is not finite, an array comes without
            skeleton or rate, or the history is longer than the film.
    """
    if isinstance(motions, Film):
        return motions
    given = _named(motions)
    if not given:
        raise ValueError("motions are empty; expected at least one")
    rates = [motion.fps for motion in given.values() if isinstance(motion, Motion)]
    fps = fps or next(iter(rates), None)
    if fps is None or not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps is {fps}; expected the frames per second of the arrays")
    found = {name: _standing(f"motion {name!r}" if name else "motion", each, skeleton, fps) for name, each in given.items()}
    frames = max(len(positions) for positions, _, _ in found.values())
    if not 0 <= history <= frames:
        raise ValueError(f"history is {history} frames; expected 0 to {frames}, the length of the longest motion")
    origins = {rooted: _origin(positions) for positions, _, rooted in reversed(found.values())}
    actors = {
        name: Actor(positions - origins[rooted], own, frames - len(positions) if history else 0, rooted, origins[rooted])
        for name, (positions, own, rooted) in found.items()
    }
    return Film(actors, float(fps), frames, history)


def placed_pose(name: str, pose: Shown, actor: Actor) -> Float[np.ndarray, "joints 3"]:
    """A single pose where it stands on an actor's stage.

    Args:
        name: what an error calls it.
        pose: a `Motion` of one frame, (3J,) about the root or (J+1, 3), metres.

    Raises:
        ValueError: the shape does not fit the actor's skeleton, or the actor has a root where the pose has none, or none where
            it has one.
    """
    lone = pose if isinstance(pose, Motion) else array(pose)[None]
    positions, skeleton, rooted = _standing(name, lone, actor.skeleton, None)
    if len(positions) != 1 or len(skeleton) != len(actor.skeleton):
        raise ValueError(f"{name} has {len(positions)} frames of {skeleton.name}; expected one of {actor.skeleton.name}")
    if rooted != actor.rooted:
        has = ("without its root", "with its root")
        raise ValueError(f"{name} is given {has[rooted]}, the motions {has[actor.rooted]}; expected the same of both")
    return positions[0] - actor.offset


def _named(motions: object) -> dict[str, Shown]:
    """Every motion by a name of its own; several in one array are counted."""
    if isinstance(motions, Mapping):
        items = [*motions.items()]
    else:
        several = isinstance(motions, Sequence)
        each = enumerate(motions if several else [motions], 1)
        items = [(_called(motion) or f"motion {number}" * several, motion) for number, motion in each]
    found: dict[str, Shown] = {}
    for name, motion in items:
        parts: dict[Any, Any] = {name: motion}
        if not isinstance(motion, Motion):
            values = array(motion)
            if values.ndim == 4 or values.ndim == 3 and values.shape[-1] != 3:
                parts = {f"{name} {number}".strip(): part for number, part in enumerate(values, 1)}
        for part, shown in parts.items():
            found[str(part) if part not in found else f"{part} ({len(found) + 1})"] = shown
    return found


def _called(motion: object) -> str:
    return (motion.name or motion.action) if isinstance(motion, Motion) else ""


def _standing(label: str, motion: Shown, skeleton: Skeleton | None, fps: float | None) -> tuple[np.ndarray, Skeleton, bool]:
    """Positions (T, J+1, 3) with z up, their skeleton, and whether they have a root."""
    if isinstance(motion, Motion):
        motion = motion.resample(fps or motion.fps).with_up("z")
        positions, skeleton, rooted = np.asarray(motion.positions, np.float64), motion.skeleton, True
    else:
        values = array(motion)
        if values.dtype.kind not in "fiu":
            raise TypeError(f"{label} is {type(motion).__name__} of {values.dtype}; expected a Motion or an array of numbers")
        if skeleton is None:
            raise ValueError(f"{label} is an array; expected skeleton=, to tell which joint is which")
        positions, rooted = placed(values.astype(np.float64), skeleton, label, "T")
    for frame, joint, _ in np.argwhere(~np.isfinite(positions)):
        raise ValueError(f"{label} has a number that is not finite at frame {frame}, {skeleton.joints[joint]}; expected metres")
    return positions, skeleton, rooted


def _origin(positions: np.ndarray) -> np.ndarray:
    """The place on the floor below the root's first position."""
    return np.array([*positions[0, 0, :2], np.quantile(positions[..., 2].min(axis=1), FLOOR_SHARE)])


COLOURS = 24  # of the palette; bodies have few, and the rest smooth their edges
MOST_BYTES = 300_000  # of the animated PNG
NARROWEST = 240  # pixels
REST = 1.0  # seconds that the last picture stays
BAR = 0.2  # inches below the bodies for the line that tells the time
MARGIN = 0.015  # of the width, beside that line
SHADOW = "#d9dce1"
FORMATS: dict[str, dict[str, Any]] = {  # how Pillow writes them
    ".png": {"format": "PNG", "compress_level": 9},
    ".webp": {"format": "WEBP", "lossless": True, "quality": 60, "method": 4},
    ".gif": {"format": "GIF", "disposal": 1},
}
FILM = ".mp4"


class Loop:
    """Pictures that follow each other without end; `loop` makes one. It shows itself in a notebook.

    In a notebook it is an animated PNG under the type of a still one: Jupyter, GitHub, nbconvert and Sphinx all show it, what
    knows no animation shows the first picture, and the course's notebooks keep it with its alternative text.

    Attributes:
        alt: the alternative text.
        milliseconds: how long each picture stays; the last one stays a second.

    Raises:
        ValueError: the alternative text is empty.
    """

    def __init__(self, pictures: Iterable[Image.Image], milliseconds: int, alt: str) -> None:
        self.alt = described(alt)
        self._pictures = _same_palette([*pictures])
        self.milliseconds = [milliseconds] * (len(self._pictures) - 1) + [round(1000 * REST)]

    def __len__(self) -> int:
        return len(self._pictures)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self._pictures[0].size

    def encoded(self, ending: str = ".png") -> bytes:
        """The content of a file: ".png" (animated, no loss), ".webp" (smallest), ".gif" (for old programs) or ".mp4" (by ffmpeg).

        Raises:
            ValueError: another ending; or .mp4, and there is no ffmpeg or it fails.
        """
        if ending == FILM:
            return self._film()
        if ending not in FORMATS:
            raise ValueError(f"the ending is {ending!r}; expected one of {', '.join([*FORMATS, FILM])}")
        buffer, (first, *others) = io.BytesIO(), self._pictures
        first.save(buffer, save_all=True, append_images=others, duration=self.milliseconds, loop=0, **FORMATS[ending])
        return buffer.getvalue()

    def _film(self) -> bytes:
        """An .mp4 of the pictures, once through; what plays films wants an even number of pixels."""
        program, rate = shutil.which("ffmpeg"), 1000 / self.milliseconds[0]
        if program is None:
            raise ValueError(f"the ending is '.mp4', and there is no ffmpeg; expected it on PATH, or {', '.join(FORMATS)}")
        rest = self._pictures[-1:] * max(0, round(self.milliseconds[-1] / self.milliseconds[0]) - 1)
        raw = b"".join(picture.convert("RGB").tobytes() for picture in [*self._pictures, *rest])
        shape = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", "{}x{}".format(*self.size), "-framerate", f"{rate:.9g}"]
        even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder, "film.mp4")
            command = [program, "-loglevel", "error", *shape, "-i", "-", *even, str(out)]
            done = subprocess.run(command, input=raw, capture_output=True)
            if done.returncode:
                raise ValueError(f"ffmpeg failed: {done.stderr.decode(errors='replace').strip()[-300:]}")
            return out.read_bytes()

    def save(self, path: str | Path) -> Path:
        """Write a file, whole or not at all; its ending says which kind.

        Raises:
            ValueError: as `encoded`.
        """
        write_atomic(Path(path), self.encoded(Path(path).suffix.lower()))
        return Path(path)

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> tuple[dict[str, str], dict[str, Any]]:
        """For a notebook: the picture, and its alternative text where no picture can be shown."""
        return {"image/png": base64.b64encode(self.encoded()).decode(), "text/plain": self.alt}, {"image/png": {"alt": self.alt}}


@style()
def loop(
    motions: Mapping[str, Shown] | Sequence[Shown] | Shown | Film,
    skeleton: Skeleton | None = None,
    *,
    fps: float | None = None,
    history: int = 0,
    alt: str,
    azimuth: float | None = None,
    pictures_per_second: Positive = 12.5,
    width: int = 600,
    most_bytes: int = MOST_BYTES,
) -> Loop:
    """Bodies side by side as a looping picture, at true speed; each stays on its spot, and its shadow lies on the floor.

    Bodies are grey while observed, black when named "truth", coloured otherwise, as in `storyboard`. Three seconds of four
    bodies take about 300 kB.

    Args:
        motions, skeleton, fps, history: as for `mwlib.plots.player`; or what a player shows, a `Film`, alone.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        azimuth: of the camera, degrees; None looks at the body from its front right.
        pictures_per_second: at most; frames between are left out.
        width: of a picture of many bodies, pixels; fewer take less.
        most_bytes: of the animated PNG; a larger one is made again, narrower.

    Raises:
        TypeError, ValueError: as `mwlib.plots.player`; or the alternative text is empty, the rate is not positive, or even a
            picture 240 pixels wide is too large.
    """
    shown = film(motions, skeleton, fps, history)
    step = max(1, round(shown.fps / pictures_per_second))
    frames = [*range((shown.frames - 1) % step, shown.frames, step)]  # the last frame is among them
    while True:
        made = Loop(_drawn(shown, frames, azimuth, width), round(1000 * step / shown.fps), alt)
        size = len(made.encoded())
        if size <= most_bytes:
            return made
        if width <= NARROWEST:
            raise ValueError(f"the loop takes {size} bytes, {width} pixels wide; expected {most_bytes}: show a shorter motion")
        width = max(NARROWEST, int(0.95 * width * most_bytes / size))  # lines grow with the width, not with the area


def _drawn(shown: Film, frames: Sequence[int], azimuth: float | None, width: int) -> Iterator[Image.Image]:
    """Each moment as a picture; what stands still is drawn once."""
    first = next(iter(shown.actors.values()))
    view = camera(first.positions[0], first.skeleton, azimuth)
    centred = {name: poses(actor.positions, actor.skeleton) for name, actor in shown.actors.items()}
    bodies = {name: project(np.stack([body * [1.0, 1.0, 0.0], body]), view) for name, body in centred.items()}
    everything = np.concatenate([body.reshape(-1, 2) for _, body in bodies.values()])  # no body is cut off
    everything *= np.array([1.08, 1.0])  # a head is wider than its point
    board = Board(first.skeleton, [everything], [""], [*bodies], below=BAR)
    board.fig.set_dpi(width / WIDTH)
    line, text = _timeline(board.fig, shown)
    canvas = FigureCanvasAgg(board.fig)
    canvas.draw()
    still = canvas.copy_from_bbox(board.fig.bbox)
    for frame in frames:
        canvas.restore_region(still)
        text.set_text(seconds_text(frame, shown.history, shown.fps) + "  observed" * (frame < shown.history))
        line.set_xdata(_until(frame, shown))
        artists: list[Artist] = [line, text]
        for column, (name, actor) in enumerate(shown.actors.items()):
            if frame >= actor.start:
                at = min(frame - actor.start, len(actor.positions) - 1)
                shadow, body = bodies[name][:, at] + (column * board.spacing, 0.0)
                lines = LineCollection(
                    [*shadow[[*actor.skeleton.bones]]], colors=SHADOW, linewidths=5, capstyle="round", zorder=0
                )
                artists.append(board.ax.add_collection(lines, autolim=False))
                artists += draw_bodies(board.ax, body[None], actor.skeleton, body_kind(name, frame, shown.history))
        for artist in artists:
            board.fig.draw_artist(artist)
        for artist in artists[2:]:
            artist.remove()
        yield _picture(canvas)


def _timeline(fig: Figure, shown: Film) -> tuple[Line2D, Text]:
    """What tells the time: a line that grows over the observed past and the future, and the seconds."""

    def line(frame: int, colour: str, animated: bool = False) -> Line2D:
        """From the beginning to a frame."""
        drawn = Line2D(_until(frame, shown), [0.5 * BAR / fig.get_figheight()] * 2, color=colour, linewidth=3, animated=animated)
        fig.add_artist(drawn)
        return drawn

    line(shown.frames - 1, FAINT)
    if shown.history:
        line(shown.history - 1, OBSERVED)
    return line(0, PREDICTED, animated=True), fig.text(MARGIN, 0.99, "", va="top", animated=True)


def _until(frame: int, shown: Film) -> tuple[float, float]:
    """Ends of the line that tells the time of a frame, as shares of the width."""
    return MARGIN, MARGIN + (1 - 2 * MARGIN) * frame / max(shown.frames - 1, 1)


def photographed(figure: Figure) -> Image.Image:
    """A figure as a picture, in its own size and resolution."""
    surface = FigureCanvasAgg(figure)
    surface.draw()
    return _picture(surface)


def _picture(surface: FigureCanvasAgg) -> Image.Image:
    return Image.fromarray(np.asarray(surface.buffer_rgba())[..., :3].copy())


def _same_palette(pictures: Sequence[Image.Image]) -> list[Image.Image]:
    """In the colours of the first, the middle and the last picture: a change is stored only where something moves."""
    sheet = Image.fromarray(np.vstack([np.asarray(pictures[i]) for i in sorted({0, len(pictures) // 2, len(pictures) - 1})]))
    colours = np.array(sheet.quantize(COLOURS, dither=Image.Dither.NONE).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) >= 248] = 255  # the page's white, which a mean of colours is not quite
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
