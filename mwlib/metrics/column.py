"""How a metric appears in a table."""

from __future__ import annotations

from typing import NamedTuple


class Column(NamedTuple):
    """A metric's column: heading, which values are better ("lower", "higher" or ""), and the factor to the unit shown.

    >>> Column("bone jitter (mm)", scale=1000.0)
    Column(heading='bone jitter (mm)', better='', scale=1000.0)
    """

    heading: str
    better: str = ""
    scale: float = 1.0
