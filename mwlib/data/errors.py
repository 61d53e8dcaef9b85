"""The one error a motion reader raises, and the one warning of a folder with files that raise it."""


class MotionFormatError(ValueError):
    """A motion file cannot be read.

    Args:
        file: the file at fault.
        place: where in it (line, key, column, frame).
        found: what stands there.
        expected: what should.
    """

    def __init__(self, file: object, place: str, found: str, expected: str) -> None:
        super().__init__(f"{file}, {place}: found {found}; expected {expected}")
        self.file, self.place, self.found, self.expected = str(file), place, found, expected


class BrokenFilesWarning(UserWarning):
    """Some motion files of a folder cannot be read and are left out; the message gives the reasons."""
