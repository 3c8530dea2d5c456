"""Programs: the operations with which kernels evaluate a polynomial f(x, y, z).

A program consists of operations only; the values of its constants are stored apart from it. So polynomials that differ
only in their numbers share one program, and one kernel. A constant is an expression without x, y and z.

f is divided into square-free factors. The multiplicity of a factor is the number of times that it occurs in f. A factor
of even multiplicity does not change the sign of f.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

from visray.polynomials import grammar, monomials
from visray.polynomials.constants import BITS, has_zero_root, rational
from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import TooLong, expand, horner, monomial_terms, recentre
from visray.polynomials.expression import Axis, Expression, Negative, Power, Product
from visray.polynomials.factorization import are_square_free, factorize
from visray.polynomials.literals import exact_parameters
from visray.polynomials.simplify import simplify, translate

Source = str | tuple[str, ...] | list[str]
# The bound on a factor's absolute value must be in this range, so that sums and products of values stay in the range of
# doubles.
LARGEST, SMALLEST = 1e140, 1e-140
MAX_PRODUCTS = 3_000_000


@dataclass(frozen=True)
class Factor:
    """A square-free factor of a polynomial, as operations.

    degree: total degree of the factor, after cancellation of terms.
    code: operations that refer to earlier ones by index: ("constant", j), ("axis", k), ("add", i, j), ("sub", i, j),
        ("mul", i, j), ("neg", i), ("pow", i, n) with n >= 2. The last one gives the value.
    even: whether the factor's multiplicity in the polynomial is even.
    """

    degree: int
    code: tuple[tuple, ...]
    even: bool


@dataclass(frozen=True)
class Program:
    """The structure of a polynomial f. Polynomials that differ only in the values of their numbers have equal programs.

    factors: the square-free factors of f.
    sign: 1 or -1. Wherever f is not 0, f has the same sign as `sign` times the product of the factors of odd
        multiplicity.
    constant_count: number of constants in the code of all factors.
    """

    factors: tuple[Factor, ...]
    sign: int
    constant_count: int


@dataclass(frozen=True)
class Compiled:
    """A program and its constants. Each tuple has one entry per constant, in the order in which the code numbers them.

    values: the constants as doubles.
    constants: the constants as expressions.
    exact_values: the constants as rationals, before they are rounded to doubles.
    """

    program: Program
    values: tuple[float, ...]
    constants: tuple[Expression, ...]
    exact_values: tuple[Fraction, ...]


def build(
    source: Source,
    parameters: dict[str, float] | None = None,
    centre: tuple = (0.0, 0.0, 0.0),
    varied: frozenset[str] = frozenset(),
) -> Compiled:
    """Compiles a polynomial. Its program takes coordinates q = p - centre instead of p = (x, y, z).

    source: text, or a list of monomials.
    parameters: values of the named parameters.
    varied: names of parameters for whose values in a neighbourhood the program is right too, so that it has the right
        derivatives by them. Other parameters decide by their values which terms and factors there are.
    """
    source = source if isinstance(source, str) else tuple(source)
    return _build(source, tuple(sorted((parameters or {}).items())), tuple(map(float, centre)), varied)


@lru_cache(maxsize=256)
def _build(
    source: str | tuple, parameters: tuple, centre: tuple[float, float, float], varied: frozenset[str]
) -> Compiled:
    """As `build`, but with arguments that the cache can store. parameters: pairs (name, value), sorted."""
    square_free, sign = _factorize(source, parameters, varied)
    values = {name: Fraction(value) for name, value in parameters}
    middle = tuple(map(Fraction, centre))
    constants = _Constants()
    factors = tuple(Factor(f.degree, _code(_recentred(f.expression, middle), constants), f.even) for f in square_free)
    expressions = tuple(constants.expressions)
    exact = tuple(rational(c, values) for c in expressions)
    return Compiled(Program(factors, sign, len(exact)), tuple(map(_double, exact)), expressions, exact)


@lru_cache(maxsize=256)
def _factorize(source: str | tuple, parameters: tuple, varied: frozenset[str]) -> tuple:
    """(square-free factors, sign) of a polynomial, as `factorize` returns them. It is cached for all centres."""
    return factorize(read(source, dict(parameters)), exact_parameters(dict(parameters)), varied)


def slope_flaw(source: Source, parameters: dict[str, float], varied: frozenset[str]) -> str | None:
    """The reason why the surface has no derivative by the parameters `varied`, or None if it has one.

    source, parameters: as for `build`.
    """
    source = source if isinstance(source, str) else tuple(source)
    exact = exact_parameters(parameters)
    if has_zero_root(read(source, parameters), exact, varied):
        return "a square root is 0 there, and its slope infinite"
    square_free, _ = _factorize(source, tuple(sorted(parameters.items())), varied)
    if not are_square_free([f.expression for f in square_free], exact):
        return "several sheets of the surface fall together there"
    return None


def read(source: Source, parameters: dict[str, float]) -> Expression:
    """The expression of a polynomial that is given as text or as a list of monomials."""
    return grammar.parse(source, parameters) if isinstance(source, str) else monomials.parse(list(source))


def _double(value: Fraction) -> float:
    """The value of a constant, rounded to double. Raises PolynomialError if it is outside the range of doubles."""
    # A product of constants may overflow or become subnormal although none of the constants does.
    if value and not -1022 < abs(value.numerator).bit_length() - value.denominator.bit_length() < 1023:
        raise PolynomialError("its constants multiply to a number beyond the doubles; write it in another unit")
    return float(value)


def _recentred(expression: Expression, centre: tuple[Fraction, Fraction, Fraction]) -> Expression:
    """The expression in coordinates about a centre, simplified.

    A sum of monomials is rewritten by Horner's scheme. Any other expression keeps its form. Domain: simplified
    expressions.
    """
    terms = monomial_terms(expression)
    return simplify(translate(expression, centre) if terms is None else horner(recentre(terms, centre)))


class _Constants:
    """The numbered constants of a program, collected while its code is written.

    Equal constants share one index if they contain a parameter, pi, phi or a root. Equal rational numbers do not, so
    that polynomials that differ only in their numbers have equal programs.

    expressions: the constants, in the order of their indices.
    shared: indices of the constants that may be shared.
    """

    def __init__(self):
        self.expressions: list[Expression] = []
        self.shared: dict[Expression, int] = {}

    def index_of(self, constant: Expression) -> int:
        """The index of a constant. A constant that shares no index is added to the list first."""
        if constant in self.shared:
            return self.shared[constant]
        self.expressions.append(constant)
        if constant.parametric or constant.irrational:
            self.shared[constant] = len(self.expressions) - 1
        return len(self.expressions) - 1


def _code(expression: Expression, constants: _Constants) -> tuple[tuple, ...]:
    """The operations that evaluate an expression, as in Factor.code. Equal operations occur once.

    constants: the constants of the program so far; new ones are added.
    """
    indices: dict[tuple, int] = {}
    sums: dict[Expression, int] = {}

    def put(*operation) -> int:
        return indices.setdefault(operation, len(indices))

    def emit(node: Expression) -> int:
        match node:
            case _ if not node.degree:
                return put("constant", constants.index_of(node))
            case Axis(k):
                return put("axis", k)
            case Negative(of):
                return put("neg", emit(of))
            case Power(of, exponent=n):
                return put("pow", emit(of), n)
            case Product(parts):
                return product(parts)
        # A sum that occurs in two places, such as (x^2 + y^2 - 1), is computed once. So its constants are also stored
        # once.
        if node not in sums:
            sums[node] = total(node.parts)
        return sums[node]

    def product(parts: tuple[Expression, ...]) -> int:
        exponents: dict[int, int] = {}
        for part in parts:
            of, n = (part.of, part.exponent) if isinstance(part, Power) and part.degree else (part, 1)
            k = emit(of)
            exponents[k] = exponents.get(k, 0) + n
        value = None
        for k, n in exponents.items():
            power = put("pow", k, n) if n > 1 else k
            value = power if value is None else put("mul", value, power)
        return value

    def total(parts: tuple[Expression, ...]) -> int:
        minus = [isinstance(p, Negative) and p.degree > 0 for p in parts]
        terms = [emit(p.of if m else p) for p, m in zip(parts, minus)]
        # If there is a term without a minus, the sum starts with it, so that no term has to be negated first.
        first = minus.index(False) if False in minus else 0
        value = terms[first]
        for k, (term, m) in enumerate(zip(terms, minus)):
            if k != first:
                value = put("sub" if m != minus[first] else "add", value, term)
        return put("neg", value) if minus[first] else value

    emit(expression)
    return tuple(indices)


def interpret(
    code: tuple[tuple, ...], constants: Any, axes: Any, power: Callable[[Any, int], Any] | None = None
) -> Any:
    """The value of a factor, by running its code in any arithmetic with + - *.

    constants: values of the program's constants.
    axes: values of x, y and z.
    power: function that returns value^exponent from a value and an exponent; by default power_by_squaring.
    """
    power = power or power_by_squaring
    results: list[Any] = []
    for name, *at in code:
        match name:
            case "constant":
                value = constants[at[0]]
            case "axis":
                value = axes[at[0]]
            case "add":
                value = results[at[0]] + results[at[1]]
            case "sub":
                value = results[at[0]] - results[at[1]]
            case "mul":
                value = results[at[0]] * results[at[1]]
            case "neg":
                value = -results[at[0]]
            case _:
                value = power(results[at[0]], at[1])
        results.append(value)
    return results[-1]


def power_by_squaring(value: Any, n: int) -> Any:
    """value^n by repeated squaring. Domain: n >= 1."""
    result = None
    while True:
        if n % 2:
            result = value if result is None else result * value
        n //= 2
        if not n:
            return result
        value = value * value


def magnitude_bounds(compiled: Compiled, reach: float) -> tuple[float, ...]:
    """For each factor, a bound on its absolute value at all points q whose coordinates are at most `reach` in size."""
    sizes = [abs(v) for v in compiled.values]
    # The bound on a difference is that on the sum, and the bound on -a is that on a.
    bounding = {"sub": lambda i, j: ("add", i, j), "neg": lambda i: ("pow", i, 1)}
    bounds = []
    for factor in compiled.program.factors:
        code = tuple(bounding[name](*at) if name in bounding else (name, *at) for name, *at in factor.code)
        bounds.append(interpret(code, sizes, (abs(reach),) * 3))
    return tuple(bounds)


def check_sizes(compiled: Compiled, reach: float):
    """Raises PolynomialError if the values of a factor may be too large or all too small for doubles.

    reach: greatest absolute value of a coordinate of the points at which the polynomial is evaluated.
    """
    for size in magnitude_bounds(compiled, reach):
        if not size <= LARGEST:
            raise PolynomialError(f"its values reach {size:g}, too large for doubles; write it in a larger unit")
        if size < SMALLEST:
            raise PolynomialError(
                f"its values reach only {size:g}, too small for doubles; multiply it by a large number"
            )


def exact_terms(source: Source, parameters: dict[str, float] | None = None) -> dict[tuple[int, int, int], Fraction]:
    """The terms of the expanded polynomial, a dict from exponents to coefficients, for tests and studies.

    Irrational constants are replaced by rational numbers with 77 correct digits.
    """
    values = exact_parameters(parameters or {})
    expression = simplify(read(source, parameters or {}))
    try:
        terms = expand(expression, lambda node: {(0, 0, 0): rational(node, values)}, 3, MAX_PRODUCTS)
    except TooLong:
        raise PolynomialError("it is too long to be expanded") from None
    if not expression.irrational:
        return terms
    # A term whose coefficient is 0 up to the rounding of irrational constants is left out.
    largest = max(map(abs, terms.values()), default=Fraction(0))
    return {e: c for e, c in terms.items() if abs(c) > largest / (1 << BITS // 2)}
