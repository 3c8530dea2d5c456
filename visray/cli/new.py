"""The command `visray new`: a scene to begin with."""

import shlex
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from visray.cli.options import app, flag
from visray.errors import UserError
from visray.output.files import write_text
from visray.terminal import write_line


@app.command
def new(
    file: Annotated[Path, Parameter(help="The file to write: .json, or .py with --python.")] = Path("scene.json"),
    /,
    *,
    python: flag("Write a Python script in place of a scene file.") = False,
) -> int:
    """Write a small scene to begin with.

    Each part of it has a comment. A file that exists is never replaced.
    """
    from visray.starter import starter

    python = python or file.suffix.lower() == ".py"
    suffix = ".py" if python else ".json"
    if python and file == Path("scene.json"):
        file = Path("scene.py")
    if not file.suffix:
        file = file.with_name(file.name + suffix)
    if file.suffix.lower() != suffix:
        what = "a script is a .py file" if python else "a scene is a .json file, and a script a .py file"
        raise UserError(f"{file}: {what}; write {file.with_suffix(suffix)}")
    if file.exists():
        raise UserError(f"{file}: exists already, and is not replaced; choose another name")
    write_text(file, starter(file.stem, python=python))
    shown = shlex.quote(str(file))
    write_line(f"{file}: written; next: {f'python {shown}' if python else f'visray render {shown}'}")
    return 0
