"""Textures: colours as functions of the texture coordinates u and v.

A new kind is one class here, its name in KINDS, and its colour in images/lookup.py.
"""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from visray.named_files import FileRule
from visray.quantities import Color, Real
from visray.records import record_kind

STRICT = ConfigDict(extra="forbid", revalidate_instances="always")
_Coordinate = Annotated[Real, Field(ge=-1e6, le=1e6)]
Pair = tuple[_Coordinate, _Coordinate]


def _paired(raw: Any) -> Any:
    """A single number as a pair of it; anything else as it is."""
    return (raw, raw) if isinstance(raw, (int, float)) and not isinstance(raw, bool) else raw


PairOrOne = Annotated[Pair, BeforeValidator(_paired, json_schema_input_type=_Coordinate | Pair)]
Wrap = Literal["repeat", "clamp", "mirror"]
# A texture has a row in the atlas for each way in which it is used (row_number): (v_ends, keeps_ka).
USES = ((False, False), (True, False), (False, True), (True, True))


@dataclass(frozen=True, kw_only=True)
class Texture:
    """A texture is looked up at the coordinates `scale` times (u, v) plus `offset`. For example, a scale of (2, 1)
    repeats it twice along u. One number is the scale along both."""

    __pydantic_config__ = STRICT
    # The section of a scene that has textures (records.Reference). No annotation, so that it is no field.
    section = "textures"

    scale: PairOrOne = (1.0, 1.0)
    offset: Pair = (0.0, 0.0)


@record_kind
@dataclass(frozen=True, kw_only=True)
class ImageTexture(Texture):
    """A PNG, JPEG, EXR or HDR `file` (relative to the scene file), with its first row at v = 1.

    `filter`: `nearest` takes the colour of the nearest pixel, `bilinear` blends four pixels. `wrap`: beyond its edges
    the picture repeats (`repeat`), keeps the colour of the edge (`clamp`), or is mirrored (`mirror`). A pair, such as
    ("repeat", "clamp"), is for u and for v. At the poles of a sphere and of other kinds whose v ends there, pixels
    beyond the pole are never blended in. `encoding`: how numbers of the file become colours, `srgb` or `linear`; with
    `auto`, PNG and JPEG are read as sRGB, EXR and HDR as linear.
    """

    type: Literal["image"] = "image"
    file: Annotated[str, FileRule()] = field(kw_only=False)
    filter: Literal["nearest", "bilinear"] = "bilinear"
    wrap: Wrap | tuple[Wrap, Wrap] = "repeat"
    encoding: Literal["auto", "srgb", "linear"] = "auto"

    @property
    def wraps(self) -> tuple[Wrap, Wrap]:
        """`wrap` along u and along v."""
        return (self.wrap, self.wrap) if isinstance(self.wrap, str) else self.wrap


@record_kind
@dataclass(frozen=True, kw_only=True)
class CheckerTexture(Texture):
    """Squares of two colours `a` and `b`, two squares along each unit of u and of v. The square with u and v from 0 to
    1/2 has colour `a`."""

    type: Literal["checker"] = "checker"
    a: Color = field(default=(0.8, 0.8, 0.8), kw_only=False)
    b: Color = field(default=(0.2, 0.2, 0.2), kw_only=False)


KINDS = (ImageTexture, CheckerTexture)


def row_number(texture: int, count: int, v_ends: bool, keeps_ka: bool) -> int:
    """Number of a texture's row in the atlas, for one way in which it is used.

    texture: number of the texture. count: number of textures
    v_ends: whether it is on a kind whose v ends at poles (Primitive.v_ends)
    keeps_ka: whether its material keeps ka (Material.textured)
    """
    return texture + count * USES.index((v_ends, keeps_ka))
