"""Sliders, menus and boxes over figure functions. Thin shells: they build controls and redraw; the pictures come from `plots`."""

from __future__ import annotations

import os
from collections.abc import Callable

from IPython.display import display
from ipywidgets import HBox, IntSlider, Play, Text, VBox, interactive, interactive_output, jslink
from ipywidgets.widgets.widget_description import DescriptionWidget
from matplotlib.figure import Figure

from mwlib.plots import show
from mwlib.plots.player import Player

FigureFunction = Callable[..., tuple[Figure, object] | Player]


def explore(figure_function: FigureFunction, *, button: str = "", **controls: object) -> VBox | None:
    """Controls above a picture that is drawn anew whenever one of them changes.

    End a cell with it, after a static figure that shows the same thing.

    Args:
        figure_function: takes the controls by name and returns (fig, ax), or a player.
        button: what stands on a button that draws; "" draws at once, and at every change. For what takes seconds.
        controls: per argument (min, max) or (min, max, step) for a slider that starts in the middle, a list for a menu, a
            bool for a box to tick, or any widget.

    Returns:
        The controls and the picture; None, so that nothing is displayed, when the environment says MW_STATIC=1.

    Raises:
        ValueError: a control is none of these.
    """
    if _static():
        return None
    box = interactive(_redrawing(figure_function), {"manual": bool(button), "manual_name": button}, **controls)
    for control in box.children:
        if control.has_trait("continuous_update"):
            control.set_trait("continuous_update", False)
        if isinstance(control, DescriptionWidget):
            control.style.description_width = "initial"  # names are never cut off
        if isinstance(control, Text):
            control.layout.width = "min(100%, 40em)"  # nor is a sentence
    return box


def player(figure_function: FigureFunction, frames: int, *, pictures_per_second: float = 5.0) -> VBox | None:
    """A play button and a slider over the frames of a motion; it waits for the reader to press play.

    Args:
        figure_function: takes `frame`, from 0 to frames - 1, and returns (fig, ax).
        frames: how many there are.
        pictures_per_second: speed of the play button.

    Returns:
        As `explore`.
    """
    if _static():
        return None
    play = Play(min=0, max=frames - 1, interval=round(1000 / pictures_per_second))
    slider = IntSlider(min=0, max=frames - 1, description="frame", continuous_update=False)
    jslink((play, "value"), (slider, "value"))
    return VBox([HBox([play, slider]), interactive_output(_redrawing(figure_function), {"frame": slider})])


def _static() -> bool:
    return os.environ.get("MW_STATIC") == "1"


def _redrawing(figure_function: FigureFunction) -> Callable[..., None]:
    """Draw and show; what goes wrong is told in one line, a reader at a slider has no use for a trace."""
    name = getattr(figure_function, "__name__", "").strip("<>_")
    shown: dict[str, object] | None = None

    def redraw(**values: object) -> None:
        nonlocal shown
        if values == shown:  # who leaves a box for its button asks twice
            return
        shown = None
        try:
            drawn = figure_function(**values)
            if isinstance(drawn, Player):
                display(drawn)
            else:
                show(drawn[0], f"{name} with " + ", ".join(f"{control} = {value}" for control, value in values.items()))
            shown = values
        except Exception as error:
            print(f"{type(error).__name__}: {error}")

    return redraw
