"""All commands of the command line, in groups, each with an example. `visray COMMAND --help` explains each of them."""

# ruff: noqa: F401 - each module adds its commands to app
from inspect import getdoc

from cyclopts import Group

from visray.cli import animating, completing, data, files, new, rendering, studies, surface, surfaces, view
from visray.cli.options import app

__all__ = ["app"]

# The groups in the order of the help; for each command an example.
GROUPS = {
    "Pictures": {
        "new": "visray new ball.json",
        "render": "visray render ball.json -o ball.png --error 1% --set objects.ball.radius=2",
        "view": "visray view ball.json",
        "animate": "visray animate scenes/bouncing-balls.json -o balls.mp4 --size 480x270",
        "surface": 'visray surface "x^2 + y^2 - z^2 - a" --param a=0.5',
        "data": "visray data cities.csv --height population --color rain -o cities.png",
    },
    "What a scene does and costs": {
        "explain": "visray explain ball.json --why 320,240",
        "check": "visray check ball.json --size 320x200",
        "cost": "visray cost ball.json -o ball.html",
        "tune": "visray tune ball.json --error 1% -o tuned.json",
        "surfaces": "visray surfaces kummer",
        "stability": "visray stability --only heart,kummer",
    },
    "Files and this machine": {
        "import": "visray import first.json -o whole.json",
        "schema": "visray schema -o schema.json",
        "doctor": "visray doctor",
        "completion": 'eval "$(visray completion bash)"',
    },
}


def _arrange() -> None:
    """Puts each command into its group, with its example."""
    for place, (title, commands) in enumerate(GROUPS.items()):
        group = Group(title, sort_key=place)
        for row, (name, example) in enumerate(commands.items()):
            command = app[name]
            command.group, command.sort_key = group, row
            command.help = f"{getdoc(command.default_command)}\n\nExample: `{example}`"
    options = Group("Options", sort_key=len(GROUPS))
    for name in ("--help", "--version"):
        app[name].group = options


_arrange()
