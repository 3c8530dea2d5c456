"""What kernels evaluate: the operations of each factor as they are compiled, and apart from them all numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

from visray.polynomials import grammar, monomials
from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import TooLong, expand, horner, monomial_terms, recentre
from visray.polynomials.expression import (
    BITS,
    Axis,
    Expression,
    Negative,
    Power,
    Product,
    rational,
    simplify,
    translate,
)
from visray.polynomials.factorization import factorize

Source = str | tuple[str, ...] | list[str]
# A bound on |f| outside of these leaves no room for the sums and differences of it that are computed in doubles.
LARGEST, SMALLEST = 1e140, 1e-140
MAX_PRODUCTS = 3_000_000


@dataclass(frozen=True)
class Factor:
    """A polynomial without repeated parts, its degree along a generic line, and whether its multiplicity is even.

    Each operation of `code` names earlier ones by their index: ("slot", j), ("axis", k), ("add", i, j), ("sub", i, j),
    ("mul", i, j), ("neg", i), ("pow", i, n) with n >= 2. The last one is the result.
    """

    degree: int
    code: tuple[tuple, ...]
    even: bool


@dataclass(frozen=True)
class Program:
    """All that is compiled; forms are equal where polynomials differ only in the values of their numbers.

    sign * the product of the factors that are not even has the sign of f everywhere.
    """

    factors: tuple[Factor, ...]
    sign: int
    slots: int


@dataclass(frozen=True)
class Compiled:
    """A form and the numbers in its slots: as doubles, as trees of constants, and as rationals before rounding."""

    program: Program
    values: tuple[float, ...]
    constants: tuple[Expression, ...]
    exact_values: tuple[Fraction, ...]


def build(source: Source, parameters: dict[str, float] | None = None, centre: tuple = (0.0, 0.0, 0.0)) -> Compiled:
    """The form of a polynomial, written as text or as a list of monomials, in q = p - centre."""
    source = source if isinstance(source, str) else tuple(source)
    return _built(source, tuple(sorted((parameters or {}).items())), tuple(map(float, centre)))


@lru_cache(maxsize=256)
def _built(source: str | tuple, parameters: tuple, centre: tuple[float, float, float]) -> Compiled:
    parts, sign = _split(source, parameters)
    values = {name: Fraction(value) for name, value in parameters}
    middle = tuple(map(Fraction, centre))
    slots = _Slots()
    factors = tuple(Factor(p.degree, _code(_about(p.tree, middle), slots), p.even) for p in parts)
    wide = tuple(rational(c, values) for c in slots.constants)
    return Compiled(Program(factors, sign, len(wide)), tuple(map(_double, wide)), tuple(slots.constants), wide)


@lru_cache(maxsize=256)
def _split(source: str | tuple, parameters: tuple) -> tuple:
    """The part that is the same about every centre."""
    return factorize(read(source, dict(parameters)), grammar.known(dict(parameters)))


def read(source: Source, parameters: dict[str, float]) -> Expression:
    """The tree of a polynomial, written as text or as a list of monomials."""
    return grammar.parse(source, parameters) if isinstance(source, str) else monomials.parse(list(source))


def _double(value: Fraction) -> float:
    # Merged constants may be beyond doubles, or among those that have lost digits, although none of them was.
    if value and not -1022 < abs(value.numerator).bit_length() - value.denominator.bit_length() < 1023:
        raise PolynomialError("its constants multiply to a number beyond the doubles; write it in another unit")
    return float(value)


def _about(tree: Expression, centre: tuple[Fraction, Fraction, Fraction]) -> Expression:
    """A simplify tree about a centre: what is written expanded in Horner's scheme, all else as it is written."""
    terms = monomial_terms(tree)
    return simplify(translate(tree, centre) if terms is None else horner(recentre(terms, centre)))


class _Slots:
    """The constants of a form. Only those with a name in them, or a root, share a slot where they are equal."""

    def __init__(self):
        self.constants: list[Expression] = []
        self.shared: dict[Expression, int] = {}

    def of(self, constant: Expression) -> int:
        if constant in self.shared:
            return self.shared[constant]
        self.constants.append(constant)
        if constant.parametric or constant.irrational:
            self.shared[constant] = len(self.constants) - 1
        return len(self.constants) - 1


