"""Text, numbers and number tables from files that nobody vouches for."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float, Shaped

from mwlib.data.errors import MotionFormatError
from mwlib.data.opening import MOST_BYTES, MOST_VALUES, allowed, read_bytes

LARGEST = 1e7  # no position (in any unit) or angle is larger
MOST_JOINTS = 500  # of one skeleton; a body with fingers and face has about 200
BLOCK = 2**20  # characters of text that are taken apart at a time
LONGEST_WORD = 200  # characters of a number or of a joint's name
SMALL_TEXT = 4_000_000  # bytes of a skeleton or of a list of clips; the longest at hand has 0.4 million


def read_text(path: Path, limit: int | None = None) -> str:
    """The file as UTF-8 text, unpacked, line ends as they are.

    Args:
        limit: bytes, at most; None: what the file's size allows.

    Raises:
        MotionFormatError: not UTF-8, broken packing, or absurdly large.
    """
    try:
        return read_bytes(path, allowed(MOST_BYTES, path) if limit is None else limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MotionFormatError(path, f"byte {error.start}", f"0x{error.object[error.start]:02x}", "UTF-8 text") from error


def words_of(text: str, stop: int | None = None) -> Iterator[str]:
    """Words one by one, so that a file of nothing but words is refused at the first wrong one."""
    return (match[0] for match in re.compile(r"\S+").finditer(text, 0, len(text) if stop is None else stop))


def lines_of(text: str, start: int = 0) -> Iterator[re.Match[str]]:
    """Lines that are not empty, one by one, whichever way they end."""
    return re.compile(r"[^\r\n]+").finditer(text, start)


def blocks_of(text: str, start: int, breaks: str) -> Iterator[str]:
    """The text from `start` on in pieces of about BLOCK characters, each cut after one of the characters `breaks`.

    Raises:
        ValueError: there is none of them for BLOCK characters.
    """
    while start < len(text):
        stop = start + BLOCK
        if stop < len(text):
            stop = 1 + max(text.rfind(character, start, stop) for character in breaks)
            if stop <= start:
                raise ValueError(f"more than {BLOCK} characters without a break")
        yield text[start:stop]
        start = stop


def number_table(
    text: str, columns: int, file: Path, place: str, delimiter: str | None = None, start: int = 0
) -> Float[np.ndarray, "rows {columns}"]:
    """Lines of numbers as one array; the text before `start` is left out.

    Raises:
        MotionFormatError: no line, a word that is no number, another number of columns, a number out of bounds, or more numbers
            than the file's size allows.
    """
    expected = f"lines of {columns} numbers"
    tables: list[np.ndarray] = []
    rows, most = 0, allowed(MOST_VALUES, file)
    try:
        for block in blocks_of(text, start, "\r\n"):
            if not block.isspace():
                tables.append(np.loadtxt(io.StringIO(block), ndmin=2, comments=None, delimiter=delimiter))
                if tables[-1].shape[1] != columns:
                    raise MotionFormatError(file, place, f"{tables[-1].shape[1]} columns", expected)
                rows += len(tables[-1])
            if rows * columns > most:
                raise MotionFormatError(file, place, f"more than {most} numbers", "at most that in a file of this size")
    except (ValueError, OverflowError) as error:
        if isinstance(error, MotionFormatError):
            raise
        found = re.sub(r"(?<=row )\d+", lambda row: str(rows + int(row[0])), str(error).split(";")[0])
        raise MotionFormatError(file, place, found[:LONGEST_WORD], expected) from error
    if not tables:
        raise MotionFormatError(file, place, "no line", expected)
    return bounded(tables[0] if len(tables) == 1 else np.concatenate(tables), file, place)


def bounded(values: Shaped[np.ndarray, "*shape"], file: Path, place: str) -> Shaped[np.ndarray, "*shape"]:
    """The same values, once they are known to be finite and of a size that a position or an angle can have.

    Raises:
        MotionFormatError: one of them is not.
    """
    good = (values >= -LARGEST) & (values <= LARGEST)  # False for nan
    if not good.all():
        at = tuple(int(i) for i in np.unravel_index(np.argmin(good), good.shape))
        raise MotionFormatError(file, f"{place}, entry {at}", str(values[at]), f"a finite number up to {LARGEST:g}")
    return values


def number(word: str, file: Path, place: str) -> float:
    """One word as a finite number of a size that makes sense.

    Raises:
        MotionFormatError: it is none.
    """
    try:
        value = float(word) if len(word) <= LONGEST_WORD else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST:
        raise MotionFormatError(file, place, repr(word[:40]), f"a finite number up to {LARGEST:g}")
    return value


def label(word: object, file: Path, place: str) -> str:
    """A name that can be written, printed and hashed.

    Raises:
        MotionFormatError: no text, one of absurd length, or half of a surrogate pair.
    """
    if not isinstance(word, str) or len(word) > LONGEST_WORD or any("\ud800" <= character <= "\udfff" for character in word):
        raise MotionFormatError(file, place, repr(word)[:60], f"a name of at most {LONGEST_WORD} characters")
    return word
