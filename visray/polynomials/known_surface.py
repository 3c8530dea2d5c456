"""A polynomial surface that has a name: its equation, its singular points, and a view that shows it well."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product

Point = tuple[float | str, float | str, float | str]


@dataclass(frozen=True)
class View:
    """From where a surface shows itself well.

    direction: from the middle of the clip towards the camera. Its length does not matter.
    up: the direction that is upwards in the picture.
    clip: radius of the clip of the picture; None: that of the known surface.
    zoom: how much larger the surface is in the picture than if it just fitted, > 0.
    """

    direction: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    clip: float | None = None
    zoom: float = 1.0


@dataclass(frozen=True)
class KnownSurface:
    """A surface f = 0 inside a sphere.

    title: name of the surface.
    expression: text of f.
    radius, centre: the sphere that is the default clip.
    source: where the surface was published.
    compact: whether the sphere contains the whole surface. Otherwise the sphere cuts the surface and leaves it open.
    parameters: default values of the parameters in f.
    singular: some of the real singular points in the sphere. A coordinate is a number or an expression without x, y, z.
    singular_count: number of the real singular points in the sphere; None if they form curves. It is that of the
        default values of the parameters.
    singular_curves: the curves in words; "" if there are none.
    view: from where the surface shows itself well; None: not known.
    """

    title: str
    expression: str
    radius: float
    source: str
    compact: bool
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parameters: dict[str, float] = field(default_factory=dict)
    singular: tuple[Point, ...] = ()
    singular_count: int | None = 0
    singular_curves: str = ""
    view: View | None = None


def signed(*points: tuple[str, str, str]) -> tuple[Point, ...]:
    """The points, and all points that differ from them only in the signs of coordinates."""
    signed = {}
    for p in points:
        for signs in product(*(("",) if c == "0" else ("", "-") for c in p)):
            signed[tuple(s + c for s, c in zip(signs, p))] = None
    return tuple(signed)


def permuted(*points: tuple[str, str, str]) -> tuple[Point, ...]:
    """The points, and all points with cyclically permuted coordinates."""
    return tuple(dict.fromkeys(q for a, b, c in points for q in ((a, b, c), (b, c, a), (c, a, b))))


def chebyshev(n: int, values: dict[int, str], odd: Iterable[int]) -> tuple[Point, ...]:
    """The nodes (singular points) of T_n(x) + T_n(y) + T_n(z) + 1, with the Chebyshev polynomial T_n.

    Their coordinates are cos(i pi / n), where two of the three numbers i are odd and one is even.

    values: text of cos(i pi / n) for each i from 1 to n - 1.
    odd: the odd numbers i.
    """
    return tuple(
        tuple(values[i] for i in indices)
        for indices in product(range(1, n), repeat=3)
        if sum(i in odd for i in indices) == 2
    )


def sum_over(form: str, last: str) -> str:
    """Text of the sum of `form` with x, y and z in place of {0}, and of the text `last`."""
    return " + ".join(form.format(v) for v in "xyz") + last
