"""The base class of kinds, such as the torus, with their own fields and a polynomial surface."""

from dataclasses import dataclass, replace
from typing import Any

from visray.geometry import Frame
from visray.primitives.algebraic import Algebraic, PlacedPolynomial, PolynomialRows
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Bounds
from visray.quantities import Arrays, stacked


@dataclass(frozen=True)
class PolynomialSolidRows:
    """Objects of one kind of PolynomialSolid, as arrays with one entry per object.

    own: the fields of the kind. Derivatives are taken by these fields.
    polynomials: the polynomials that define the surfaces.
    """

    own: Any
    polynomials: PolynomialRows

    def placed(self, outer: Frame | None) -> PlacedPolynomial:
        """The objects in the world. The parameters of the polynomials are taken from the objects' own fields.

        outer: the objects' transforms, or None.
        """
        own = self.own
        parameters = tuple(getattr(own, name) for name in own.parameters)
        return replace(self.polynomials, parameters=parameters).placed_in(own.frame().then(outer), own.shape())

    def bounds(self, outer: Frame | None) -> Bounds:
        """As Primitive.bounds."""
        return self.own.bounds(outer)


class PolynomialSolid(Algebraic):
    """A closed solid whose surface is a polynomial surface that no clip cuts.

    A kind defines `frame`, `shape`, `extents` and `canonical_volume`, as all kinds do. It also defines:
    definition: method that returns the polynomial.
    parameters: names of the fields that are the polynomial's parameters, in the order of the parameters.
    """

    closed = True
    clipped = False
    parameters: tuple[str, ...]

    def definition(self) -> Polynomial:
        """The polynomial in coordinates of the frame. Its clip is centred at the origin and contains the surface."""
        raise TypeError(f"{type(self).__name__} has no definition")

    @property
    def kind(self) -> Any:
        program = self.definition().compiled().program
        return self.kind_of(program, True, type(self.definition().clip_volume()), len(self.parameters), False)

    @classmethod
    def volumes(cls, table: PolynomialSolidRows, outer: Frame | None) -> tuple[Any, Any]:
        return super(Algebraic, cls).volumes(table.own, outer)

    @classmethod
    def table(cls, a: Arrays, objects: list) -> PolynomialSolidRows:
        definitions = PolynomialRows.of(a, [x.definition() for x in objects])
        return PolynomialSolidRows(stacked(a, cls, objects), definitions)

    @classmethod
    def columns(cls, primitive: Any, table: PolynomialSolidRows) -> dict[str, Any]:
        return super().columns(primitive, table.own)
