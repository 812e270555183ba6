"""The error of code that cannot be traced."""


class TraceError(Exception):
    """The code cannot be traced; the text says why, and what to do instead."""

    place: str | None = None
    """file and line, if it is not the line that is being run"""
