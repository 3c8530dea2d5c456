"""Kinds with fields of their own whose surface is that of a polynomial, such as the torus."""

from dataclasses import dataclass, replace
from typing import Any

from visray.geometry import Frame
from visray.primitives.algebraic import Algebraic, PlacedPolynomial, PolynomialRows
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Bounds
from visray.quantities import Arrays, stacked


@dataclass(frozen=True)
class PolynomialSolidRows:
    """Objects of such a kind as arrays with one entry per object.

    own: the fields of the kind; derivatives are taken by these.
    polynomials: the polynomials that define the surfaces.
    """

    own: Any
    polynomials: PolynomialRows

    def placed(self, outer: Frame | None) -> PlacedPolynomial:
        """The polynomials in the frames of the objects. The objects' own fields serve as the parameters."""
        own = self.own
        parameters = tuple(getattr(own, name) for name in own.parameters)
        return replace(self.polynomials, parameters=parameters).placed_in(own.frame().then(outer), own.shape())

    def bounds(self, outer: Frame | None) -> Bounds:
        """As Primitive.bounds."""
        return self.own.bounds(outer)


class PolynomialSolid(Algebraic):
    """A closed solid bounded by a polynomial surface that lies within its clip, in the frame of the object's fields.

    A kind defines `frame`, `shape` and `extents`, as all kinds do. It also defines:
    definition: the polynomial.
    parameters: names of the fields that are the polynomial's parameters, in the order of the parameters.
    """

    closed = True
    clipped = False
    parameters: tuple[str, ...]

    def definition(self) -> Polynomial:
        """The polynomial in coordinates of the frame. Its clip is centred at the frame's origin and never cuts the
        surface."""
        raise TypeError(f"{type(self).__name__} has no definition")

    @property
    def kind(self) -> Any:
        program = self.definition().compiled().program
        return self.kind_of(program, True, type(self.definition().clip_volume()), len(self.parameters), False)

    @classmethod
    def table(cls, a: Arrays, objects: list) -> PolynomialSolidRows:
        definitions = PolynomialRows.of(a, [x.definition() for x in objects])
        return PolynomialSolidRows(stacked(a, cls, objects), definitions)

    @classmethod
    def columns(cls, primitive: Any, table: PolynomialSolidRows) -> dict[str, Any]:
        return super().columns(primitive, table.own)
