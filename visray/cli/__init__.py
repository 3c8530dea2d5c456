"""The command line, and the only door to its library."""

from visray.cli.commands import main

__all__ = ["main"]
