"""What is asked for: the formula or the name of a known surface, with its parameters, as a polynomial."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from visray import polynomials
from visray.errors import UserError
from visray.hints import hint
from visray.polynomials import Compiled, PolynomialError
from visray.polynomials.catalogue import SURFACES, KnownSurface
from visray.polynomials.everyday import everyday
from visray.primitives.polynomial import Polynomial
from visray.surface_picture.like import known_like
from visray.surface_picture.names import advice, known_name
from visray.terminal import printable

# Name of the object, and of the files of a surface without a name.
SURFACE = "surface"
# Value of a letter without a value.
DEFAULT = 1.0
# Longest formula that a message shows.
SHOWN = 60
# A text that may be meant as the name of a surface.
_WORDS = re.compile(r"[A-Za-zß]{3,}([ _-]?[A-Za-z0-9]+)*")


@dataclass(frozen=True)
class Asked:
    """The surface that is asked for.

    shape: the polynomial without a clip of its own.
    compiled: the polynomial in coordinates about the origin.
    known: the known surface, or None.
    twin: the known surface of which the formula is a multiple, or None.
    name: of the surface, for files.
    label: the formula or the name, for messages.
    notes: how the formula was read, where that may surprise.
    """

    shape: Polynomial
    compiled: Compiled
    known: KnownSurface | None
    name: str
    label: str
    notes: tuple[str, ...]
    twin: KnownSurface | None = None

    @property
    def model(self) -> KnownSurface | None:
        """The known surface whose view and clip are taken; None if they are fitted."""
        return self.known or self.twin

    @property
    def described(self) -> str:
        """The formula with the values of its parameters, for messages."""
        values = _listed(self.shape.parameters)
        return f"{self.label} with {values}" if values else self.label

    @property
    def degree(self) -> int:
        """Degree of the surface; factors that occur several times count once."""
        return sum(f.degree for f in self.compiled.program.factors)


def asked(formula: str, parameters: Mapping[str, float]) -> Asked:
    """Reads a formula or the name of a known surface. Raises a UserError if it, or a parameter, is wrong."""
    text = " ".join(formula.split())
    label = printable(text if len(text) <= SHOWN else text[: SHOWN - 3] + "...") or "the formula"
    values = {name: _finite(name, value) for name, value in parameters.items()}
    if name := known_name(text):
        known = SURFACES[name]
        _check_names(values, tuple(known.parameters), f"the surface {name}")
        shape = Polynomial(surface=name, parameters=values)
        return Asked(shape, _compiled(shape, label), known, name, name, ())
    if _WORDS.fullmatch(text) and (near := advice(text)):
        raise UserError(f"{label}: no surface has this name; {near} (visray surfaces lists them)")
    try:
        read = everyday(text, values)
    except PolynomialError as error:
        lists = "; visray surfaces lists the known names" if _WORDS.fullmatch(text) else ""
        raise UserError(f"{label}: {error}{lists}") from None
    _check_names(values, read.parameters, "the formula")
    free = [letter for letter in read.parameters if letter not in values]
    notes = [*read.notes, *([_about_letters(free)] if free else [])]
    given = {name: values.get(name, DEFAULT) for name in read.parameters}
    shape = Polynomial(expression=read.expression, parameters=given)
    compiled = _compiled(shape, label)
    notes += _about_degree(shape, compiled)
    like = None if given else known_like(read.expression)
    if like is not None:
        notes.append(f"this is the known surface {like}, and is shown as visray surface {like} shows it")
    return Asked(shape, compiled, None, SURFACE, label, tuple(notes), SURFACES[like] if like else None)


def _listed(parameters: Mapping[str, float]) -> str:
    """Names and values as text."""
    return ", ".join(f"{name} = {value:g}" for name, value in parameters.items())


def _finite(name: str, value: float) -> float:
    """The value of a parameter. Raises a UserError if it is no finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise UserError(f"{name} = {value!r}: must be a finite number")
    return float(value)


def _check_names(values: Mapping[str, float], names: tuple[str, ...], where: str) -> None:
    """Raises a UserError if a parameter with a value is none of the names. where: what has these names."""
    for name in values:
        if name not in names:
            raise UserError(f"{name}: is no parameter of {where}; {hint(name, names) if names else 'it has none'}")


def _about_letters(letters: list[str]) -> str:
    """The note about letters that have no value."""
    given = " = ".join([*letters, f"{DEFAULT:g}"])
    options = " ".join(f"--param {letter}=2" for letter in letters[:1])
    return f"{given}, as no value was given; {options} gives another"


def _compiled(shape: Polynomial, label: str) -> Compiled:
    """The polynomial in coordinates about the origin. Raises a UserError if it makes no surface."""
    try:
        return polynomials.build(shape.source(), shape.parameters)
    except PolynomialError as error:
        values = _listed(shape.parameters)
        raise UserError(f"{label}{f' with {values}' if values else ''}: {error}") from None


def _about_degree(shape: Polynomial, compiled: Compiled) -> list[str]:
    """A note, if the values of the parameters make the degree smaller than the formula looks."""
    names = frozenset(shape.parameters)
    try:
        written = polynomials.build(shape.source(), shape.parameters, varied=names)
    except PolynomialError:
        return []
    degree, usual = (sum(f.degree for f in x.program.factors) for x in (compiled, written))
    if degree == usual:
        return []
    return [f"with {_listed(shape.parameters)} the degree is {degree}, not {usual}"]
