"""Polynomial surfaces: f(x, y, z) = 0 of any degree, inside a clip."""

import re
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Annotated, Any, Literal

from pydantic import Field

from visray import polynomials
from visray.geometry import Frame
from visray.polynomials import Compiled, PolynomialError
from visray.polynomials.catalogue import SURFACES
from visray.polynomials.everyday import Everyday, everyday
from visray.polynomials.grammar import LONGEST_MENDED
from visray.primitives.algebraic import Algebraic, PlacedPolynomial, PolynomialRows
from visray.primitives.clips import Ball, Block, Clip
from visray.primitives.primitive import Bounds, identity, scalars
from visray.primitives.sphere import sphere_uv
from visray.quantities import Arrays, Name, Real
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class Polynomial(Algebraic):
    """A polynomial surface: all points with f(x, y, z) = 0 inside the clip, a ball or a box.

    f is given by one of three fields. `expression` is a text such as "x^2 + y^2 - z^2 - 1", with + - * / ^ and
    constants: numbers, pi, phi (the golden ratio), e, the `parameters`, and functions of them such as sqrt(2) and
    cos(2*pi/5). `monomis` is a list of monomials, as in the original
    VisRayTrace. `surface` is the name of a known surface. Repeated factors count once.

    `ends`: if "open", the surface has a hole wherever the clip cuts it. If "capped", the object is the solid of all
    points of the clip with f < 0; use this for glass.
    `tolerance`: greatest error of the distance to a crossing, in units of half the length of the ray inside the clip.
    For a ball this error is at most `tolerance` times the radius. 0 means exact to the last digit. Surfaces of degree 1
    and 2 are solved by formulas and have no tolerance. The field is for studies of the cost of accuracy; a tolerance
    saves almost no time.
    uv: longitude and latitude about the clip's centre, as on a sphere.
    """

    v_ends = True
    flows = True
    # Names of the parameters by which derivatives are asked for (varied_by). No annotation, so that it is no field.
    varied = frozenset()

    type: Literal["polynomial"] = "polynomial"
    expression: Annotated[str, Field(strict=True)] | None = field(default=None, kw_only=False)
    monomis: tuple[Annotated[str, Field(strict=True)], ...] | None = None
    surface: Annotated[str, Field(strict=True)] | None = None
    parameters: dict[Name, Real] = field(default_factory=dict)
    clip: Annotated[Ball | Block, Field(discriminator="type")] | None = None
    ends: Literal["open", "capped"] = "open"
    tolerance: Annotated[Real, Field(ge=0, le=1)] = 0.0

    def __post_init__(self):
        if self.surface in SURFACES:
            # All parameters of the surface become fields, so that each has an address.
            object.__setattr__(self, "parameters", SURFACES[self.surface].parameters | self.parameters)

    @property
    def closed(self) -> bool:
        """Whether the object is a solid."""
        return self.ends == "capped"

    def advice_for_solid(self) -> str:
        return 'write "ends": "capped"'

    @property
    def kind(self) -> Any:
        program = self.compiled().program
        # Whether there is a tolerance is part of the kernel's structure, because its code would cost time even if all
        # tolerances were 0. The value of the tolerance is data.
        loose = self.tolerance > 0 and any(f.degree > 2 for f in program.factors)
        return self.kind_of(program, self.closed, type(self.clip_volume()), len(self.parameters), loose)

    def clip_volume(self) -> Clip:
        """The clip of the object. By default it is the ball of the known surface, or else a ball of radius 5."""
        if self.clip is None and self.surface:
            known = SURFACES[self.surface]
            return Ball(center=known.centre, radius=known.radius)
        return self.clip or Ball()

    def source(self) -> str | tuple[str, ...]:
        """The polynomial as it is written in the scene or in the catalogue: one text, or a list of monomials."""
        if self.surface is not None:
            return SURFACES[self.surface].expression
        return self.monomis if self.expression is None else self.expression

    def compiled(self) -> Compiled:
        """The compiled polynomial, in coordinates about the clip's centre."""
        o = scalars(self.clip_volume()).frame().o
        return polynomials.build(self.source(), self.parameters, tuple(map(float, o)), self.varied)

    def varied_by(self, names: Iterable[str]) -> "Polynomial":
        """A copy of the object with the right derivatives by the named parameters: its program is right for all their
        values in a neighbourhood. Raises PolynomialError if the surface has no such derivative."""
        if flaw := polynomials.slope_flaw(self.source(), self.parameters, frozenset(names)):
            raise PolynomialError(flaw)
        varied = copy(self)
        object.__setattr__(varied, "varied", frozenset(names))
        return varied

    def with_fields(self, **changes: Any) -> "Polynomial":
        changed = super().with_fields(**changes)
        object.__setattr__(changed, "varied", self.varied)
        return changed

    def rounded_constants(self) -> tuple[str, ...]:
        """Texts of the functions in the polynomial that have no exact form here, such as "sin(1)"."""
        return polynomials.inexact(self.compiled().constants)

    def flaws(self) -> list[tuple[str, str]]:
        given = [name for name in ("expression", "monomis", "surface") if getattr(self, name) is not None]
        if len(given) != 1:
            several = f"{' and '.join(given)} are written; keep one"
            return [(given[-1] if given else "expression", several if given else "is missing; or monomis, or surface")]
        if self.surface is not None and self.surface not in SURFACES:
            near = get_close_matches(self.surface, SURFACES, 1)
            hint = f'did you mean "{near[0]}"? ' if near else ""
            return [("surface", f"unknown surface; {hint}(one of {', '.join(SURFACES)})")]
        if errors := [("clip", text) for _, text in self.clip_volume().flaws()] + self._unused():
            return errors
        try:
            polynomials.check_sizes(self.compiled(), max(map(float, scalars(self.clip_volume()).half_sides())))
        except PolynomialError as error:
            part = "" if error.part is None else f".{error.part}"
            return [(f"{given[0]}{part}", self._with_mended(str(error)))]
        return []

    def _with_mended(self, message: str) -> str:
        """The message about an expression that is wrong. If it is right as people write formulas elsewhere, as x² = 2y
        is, the message has it as visray reads it."""
        read = self._everyday()
        if read is None or read.notes or not set(read.parameters) <= self.parameters.keys():
            return message
        same = read.expression.replace(" ", "") == self.expression.replace(" ", "")
        if same or len(read.expression) > LONGEST_MENDED:
            return message
        return f"{message.split('; ')[0]}; write {read.expression}"

    def _everyday(self) -> Everyday | None:
        """The expression as people write formulas elsewhere; None if there is none, or if that is wrong too."""
        try:
            return None if self.expression is None else everyday(self.expression, self.parameters)
        except PolynomialError:
            return None

    def _unused(self) -> list[tuple[str, str]]:
        """A list with one error (field, message) for the first parameter that f does not contain, or the empty list."""
        if self.surface is not None:
            names, place = SURFACES[self.surface].parameters, f"the surface {self.surface}"
        elif self.expression is not None:
            names, place = re.findall(r"\w+", self.expression), "the expression"
        else:
            names, place = (), "monomis, which have none"
        unused = [name for name in self.parameters if name not in names and (names or self.expression is None)]
        if unused and (read := self._everyday()):
            # The letter is in it, as in 2ax; the missing sign is the error to be told.
            unused = [name for name in unused if name not in read.parameters]
        return [("parameters", f"{unused[0]} is not in {place}; leave it out")] if unused else []

    def carrier(self) -> Frame:
        # A clip that moves does not move the surface.
        return identity()

    def bounds(self, outer: Frame | None) -> Bounds:
        # This is only for bounding_box, outside of kernels; kernels use PolynomialRows.bounds.
        return scalars(self.clip_volume()).bounds(outer)

    @classmethod
    def table(cls, a: Arrays, objects: list["Polynomial"]) -> PolynomialRows:
        return PolynomialRows.of(a, objects)

    @classmethod
    def columns(cls, primitive: "Polynomial", table: PolynomialRows) -> dict[str, Any]:
        return {f"parameters.{name}": column for name, column in zip(primitive.parameters, table.parameters)}

    @staticmethod
    def uv(placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        return sphere_uv(placed.inverse.point(p))

    def mitsuba(self) -> str:
        return "Mitsuba has no polynomial surfaces; `visray stability` compares them with exact arithmetic"
