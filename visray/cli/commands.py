"""All commands of the command line. `visray COMMAND --help` explains each of them."""

from visray.cli import animating, data, files, rendering, studies, surface, view  # noqa: F401 - they add commands to app
from visray.cli.options import app

__all__ = ["app"]
