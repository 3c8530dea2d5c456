"""Size rules: how the values of a column become heights and radii."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from visray.data.column import Column, Place, row_place, rows_text
from visray.quantities import FARTHEST, LengthOrZero, Real
from visray.records import record_kind

_Size = Annotated[Real, Field(ge=0, le=FARTHEST)]


@dataclass(frozen=True, eq=False)
class Sizes:
    """Sizes of values.

    size: world units; negative for what hangs down; NaN for missing values. Shape: (N)
    slope: derivative of `size` by the value. The domain is held fixed, even if it is that of the data. Infinite at the
        value 0 of the scale sqrt and where sizes jump there, 0 for constant data. Shape: (N)
    lo, hi: the domain.
    """

    size: np.ndarray
    slope: np.ndarray
    lo: float
    hi: float


@record_kind
@dataclass(frozen=True, kw_only=True)
class SizeRule:
    """The size of a datum is a + t (b - a), in world units, for the `range` (a, b) and the place t of its value in the
    `domain` (lo, hi): t = (f(v) - f(lo)) / (f(hi) - f(lo)). Beyond the domain, t is below 0 or above 1.

    `column` holds the values. `scale` says what f is: the value itself (linear), its root (sqrt; areas are then
    proportional to values if lo and a are 0), or its logarithm (log). The default domain is from 0 to the largest
    absolute value; for log it is from the smallest to the largest one, and all values must be above 0. The default
    range depends on the scene.

    `negative`: a negative value has the size of its absolute value and hangs down (`down`), or it is an error
    (`refuse`). If lo is negative, negative values are placed in the domain as they are, and hang down only if the
    size is negative.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    column: Column
    scale: Literal["linear", "sqrt", "log"] = "linear"
    domain: tuple[Real, Real] | None = None
    range: tuple[_Size, _Size] | None = None
    negative: Literal["down", "refuse"] = "down"

    @property
    def _signed(self) -> bool:
        """Whether negative values lie in the domain, and are not turned around."""
        return self.domain is not None and self.domain[0] < 0

    def sizes(self, values: np.ndarray, default_range: tuple[float, float]) -> Sizes:
        """Sizes of values, NaN for missing ones. Domain: no flaws. Shape: (N).

        default_range: (a, b) if the rule has no range, in world units.
        """
        v = np.asarray(values, float)
        size, slope = self._unsigned(v, *(self.range or default_range))
        lo, hi = self.limits(v)
        if self._signed:
            return Sizes(size, slope, lo, hi)
        # Below 0 a gizmo hangs down: where the size of 0 is not 0, it jumps there.
        jump = (v == 0) & (size != 0) & (lo < hi)
        return Sizes(np.where(v < 0, -size, size), np.where(jump, np.inf, slope), lo, hi)

    def limits(self, values: np.ndarray) -> tuple[float, float]:
        """The domain (lo, hi); (0, 0) without values. Shape: (N)."""
        if self.domain is not None:
            return self.domain
        found = np.abs(values[np.isfinite(values)])
        if self.scale == "log":
            found = found[found > 0]
        if not len(found):
            return 0.0, 0.0
        return float(found.min()) if self.scale == "log" else 0.0, float(found.max())

    def _unsigned(self, v: np.ndarray, a: float, b: float) -> tuple[np.ndarray, np.ndarray]:
        """(size, its derivative by v) before negative values are turned down. Shapes: (N) each."""
        x = v if self._signed else np.abs(v)
        lo, hi = self.limits(v)
        first, last = _scaled(self.scale, lo), _scaled(self.scale, hi)
        if not first < last:
            # Only zeros, or for log only one value. A zero has the size a, as among other values.
            return np.where(np.isnan(v), v, a if hi == 0 else b), 0 * v
        t = (_scaled(self.scale, x) - first) / (last - first)
        slope = _scale_slope(self.scale, x) / (last - first) * (b - a) if a != b else np.zeros_like(t)
        return a + t * (b - a), slope

    def flaws(
        self,
        values: np.ndarray | None = None,
        default_range: tuple[float, float] = (0.0, 1.0),
        rows: np.ndarray | None = None,
        place: Place = row_place,
    ) -> list[tuple[str, str]]:
        """A list of errors (field, message); empty if there is none.

        values: the values of the column; None: only the fields are checked.
        default_range: as in `sizes`.
        rows: numbers of the rows; None: they are counted from 0.
        place: where a row stands, from its number.

        Shapes: (N) each.
        """
        if self.domain is not None:
            lo, hi = self.domain
            if not lo < hi:
                turned = "; to give larger values smaller sizes, turn the range around" if hi < lo else ""
                return [("domain", f"the first number must be less than the second{turned}")]
            if self.scale == "log" and lo <= 0:
                return [("domain", "both numbers must be above 0 for the scale log")]
            if self.scale == "sqrt" and lo < 0:
                return [("domain", "both numbers must be at least 0 for the scale sqrt")]
            if not _scaled(self.scale, lo) < _scaled(self.scale, hi):
                return [("domain", "the two numbers are too near for double precision")]
        if values is None:
            return []
        v = np.asarray(values, float)
        return self._value_flaws(v, default_range, lambda wrong: rows_text(wrong, v, rows, place))

    def _value_flaws(
        self, v: np.ndarray, default_range: tuple[float, float], said: Callable[[np.ndarray], str]
    ) -> list[tuple[str, str]]:
        """A list with the first kind of error about values, if there is one. Shape: v (N).

        said: wrong rows in words, from their mask.
        """
        a, b = self.range or default_range
        if (wrong := np.isinf(v)).any():
            return [("column", f"has infinite values: {said(wrong)}; leave these cells empty")]
        if self.scale == "log" and (wrong := v <= 0).any():
            text = f'values of "{self.column}" must be above 0 for log, unlike {said(wrong)}'
            return [("scale", f'{text}; take "linear" or "sqrt", or leave these cells empty')]
        if self.negative == "refuse" and not self._signed and (wrong := v < 0).any():
            text = f'negative values of "{self.column}" are refused: {said(wrong)}'
            return [("negative", f'{text}; write "down", or leave these cells empty')]
        size = self._unsigned(v, a, b)[0]
        turned = (v < 0) & (self.negative == "down") if self._signed else np.zeros_like(v, bool)
        if (wrong := (size < 0) & ~turned).any():
            text = f"values so far beyond the domain have a size below 0: {said(wrong)}"
            return [("domain", f"{text}; widen the domain, or leave it out")]
        if (wrong := np.abs(size) > FARTHEST).any():
            text = f"values so far beyond the domain have a size above {FARTHEST:g}: {said(wrong)}"
            return [("domain", f"{text}; widen the domain")]
        return []

    def notes(self, values: np.ndarray) -> list[str]:
        """A list of sentences about what is odd in the sizes of values. Domain: no flaws. Shape: (N)."""
        v = np.asarray(values, float)
        if np.isnan(v).all():
            return [f'The column "{self.column}" has no values.']
        lo, hi = self.limits(v)
        if lo < hi:
            return []
        if hi == 0:
            return [f'All values of the column "{self.column}" are 0; all have the smallest size.']
        return [f'All values of the column "{self.column}" are {hi:g}; all have the largest size.']


def _scaled(scale: str, x: Any) -> Any:
    """f of a scale. Domain: x >= 0 for sqrt, x > 0 for log. Shape: (N), or a number."""
    if scale == "linear":
        return x
    # A number beyond the domain of f has no finite size; `flaws` refuses it.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(x) if scale == "sqrt" else np.log(x) if np.ndim(x) or x > 0 else 0.0


def _scale_slope(scale: str, x: np.ndarray) -> np.ndarray:
    """Derivative of f. Shape: (N)."""
    with np.errstate(divide="ignore"):
        return np.ones_like(x) if scale == "linear" else 0.5 / np.sqrt(x) if scale == "sqrt" else 1 / x


# What a layer may have as a size: a rule, the name of a column, or one size for all, in world units.
SizeSpec = SizeRule | LengthOrZero | Column


def size_rule_of(spec: Any) -> Any:
    """The size rule of a layer: a text is the name of a column. A constant size stays as it is."""
    return SizeRule(column=spec) if isinstance(spec, str) else spec
