"""What is known of the known surfaces, as tables and as JSON."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from visray import polynomials
from visray.polynomials.catalogue import SURFACES, KnownSurface
from visray.tables import Column, Table


def degree(known: KnownSurface) -> int:
    """Degree of a known surface."""
    return sum(factor.degree for factor in polynomials.build(known.expression, known.parameters).program.factors)


def singular_points(known: KnownSurface) -> str:
    """The real singular points in the sphere, in words: their number, or what curves they form."""
    return str(known.singular_count) if known.singular_count is not None else f"not isolated: {known.singular_curves}"


def as_json(names: Iterable[str]) -> dict[str, Any]:
    """Report on known surfaces by name: all fields of `KnownSurface`, and `degree`."""
    return {name: {"degree": degree(SURFACES[name])} | asdict(SURFACES[name]) for name in names}


def list_table(names: Iterable[str]) -> Table:
    """A table of known surfaces, with a row for each, and one more for each parameter after the first. A terminal of 80
    columns shows it whole."""
    shown = Table(
        Column("name", no_wrap=True),
        Column("surface", no_wrap=True),
        Column("degree", justify="right"),
        "singular points",
        "--param",
    )
    for name, known in ((name, SURFACES[name]) for name in names):
        singular = str(known.singular_count) if known.singular_count is not None else "curves"
        first, *others = [f"{x} = {value:.5g}" for x, value in known.parameters.items()] or [""]
        shown.add_row(name, known.title, str(degree(known)), singular, first)
        for other in others:
            shown.add_row("", "", "", "", other)
    return shown


def single_table(name: str) -> Table:
    """A table of what is known of one surface. The formula is wrapped."""
    known = SURFACES[name]
    shown = Table("", Column("", overflow="fold"), title=known.title, show_header=False, title_justify="left")
    where = f"a sphere of radius {known.radius:g}" + (
        "" if not any(known.centre) else f" around ({', '.join(f'{x:g}' for x in known.centre)})"
    )
    rows = {
        "formula": f"{known.expression} = 0",
        "degree": str(degree(known)),
        "singular points": singular_points(known),
        "parameters": _parameters(known) or "none",
        "clip": f"{where}, {'which holds all of it' if known.compact else 'which cuts it'}",
        "source": known.source,
        "a picture": f"visray surface {name}",
        "in a scene": f'{{"type": "polynomial", "surface": "{name}"}}',
    }
    if known.view and known.view.clip:
        rows["clip"] += f"; a picture shows a sphere of radius {known.view.clip:g}, which looks better"
    for title, text in rows.items():
        shown.add_row(title, text)
    return shown


def _parameters(known: KnownSurface) -> str:
    """The parameters and their default values."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in known.parameters.items())
