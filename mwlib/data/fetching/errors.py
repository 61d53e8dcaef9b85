"""What may go wrong with a download."""


class FetchError(OSError):
    """Data could not be had; the message says from where, what was found and what was expected."""


class NotOfferedError(FetchError):
    """The server answers, but not with the file: none there, another content, or a page in its place."""