def _code(tree: Expression, slots: _Slots) -> tuple[tuple, ...]:
    found: dict[tuple, int] = {}
    sums: dict[Expression, int] = {}

    def put(*operation) -> int:
        return found.setdefault(operation, len(found))

    def emit(node: Expression) -> int:
        match node:
            case _ if not node.degree:
                return put("slot", slots.of(node))
            case Axis(k):
                return put("axis", k)
            case Negative(of):
                return put("neg", emit(of))
            case Power(of, exponent=n):
                return put("pow", emit(of), n)
            case Product(parts):
                return product(parts)
        # Equal sums are one, with their numbers: (x^2 + y^2 - 1) in two places is computed once.
        if node not in sums:
            sums[node] = total(node.parts)
        return sums[node]

    def product(parts: tuple[Expression, ...]) -> int:
        exponents: dict[int, int] = {}
        for part in parts:
            of, n = (part.of, part.exponent) if isinstance(part, Power) and part.degree else (part, 1)
            k = emit(of)
            exponents[k] = exponents.get(k, 0) + n
        whole = None
        for k, n in exponents.items():
            power = put("pow", k, n) if n > 1 else k
            whole = power if whole is None else put("mul", whole, power)
        return whole

    def total(parts: tuple[Expression, ...]) -> int:
        minus = [isinstance(p, Negative) and p.degree > 0 for p in parts]
        terms = [emit(p.of if m else p) for p, m in zip(parts, minus)]
        # A sum starts with a term that is added, so that none has to be negate first.
        first = minus.index(False) if False in minus else 0
        whole = terms[first]
        for k, (term, m) in enumerate(zip(terms, minus)):
            if k != first:
                whole = put("sub" if m != minus[first] else "add", whole, term)
        return put("neg", whole) if minus[first] else whole

    emit(tree)
    return tuple(found)


def interpret(code: tuple[tuple, ...], slots: Any, axes: Any, power: Callable[[Any, int], Any] | None = None) -> Any:
    """The value of a factor in any arithmetic with + - *."""
    power = power or repeated
    done: list[Any] = []
    for name, *at in code:
        match name:
            case "slot":
                value = slots[at[0]]
            case "axis":
                value = axes[at[0]]
            case "add":
                value = done[at[0]] + done[at[1]]
            case "sub":
                value = done[at[0]] - done[at[1]]
            case "mul":
                value = done[at[0]] * done[at[1]]
            case "neg":
                value = -done[at[0]]
            case _:
                value = power(done[at[0]], at[1])
        done.append(value)
    return done[-1]


def repeated(value: Any, n: int) -> Any:
    """A power by squaring."""
    result = None
    while True:
        if n % 2:
            result = value if result is None else result * value
        n //= 2
        if not n:
            return result
        value = value * value


def magnitude_bounds(built: Compiled, reach: float) -> tuple[float, ...]:
    """For each factor a bound on its size where no coordinate of q is above `reach` in size."""
    sizes = [abs(v) for v in built.values]
    # The bound of a difference is that of the sum, and that of -a is that of a.
    bounds = {"sub": lambda i, j: ("add", i, j), "neg": lambda i: ("pow", i, 1)}
    found = []
    for factor in built.program.factors:
        code = tuple(bounds[name](*at) if name in bounds else (name, *at) for name, *at in factor.code)
        found.append(interpret(code, sizes, (abs(reach),) * 3))
    return tuple(found)


def check_sizes(built: Compiled, reach: float):
    """PolynomialError where a factor would overflow or vanish in doubles."""
    for size in magnitude_bounds(built, reach):
        if not size <= LARGEST:
            raise PolynomialError(f"its values reach {size:g}, too large for doubles; write it in a larger unit")
        if size < SMALLEST:
            raise PolynomialError(
                f"its values reach only {size:g}, too small for doubles; multiply it by a large number"
            )


def exact_terms(source: Source, parameters: dict[str, float] | None = None) -> dict[tuple[int, int, int], Fraction]:
    """The polynomial expanded, with irrational constants as rationals of 77 digits; for tests and studies."""
    values = grammar.known(parameters or {})
    tree = simplify(read(source, parameters or {}))
    try:
        found = expand(tree, lambda node: {(0, 0, 0): rational(node, values)}, 3, MAX_PRODUCTS)
    except TooLong:
        raise PolynomialError("it is too long to be expanded") from None
    if not tree.irrational:
        return found
    # Terms that cancel but for the rounding of irrational constants are none.
    largest = max(map(abs, found.values()), default=Fraction(0))
    return {e: c for e, c in found.items() if abs(c) > largest / (1 << BITS // 2)}
