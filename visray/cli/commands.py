"""All commands of the command line. `visray COMMAND --help` explains each of them."""

# ruff: noqa: F401 - each module adds its commands to app
from visray.cli import animating, completing, data, files, new, rendering, studies, surface, surfaces, view
from visray.cli.options import app

__all__ = ["app"]
