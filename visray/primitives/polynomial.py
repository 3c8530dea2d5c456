"""Polynomial surfaces: f(x, y, z) = 0 of any degree, within a clip."""

import re
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Annotated, Any, Literal

from pydantic import Field

from visray import polynomials
from visray.geometry import Frame
from visray.polynomials import Compiled, PolynomialError
from visray.polynomials.catalogue import SURFACES
from visray.primitives.algebraic import Algebraic, PlacedPolynomial, PolynomialRows
from visray.primitives.clips import Ball, Block, Clip
from visray.primitives.primitive import Bounds, scalars
from visray.primitives.sphere import sphere_uv
from visray.quantities import Arrays, Name, Real


@dataclass(frozen=True, kw_only=True)
class Polynomial(Algebraic):
    """All points with f(x, y, z) = 0 in the clip. Written in one of three ways: an `expression` such as
    "x^2 + y^2 - z^2 - 1", with + - * / ^, numbers, pi, phi, sqrt(number) and the `parameters`; the list `monomis` of
    the original VisRayTrace; or the name of a known `surface`.

    `ends` says whether the surface is open where it is cut by the clip, or capped: a closed solid of all points of
    the clip where f < 0, as glass should be. Multiple factors count once.
    `tolerance`: how far off a crossing may be along its ray, as a share of half the ray's chord in the clip: so by no
    more than so many radii of the clip. 0: to the last digit. Degrees 1 and 2 have formulas, and no tolerance. It is
    for studies of what accuracy costs: it saves next to nothing.
    uv: as on a globe about the clip's centre.
    """

    type: Literal["polynomial"] = "polynomial"
    expression: Annotated[str, Field(strict=True)] | None = None
    monomis: tuple[Annotated[str, Field(strict=True)], ...] | None = None
    surface: Annotated[str, Field(strict=True)] | None = None
    parameters: dict[Name, Real] = field(default_factory=dict)
    clip: Annotated[Ball | Block, Field(discriminator="type")] | None = None
    ends: Literal["open", "capped"] = "open"
    tolerance: Annotated[Real, Field(ge=0, le=1)] = 0.0

    def __post_init__(self):
        if self.surface in SURFACES:
            # Written out, so that each has an address.
            object.__setattr__(self, "parameters", SURFACES[self.surface].parameters | self.parameters)

    @property
    def closed(self) -> bool:
        """Whether it is the surface of a solid."""
        return self.ends == "capped"

    @property
    def kind(self) -> Any:
        form = self.compiled().program
        # That there is a tolerance is structure, as code for it costs time even where it is 0; what it is is data.
        loose = self.tolerance > 0 and any(f.degree > 2 for f in form.factors)
        return self.kind_of(form, self.closed, type(self.clip_volume()), len(self.parameters), loose)

    def clip_volume(self) -> Clip:
        """The clip, by default the named surface's own, or a ball of radius 5."""
        if self.clip is None and self.surface:
            classic = SURFACES[self.surface]
            return Ball(center=classic.centre, radius=classic.radius)
        return self.clip or Ball()

    def source(self) -> str | tuple[str, ...]:
        """The polynomial as text."""
        if self.surface is not None:
            return SURFACES[self.surface].expression
        return self.monomis if self.expression is None else self.expression

    def compiled(self) -> Compiled:
        """The polynomial, ready for kernels, in coordinates about the clip's centre."""
        o = scalars(self.clip_volume()).frame().o
        return polynomials.build(self.source(), self.parameters, tuple(map(float, o)))

    def flaws(self) -> list[tuple[str, str]]:
        ways = [name for name in ("expression", "monomis", "surface") if getattr(self, name) is not None]
        if len(ways) != 1:
            several = f"{' and '.join(ways)} are written; keep one"
            return [(ways[-1] if ways else "expression", several if ways else "is missing; or monomis, or surface")]
        if self.surface is not None and self.surface not in SURFACES:
            near = get_close_matches(self.surface, SURFACES, 1)
            hint = f'did you mean "{near[0]}"? ' if near else ""
            return [("surface", f"unknown surface; {hint}(one of {', '.join(SURFACES)})")]
        if wrong := [("clip", text) for _, text in self.clip_volume().flaws()] + self._unused():
            return wrong
        try:
            polynomials.check_sizes(self.compiled(), max(map(float, scalars(self.clip_volume()).half())))
        except PolynomialError as error:
            part = "" if error.part is None else f".{error.part}"
            return [(f"{ways[0]}{part}", str(error))]
        return []

    def _unused(self) -> list[tuple[str, str]]:
        """Parameters that nothing depends on."""
        if self.surface is not None:
            there, of = SURFACES[self.surface].parameters, f"the surface {self.surface}"
        elif self.expression is not None:
            there, of = re.findall(r"\w+", self.expression), "the expression"
        else:
            there, of = (), "monomis, which have none"
        wrong = [name for name in self.parameters if name not in there and (there or self.expression is None)]
        return [("parameters", f"{wrong[0]} is not in {of}; leave it out")] if wrong else []

    def bounds(self, outer: Frame | None) -> Bounds:
        # Of the host, as bounding_box asks; kernels have PolynomialRows.
        return scalars(self.clip_volume()).bounds(outer)

    @classmethod
    def table(cls, a: Arrays, things: list["Polynomial"]) -> PolynomialRows:
        return PolynomialRows.of(a, things)

    @classmethod
    def columns(cls, thing: "Polynomial", table: PolynomialRows) -> dict[str, Any]:
        return {f"parameters.{name}": column for name, column in zip(thing.parameters, table.parameters)}

    @staticmethod
    def uv(placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        return sphere_uv(placed.inverse.point(p))

    def mitsuba(self) -> str:
        return "Mitsuba has no polynomial surfaces; `visray stability` compares them with exact arithmetic"
