"""The command `visray data`: a picture of a table without a scene file."""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from visray import clock
from visray.cli.describing import describe_table
from visray.cli.options import Integer, Json, Seconds, Share, Threads, app, flag, parse_list, parse_size
from visray.cli.picture_options import Filter, Preview, Quiet, Region, Scale, Show, Time
from visray.cli.showing import Showing
from visray.cli.standard_output import is_aside, reserve
from visray.errors import UserError
from visray.leftovers import passing_folder
from visray.terminal import write_line

if TYPE_CHECKING:
    from visray.data_picture import DataPicture

Column = Annotated[str | None, Parameter(show_default=False)]


@app.command(name="data")
def data_command(
    file: Annotated[Path, Parameter(help="A table: .csv, .tsv, .txt, or .geojson.")],
    /,
    *,
    output: Annotated[
        list[Path],
        Parameter(
            name=("--output", "-o"),
            help="A .png or .exr file; with --animate also a movie, .mp4, .gif or .webp, or a folder or shot.####.png "
            "for frames. May be given more than once. Default: the name of the table, as .png.",
            show_default=False,
        ),
    ] = [],  # noqa: B006 - only read
    height: Annotated[str | None, Parameter(help="Column shown as the height of bars.")] = None,
    radius: Annotated[str | None, Parameter(help="Column shown as the size of spheres, or the width of bars.")] = None,
    color: Annotated[str | None, Parameter(help="Column shown as colour.")] = None,
    lon: Annotated[str | None, Parameter(help="Column of longitudes. Default: found by its name.")] = None,
    lat: Annotated[str | None, Parameter(help="Column of latitudes. Default: found by its name.")] = None,
    time_column: Annotated[
        str | None, Parameter(help="Column of dates or other moments: rows of one name are then one place.")
    ] = None,
    date: Annotated[
        str | None, Parameter(help="The date that is shown, with --time-column. Default: the first one.")
    ] = None,
    held: flag(
        "With --time-column: numbers stay what they are until the next date. Else they are interpolated."
    ) = False,
    animate: Annotated[
        Seconds | None,
        Parameter(help="Length in seconds of an animation, with --time-column: from the first date to the last one."),
    ] = None,
    turns: Annotated[
        float | None,
        Parameter(help="With --animate: how often the globe turns. Default: once.", allow_leading_hyphen=True),
    ] = None,
    overwrite: flag("With --animate: replace the frames and movies that exist.") = False,
    palette: Annotated[str | None, Parameter(help="Palette of the colours, such as viridis or RdBu.")] = None,
    norm: Annotated[
        str | None, Parameter(help="Norm of the colours: linear, log, symmetric, power or quantile.")
    ] = None,
    domain: Annotated[
        str | None,
        Parameter(
            help="LOW,HIGH: values at the two ends of the colours. Default: the smallest and the largest.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    bands: Annotated[Integer | None, Parameter(help="Number of steps of the colours. Default: no steps.")] = None,
    labels: Annotated[
        str | None, Parameter(help="COLUMN=TEXT, with commas between: what the legend calls columns.")
    ] = None,
    units: Annotated[
        str | None, Parameter(help="COLUMN=UNIT, with commas between: units of columns, such as rain=mm.")
    ] = None,
    gizmo: Annotated[
        str | None, Parameter(help="Shape of a datum: cylinder, box, cone, sphere, disk, triangle or line.")
    ] = None,
    base: Annotated[
        Literal["auto", "map", "globe"], Parameter(help="What the data stand on; auto is a map around them.")
    ] = "auto",
    map: Annotated[
        Path | None, Parameter(help="A picture of the map, with --extent. Default: a plain map is drawn.")
    ] = None,
    extent: Annotated[
        str | None,
        Parameter(
            help="WEST,EAST,SOUTH,NORTH: edges of the map in degrees, such as -10,30,35,60.", allow_leading_hyphen=True
        ),
    ] = None,
    title: Annotated[str, Parameter(help="Title of the picture.", show_default=False)] = "",
    source_line: Annotated[str, Parameter(help="Line that says where the data are from.", show_default=False)] = "",
    name: Annotated[str | None, Parameter(help="Column of names. Default: found by its name.")] = None,
    places: Annotated[
        str,
        Parameter(
            help="Rows whose names are written at their places: none, all, or names with commas between. "
            "auto: all, if there are at most 15 rows."
        ),
    ] = "auto",
    save: Annotated[
        Path | None, Parameter(help="Write the scene to this .json file, and a map that was drawn next to it.")
    ] = None,
    describe: flag("Only tell what the columns of the table hold.") = False,
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels. Default: 960x540.")] = None,
    scale: Scale = None,
    region: Region = None,
    filter: Filter = None,
    spp: Annotated[Integer | None, Parameter(help="Samples per pixel. Default: 16.")] = None,
    error: Annotated[
        Share | None, Parameter(help="Take samples until the error is no larger: 0.01 or 1% is 1 % of the luminance.")
    ] = None,
    time: Time = None,
    threads: Threads = None,
    show: Show = False,
    preview: Preview = False,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Make a picture of a table of places, on a map or a globe.

    The table has longitudes and latitudes; they are shown as bars, spheres or lines. Map, camera, lights and legend
    are fitted to the data. With --save the scene becomes a file, to be changed and rendered by `visray render`.
    Without --height, --radius and --color, the first column with quantities is shown.
    """
    if describe:
        return describe_table(file, json)
    if quiet:
        warnings.simplefilter("ignore")
    showing = Showing.of(show, preview, json, output)
    outputs = showing.outputs(output, [Path(file.stem + ".png")])
    reserve(outputs, json=json, preview=showing.screen is not None)
    if save is not None:
        _check_save(save, file, outputs)
    edges = _parse_numbers("--extent", extent, "WEST,EAST,SOUTH,NORTH in degrees, such as -10,30,35,60", 4)
    ends = _parse_numbers("--domain", domain, "LOW,HIGH, two numbers, such as 0,100", 2)
    film, texts = (
        parse_size(size),
        {"labels": _parse_pairs("--labels", labels), "units": _parse_pairs("--units", units)},
    )
    from visray.data.source import table_from

    if not file.is_file():
        table_from(str(file))  # says what is wrong, before the imports that take longer
    from visray.adaptive.stopping import Goal
    from visray.cli.animating import animate_command
    from visray.cli.rendering import render_command
    from visray.data_picture import Wishes, data_picture
    from visray.output.files import check_writable
    from visray.output.image import check_destination
    from visray.output.sequence import is_for_frames
    from visray.progress import Bar

    Goal.from_arguments(error, time, spp, clock.now())
    moves = animate is not None and any(is_for_frames(path) for path in outputs)
    if moves and showing:
        raise UserError("--show and --preview: show one picture; leave them out, and open the movie or the frames")
    for path in outputs:
        if not (moves or is_aside(path)):
            check_destination(path)
        if map is not None and map.resolve() == path.resolve():
            raise UserError(f"{path}: is the picture of the map; write to another file")
    if save is not None:
        check_writable(save)
    wishes = Wishes(
        lon=lon, lat=lat, name=name, height=height, radius=radius, color=color, palette=palette, norm=norm,
        domain=ends, bands=bands, **texts,
        gizmo=gizmo, base=base, image=None if map is None else str(map), extent=edges, title=title,
        source_line=source_line, time_column=time_column, date=date, held=held, animate=animate,
        turns=turns,
        places=places if places in ("auto", "none", "all") else parse_list(places),
        spp=spp, **({} if film is None else {"size": film}),
    )  # fmt: skip
    with _scene_file(save, file.stem) as scene:
        with Bar(f"reading {file.name}", 1, not (quiet or json)):
            made = data_picture(str(file), wishes, str(_map_path(scene)))
            _write(made, scene, save is not None)
        for text in made.notes:
            warnings.warn(text, stacklevel=1)
        if not (quiet or json):
            write_line(f"{file}: " + ", ".join(f"{name} {text}" for name, text in made.choices.items()))
            if save is not None:
                write_line(f"{save}: written")
            if animate is not None and not moves:
                write_line(_how_to_animate(save, file))
        report = {"choices": made.choices, "notes": made.notes} | ({} if save is None else {"scene": str(save)})
        options = {"allow_outside": True, "output": outputs, "error": error, "time": time, "threads": threads}
        options |= {"quiet": quiet, "json": json, "more": report, "scale": scale, "region": region, "filter": filter}
        if moves:
            return animate_command(scene, overwrite=overwrite, **options)
        return render_command(scene, showing=showing, **options)


def _how_to_animate(save: Path | None, file: Path) -> str:
    """How a picture of the beginning of an animation becomes a movie. save: the scene file. file: the table"""
    made = f"-o {file.stem}.mp4"
    if save is not None:
        outside = "" if file.resolve().is_relative_to(save.resolve().parent) else " --allow-outside"
        made = f"visray animate {save}{outside} -o {save.stem}.mp4"
    return f"the picture shows the beginning; {made} makes the movie"


def _map_path(scene: Path) -> Path:
    """Path of the map that is drawn for a scene file."""
    return scene.with_name(f"{scene.stem}-map.png")


def _check_save(save: Path, file: Path, outputs: list[Path]) -> None:
    """Raises a UserError if the scene cannot be written: its file has a wrong name, or it or its map would replace the
    table or the picture."""
    if save.suffix.lower() != ".json":
        raise UserError(f"{save}: a scene is a .json file; end the name so")
    if save.resolve() == file.resolve():
        raise UserError(f"{save}: is the table; give the scene another name")
    if _map_path(save).resolve() in [path.resolve() for path in outputs]:
        raise UserError(f"{_map_path(save)}: is the map of the scene {save}; give the picture another name")


def _parse_numbers(option: str, text: str | None, form: str, count: int) -> tuple[float, ...] | None:
    """Numbers from a text such as -10,30,35,60; None if there is no text. form: what the option takes, in words. count:
    of numbers"""
    if text is None:
        return None
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(isfinite, numbers)):
        raise UserError(f"{option} = {text!r}: must be {form}")
    return numbers


def _parse_pairs(option: str, text: str | None) -> dict[str, str]:
    """Texts by column from a text such as rain=mm,height=m. A comma that no column follows belongs to the text."""
    pairs = [part.partition("=") for part in re.split(r",(?=[^,=]+=)", text or "") if part]
    if not all(name.strip() and sign for name, sign, _ in pairs):
        raise UserError(f"{option} = {text!r}: must be COLUMN=TEXT, such as rain=mm, with commas between")
    return {name.strip(): value.strip() for name, _, value in pairs}


@contextmanager
def _scene_file(save: Path | None, stem: str) -> Iterator[Path]:
    """Yields the path of the scene file: that of the user, or one in a folder that is removed afterwards. stem: its
    name without its ending; frames in a folder are called so."""
    if save is not None:
        yield save
        return
    with passing_folder() as folder:
        yield folder / f"{stem}.json"


def _write(made: "DataPicture", scene: Path, kept: bool) -> None:
    """Writes the scene file, and the picture of its map if it was drawn. kept: whether the user asked for the file."""
    from visray.data_picture.drawn_map import write_map
    from visray.output.files import write_text
    from visray.scene.load import dump

    with warnings.catch_warnings():
        if not kept:
            warnings.simplefilter("ignore")
        text = dump(made.scene, scene.parent)
    if made.drawn is not None:
        write_map(made.drawn, made.scene.textures["map"].file)
    write_text(scene, text)
