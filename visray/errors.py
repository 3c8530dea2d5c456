"""Errors that a user can put right: one line each, never a traceback."""


class UserError(Exception):
    """One or more lines, each: where, what is wrong, what would be right. The command line prints them and exits with
    2."""

    def __init__(self, *lines: str):
        super().__init__("\n".join(lines))
        self.lines = lines


class GoalWarning(UserWarning):
    """A picture has more error than was asked for."""
