"""The layers of a picture, one record each. Renderer, files, command line and documentation read them from here.

To add a layer, add a record below, and compute its values in the code of its source (docs/extending.md).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

# The source of a layer: the code that computes it. Each source returns a dict of its layers by name.
#   film         from the colours of all samples (picture_layers.developed, adaptive.dual_buffer)
#   adaptive     from the colours of all samples, only with `error` or `time` (adaptive.dual_buffer)
#   first hit    from the ray through the pixel's centre (integrator.first_hit)
#   certificate  from the ray through the pixel's centre, only in scenes with polynomial surfaces or tori
#                (integrator.certificate)
#   motion       from the first hit and the scene of the next frame, only in animated scenes (motion_vectors.forward)
#   overlay      drawn over the picture, only in scenes with a legend (legend.layer)
Source = Literal["film", "adaptive", "first hit", "certificate", "motion", "overlay"]
# NumPy types of the numbers of a layer, and their names in EXR files.
TYPES = {"float16": "half", "float32": "float", "uint32": "uint32"}


@dataclass(frozen=True)
class Layer:
    """One layer of a picture.

    name: name of the layer in vr.render and in an Image.
    channels: names of the channels in an EXR file, one for each number of a pixel.
    dtype: NumPy type of the numbers in an EXR file. In memory, float16 is float32.
    unit: unit of the numbers.
    filtered: whether the value of a pixel comes from all its samples. If not, it comes from the ray through its centre,
        or from no ray at all (source "overlay").
    source: the code that computes the layer (Source).
    meaning: one line for users.
    """

    name: str
    channels: tuple[str, ...]
    dtype: str
    unit: str
    filtered: bool
    source: Source
    meaning: str

    @property
    def memory_dtype(self) -> str:
        """The NumPy type of the layer's numbers in an Image: uint32 or float32."""
        return "uint32" if self.dtype == "uint32" else "float32"


def _vector(prefix: str, letters: str) -> tuple[str, ...]:
    """Names of channels, such as N.X, N.Y, N.Z."""
    return tuple(f"{prefix}.{letter}" for letter in letters)


# The layers in the order of a picture. The channel names are such that Nuke and Blender read them as intended: at most
# two dots, no digit at the beginning, and Z without a prefix only because no X and Y are without a prefix.
LAYERS = (
    Layer("RGB", ("R", "G", "B"), "float16", "linear Rec. 709", True, "film",
          "colour, premultiplied by A"),
    Layer("A", ("A",), "float16", "0 to 1", True, "film",
          "coverage: 1 unless the film is transparent"),
    Layer("variance", _vector("variance", "RGB"), "float32", "RGB squared", True, "film",
          "variance of the pixel's samples (no such layer at 1 spp); divided by spp, that of the pixel if its samples "
          "were independent"),
    Layer("error", _vector("error", "RGB"), "float32", "RGB", True, "adaptive",
          "with `--error` or `--time`: standard error of the pixel, from the difference of its two halves over 3 x 3 "
          "pixels"),
    Layer("samples", ("samples.count",), "uint32", "samples", True, "adaptive",
          "with `--error` or `--time`: number of samples of the pixel"),
    Layer("Z", ("Z",), "float32", "world", False, "first hit",
          "depth along the view direction; inf where nothing is hit"),
    Layer("distance", ("dist.Z",), "float32", "world", False, "first hit",
          "distance along the ray; inf where nothing is hit"),
    Layer("N", _vector("N", "XYZ"), "float32", "1", False, "first hit",
          "unit normal in world space, turned to the camera; 0 where nothing is hit"),
    Layer("P", _vector("P", "XYZ"), "float32", "world", False, "first hit",
          "point in world space; 0 where nothing is hit"),
    Layer("UV", _vector("UV", "UV"), "float32", "1", False, "first hit",
          "texture coordinates, v upwards; 0 where nothing is hit"),
    Layer("albedo", _vector("albedo", "RGB"), "float16", "0 to 1", False, "first hit",
          "kd of the material, or the colour of its texture; 0 where nothing is hit"),
    Layer("id", ("id.object",), "uint32", "number", False, "first hit",
          "number of the object in the order of the scene file, from 1; 0 where nothing is hit"),
    Layer("unresolved", ("proof.unresolved",), "uint32", "intervals", False, "certificate",
          "with polynomial surfaces and tori: parts of the ray where rounding hides whether there is a crossing"),
    Layer("residual", ("proof.residual",), "float32", "ulp", False, "certificate",
          "with polynomial surfaces and tori: distance of the point from its surface, in units in the last place"),
    Layer("forward", _vector("forward", "UV"), "float32", "pixels", False, "motion",
          "in animated scenes: movement to the next frame of what is seen, U to the right and V down; 0 where it will "
          "not be before the camera"),
    Layer("legend", _vector("legend", "RGBA"), "float16", "linear Rec. 709", False, "overlay",
          "with a legend of data: its colour, premultiplied by its alpha; it is to lie over RGB"),
)  # fmt: skip
BY_NAME = {layer.name: layer for layer in LAYERS}
NAMES = tuple(BY_NAME)


def names_from(*sources: Source) -> tuple[str, ...]:
    """Names of the layers with one of these sources."""
    return tuple(layer.name for layer in LAYERS if layer.source in sources)


def layers_of_files(suffixes: Iterable[str]) -> tuple[str, ...]:
    """Names of the layers of a picture for files with these suffixes: all if there is an EXR file, else only colour,
    coverage, the certificate and the legend."""
    return NAMES if ".exr" in suffixes else ("RGB", "A", *names_from("certificate", "overlay"))


def table() -> tuple[list[str], list[list[str]]]:
    """Column headings and rows of the table of layers in the documentation."""
    heads = ["layer", "channels", "type", "unit", "taken from", "meaning"]
    return heads, [_row(layer) for layer in LAYERS]


def _row(layer: Layer) -> list[Any]:
    """The row of a layer in the table."""
    channels = " ".join(f"`{channel}`" for channel in layer.channels)
    taken_from = "all samples" if layer.filtered else "drawn" if layer.source == "overlay" else "pixel's centre"
    return [f"`{layer.name}`", channels, TYPES[layer.dtype], layer.unit, taken_from, layer.meaning]
