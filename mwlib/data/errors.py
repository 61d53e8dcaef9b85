"""The one error a motion reader raises."""


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
