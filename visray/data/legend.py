"""The legend of a data scene, as it is written in a scene file."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from visray.data.base import Latitude, Longitude
from visray.quantities import Real
from visray.records import record_kind

_Flag = Annotated[bool, Field(strict=True)]
_Text = Annotated[str, Field(strict=True)]
_NotEmpty = Annotated[str, Field(strict=True, min_length=1)]
TextSize = Annotated[Real, Field(ge=0.5, le=4)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class Legend:
    """What is written over the picture: `title` and `subtitle` at the top, the `source` of the data at the bottom, and
    keys that say what colours and sizes mean. The `date` of data with a time is below the title: true writes it as
    fine as the data, and a format such as "%d %B %Y" in its own way.

    `bars` and `sizes` say whether colours and sizes have keys. `position` is the place of the keys. `labels` are texts
    in place of the names of columns, `units` the units of columns, such as {"rain": "mm"}, and `no_data` is the text
    for missing values.
    `places` are the places that are named in the picture: `none`, `all` rows that have a name, or a list of names.
    `points` are further places by name, each as longitude and latitude; a dot marks them.
    `theme` is that of the picture: on a `light` one the text is dark; `auto` looks at the picture. `size` is the size
    of the text, relative to the usual one. `font` is a family of fonts; where it lacks a character, or is not
    installed, others are taken.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    title: _Text = ""
    subtitle: _Text = ""
    source: _Text = ""
    places: Literal["none", "all"] | tuple[_NotEmpty, ...] = "none"
    points: dict[_NotEmpty, tuple[Longitude, Latitude]] = field(default_factory=dict)
    date: _Flag | _NotEmpty = True
    bars: _Flag = True
    sizes: _Flag = True
    labels: dict[_NotEmpty, _Text] = field(default_factory=dict)
    units: dict[_NotEmpty, _Text] = field(default_factory=dict)
    no_data: _Text = "no data"
    position: Literal["right", "left", "bottom"] = "right"
    theme: Literal["auto", "light", "dark"] = "auto"
    size: TextSize = 1.0
    font: _NotEmpty | None = None
