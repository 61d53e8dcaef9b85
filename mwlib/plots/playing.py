"""Three-dimensional player of motions for notebooks and web pages; nothing is fetched from anywhere."""

from __future__ import annotations

import base64
import gzip
import html
import json
import os
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Float

from mwlib.body.skeleton import Skeleton
from mwlib.files import write_atomic
from mwlib.hashing import sha256
from mwlib.plots.bodies import COLOURS, ELEVATION, body_kind, camera, heads_of, numbers_of, sides_of
from mwlib.plots.look import CYCLE
from mwlib.plots.loops import Film, Loop, Shown, film, loop, placed_pose
from mwlib.plots.saving import described
from mwlib.settings import Positive

if TYPE_CHECKING:
    from mwlib.plots.player_widget import PlayerWidget


ASSETS = Path(__file__).with_name("assets")
BUNDLE = ASSETS / "player.js"
SOURCES = ("player.src.js", "scene.src.js", "player.css", "package.json", "package-lock.json")
RECORD = "// sources "  # the bundle's first line: this, and `sources_hash`

# The first copy on a page serves all its players; a page may hold players of several versions, each with its own key.
LOAD = """
function load(key, packed) {
  const unpack = async () => {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const code = new Blob([await new Response(stream).text()], { type: "text/javascript" });
    return import(URL.createObjectURL(code));
  };
  if (packed) globalThis[key] ??= unpack();
  return globalThis[key];
}
"""
FILL = """
const ready = document.readyState === "loading" && new Promise((go) => document.addEventListener("DOMContentLoaded", go));
Promise.all([load(%(key)s, %(packed)s), ready]).then(([player]) => player?.mountAll(%(key)s));
"""


def sources_hash() -> str:
    """SHA-256 over what the bundle is built of; line ends do not count."""
    texts = {name: (ASSETS / name).read_text(encoding="utf-8") for name in SOURCES}
    return sha256(f"{name}\n{len(text)}\n{text}" for name, text in texts.items())


@lru_cache(maxsize=1)
def packed() -> tuple[str, str]:
    """A key that tells bundles apart, and the bundle as base64 of gzip."""
    code = BUNDLE.read_bytes()
    return f"mwlibPlayer_{sha256([code])[:12]}", base64.b64encode(gzip.compress(code, 9, mtime=0)).decode()


def script(embed: bool) -> str:
    """A script element that fills the players of its page; without the bundle it needs another that has it."""
    key, code = packed()
    return f"<script>(() => {{{LOAD}{FILL % {'key': json.dumps(key), 'packed': json.dumps(code if embed else '')}}}})();</script>"


