"""What can be said of a formula before a picture is made: its degree, its factors, and whether there is a surface.

A surface is seen where a factor of f changes its sign. A factor that only touches 0, as x^2 + y^2 does, is 0 on curves
or in points, which no ray meets.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from visray import polynomials
from visray.polynomials.factorization import SquareFreeFactor, factorize
from visray.polynomials.literals import exact_parameters
from visray.polynomials.one_sign import one_sign
from visray.polynomials.program import Factor, read
from visray.polynomials.sign_region import FAR, Region
from visray.polynomials.term_text import term_text
from visray.primitives.clips import Ball, Clip
from visray.primitives.primitive import scalars

Points = Literal["found", "none", "thin", "unknown"]


@dataclass(frozen=True)
class FormulaFactor:
    """A factor of a formula.

    text: the factor as a sum of terms; words if it is long.
    degree: its degree. multiplicity: how often it occurs.
    points: as in FormulaFacts, for the surface of this factor.
    sign: 1 or -1 if it has this sign, or is 0, wherever it is looked at; else 0.
    everywhere: whether that is proved for all of space.
    """

    text: str
    degree: int
    multiplicity: int
    points: Points
    sign: int
    everywhere: bool


@dataclass(frozen=True)
class FormulaFacts:
    """Facts about a formula f.

    degree: degree of f.
    factors: its factors; each is drawn once.
    points: "found": there is a surface in the clip. "none": it is proved that no point with f = 0 is there. "thin": it
        is proved that f = 0 is at most curves or points, which cannot be seen. "unknown": no surface was found, and
        there is no proof.
    everywhere: whether "none" or "thin" holds in all of space, and not only in the clip.
    notes: sentences about factors and squares.
    nothing: why there is nothing to see, as a sentence; None if there is a surface.
    """

    degree: int
    factors: tuple[FormulaFactor, ...]
    points: Points
    everywhere: bool
    notes: tuple[str, ...]
    nothing: str | None


def formula_facts(expression: str, parameters: Mapping[str, float], clip: Clip | None = None) -> FormulaFacts:
    """Facts about the surface f = 0.

    expression: f in the strict grammar.
    clip: part of space in which the surface is looked for; if None, the ball of radius FAR around the origin.

    PolynomialError is raised if f is no polynomial, or a constant.
    """
    volume = scalars(clip or Ball(radius=FAR))
    centre, half = tuple(map(float, volume.frame().o)), tuple(map(float, volume.half_sides()))
    return _facts(
        expression, tuple(sorted(parameters.items())), centre, half, isinstance(clip or Ball(), Ball), clip is None
    )


@lru_cache(maxsize=64)
def _facts(expression: str, parameters: tuple, centre: tuple, half: tuple, ball: bool, far: bool) -> FormulaFacts:
    """As formula_facts. centre, half: centre and half sides of the clip. ball: whether it is a ball. far: whether all
    distances from the centre are looked at."""
    values = exact_parameters(dict(parameters))
    compiled = polynomials.build(expression, dict(parameters), centre)
    square_free, sign = factorize(read(expression, dict(parameters)), values)
    region = Region(compiled.values, half, ball, far)
    factors = tuple(_factor(f, code, values, region) for f, code in zip(square_free, compiled.program.factors))
    all_points = {f.points for f in factors}
    points: Points = next(p for p in ("found", "unknown", "thin", "none") if p in all_points)
    everywhere = points in ("thin", "none") and all(f.everywhere for f in factors)
    degree = sum(f.degree * f.multiplicity for f in factors)
    for factor in factors:
        sign *= 1 if factor.multiplicity % 2 == 0 else factor.sign
    where = "" if everywhere else f" within {FAR:g} of the origin" if far else " in the clip"
    nothing = _nothing(points, sign, where)
    return FormulaFacts(degree, factors, points, everywhere, tuple(_factor_notes(factors)), nothing)


def _factor_notes(factors: tuple[FormulaFactor, ...]) -> list[str]:
    """Sentences about factors and squares."""
    notes = []
    if len(factors) > 1:
        several = " and of ".join(f.text for f in factors) if len(factors) <= 4 else f"{len(factors)} factors"
        notes.append(f"f is a product: its surface is that of {several}, together")
    notes += [f"{f.text} occurs {f.multiplicity} times in f; it is drawn once" for f in factors if f.multiplicity > 1]
    if len(factors) > 1:
        hidden = [f for f in factors if f.points in ("none", "thin")]
        seen = any(f.points not in ("none", "thin") for f in factors)
        notes += [f"nothing is seen of the factor {f.text}: it {_side(f)}" for f in hidden if seen]
    return notes


def _side(factor: FormulaFactor) -> str:
    """Words about the sign of a factor that has one sign."""
    if factor.points == "thin":
        return "never changes its sign"
    return (
        f"is {'above' if factor.sign > 0 else 'below'} 0 {'everywhere' if factor.everywhere else 'where it is drawn'}"
    )


def _nothing(points: Points, sign: int, where: str) -> str | None:
    """The sentence about a formula of which nothing is seen; None if there is a surface.

    sign: sign of f wherever it is not 0. where: the part of space, for the sentence; "" for all of it.
    """
    side = "above 0" if sign > 0 else "below 0"
    match points:
        case "none":
            return f"it has no real points{where}: f is {side} {'there' if where else 'everywhere'}"
        case "thin":
            least = "at least 0" if sign > 0 else "at most 0"
            return f"f is {least}{where or ' everywhere'}, so f = 0 is at most curves or points"
        case "unknown":
            return f"no surface was found{where}: f is {side} at all places that were looked at"
    return None


def _factor(factor: SquareFreeFactor, code: Factor, values: dict, region: Region) -> FormulaFactor:
    """The facts about one factor. code: its code, in coordinates about the clip's centre."""
    proved = one_sign(factor.expression, values)
    sign = proved[0] if proved else region.sign(code)
    if proved:
        strict = proved[1] or (not region.far and region.is_free(code))
        points, everywhere = ("none" if strict else "thin"), proved[1] or not strict
    else:
        points, everywhere = ("found" if not sign else "none" if region.is_free(code) else "unknown"), False
    text = term_text(factor.expression, factor.degree)
    return FormulaFactor(text, factor.degree, factor.multiplicity, points, sign, everywhere)
