"""Bodies that move without end, as one picture: in a notebook's stored output, in a README, on a page without scripts."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

from mwlib.body.skeleton import Skeleton
from mwlib.files import write_atomic
from mwlib.plots.bodies import THREE_QUARTER, Board, draw_bodies, facing, project
from mwlib.plots.look import FAINT, OBSERVED, PREDICTED, WIDTH, style
from mwlib.plots.save import described
from mwlib.plots.skeletons import body_kind, seconds_text
from mwlib.plots.stage import Actor, Shown, Stage, stage

COLOURS = 24  # of the palette; bodies have few, and the rest smooth their edges
MOST_BYTES = 300_000  # of the animated PNG
NARROWEST = 240  # pixels
REST = 1.0  # seconds that the last picture stays
BAR = 0.2  # inches below the bodies for the line that tells the time
MARGIN = 0.015  # of the width, beside that line
SHADOW = "#d9dce1"
FORMATS = {".png": "PNG", ".webp": "WEBP", ".gif": "GIF"}


class Loop:
    """Pictures that follow each other without end; `loop` makes one. It shows itself in a notebook.

    In a notebook it is an animated PNG under the type of a still one: Jupyter, GitHub, nbconvert and Sphinx all show it, what
    knows no animation shows the first picture, and the course's notebooks keep it with its alternative text.

    Attributes:
        alt: the alternative text.
        milliseconds: how long each picture stays.
    """

    def __init__(self, pictures: Sequence[Image.Image], milliseconds: Sequence[int], alt: str) -> None:
        self._pictures, self.milliseconds, self.alt = [*pictures], [*milliseconds], alt

    @classmethod
    def of_figures(cls, figures: Iterable[Figure], milliseconds: int, alt: str) -> Self:
        """Figures of one size as pictures of one palette; the last one stays a second.

        Raises:
            ValueError: the alternative text is empty.
        """
        alt, pictures = described(alt), _same_palette([_photographed(figure) for figure in figures])
        return cls(pictures, [milliseconds] * (len(pictures) - 1) + [round(1000 * REST)], alt)

    def __len__(self) -> int:
        return len(self._pictures)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self._pictures[0].size

    def encoded(self, ending: str = ".png") -> bytes:
        """The content of a file: ".png" (animated, no loss), ".webp" (smallest) or ".gif" (for old programs).

        Raises:
            ValueError: another ending.
        """
        if ending not in FORMATS:
            raise ValueError(f"the ending is {ending!r}; expected one of {', '.join(FORMATS)}")
        buffer, (first, *others) = io.BytesIO(), self._pictures
        own = {".webp": {"lossless": True, "quality": 60, "method": 4}, ".gif": {"disposal": 1}, ".png": {"compress_level": 9}}[
            ending
        ]
        timing = {"save_all": True, "append_images": others, "duration": self.milliseconds, "loop": 0}
        first.save(buffer, FORMATS[ending], **timing, **own)
        return buffer.getvalue()

    def save(self, path: str | Path) -> Path:
        """Write a file, whole or not at all; its ending says which kind.

        Raises:
            ValueError: another ending than .png, .webp or .gif.
        """
        write_atomic(Path(path), self.encoded(Path(path).suffix.lower()))
        return Path(path)

    def _repr_mimebundle_(
        self, include: object = None, exclude: object = None
    ) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
        """For a notebook: the picture, and its alternative text where no picture can be shown."""
        return {"image/png": base64.b64encode(self.encoded()).decode(), "text/plain": self.alt}, {"image/png": {"alt": self.alt}}


def loop(
    motions: Mapping[str, Shown] | Sequence[Shown] | Shown,
    skeleton: Skeleton | None = None,
    *,
    fps: float | None = None,
    history: int = 0,
    alt: str,
    azimuth: float | None = None,
    pictures_per_second: float = 12.5,
    width: int = 600,
    most_bytes: int = MOST_BYTES,
) -> Loop:
    """Bodies side by side as a looping picture, at true speed; each stays on its spot, and its shadow lies on the floor.

    Bodies are grey while observed, black when named "truth", coloured otherwise, as in `storyboard`. Three seconds of four
    bodies take about 300 kB.

    Args:
        motions, skeleton, fps, history: as for `mwlib.plots.player`.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        azimuth: of the camera, degrees; None looks at the body from its front right.
        pictures_per_second: at most; frames between are left out.
        width: of a picture of many bodies, pixels; fewer take less.
        most_bytes: of the animated PNG; a larger one is made again, narrower.

    Raises:
        TypeError, ValueError: as `mwlib.plots.player`; or the alternative text is empty, the rate is not positive, or even a
            picture 240 pixels wide is too large.
    """
    shown = stage(motions, skeleton, fps, history)
    how = {"pictures_per_second": pictures_per_second, "width": width, "most_bytes": most_bytes}
    return loop_of(shown, history=history, alt=alt, azimuth=azimuth, **how)


def loop_of(
    shown: Stage,
    *,
    history: int,
    alt: str,
    azimuth: float | None = None,
    pictures_per_second: float = 12.5,
    width: int = 600,
    most_bytes: int = MOST_BYTES,
) -> Loop:
    """`loop`, of bodies that stand ready.

    Raises:
        ValueError: as `loop`.
    """
    alt = described(alt)
    if not pictures_per_second > 0:
        raise ValueError(f"pictures_per_second is {pictures_per_second}; expected a positive number")
    step = max(1, round(shown.fps / pictures_per_second))
    frames = [*range((shown.frames - 1) % step, shown.frames, step)]  # the last frame is among them
    milliseconds = [round(1000 * step / shown.fps)] * (len(frames) - 1) + [round(1000 * REST)]
    while True:
        made = Loop(_same_palette([*_drawn(shown, frames, history, azimuth, width)]), milliseconds, alt)
        size = len(made.encoded())
        if size <= most_bytes:
            return made
        if width <= NARROWEST:
            raise ValueError(f"the loop takes {size} bytes, {width} pixels wide; expected {most_bytes}: show a shorter motion")
        width = max(NARROWEST, int(0.95 * width * most_bytes / size))  # lines grow with the width, not with the area


@style()
def _drawn(shown: Stage, frames: Sequence[int], history: int, azimuth: float | None, width: int) -> Iterator[Image.Image]:
    """Each moment as a picture; what stands still is drawn once."""
    first = next(iter(shown.actors.values()))
    view = facing(first.positions[0], first.skeleton) + THREE_QUARTER if azimuth is None else azimuth
    bodies = {name: _flat(actor, view) for name, actor in shown.actors.items()}
    board = Board(first.skeleton, [body.points for body in bodies.values()], [""], [*bodies])
    board.fig.set_dpi(width / WIDTH)
    _lift(board)
    line, text = _timeline(board.fig, history, shown.frames)
    canvas = FigureCanvasAgg(board.fig)
    canvas.draw()
    still = canvas.copy_from_bbox(board.fig.bbox)
    for frame in frames:
        canvas.restore_region(still)
        text.set_text(seconds_text(frame, history, shown.fps) + "  observed" * (frame < history))
        line.set_xdata((MARGIN, MARGIN + (1 - 2 * MARGIN) * frame / max(shown.frames - 1, 1)))
        artists: list[Artist] = [line, text]
        for column, (name, body) in enumerate(bodies.items()):
            at = frame - shown.actors[name].start
            if at >= 0:
                artists += _standing(board, column, body, min(at, len(body.points) - 1), body_kind(name, frame, history))
        for artist in artists:
            board.fig.draw_artist(artist)
        for artist in artists[2:]:
            artist.remove()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _lift(board: Board) -> None:
    """Make room below the bodies."""
    (wide, high), place = board.fig.get_size_inches(), board.ax.get_position()
    board.fig.set_size_inches(wide, high + BAR)
    board.ax.set_position((place.x0, BAR / (high + BAR), place.width, place.height * high / (high + BAR)))


class _Flat(NamedTuple):
    """A body and its shadow as the camera sees them, (T, J+1, 2) metres."""

    points: np.ndarray
    shadow: np.ndarray
    skeleton: Skeleton


def _flat(actor: Actor, view: float) -> _Flat:
    """The root stays above one spot of the floor."""
    centred = actor.positions - actor.positions[:, :1] * np.array([1.0, 1.0, 0.0])
    return _Flat(project(centred, view), project(centred * np.array([1.0, 1.0, 0.0]), view), actor.skeleton)


def _standing(board: Board, column: int, body: _Flat, at: int, kind: str) -> list[Artist]:
    """The artists of a body on its place, the shadow first."""
    place = np.array([column * board.spacing, 0.0])
    lines = list((body.shadow[at] + place)[list(body.skeleton.bones)])
    shadow = LineCollection(lines, colors=SHADOW, linewidths=5, capstyle="round", zorder=0)
    return [
        board.ax.add_collection(shadow, autolim=False),
        *draw_bodies(board.ax, body.points[at : at + 1] + place, body.skeleton, kind),
    ]


def _timeline(fig: Figure, history: int, frames: int) -> tuple[Line2D, Text]:
    """What tells the time: a line that grows over the observed past and the future, and the seconds."""
    y, ends = 0.5 * BAR / fig.get_figheight(), (MARGIN, 1 - MARGIN)
    fig.add_artist(Line2D(ends, (y, y), color=FAINT, linewidth=3))
    if history:
        seen = MARGIN + (1 - 2 * MARGIN) * (history - 1) / max(frames - 1, 1)
        fig.add_artist(Line2D((MARGIN, seen), (y, y), color=OBSERVED, linewidth=3))
    line = Line2D(ends, (y, y), color=PREDICTED, linewidth=3, animated=True)
    fig.add_artist(line)
    text = fig.text(MARGIN, 0.99, "", va="top", animated=True)
    return line, text


def _photographed(figure: Figure) -> Image.Image:
    surface = FigureCanvasAgg(figure)
    surface.draw()
    return Image.fromarray(np.asarray(surface.buffer_rgba())[..., :3].copy())


def _same_palette(pictures: Sequence[Image.Image]) -> list[Image.Image]:
    """In the colours of the first, the middle and the last picture: a change is stored only where something moves."""
    some = [pictures[i] for i in sorted({0, len(pictures) // 2, len(pictures) - 1})]
    sheet = Image.new("RGB", (some[0].width, some[0].height * len(some)))
    for row, picture in enumerate(some):
        sheet.paste(picture, (0, row * picture.height))
    colours = np.array(sheet.quantize(COLOURS, dither=Image.Dither.NONE).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) >= 248] = 255  # the page's white, which a mean of colours is not quite
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
