"""Failures that a user sees as one line."""


class QuadcosimError(Exception):
    """Something went wrong; the text says what, and what was expected (exit code 1)."""


class UsageError(QuadcosimError):
    """The request cannot be carried out as it is written (exit code 2)."""


class SimulatorError(QuadcosimError):
    """An FMU refused a call; `divergence` if it says that the closed loop has diverged."""

    def __init__(self, text: str, *, divergence: bool = False, details: str = "") -> None:
        super().__init__(text)
        self.divergence = divergence
        self.details = details
        """The FMU's own traceback, for `--debug`."""
