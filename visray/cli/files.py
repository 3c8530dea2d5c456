"""The commands that convert: schema and import."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from visray.cli.options import Compat, Setup, app, write_or_print
from visray.scene import load as loading


@app.command
def schema(*, output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None) -> int:
    """Print the JSON Schema of scene files, or write it to a file."""
    write_or_print(json.dumps(loading.schema(), indent=2) + "\n", output)
    return 0


@app.command(name="import")
def import_command(
    scene: Path,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"), help="A .json file; else it is printed.")] = None,
) -> int:
    """Convert a scene of the original VisRayTrace, and its setup, to visray's own format."""
    write_or_print(loading.dump(loading.load(scene, setup, compat), output and output.parent), output)
    return 0
