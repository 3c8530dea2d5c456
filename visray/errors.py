"""Errors that a user can correct: one line each, never a traceback."""


class UserError(Exception):
    """One or more lines, each with the address, what is wrong, and what would be right. The command line prints them
    and exits with status 2."""

    def __init__(self, *lines: str):
        super().__init__("\n".join(lines))
        self.lines = lines


class GoalWarning(UserWarning):
    """A picture has a larger error than was asked for."""
