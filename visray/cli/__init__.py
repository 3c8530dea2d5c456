"""The command line. Only this package imports cyclopts."""

from visray.cli.commands import main

__all__ = ["main"]
