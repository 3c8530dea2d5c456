"""Options of the commands that make pictures: how a picture is made, and how it is written."""

import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from visray.cli import candidates
from visray.cli.options import Integer, Seconds, Share, flag, parse_size
from visray.errors import UserError
from visray.hints import hint
from visray.modes import MODES, Mode
from visray.output.layers import LAYERS, NAMES, Layer, layers_of_files, names_from

FILTERS = ("box", "tent", "gaussian", "mitchell")
Samples = Annotated[Integer | None, Parameter(help="Samples per pixel. Default: as the scene says.")]
Error = Annotated[
    Share | None,
    Parameter(help="Take samples until the error is no larger: 0.01 or 1% is 1 % of the mean luminance."),
]
Time = Annotated[Seconds | None, Parameter(help="Make the best picture in this time: 20 or 20s, 2min, 1h.")]
Size = Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels, such as 640x480.")]
Scale = Annotated[float | None, Parameter(help="Multiply width and height: 0.5 is a picture of half the size.")]
Region = Annotated[
    str | None,
    Parameter(help="Render only these pixels: LEFT,TOP,RIGHT,BOTTOM in the whole picture, such as 100,50,420,290."),
]
Filter = Annotated[
    str | None,
    Parameter(help=f"Filter of the pixels: {', '.join(FILTERS)}; with its radius in pixels, such as gaussian,2."),
]
Precision = Annotated[Literal["single", "double"] | None, Parameter(help="Precision of shading.")]
Seed = Annotated[Integer | None, Parameter(help="Seed of the random numbers. Another gives other noise.")]
Backend = Annotated[Literal["llvm", "cuda", "metal"], Parameter(help="cuda and metal are untested.")]
Layers = Annotated[
    str | None,
    Parameter(
        help="Layers of the EXR file, separated by commas: see below. Default: all.", completer=candidates.layers
    ),
]
Gamma = Annotated[str, Parameter(help="Display curve of the PNG file: srgb, or an exponent such as 2.2.")]
Exposure = Annotated[float, Parameter(help="Exposure of the PNG file, in stops: 1 is twice as bright.")]
Float = flag("Write colours of EXR files as 32-bit floats, not halves, which end at 65504.", name="--float")
NoLegend = flag("Draw no legend into the picture of a data scene, and put none into its EXR file.")
Show = flag("Show the picture in the system's viewer. Without -o, no file is written.")
Preview = flag("Show the picture in the terminal. Without -o, no file is written.")
Quiet = flag("Print nothing, and show no progress.")


def _list(title: str, records: Iterable[Layer | Mode]) -> str:
    """A list for the help text, in Markdown, with the name and the meaning of each record.

    title: text above the list. records: the layers or the shading modes.
    """
    return "\n".join([title, "", *(f"- **{record.name}**: {record.meaning}" for record in records)])


EPILOGUE = "\n\n".join(
    [
        _list("Layers of an EXR file, for `--layers`:", LAYERS),
        _list("Shading modes, for `--set settings.shading=MODE`:", MODES),
    ]
)


def needed_layers(text: str | None, outputs: list[Path]) -> tuple[str, ...]:
    """Names of the layers to render, as a tuple.

    text: value of the option --layers, names separated by commas, to which RGB, A and the legend of a data scene are
        added. If it is None or "all":
        all layers if there is an EXR file, else only colour, coverage, the certificate and the legend.
    outputs: paths of the files to write.
    """
    suffixes = {o.suffix.lower() for o in outputs}
    if text is None or text == "all":
        return layers_of_files(suffixes)
    by_lower = {name.lower(): name for name in NAMES}
    asked = [word.strip() for word in text.split(",")]
    if unknown := [word for word in asked if word.lower() not in by_lower]:
        raise UserError(f"--layers = {text!r}: there is no layer {unknown[0]!r}; choose from {', '.join(NAMES)}")
    always = ("RGB", "A", *names_from("overlay"))
    names = tuple(dict.fromkeys((*always, *(by_lower[word.lower()] for word in asked))))
    if len(names) > len(always) and ".exr" not in suffixes:
        warnings.warn("--layers: only an EXR file has layers, and none is written", stacklevel=1)
    return names


def film_changes(size: str | None, scale: float | None, region: str | None, filter: str | None) -> dict[str, Any]:
    """The film that the options ask for, as arguments of scene.adjusted.adjusted."""
    return {"size": parse_size(size), "scale": scale, "region": parse_region(region), "filter": parse_filter(filter)}


def parse_region(text: str | None) -> tuple[int, ...] | None:
    """The edges of a region from a text such as 100,50,420,290, or None if there is no text."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 4 or not all(re.fullmatch("-?[0-9]{1,9}", part) for part in parts):
        right = "must be LEFT,TOP,RIGHT,BOTTOM in whole pixels, such as 100,50,420,290"
        raise UserError(f"--region = {text!r}: {right}")
    return tuple(map(int, parts))


def parse_filter(text: str | None) -> dict[str, Any] | None:
    """A filter from a text such as gaussian or gaussian,2, or None if there is no text."""
    if text is None:
        return None
    name, comma, radius = (part.strip() for part in text.partition(","))
    if name not in FILTERS:
        raise UserError(f"--filter = {text!r}: unknown filter; {hint(name, FILTERS)}")
    try:
        return {"type": name} | ({"radius": float(radius)} if comma else {})
    except ValueError:
        raise UserError(f"--filter = {text!r}: the radius must be a number of pixels, such as {name},2") from None


def parse_gamma(text: str) -> Any:
    """Display curve from a text: a number if the text is one, else the text itself, such as "srgb". It is checked
    later, together with the output files."""
    try:
        return float(text)
    except ValueError:
        return text
