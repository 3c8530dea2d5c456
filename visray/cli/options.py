"""What all commands share: the cyclopts application, options, loading of scenes, and printing of reports.

The modules of commands import at their top only what the help needs, so that help and errors come at once. Each command
imports what it needs when it runs.
"""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from visray import terminal
from visray.cli import candidates
from visray.cli.quantities import parse_integer, parse_seconds, parse_share
from visray.errors import UserError
from visray.output.files import write_text
from visray.scene.source import Source, read
from visray.version import __version__

if TYPE_CHECKING:
    from visray.scene.scene import Scene

app = App(
    name="visray",
    help="A ray tracer that shows what accuracy costs, stays stable in hard cases, and simulates only what is "
    "needed.\n\nBegin with `visray new ball.json`, and then `visray render ball.json`.",
    version=__version__,
    suppress_keyboard_interrupt=False,
    # A word is a value as it is written: a file may be called [a].exr.
    default_parameter=Parameter(negative=(), json_list=False, json_dict=False),
)


def flag(help: str, **more: Any) -> Any:
    """The type of an option without a value, such as --quiet. Its help does not say that the default is False.

    help: text for the help. more: further arguments of cyclopts.Parameter.
    """
    return Annotated[bool, Parameter(help=help, show_default=False, **more)]


Integer = Annotated[int, Parameter(converter=parse_integer)]
Share = Annotated[float, Parameter(converter=parse_share)]
Seconds = Annotated[float, Parameter(converter=parse_seconds)]
SceneFile = Annotated[Path, Parameter(help="A scene file (.json).")]
Setup = Annotated[Path | None, Parameter(help="The setup file of a scene in the format of the original VisRayTrace.")]
Compat = flag("With a scene of the original VisRayTrace: use its rules for light, occlusion and weights.")
Outside = flag("Read textures and meshes outside of the scene's folder too. Only for scenes that you trust.")
Json = flag("Print the report as JSON.", name="--json")
At = Annotated[Seconds | None, Parameter(help="The moment of an animated scene, in seconds. Default: 0.")]
Threads = Annotated[Integer | None, Parameter(help="Number of threads. Default: one per core.")]
Cluster = Annotated[
    str | None,
    Parameter(help="Render with the workers of a Dask scheduler, tcp://HOST:PORT, or with local:N, N on this machine."),
]
Settings = Annotated[
    list[str],
    Parameter(
        name="--set",
        completer=candidates.addresses,
        help="ADDRESS=VALUE, such as objects.ball.radius=2 or camera.origin=0,1,5. Several may follow, with spaces or "
        "commas between. May be given more than once.",
        show_default=False,
    ),
]
Outputs = Annotated[
    list[Path],
    Parameter(
        name=("--output", "-o"),
        help="A .exr or .png file; - writes a PNG file to standard output, and -.exr an EXR file. May be given more "
        "than once. Default: the name of the scene, as both.",
        show_default=False,
    ),
]
# Exit code after Ctrl-C.
INTERRUPTED = 130


def load_still(
    scene: Path,
    setup: Path | None,
    compat: bool,
    assignments: list[str],
    at: float | None,
    *,
    allow_outside: bool,
    size: tuple[int, int] | None = None,
) -> "Scene":
    """As load_scene; of an animated scene one moment. at: the moment in seconds; None: the beginning."""
    loaded = load_scene(scene, setup, compat, assignments, allow_outside=allow_outside, size=size)
    from visray.animation.moment import still_at

    return still_at(loaded, at)


def load_scene(
    scene: Path, setup: Path | None, compat: bool, assignments: list[str], *, allow_outside: bool, **settings: Any
) -> "Scene":
    """Loads a scene file, and changes the scene as the options of the command line say.

    setup: the setup file of a scene of the original VisRayTrace, or None.
    compat: whether the rules of the original VisRayTrace apply.
    assignments: values of the option --set, each ADDRESS=VALUE.
    allow_outside: whether the scene may name files outside of its folder.
    settings: size of the film, and values of fields of Settings by name; None keeps the scene's value.
    """
    source = read_scene_file(scene)
    # Here, because these imports take longer than to see that a file is missing, or is no JSON.
    from visray.scene.address import parse_assignments
    from visray.scene.repaired import loaded_with

    assigned = parse_assignments(assignments)
    return loaded_with(assigned, scene, setup, compat, source, allow_outside=allow_outside, **settings)


def read_scene_file(scene: Path) -> Source:
    """The content of a scene file. If there is none, the error names files that may be meant."""
    try:
        return read(scene)
    except UserError as error:
        if not isinstance(error.__context__, FileNotFoundError | IsADirectoryError):
            raise
    from visray.cli.scene_files import meant

    raise UserError(f"{scene}: {meant(scene)}")


def check_cluster(address: str | None) -> None:
    """Raises a UserError if the option --cluster is no address. None: it is not given."""
    from visray.cluster.address import check_address

    if address is not None:
        check_address(address)


def parse_size(text: str | None) -> tuple[int, int] | None:
    """Width and height from a text such as 640x480, or None if there is no text."""
    if text is None:
        return None
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.isdecimal() and int(p) > 0 for p in parts):
        raise UserError(f"--size = {text!r}: must be WIDTHxHEIGHT in whole pixels greater than 0, such as 640x480")
    return int(parts[0]), int(parts[1])


def parse_pixel(text: str) -> tuple[int, int]:
    """Column and row of a pixel from a text such as 320,240."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 2 or not all(part.isascii() and part.isdecimal() for part in parts):
        raise UserError(f"--why = {text!r}: must be X,Y, the column and row of a pixel, such as 320,240")
    return int(parts[0]), int(parts[1])


def parse_list(text: str) -> tuple[str, ...]:
    """The words of a text, as a tuple. Commas separate the words."""
    return tuple(word for part in text.split(",") if (word := part.strip()))


def write_or_print(text: str, path: Path | None) -> None:
    """Writes a text to a file, or prints it if `path` is None or -."""
    if path is None or str(path) == "-":
        terminal.write(text)
        return
    commented = _has_comments(path)
    write_text(path, text)
    if commented:
        warnings.warn(f"{path}: had comments, and what is written is plain JSON without them", stacklevel=1)


def _has_comments(path: Path) -> bool:
    """Whether a file exists, and is JSON with comments."""
    from visray.scene.comments import has_comments

    try:
        return path.suffix.lower() == ".json" and has_comments(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False
