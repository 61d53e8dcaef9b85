"""Pictures as wide as a column of a paper, in its font, as MWLIB_COLUMN and MWLIB_FONT ask for."""

import io
import os
import re
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_pdf import Op, PdfFile, RendererPdf
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont

COLUMN, FONT = "MWLIB_COLUMN", "MWLIB_FONT"
INCHES = {"": 1.0, "in": 1.0, "cm": 1 / 2.54, "mm": 1 / 25.4}
SMALLEST = 0.7  # own choice: of the size on a screen, so 7 points for most texts; smaller ones are hard to read on paper


def column() -> float | None:
    """Inches of the column that pictures for print are to fit; None where nobody said.

    Raises:
        ValueError: MWLIB_COLUMN is no length from 2 to 12 inches.
    """
    said = os.environ.get(COLUMN, "").strip()
    found = re.fullmatch(r"(\d+\.?\d*) ?(in|cm|mm|)", said)
    if said and not (found and 2 <= float(found[1]) * INCHES[found[2]] <= 12):
        raise ValueError(f"{COLUMN} is {said!r}; expected the width of a column such as 3.3in or 84mm, 2 to 12 inches")
    return float(found[1]) * INCHES[found[2]] if found else None


def fonts() -> Any:
    """Settings of matplotlib for the font that is asked for; none where nobody did.

    Raises:
        ValueError: this machine does not have the font that MWLIB_FONT names.
    """
    if not (font := os.environ.get(FONT, "").strip()):
        return {}
    try:
        findfont(font, fallback_to_default=False)
    except ValueError:
        known = "STIXGeneral (like Times), DejaVu Serif and DejaVu Sans, which come with matplotlib"
        raise ValueError(
            f"{FONT} is {font!r}, which is not installed; expected a font of this machine, such as {known}"
        ) from None
    return {"font.sans-serif": [font, "DejaVu Sans"], "mathtext.fontset": "stix"}


def printed(fig: Figure, wide: float, metadata: dict[str, Any]) -> bytes:
    """A figure as a PDF page of the width of a column.

    It is laid out anew on a smaller sheet, then the whole page is made smaller, but texts not below `SMALLEST` of their size.
    Sizes and layout of the figure stay as they were.

    Args:
        wide: inches; a narrower figure stays as wide as it is.
        metadata: of the file.
    """
    (width, tall), buffer = map(float, fig.get_size_inches()), io.BytesIO()
    scale = max(SMALLEST, min(1.0, wide / width))
    sheet = min(wide / scale, width)
    layout = fig.get_layout_engine()
    # Texts are larger beside the rest now, and curves leave them more room; bodies and given places keep their proportions.
    is_free = layout and all(axes.get_aspect() == "auto" for axes in fig.axes)
    height = tall * (sheet / width) ** (0.5 if is_free else 1)
    dpi = fig.dpi
    fig.dpi = 72  # units of a page
    try:
        fig.set_size_inches(sheet, height)
        if layout:
            with mpl.rc_context(fonts()):
                layout.execute(fig)
            fig.set_layout_engine("none")
        page = PdfFile(buffer, metadata=metadata)
        page.newPage(scale * sheet, scale * height)
        page.width, page.height = sheet, height  # what lies beyond is cut off
        page.output(scale, 0, 0, scale, 0, 0, Op.concat_matrix)
        renderer = RendererPdf(page, 72, height, sheet)
        with mpl.rc_context(fonts()):
            fig.draw(renderer)
        renderer.finalize()
        page.finalize()
        page.close()
    finally:
        fig.dpi = dpi
        fig.set_size_inches(width, tall)
        fig.set_layout_engine(layout) if layout else None
    return buffer.getvalue()
