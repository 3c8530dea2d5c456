"""The command `visray surfaces`: what is known of the known surfaces, and a sheet with a picture of each."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from visray.cli import candidates
from visray.cli.options import INTERRUPTED, Integer, Json, app, parse_list, parse_size
from visray.errors import UserError
from visray.terminal import write_json, write_line


@app.command
def surfaces(
    name: Annotated[
        str | None, Parameter(help="The name of a surface. Default: all.", completer=candidates.surfaces)
    ] = None,
    /,
    *,
    sheet: Annotated[
        Path | None,
        Parameter(help="Write a contact sheet to this .png file: a picture of each surface, with its name."),
    ] = None,
    size: Annotated[
        str | None, Parameter(help="With --sheet: WIDTHxHEIGHT of each picture in pixels. Default: 240x240.")
    ] = None,
    columns: Annotated[
        Integer | None, Parameter(help="With --sheet: number of pictures side by side. Default: as for a page.")
    ] = None,
    only: Annotated[
        str | None,
        Parameter(help="Names of surfaces, separated by commas. Default: all.", show_default=False),
    ] = None,
    json: Json = False,
) -> int:
    """List the known polynomial surfaces, or tell of one.

    The list has the degree, the number of real singular points in the clip, and the parameters of each. Given a
    NAME, also its formula, its source, and how to render it. With --sheet: a picture of each. Ctrl-C keeps the
    pictures that are finished.
    """
    from visray.polynomials.catalogue import SURFACES

    if name is not None and only is not None:
        raise UserError("--only: names surfaces, and so does the word before it; leave one out")
    wanted = tuple(map(_known, (name,) if name is not None else parse_list(only or "")))
    if only is not None and not wanted:
        raise UserError("--only: names no surface; write names, with commas between, such as heart,kummer")
    chosen = tuple(dict.fromkeys(wanted)) or tuple(SURFACES)
    if sheet is not None:
        return _draw(sheet, chosen, parse_size(size), columns, json)
    for option, value in (("--size", size), ("--columns", columns)):
        if value is not None:
            raise UserError(f"{option}: is for the pictures of --sheet; add --sheet surfaces.png, or leave it out")
    from visray.surface_picture import known_report
    from visray.tables import show

    if json:
        write_json(known_report.as_json(chosen))
    elif name is not None:
        show(known_report.single_table(chosen[0]))
    else:
        show(known_report.list_table(chosen))
        write_line("visray surfaces NAME tells more of one; visray surface NAME makes a picture of it")
    return 0


def _known(word: str) -> str:
    """The name of a known surface. Raises a UserError if a word names none."""
    from visray.hints import hint
    from visray.polynomials.catalogue import SURFACES
    from visray.surface_picture.names import advice, known_name

    if found := known_name(word):
        return found
    near = advice(word)
    raise UserError(f"surfaces: there is no surface {word!r}; {f'{near} ' if near else ''}({hint('', SURFACES)})")


def _draw(path: Path, names: tuple[str, ...], size: tuple[int, int] | None, columns: int | None, json: bool) -> int:
    """Writes the contact sheet. Returns the exit code."""
    if path.suffix.lower() != ".png":
        raise UserError(f"{path}: a contact sheet is a .png file; end the name so")
    from visray.output.files import check_writable
    from visray.surface_picture.sheet import SIZE, contact_sheet

    check_writable(path)
    drawn = contact_sheet(names, size or SIZE, columns, progress=not json)
    if not drawn.names:
        raise UserError(f"{path}: not written, because no picture was finished; wait for the first one")
    drawn.write(path)
    if json:
        write_json(drawn.as_json() | {"output": str(path)})
    else:
        missing = f" of {len(names)}" if drawn.stopped else ""
        write_line(f"{path}: written, with {len(drawn.names)}{missing} surfaces")
    return INTERRUPTED if drawn.stopped else 0
