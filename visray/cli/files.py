"""The commands `visray schema` and `visray import`."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from visray.cli.options import Compat, Outside, SceneFile, Setup, app, load_scene, write_or_print


@app.command
def schema(
    *,
    output: Annotated[
        Path | None, Parameter(name=("--output", "-o"), help="A .json file. Default: the schema is printed.")
    ] = None,
) -> int:
    """Print the JSON Schema of scene files.

    With it, editors complete the names of fields and explain them.
    """
    from visray.scene import load as loading

    write_or_print(json.dumps(loading.schema(), indent=2) + "\n", output)
    return 0


@app.command(name="import")
def import_command(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    output: Annotated[
        Path | None, Parameter(name=("--output", "-o"), help="A .json file. Default: the scene is printed.")
    ] = None,
) -> int:
    """Write any scene in visray's format, with all that was fitted.

    A scene of the original VisRayTrace is converted. A camera and lights that a scene does not have are fitted, and
    written too. What is written is plain JSON without comments.
    """
    loaded = load_scene(scene, setup, compat, [], allow_outside=allow_outside)
    from visray.scene.load import dump

    write_or_print(dump(loaded, output and output.parent), output)
    return 0
