"""The ball in which a surface is drawn, with numbers as people write them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from visray.errors import UserError
from visray.polynomials import PolynomialError, build, check_sizes
from visray.polynomials.catalogue import SURFACES
from visray.polynomials.formula_facts import FormulaFacts, formula_facts
from visray.primitives.clips import Ball
from visray.quantities import FARTHEST
from visray.surface_picture.field import Field
from visray.surface_picture.points import surface_points
from visray.surface_picture.reading import Asked
from visray.surface_picture.whereabouts import Whereabouts, whereabouts

# The clip of a surface that ends is larger than the surface by this share.
MARGIN = 0.02
# The centre of a clip is rounded to this share of its radius.
ROUNDED = 0.02


@dataclass(frozen=True)
class Cut:
    """The clip of a surface.

    ball: the clip.
    whole: whether it holds the whole surface; None if that was not looked at.
    points: points of the surface all over the clip. Shape: (N, 3), N > 0.
    """

    ball: Ball
    whole: bool | None
    points: np.ndarray


def clip_for(surface: Asked, field: Field, radius: float | None) -> Cut:
    """The clip of a surface. Raises a UserError if nothing of it is to be seen.

    field: the polynomial of the surface. radius: that of the clip, if it is asked for.
    """
    known, found, whole = surface.model, None, None
    if radius is not None:
        ball = Ball(center=known.centre if known else (0.0, 0.0, 0.0), radius=float(radius))
    elif known:
        own = known.view.clip if known.view else None
        grown, ends = _growth(surface, field)
        radius = own or known.radius
        radius = radius if grown == 1 else _two_digits(grown * radius, math.ceil)
        ball, whole = Ball(center=known.centre, radius=radius), known.compact and own is None and ends
    else:
        found = whereabouts(field)
        if found is None:
            raise UserError(_nowhere(surface))
        ball, whole = _ball(found), found.compact
    _check_sizes(surface, ball)
    points = surface_points(field, np.array(ball.center), ball.radius)
    if found is not None:
        near = np.linalg.norm(found.points - np.array(ball.center), axis=1) <= ball.radius
        points = np.concatenate([points, found.points[near]])
    if not len(points):
        raise UserError(_nothing_in(surface, field, ball))
    return Cut(ball, whole, points)


def _growth(surface: Asked, field: Field) -> tuple[float, bool]:
    """How much larger a known surface is with its parameters than with the usual ones, and whether it ends if it does
    with those. 1 and True for the usual ones."""
    known, name = surface.known, surface.shape.surface
    if known is None or not surface.shape.parameters.items() - known.parameters.items():
        return 1.0, True
    usual, found = _usual(name), whereabouts(field)
    if usual is None or found is None:
        return 1.0, True
    return found.radius / usual.radius, found.compact


@cache
def _usual(name: str) -> Whereabouts | None:
    """Where a known surface with its usual parameters is."""
    known = SURFACES[name]
    return whereabouts(Field(build(known.expression, known.parameters)))


def facts(surface: Asked, clip: Ball | None) -> FormulaFacts:
    """What can be said of the formula. clip: the part of space that counts; None: all of it."""
    return formula_facts(surface.shape.source(), surface.shape.parameters, clip)


def _ball(found: Whereabouts) -> Ball:
    """The clip that shows the surface."""
    unit = 10.0 ** math.floor(math.log10(ROUNDED * found.radius))
    places = max(0, -round(math.log10(unit)))
    # Adding 0 makes 0 of -0.
    centre = tuple(round(float(x), places) + 0.0 for x in np.round(found.centre / unit) * unit)
    if not found.compact:
        return Ball(center=centre, radius=_two_digits(found.radius, round))
    reach = found.radius + float(np.linalg.norm(found.centre - np.array(centre)))
    return Ball(center=centre, radius=_two_digits((1 + MARGIN) * reach, math.ceil))


def _two_digits(x: float, rounding: Callable[[float], int]) -> float:
    """A number > 0, rounded to two digits."""
    power = math.floor(math.log10(x)) - 1
    return float(f"{rounding(x / 10.0**power)}e{power}")


def _check_sizes(surface: Asked, ball: Ball) -> None:
    """Raises a UserError if values of f in the clip are too large or too small for doubles."""
    try:
        check_sizes(surface.compiled, float(np.abs(ball.center).max()) + ball.radius)
    except PolynomialError as error:
        raise UserError(f"{surface.described}: {error}") from None


def _nowhere(surface: Asked) -> str:
    """The error of a formula whose surface is found nowhere."""
    why = facts(surface, None).nothing or "no place was found where f changes its sign"
    return f"{surface.described}: shows nothing: {why}; change a sign or a number"


def _nothing_in(surface: Asked, field: Field, ball: Ball) -> str:
    """The error of a clip that the surface misses."""
    found = whereabouts(field)
    if found is None:
        return _nowhere(surface)
    reach = _two_digits(float(np.linalg.norm(found.centre - np.array(ball.center))) + found.radius, math.ceil)
    advice = f"; --clip {reach:g} shows it" if reach <= FARTHEST else ""
    return f"{surface.described}: no point of the surface is in the clip, a ball of radius {ball.radius:g}{advice}"
