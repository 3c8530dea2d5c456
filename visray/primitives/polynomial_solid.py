"""Kinds that are defined by another kind: a polynomial surface in a frame of their own, with fields of their own."""

from dataclasses import dataclass, replace
from typing import Any

from visray.geometry import Frame
from visray.primitives.algebraic import Algebraic, PlacedPolynomial, PolynomialRows
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Bounds
from visray.quantities import Arrays, stacked


@dataclass(frozen=True)
class PolynomialSolidRows:
    """Objects of such a kind as arrays: the kind's own columns, by which derivatives are taken, and the polynomials."""

    own: Any
    polynomials: PolynomialRows

    def placed(self, outer: Frame | None) -> PlacedPolynomial:
        """The polynomials in the objects' frames; their parameters are the objects' own columns."""
        own = self.own
        known = tuple(getattr(own, name) for name in own.parameters)
        return replace(self.polynomials, parameters=known).within(own.frame().then(outer), own.shape())

    def bounds(self, outer: Frame | None) -> Bounds:
        """As of a primitive."""
        return self.own.bounds(outer)


class PolynomialSolid(Algebraic):
    """A kind that is the solid of a polynomial (polynomial.py), whole within its clip, in the frame of its fields.

    A kind says its `frame`, `shape` and `extents`, as all kinds do; its `definition`; and `parameters`: the fields that
    are the definition's parameters, in their order there.
    """

    closed = True
    clipped = False
    parameters: tuple[str, ...]

    def definition(self) -> Polynomial:
        """The polynomial in coordinates of the frame, its clip about the frame's origin: a clip that never cuts it."""
        raise TypeError(f"{type(self).__name__} has no definition")

    @property
    def kind(self) -> Any:
        form = self.definition().compiled().program
        return self.kind_of(form, True, type(self.definition().clip_volume()), len(self.parameters), False)

    @classmethod
    def table(cls, a: Arrays, things: list) -> PolynomialSolidRows:
        return PolynomialSolidRows(stacked(a, cls, things), PolynomialRows.of(a, [x.definition() for x in things]))

    @classmethod
    def columns(cls, thing: Any, table: PolynomialSolidRows) -> dict[str, Any]:
        return super().columns(thing, table.own)