ShownAs = Literal["widget", "html", "loop"]
MILLIMETRE, LARGEST = 0.001, 32767  # positions are int16
LONG_WAY = 2.5  # metres; a body that goes farther is followed
# Own choice for dark pages: the same hues, light enough for 4.5:1 on #1b1f26.
DARK = {"observed": ("#8b929c",) * 3, "truth": ("#f2f4f7",) * 3, "predicted": ("#aab2bf", "#58a6e0", "#f58a45")}
THEMES = {
    "light": {**COLOURS, "grid": "#9aa1ab", "shadow": 0.25, "ghost": CYCLE[4], "paper": "#ffffff"},
    "dark": {**DARK, "grid": "#5b6472", "shadow": 0.5, "ghost": "#c68bf0", "paper": "#1b1f26"},
}
PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ margin: 0 auto; padding: 12px; max-width: 1100px; font-family: system-ui, sans-serif; background: #fff; color: #22262e; }}
@media (prefers-color-scheme: dark) {{ body {{ background: #12151a; color: #e8ebf0; }} }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


class Player:
    """Bodies that move, seen from any side; shows itself in a notebook. `player` makes one.

    Attributes:
        payload: all that the browser gets; JSON values.
        alt: the alternative text.
    """

    def __init__(self, shown: Film, payload: Mapping[str, Any], shown_as: ShownAs | None = None) -> None:
        self._stage, self._shown_as = shown, shown_as
        self.payload: dict[str, Any] = json.loads(json.dumps(payload))  # as the browser will see it
        self.alt: str = self.payload["alt"]

    def html(self, embed: bool = True) -> str:
        """The player as a piece of HTML that stands alone: in a page, in a notebook's output, in documentation.

        Args:
            embed: take the player's program along (200 kB). One copy on a page is enough for all.
        """
        said = json.dumps(self.payload, separators=(",", ":")).replace("<", "\\u003c")
        data = f'<script type="application/json">{said}</script>'
        label = html.escape(self.alt)
        return (
            f'<div class="mwlib-player" data-bundle="{packed()[0]}" role="group" aria-label="{label}">'
            f"<p>{label}</p>{data}</div>\n{script(embed)}"
        )

    def save_html(self, path: str | Path, *others: Player, title: str = "Motions") -> Path:
        """Write a page that needs no server and no network; other players follow below, and share the program.

        Args:
            path: of the file.
            others: players that stand on the same page.
            title: of the page.

        Returns:
            The path.
        """
        parts = [player.html(embed=player is self) for player in (self, *others)]
        write_atomic(Path(path), PAGE.format(title=html.escape(title), body="\n".join(parts)))
        return Path(path)

    def loop(self, **options: Any) -> Loop:
        """The same bodies as a looping picture; options as for `mwlib.plots.loop`."""
        return loop(self._stage, **{"alt": self.alt, **options})

    def widget(self) -> PlayerWidget:
        """A widget whose `frame`, `playing` and `speed` follow the player and steer it; needs a running notebook.

        Raises:
            ModuleNotFoundError: anywidget is not installed.
        """
        from mwlib.plots.player_widget import PlayerWidget  # needs what only notebooks have

        key, bundle = packed()
        return PlayerWidget(key=key, bundle=bundle, payload=self.payload, speed=self.payload["speed"])

    _repr_html_ = html  # for tools that show HTML

    def _ipython_display_(self) -> None:
        from IPython.display import display  # at hand in every notebook; the library itself does without

        shown_as = "loop" if os.environ.get("MW_STATIC") == "1" else self._shown_as or _live()
        if shown_as == "html":
            display({"text/html": self.html(), "text/plain": self.alt}, raw=True)
        else:
            display(self.loop() if shown_as == "loop" else self.widget())


def player(
    motions: Mapping[str, Shown] | Sequence[Shown] | Shown,
    skeleton: Skeleton | None = None,
    *,
    fps: float | None = None,
    history: int = 0,
    layout: Literal["side", "overlay"] = "side",
    keyframes: Sequence[int] | Mapping[int, Shown] = (),
    azimuth: float | None = None,
    speed: Positive = 1.0,
    loop: bool = True,
    autoplay: bool = True,
    follow: bool | None = None,
    height: int = 420,
    alt: str | None = None,
    shown_as: ShownAs | None = None,
) -> Player:
    """Play motions in three dimensions: turn them with the mouse or a finger, stop, search, slow down, lay them over each other.

    Bodies are grey while observed, black when named "truth", coloured otherwise: left limbs blue, right limbs orange and
    striped. Keys, when the player has the focus: space, arrows, Home and End, shift with arrows to turn, l, o, f, r as the
    buttons say. It starts paused for readers whose system asks for less motion.

    Positions are kept as whole millimetres, or coarser where they reach beyond 32 m: 34 kB for 5 s of 17 joints at 50 Hz.

    Args:
        motions: a `Motion`, a list of them, an array, or a mapping from names to these. An array is (T, 3J) about the root or
            (T, J+1, 3), metres, z up; with a further axis in front it is several motions. With a history, a motion that is
            shorter than the longest is its end, as in `storyboard`.
        skeleton: of the arrays; a `Motion` has its own.
        fps: frames per second of the arrays, and of the film; None takes that of the first `Motion`.
        history: observed frames H; time 0 is the last of them.
        layout: side by side, or one over the other. The reader can change it.
        keyframes: frames to mark on the bar; each body's pose there stands as a ghost. A mapping gives the poses: frame ->
            (3J,), (J+1, 3) or a `Motion` of one frame. Negative frames count from the end.
        azimuth: of the camera at first, degrees; None looks at the body from its front right.
        speed: times true speed.
        loop: begin again after the last frame.
        autoplay: begin when the page is shown.
        follow: keep the bodies in the middle of their panels; None does if one goes farther than 2.5 m.
        height: of the picture, pixels.
        alt: what the player shows, for someone who cannot see it; None counts the motions and names them.
        shown_as: in a notebook: "widget" (which needs a running kernel), "html" (stands alone, and stays in the saved notebook)
            or "loop" (a picture that moves). None: a widget where a kernel runs and anywidget is installed, else HTML. With
            MW_STATIC=1 in the environment, which the course's own notebooks are made with, it is a loop in any case.

    Raises:
        TypeError: something is neither a motion nor an array of numbers.
        ValueError: there are no motions, a shape does not fit the skeleton, a number is not finite, an array comes without
            skeleton or rate, the history is longer than the film, a keyframe lies outside of it, or a choice is none of those
            offered.

    >>> from mwlib.data import load_motions
    >>> walk = load_motions("synthetic", fps=25)[0].cut(0, 50)
    >>> player({"truth": walk, "slower": walk.resample(12.5)}, history=10).alt
    '3-D player of 2 motions: truth, slower. 50 frames at 25 Hz, 2.0 s, the first 10 observed.'
    """
    shown = film(motions, skeleton, fps, history)
    first = next(iter(shown.actors.values()))
    marks = numbers_of(keyframes, shown.frames, "the film")
    wanders = any(np.linalg.norm(np.ptp(actor.positions[:, 0, :2], axis=0)) > LONG_WAY for actor in shown.actors.values())
    payload = {
        "alt": described(alt) if alt is not None else _counted(shown), "fps": shown.fps, "frames": shown.frames,
        "history": history, "layout": layout, "speed": speed, "loop": loop, "autoplay": autoplay, "height": height,
        "follow": wanders if follow is None else follow, "elevation": ELEVATION, "colours": THEMES,
        "azimuth": camera(first.positions[0], first.skeleton, azimuth),
        "bodies": [
            {"name": name, "kind": body_kind(name, 0, 0), "start": actor.start, **_drawn(actor.positions, actor.skeleton, shown)}
            for name, actor in shown.actors.items()
        ],
        "keyframes": sorted(marks), "ghosts": _ghosts(shown, marks, keyframes),
    }  # fmt: skip
    return Player(shown, payload, shown_as)


def _live() -> ShownAs:
    from IPython.core.getipython import get_ipython  # at hand in every notebook; the library itself does without

    return "widget" if find_spec("anywidget") and getattr(get_ipython(), "kernel", None) else "html"


def _drawn(positions: Float[np.ndarray, "T joints 3"], skeleton: Skeleton, shown: Film) -> dict[str, Any]:
    """What the browser needs to draw a body; its feet stand on the floor, not in it."""
    first = next(iter(shown.actors.values()))
    size = float(np.median(np.linalg.norm(np.ptp(first.positions, axis=1), axis=-1)))  # about its height, however it lies
    raised = positions + np.array([0.0, 0.0, 0.02 * size])
    unit = max(MILLIMETRE, float(np.abs(raised).max()) / LARGEST)
    data = base64.b64encode(np.round(raised / unit).astype("<i2").tobytes()).decode()
    of_all = {"parents": [*skeleton.parents], "sides": sides_of(skeleton), "heads": heads_of(skeleton)}
    return {**of_all, "size": size, "unit": unit, "data": data}


def _ghosts(shown: Film, marks: Mapping[int, int], keyframes: object) -> list[dict[str, Any]]:
    """Poses at the keyframes, each with the numbers of the bodies that it belongs to."""
    found: dict[str, dict[str, Any]] = {}
    for number, actor in enumerate(shown.actors.values()):
        for frame, given in marks.items():
            at = frame - actor.start
            if isinstance(keyframes, Mapping):
                pose = placed_pose(f"the pose of keyframe {given}", keyframes[given], actor)
            elif 0 <= at < len(actor.positions):
                pose = actor.positions[at]
            else:
                continue
            ghost = _drawn(pose[None], actor.skeleton, shown)
            found.setdefault(f"{frame} {ghost['data']}", {**ghost, "frame": frame, "start": 0, "of": []})["of"].append(number)
    return list(found.values())


def _counted(shown: Film) -> str:
    names, count = ", ".join(filter(None, shown.actors)), len(shown.actors)
    said = f"3-D player of {count} motion{'s' * (count > 1)}{f': {names}' * bool(names)}."
    said += f" {shown.frames} frames at {shown.fps:g} Hz, {shown.frames / shown.fps:.1f} s"
    return said + f", the first {shown.history} observed" * bool(shown.history) + "."
