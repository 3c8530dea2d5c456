"""What a legend says, as plain records: colour bars, scales of sizes, texts and places."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from visray.output.curves import curve

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Tick:
    """A value on a colour bar. position: its place from 0 (left end) to 1 (right end). text: the value as text."""

    position: float
    text: str


@dataclass(frozen=True, eq=False)
class ColorBar:
    """A strip with the colours of a palette, and what they mean.

    label: what is shown, with its unit.
    colours: colours from the left end to the right end, linear Rec. 709. Those of a continuous palette lie at
        positions (i + 1/2) / N and are interpolated; those of steps fill equal parts of the strip.
    stepped: whether the colours are steps: of bands, or of a palette that is itself a list of colours.
    ticks: values below the strip.
    under, over, missing: colours of values below and above the range, and of missing values; None if there are none.

    Shapes: colours (N, 3).
    """

    label: str
    colours: np.ndarray
    stepped: bool = False
    ticks: tuple[Tick, ...] = ()
    under: Colour | None = None
    over: Colour | None = None
    missing: Colour | None = None

    def strip(self, pixels: int) -> np.ndarray:
        """Colours at the centres of `pixels` pixels side by side, as numbers for a screen: sRGB from 0 to 1.

        They are interpolated in sRGB, as a palette is.

        Shapes: result (pixels, 3).
        """
        shown = curve(np.clip(np.asarray(self.colours, float), 0, 1), "srgb")
        at, n = (np.arange(pixels) + 0.5) / pixels, len(shown)
        if self.stepped:
            return shown[np.minimum((at * n).astype(int), n - 1)]
        return np.stack([np.interp(at * n - 0.5, np.arange(n), channel) for channel in shown.T], axis=1)


@dataclass(frozen=True)
class SizeScale:
    """Gizmos of some values, in the size that they have in the picture.

    label: what is shown, with its unit.
    shape: "bar" for heights, "disk" or "square" for widths.
    entries: values as text, and sizes in pixels: the height of a bar, the whole width of a disk or a square.
    """

    label: str
    shape: Literal["bar", "disk", "square"]
    entries: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Place:
    """A name at a point of the picture.

    x, y: position in pixels, from the left and from the top edge of the picture.
    dotted: whether a dot marks the point.
    radius: how far the name keeps from the point, in pixels, because a gizmo stands there.
    """

    name: str
    x: float
    y: float
    dotted: bool = False
    radius: float = 0.0


@dataclass(frozen=True)
class LegendContent:
    """All that a legend says.

    places: those that come first are named first if there is no room for all.
    no_data, position, theme, size, font: as in visray.data.legend.Legend.
    date: the date that data with a time show; "" for none.
    notes: what the legend leaves out, each a sentence for users.
    """

    title: str = ""
    subtitle: str = ""
    source: str = ""
    bars: tuple[ColorBar, ...] = ()
    sizes: tuple[SizeScale, ...] = ()
    places: tuple[Place, ...] = ()
    no_data: str = "no data"
    position: Literal["right", "left", "bottom"] = "right"
    theme: Literal["auto", "light", "dark"] = "auto"
    size: float = 1.0
    font: str | None = None
    date: str = ""
    notes: tuple[str, ...] = ()

    def texts(self) -> list[str]:
        """All texts of the legend."""
        keys = [text for bar in self.bars for text in (bar.label, *(tick.text for tick in bar.ticks))]
        keys += [text for scale in self.sizes for text in (scale.label, *(text for text, _ in scale.entries))]
        own = self.title, self.subtitle, self.date, self.source, self.no_data
        return [*own, *keys, *(place.name for place in self.places)]
