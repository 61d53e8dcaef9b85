"""Sliders, menus and boxes over figure functions. Thin shells: they build controls and redraw; the pictures come from `plots`."""

import os
import time
from collections.abc import Callable

from IPython.display import display
from ipywidgets import Checkbox, HBox, IntRangeSlider, IntSlider, Label, Text, VBox, interactive
from ipywidgets.widgets.widget_description import DescriptionWidget
from matplotlib.figure import Figure

from mwlib.plots import Player, show

FigureFunction = Callable[..., tuple[Figure, object] | Player]
PlayerFunction = Callable[[int, int, int], Player]


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


def keyframes(look: PlayerFunction, frames: int, between: tuple[int, int], start: tuple[int, int]) -> VBox | None:
    """Two keyframes to drag along the frames of a clip, and above them the player of what lies between, made anew each time.

    As many frames lie between as in the clip, or within `between` the nearest number to that; untick the box to choose it.

    Args:
        look: takes the numbers of two frames and N, the frames between, and returns a `Player`. What it raises is told in a line,
            and the last player stays.
        frames: of the clip.
        between: the least and the most N.
        start: the keyframes at first.

    Returns:
        As `explore`; the children are the player's box, the two handles, a row of box and slider for N, and a line of text.
    """
    if _static():
        return None
    stage, told, wide = VBox(), Label(), {"width": "100%"}
    pair = IntRangeSlider(value=start, min=0, max=frames - 1, description="keyframes", continuous_update=False, layout=wide)
    follows = Checkbox(True, description="N as in the clip", indent=False)
    number = IntSlider(min=between[0], max=between[1], description="N", continuous_update=False)

    def redraw(_: object = None) -> None:
        """Draw what the controls say now."""
        first, last = pair.value
        wanted = min(max(last - first - 1, between[0]), between[1])
        number.disabled = follows.value
        if follows.value and number.value != wanted:
            number.value = wanted  # which comes back here
            return
        began = time.perf_counter()
        try:
            made = look(first, last, number.value).widget()
        except Exception as error:
            told.value = f"{type(error).__name__}: {error}"
            return
        told.value = f"frames {first} and {last}, {number.value} between: made in {time.perf_counter() - began:.1f} s"
        old, stage.children = stage.children, (made,)
        for each in old:
            each.close()

    for control in (pair, follows, number):
        control.observe(redraw, "value")
    redraw()
    return VBox([stage, pair, HBox([follows, number]), told])


def _static() -> bool:
    return os.environ.get("MW_STATIC") == "1"


def _redrawing(figure_function: FigureFunction) -> Callable[..., None]:
    """Draw and show; what goes wrong is told in one line, a reader at a slider has no use for a trace."""
    name = getattr(figure_function, "__name__", "").strip("<>_")
    shown: dict[str, object] | None = None

    def redraw(**values: object) -> None:
        """Draw what the controls say now."""
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
