"""The command `visray surface`: a picture of a surface f(x, y, z) = 0 without a scene file."""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from visray import clock
from visray.cli import candidates
from visray.cli.options import Integer, Json, Settings, Share, Threads, app, flag, parse_size
from visray.cli.picture_options import Filter, Preview, Quiet, Region, Scale, Show, Time
from visray.cli.showing import Showing
from visray.cli.standard_output import is_aside, reserve
from visray.cli.view import Host, NoBrowser, Port, check_live, show_live
from visray.errors import UserError
from visray.hints import similar
from visray.leftovers import passing_folder
from visray.terminal import write_line

# Error of a picture for which nothing else is asked.
ERROR = 0.01


@app.command(name="surface")
def surface_command(
    formula: Annotated[
        str,
        Parameter(
            help='f(x, y, z) as text, such as "x^2 + y^2 - z^2 - a", an equation, or the name of a known surface.',
            allow_leading_hyphen=True,
            completer=candidates.surfaces,
        ),
    ],
    /,
    *more_words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    output: Annotated[
        list[Path],
        Parameter(
            name=("--output", "-o"),
            help="A .png or .exr file. May be given more than once. Default: the name of the known surface, or "
            "surface, as .png.",
            show_default=False,
        ),
    ] = [],  # noqa: B006 - only read
    param: Annotated[
        list[str],
        Parameter(help="NAME=NUMBER: a parameter of the formula. May be given more than once.", show_default=False),
    ] = [],  # noqa: B006 - only read
    clip: Annotated[
        float | None,
        Parameter(help="Radius of the ball in which the surface is drawn. Default: fitted.", allow_leading_hyphen=True),
    ] = None,
    towards: Annotated[
        str | None,
        Parameter(
            name="--from",
            help="X,Y,Z: direction from which the surface is seen; z is upwards. Default: chosen.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    color: Annotated[
        str | None, Parameter(help="Colour of the side that is seen more: a name, #rrggbb, or 0.8,0.3,0.1 (linear).")
    ] = None,
    inside: Annotated[str | None, Parameter(help="Colour of the other side, in the same way.")] = None,
    save: Annotated[Path | None, Parameter(help="Write the scene to this .json file.")] = None,
    set: Settings = [],  # noqa: B006 - the name of the option; only read
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels. Default: 640x640.")] = None,
    scale: Scale = None,
    region: Region = None,
    filter: Filter = None,
    spp: Annotated[Integer | None, Parameter(help="Samples per pixel. Default: as many as the error needs.")] = None,
    error: Annotated[
        Share | None,
        Parameter(help="Take samples until the error is no larger: 0.01 or 1% is 1 % of the luminance. Default: 1%."),
    ] = None,
    time: Time = None,
    threads: Threads = None,
    view: flag("Show it live in the browser, to be turned and changed. Ctrl-C ends it.") = False,
    host: Host = "127.0.0.1",
    port: Port = None,
    no_browser: NoBrowser = False,
    show: Show = False,
    preview: Preview = False,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Make a picture of a formula, or of a known surface.

    Clip, camera, lights and colours are fitted to it. Letters other than x, y and z are parameters. `visray
    surfaces` lists the known surfaces. With --save the scene becomes a file, to be changed and rendered by `visray
    render`. With --view, sliders change the parameters.
    """
    if quiet:
        warnings.simplefilter("ignore")
    _check_one_formula(formula, more_words, param)
    numbers, texts = _parse_parameters(param), {"--color": color, "--inside": inside}
    colors = [_parse_color(option, text) for option, text in texts.items()]
    direction, film = _parse_triple("--from", towards, "1,-2,1"), parse_size(size)
    showing = Showing.of(show, preview, json, output)
    reserve(output, json=json, preview=showing.screen is not None)
    from visray.output.files import check_writable, write_text

    if save is not None:
        if save.suffix.lower() != ".json":
            raise UserError(f"{save}: a scene is a .json file; end the name so")
        check_writable(save)
    if view and (output or showing or json):
        raise UserError("--view: shows a live picture, which its page can save; leave out -o, --show and --json")
    from visray.adaptive.stopping import Goal
    from visray.cli.rendering import render_command
    from visray.output.image import check_destination
    from visray.progress import Bar
    from visray.scene.load import dump, load
    from visray.surface_picture.picture import SIZE, Wishes
    from visray.surface_picture.recipe import Recipe

    if error is None and time is None and spp is None:
        error = ERROR
    Goal.from_arguments(error, time, spp, clock.now())
    if view:
        check_live(host, port)
    for path in output:
        if not is_aside(path):
            check_destination(path)
    recipe = Recipe(formula, numbers, Wishes(film or SIZE, clip, direction, *colors), tuple(set))
    with Bar("looking at the surface", 1, not (quiet or json)):
        scene, made = recipe.picture()
    for text in made.notes:
        warnings.warn(text, stacklevel=1)
    if not (quiet or json):
        write_line(f"{made.name}: " + "; ".join(f"{name} {text}" for name, text in made.choices.items()))
    with _scene_file(save, made.name) as file:
        write_text(file, dump(scene, file.parent))
        if save is not None and not (quiet or json):
            write_line(f"{save}: written")
        if view:
            options = {"host": host, "port": port, "error": error or ERROR, "browser": not no_browser}
            more = {"file": save, "command": ["visray", "view", str(save)]} if save else {"recipe": recipe}
            return show_live((lambda: load(file)) if save else lambda: scene, name=made.name, **more, **options)
        report = {"choices": made.choices, "notes": list(made.notes)} | ({} if save is None else {"scene": str(save)})
        return render_command(
            file, output=showing.outputs(output, [Path(f"{made.name}.png")]), spp=spp, error=error, time=time,
            threads=threads, showing=showing, quiet=quiet, json=json, more=report, scale=scale, region=region,
            filter=filter,
        )  # fmt: skip


def _check_one_formula(formula: str, more: tuple[str, ...], param: list[str]) -> None:
    """Raises a UserError if there are words beside the formula, as when it has no quotes. more: these words."""
    if not more:
        return
    if more[0].startswith("--") or (re.match("-[A-Za-z]", more[0]) and set(more[0][1:]) - set("xyz")):
        options = [name for argument in app["surface"].assemble_argument_collection() for name in argument.names]
        near = similar(more[0], [name for name in options if name.startswith("--")])
        raise UserError(f"{more[0]}: no such option{f'; did you mean {near[0]}?' if near else ''} (see --help)")
    name = next((text for text in param if "=" not in text), None)
    if name is not None:
        words = [word for word in more if word != "="] or ["2"]
        raise UserError(f"--param {name} {' '.join(more)}: write it as one word, --param {name}={words[0].lstrip('=')}")
    whole = " ".join((formula, *more))
    example = whole if len(whole) <= 60 else "x^2 + y^2 - 1"
    raise UserError(f'{formula}: other words stand beside the formula; put it in quotes: visray surface "{example}"')


def _parse_parameters(texts: list[str]) -> dict[str, float]:
    """Names and values of the parameters from texts such as a=0.5."""
    pairs = [_parse_parameter(text) for text in texts]
    names = [name for name, _ in pairs]
    if twice := [name for name in names if names.count(name) > 1]:
        raise UserError(f"--param: {twice[0]} has two values; give one")
    return dict(pairs)


def _parse_parameter(text: str) -> tuple[str, float]:
    """Name and value from a text such as a=0.5."""
    name, sign, number = (part.strip() for part in text.partition("="))
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if not (name and sign and isfinite(value)):
        raise UserError(f"--param = {text!r}: must be NAME=NUMBER, such as a=0.5")
    return name, value


def _parse_triple(option: str, text: str | None, example: str) -> tuple[float, float, float] | None:
    """Three numbers from a text; None if there is no text. example: what would be right."""
    if text is None:
        return None
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise UserError(f"{option} = {text!r}: must be three numbers with commas between, such as {example}")
    return numbers


def _parse_color(option: str, text: str | None) -> tuple[float, float, float] | None:
    """The colour that a text spells, in linear light; None if there is no text."""
    if text is None or ("," in text and not text.lower().startswith("rgb")):
        return _parse_triple(option, text, "0.8,0.3,0.1")
    from visray.colors import color_of_text

    try:
        return color_of_text(text)
    except ValueError as error:
        raise UserError(f"{option} = {text!r}: {error}") from None


@contextmanager
def _scene_file(save: Path | None, stem: str) -> Iterator[Path]:
    """Yields the path of the scene file: that of the user, or one in a folder that is removed afterwards."""
    if save is not None:
        yield save
        return
    with passing_folder() as folder:
        yield folder / f"{stem}.json"
