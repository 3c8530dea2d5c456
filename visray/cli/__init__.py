"""The command line. Only this package imports cyclopts."""

from visray.cli.program import main

__all__ = ["main"]
