"""Colour rules: how the values of a column become colours."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from visray.data.color_value import ColorValue, color_flaw, color_numbers, is_hex
from visray.data.column import Column, Place, row_place, rows_text
from visray.data.norm import LogNorm, Norm, PowerNorm, QuantileNorm
from visray.data.palette import TABLE, Encoding, PaletteSpec, palette_flaw, palette_of
from visray.data.resolved_colors import Colours, ResolvedColors
from visray.quantities import Real
from visray.records import record_kind

NormName = Literal["linear", "log", "symmetric", "power", "quantile", "banded"]
_Flag = Annotated[bool, Field(strict=True)]
_Whole = Annotated[int, Field(strict=True)]
MOST_BANDS = 256
# Zero may be this far from the middle of a palette, as a share of the domain, before a note says so.
OFF_MIDDLE = 0.01


@record_kind
@dataclass(frozen=True, kw_only=True)
class ColorRule:
    """The colour of a datum is the colour that `palette` has at the place t of its value in the `domain`.

    `column` holds the values. `norm` says what t is, for a domain from lo to hi:
    linear: (v - lo) / (hi - lo). log: log(v / lo) / log(hi / lo). power: the linear t to the power `exponent`.
    symmetric: linear, with `center` in the middle. quantile: the share of the data that are smaller.
    banded: linear, with one colour for each of the `bands`.

    `domain` is (lo, hi); by default it is the range of the data, and for symmetric the smallest range about `center`
    that contains them. `bands` is a number of bands, or their edges; a number also goes with the other norms. Values
    beyond the domain have the colours `under` and `over`, by default those of the palette's ends. Missing values have
    the colour `missing`. `lookup`: `smooth` blends colours, `table` takes one of 256, as the original VisRayTrace does.
    `encoding` says whether the palette's numbers are sRGB or linear light.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    column: Column
    palette: PaletteSpec = "viridis"
    reversed: _Flag = False
    norm: NormName = "linear"
    domain: tuple[Real, Real] | None = None
    center: Real = 0.0
    exponent: Real = 0.5
    bands: _Whole | tuple[Real, ...] | None = None
    under: ColorValue | None = None
    over: ColorValue | None = None
    missing: ColorValue = "#808080"
    lookup: Literal["smooth", "table"] = "smooth"
    encoding: Encoding = "srgb"

    def colours(self, values: np.ndarray) -> Colours:
        """Colours of values, NaN for missing ones. Domain: no flaws. Shape: (N)."""
        return self.resolved(values).colours(values)

    def resolved(self, values: np.ndarray) -> ResolvedColors:
        """The rule with the domain, bands and colours that the values give it. Domain: no flaws. Shape: (N)."""
        norm = self._norm(np.asarray(values, float))
        palette = palette_of(self.palette, self.reversed, self.encoding, self.lookup == "table")
        ends = palette.srgb(np.array([0.0, 1.0]))
        under, over = (end if c is None else color_numbers(c) for end, c in zip(ends, (self.under, self.over)))
        return ResolvedColors(norm, palette, self._edges(norm), under, over, color_numbers(self.missing))

    def _norm(self, values: np.ndarray) -> Norm:
        """The norm, with its domain. Values that are missing or infinite say nothing about it. Shape: (N)."""
        finite = values[np.isfinite(values)]
        if np.iterable(self.bands):
            return Norm(self.bands[0], self.bands[-1])
        if self.norm == "log":
            finite = finite[finite > 0]
        if self.norm == "quantile":
            lo, hi = self.domain or (-np.inf, np.inf)
            finite = finite[(finite >= lo) & (finite <= hi)]
        if self.domain is not None:
            lo, hi = self.domain
        elif not len(finite):
            lo = hi = self.center if self.norm == "symmetric" else 0.0
        elif self.norm == "symmetric":
            half = np.abs(finite - self.center).max()
            lo, hi = self.center - half, self.center + half
        else:
            lo, hi = finite.min(), finite.max()
        lo, hi = float(lo), float(hi)
        if self.norm == "quantile" and len(finite):
            return QuantileNorm.of(finite)
        if self.norm == "power":
            return PowerNorm(lo, hi, self.exponent)
        return LogNorm(lo, hi) if self.norm == "log" else Norm(lo, hi)

    def _edges(self, norm: Norm) -> np.ndarray | None:
        """Edges of the bands; None without bands, and if the domain is one point. Shape: (B + 1)."""
        if np.iterable(self.bands):
            return np.array(self.bands, float)
        if self.bands is None or norm.constant:
            return None
        return norm.value(np.arange(self.bands + 1) / self.bands)

    def flaws(
        self, values: np.ndarray | None = None, rows: np.ndarray | None = None, place: Place = row_place
    ) -> list[tuple[str, str]]:
        """A list of errors (field, message); empty if there is none.

        values: the values of the column; None: only the fields are checked.
        rows: numbers of the rows; None: they are counted from 0.
        place: where a row stands, from its number.

        Shapes: (N) each.
        """
        found = self._palette_flaws() + self._domain_flaws() + self._band_flaws() + self._unused()
        if values is None:
            return found
        v = np.asarray(values, float)
        return found + self._value_flaws(v, lambda wrong: rows_text(wrong, v, rows, place))

    def _palette_flaws(self) -> list[tuple[str, str]]:
        """A list of errors in the palette and in other colours."""
        flaw = palette_flaw(self.palette)
        found = [(f"palette.{flaw[0]}".rstrip("."), flaw[1])] if flaw else []
        given = {name: getattr(self, name) for name in ("under", "over", "missing")}
        return found + [(name, text) for name, c in given.items() if c is not None and (text := color_flaw(c))]

    def _domain_flaws(self) -> list[tuple[str, str]]:
        """A list with the error of the domain or of the exponent, if there is one."""
        if not self.exponent > 0:
            return [("exponent", "must be greater than 0")]
        if self.domain is None:
            return []
        lo, hi = self.domain
        if np.iterable(self.bands):
            return [("domain", "the edges of the bands are the domain already; leave one of the two out")]
        if not lo < hi:
            backwards = '; to turn the palette around, write "reversed": true' if hi < lo else ""
            return [("domain", f"the first number must be less than the second{backwards}")]
        if self.norm == "log" and lo <= 0:
            return [("domain", "both numbers must be above 0 for the norm log")]
        half = max(hi - self.center, self.center - lo)
        # Numbers of a file are rounded to double: a sum of three of them is exact to a few roundings.
        rounding = 4 * np.finfo(float).eps * max(abs(lo), abs(hi))
        if self.norm == "symmetric" and abs(lo / 2 + hi / 2 - self.center) > rounding:
            right = f"[{self.center - half:g}, {self.center + half:g}]"
            return [("domain", f"must have the center {self.center:g} in its middle, as {right} has")]
        return []

    def _band_flaws(self) -> list[tuple[str, str]]:
        """A list with the error of the bands, if there is one."""
        bands = self.bands
        if bands is None:
            wanted = "is missing for the norm banded; write a number of bands, such as 5, or edges, such as [0, 10, 50]"
            return [("bands", wanted)] if self.norm == "banded" else []
        if isinstance(bands, int):
            return (
                self._few_colors(bands) if 1 <= bands <= MOST_BANDS else [("bands", f"must be from 1 to {MOST_BANDS}")]
            )
        if self.norm not in ("linear", "banded"):
            return [("bands", f'edges say it all; the norm is then "banded", and not "{self.norm}"')]
        if not 2 <= len(bands) <= MOST_BANDS + 1:
            return [("bands", f"must have from 2 to {MOST_BANDS + 1} edges")]
        if not (np.diff(bands) > 0).all():
            return [("bands", "the edges must rise")]
        return self._few_colors(len(bands) - 1)

    def _few_colors(self, bands: int) -> list[tuple[str, str]]:
        """A list with an error if the palette is qualitative and has fewer colours than there are bands."""
        if palette_flaw(self.palette):
            return []
        palette = palette_of(self.palette)
        if not 0 < palette.steps < bands:
            return []
        most = palette.steps
        text = (
            f"the palette {palette.name} has only {most} colours; write at most {most} bands, or take another palette"
        )
        return [("bands", text)]

    def _unused(self) -> list[tuple[str, str]]:
        """A list of errors about fields that are given, but that the norm does not read."""
        readers = {"center": ("symmetric", 0.0), "exponent": ("power", 0.5)}
        return [
            (name, f'is for the norm "{norm}"; write "norm": "{norm}", or leave it out')
            for name, (norm, default) in readers.items()
            if self.norm != norm and getattr(self, name) != default
        ]

    def _value_flaws(self, values: np.ndarray, said: Callable[[np.ndarray], str]) -> list[tuple[str, str]]:
        """A list of errors about values. said: wrong rows in words, from their mask. Shape: (N)."""
        found = []
        if (endless := np.isinf(values)).any():
            found.append(("column", f"has infinite values: {said(endless)}; leave these cells empty"))
        low = (values <= 0) & ~np.isinf(values)
        if self.norm == "log" and low.any():
            text = f'values of "{self.column}" must be above 0 for log, unlike {said(low)}'
            found.append(("norm", f'{text}; take "power" or "symmetric", or leave these cells empty'))
        return found

    def notes(self, values: np.ndarray) -> list[str]:
        """A list of sentences about what is odd in the colours of values. Domain: no flaws. Shape: (N)."""
        resolved, colours = self.resolved(values), self.colours(values)
        # An imported scene has tables of colours, such as complements, that nobody chose.
        imported = self.lookup == "table" and not isinstance(self.palette, str) and len(self.palette) == TABLE
        found = [resolved.palette.note] if resolved.palette.note and not imported else []
        if colours.missing == len(values):
            found.append(f'The column "{self.column}" has no values; all colours are those of missing values.')
        elif resolved.norm.constant:
            found.append(f'The column "{self.column}" is constant ({resolved.lo:g}); it has the middle of the palette.')
        found += self._middle_notes(resolved)
        for count, side, end in ((colours.under, "below", resolved.lo), (colours.over, "above", resolved.hi)):
            if count:
                found.append(f'{count} of {len(values)} values of "{self.column}" are {side} the domain ({end:g}).')
        return found

    def _middle_notes(self, resolved: ResolvedColors) -> list[str]:
        """A list with a sentence if the palette has a middle, and zero lies elsewhere, by chance: the data set the
        domain."""
        lo, hi = resolved.lo, resolved.hi
        if self.norm not in ("linear", "banded") or np.iterable(self.bands) or self.domain or not lo < 0 < hi:
            return []
        middle = lo / 2 + hi / 2
        if abs(middle) <= OFF_MIDDLE * (hi - lo) or not resolved.palette.diverging:
            return []
        name = f"{resolved.palette.name} " if resolved.palette.name else ""
        text = f"The palette {name}has its middle at {middle:.2g}, and not at 0"
        return [f'{text}; to have it there, write "norm": "symmetric".']


_Part = Annotated[Real, Field(ge=0, le=1)]
# What a layer may have as its colour: a rule, the name of a column, one colour for all (sRGB), or none.
ColorSpec = ColorRule | Column | tuple[_Part, _Part, _Part] | None


def color_rule_of(spec: Any) -> ColorRule | tuple[float, float, float] | None:
    """The colour rule of a layer, or its one colour in sRGB, or None. A text is the name of a column, unless it is a
    colour such as "#ff6347"; the name of a colour could be that of a column too."""
    if not isinstance(spec, str):
        return spec
    return tuple(color_numbers(spec).tolist()) if is_hex(spec) else ColorRule(column=spec)
