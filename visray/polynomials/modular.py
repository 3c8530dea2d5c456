"""Polynomials along random lines and modulo a prime: exact arithmetic with integers of bounded size.

Along a line (x, y, z) = start + t step, an expression is a polynomial in t. Such a polynomial is stored as the list of
its coefficients modulo a prime p, the constant one first. The polynomial 0 is the empty list.
"""

from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import chain, count, islice
from random import Random

from visray.polynomials.constants import rational
from visray.polynomials.expression import Axis, Expression, Function, NamedConstant, Number, Parameter, Root, fold

# Let p be a prime with p + 1 divisible by 8 * 3 * 5 * ... * 23. Modulo p, each of the primes 2, 3, ..., 23 is a square.
# The square root a^((p + 1) / 4) of a is itself a square. So products of roots are correct, as for positive real
# numbers: sqrt(12) is 2 sqrt(3).
_STEP = 8 * 3 * 5 * 7 * 11 * 13 * 17 * 19 * 23
_MERSENNE = (1 << 61) - 1
# Any other prime number is a square modulo half of all primes p, independently of other prime numbers. So an expression
# with square roots of 8 such numbers needs about 2^8 tries.
MAX_TRIES = 1000


class UndefinedModulo(Exception):
    """The error for a constant that does not exist modulo this prime. It may exist modulo another prime."""


class Residues:
    """Numbers modulo a prime p: one number for each of several points on a line."""

    __slots__ = ("p", "values")

    def __init__(self, values: list[int], p: int):
        self.values, self.p = values, p

    def __add__(self, other):
        p = self.p
        return Residues([(a + b) % p for a, b in zip(self.values, other.values)], p)

    def __mul__(self, other):
        p = self.p
        return Residues([a * b % p for a, b in zip(self.values, other.values)], p)

    def __neg__(self):
        return Residues([-a % self.p for a in self.values], self.p)

    def __pow__(self, n):
        return Residues([pow(a, n, self.p) for a in self.values], self.p)

    def __truediv__(self, other):
        return self * Residues([inverse(b, self.p) for b in other.values], self.p)


def inverse(value: int, p: int) -> int:
    """1 / value modulo p. Raises UndefinedModulo if p divides the value."""
    if value % p == 0:
        raise UndefinedModulo
    return pow(value, -1, p)


def restrict_to_line(
    expression: Expression, parameters: dict[str, Fraction], p: int, seed: int, free: bool = False
) -> list[int]:
    """Coefficients modulo p of the expression along a random line, the constant one first.

    seed: seed of the random numbers, which choose the line and the values of pi and of functions modulo p.
    free: whether phi and square roots also get random values, as if they were variables. Otherwise they get their true
        values modulo p; if one does not exist, UndefinedModulo is raised.
    """
    random = Random(seed)
    starts = [random.randrange(p) for _ in range(3)]
    steps = [random.randrange(1, p) for _ in range(3)]
    # Squares, so that square roots of them exist.
    pi = random.randrange(1, p) ** 2 % p
    points = range(expression.degree + 1)
    chosen: dict[Expression, int] = {}

    def number(value: Fraction) -> Residues:
        return Residues([value.numerator * inverse(value.denominator, p) % p] * len(points), p)

    def irrational(node: Expression) -> int:
        if isinstance(node, Function):
            return _of_function(node, parameters, p, seed)
        if free:
            return random.randrange(1, p)
        if isinstance(node, Root):
            return _root(fold(node.of, number, leaf).values[0], p)
        return (1 + _root(5, p)) * inverse(2, p) % p

    def leaf(node: Expression) -> Residues:
        match node:
            case Axis(k):
                return Residues([(starts[k] + t * steps[k]) % p for t in points], p)
            case Parameter(name):
                return number(parameters[name])
            case NamedConstant("pi"):
                return Residues([pi] * len(points), p)
        if node not in chosen:
            chosen[node] = irrational(node)
        return Residues([chosen[node]] * len(points), p)

    return _interpolate(fold(expression, number, leaf).values, p)


def _of_function(node: Function, parameters: dict[str, Fraction], p: int, seed: int) -> int:
    """A random number modulo p for a function of a constant: the same one wherever the function occurs.

    A function has its true value if that is a whole number, as cos(a) is 1 if the parameter a is 0.
    """
    value = rational(node, parameters)
    if value.denominator == 1:
        return value.numerator % p
    return Random(f"{seed} {node!r}").randrange(1, p) ** 2 % p


def _root(value: int, p: int) -> int:
    """The square root of a value modulo p. Raises UndefinedModulo if the value has no square root."""
    root = pow(value, (p + 1) // 4, p)
    if root * root % p != value % p:
        raise UndefinedModulo
    return root


def suitable_prime(expression: Expression, parameters: dict[str, Fraction]) -> int:
    """A prime near 2^61 modulo which all constants of the expression exist. Raises UndefinedModulo if none is found."""
    candidates = (_STEP * k - 1 for k in count((1 << 61) // _STEP))
    primes = chain([] if expression.irrational else [_MERSENNE], filter(is_prime, candidates))
    for p in islice(primes, MAX_TRIES):
        try:
            for node in _constants(expression):
                if not (isinstance(node, Number) and node.value.denominator % p):
                    restrict_to_line(node, parameters, p, 1)
        except UndefinedModulo:
            continue
        return p
    raise UndefinedModulo


def _constants(expression: Expression) -> Iterator[Expression]:
    """The largest subexpressions without x, y and z: those that no larger such subexpression contains."""
    if not expression.degree:
        yield expression
        return
    for part in getattr(expression, "parts", None) or ((expression.of,) if hasattr(expression, "of") else ()):
        yield from _constants(part)


@cache
def is_prime(n: int) -> bool:
    """Whether n is a prime. Uses the Miller-Rabin test, which is certain with these bases. Domain: n < 2^64."""
    bases = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)
    if n < 2 or any(n % b == 0 for b in bases):
        return n in bases
    s = (n - 1 & 1 - n).bit_length() - 1
    for b in bases:
        x = pow(b, n - 1 >> s, n)
        if x not in (1, n - 1) and all((x := x * x % n) != n - 1 for _ in range(s - 1)):
            return False
    return True


def _interpolate(values: list[int], p: int) -> list[int]:
    """Coefficients modulo p of the polynomial that has the given values at 0, 1, 2, ...

    Computed by Newton's divided differences and Horner's scheme.
    """
    differences = list(values)
    for k in range(1, len(values)):
        by = inverse(k, p)
        for j in range(len(values) - 1, k - 1, -1):
            differences[j] = (differences[j] - differences[j - 1]) * by % p
    coefficients: list[int] = []
    for k in range(len(values) - 1, -1, -1):
        coefficients = [(a - k * b) % p for a, b in zip([0, *coefficients], [*coefficients, 0])]
        coefficients[0] = (coefficients[0] + differences[k]) % p
    return without_leading_zeros(coefficients)


def without_leading_zeros(a: list[int]) -> list[int]:
    """Removes zero coefficients of the highest powers from the end of the list, in place. Returns the same list."""
    while a and not a[-1]:
        a.pop()
    return a


def divide(a: list[int], b: list[int], p: int) -> tuple[list[int], list[int]]:
    """(quotient, remainder) of the polynomials a and b modulo p. Domain: b is not 0."""
    a, quotient, by = list(a), [0] * max(0, len(a) - len(b) + 1), inverse(b[-1], p)
    for k in range(len(quotient) - 1, -1, -1):
        factor = quotient[k] = a[k + len(b) - 1] * by % p
        if factor:
            for j, c in enumerate(b):
                a[k + j] = (a[k + j] - factor * c) % p
    return quotient, without_leading_zeros(a)


def gcd(a: list[int], b: list[int], p: int) -> list[int]:
    """The greatest common divisor of two polynomials modulo p, scaled to the leading coefficient 1."""
    while b:
        a, b = b, divide(a, b, p)[1]
    by = inverse(a[-1], p)
    return [c * by % p for c in a]


def is_square_free(a: list[int], p: int) -> bool:
    """Whether no factor occurs twice in a polynomial modulo p. Domain: its degree is below p."""
    return len(gcd(a, [k * c % p for k, c in enumerate(a)][1:], p)) == 1


def factor_degrees(a: list[int], p: int) -> list[int]:
    """The degrees of the irreducible factors of a polynomial modulo p, by distinct-degree factorization.

    Domain: square-free polynomials.
    """
    degrees, power = [], [0, 1]
    for k in count(1):
        if 2 * k > len(a) - 1:
            return degrees + [len(a) - 1] * (len(a) > 1)
        power = _power_modulo(divide(power, a, p)[1], p, a)
        # t^(p^k) - t is the product of all irreducible polynomials whose degree divides k. Factors of a lower degree
        # were removed from `a` before, so the common divisor is the product of the factors of degree k.
        rest = power + [0] * (2 - len(power))
        part = gcd(a, without_leading_zeros([rest[0], (rest[1] - 1) % p, *rest[2:]]), p)
        if len(part) > 1:
            degrees += [k] * ((len(part) - 1) // k)
            a = divide(a, part, p)[0]


def _power_modulo(a: list[int], n: int, modulus: list[int]) -> list[int]:
    """The power a^n of the polynomial a, modulo the polynomial `modulus`. Coefficients are also taken modulo n."""
    result = [1]
    for bit in bin(n)[2:]:
        result = _multiply_modulo(result, result, modulus, n)
        if bit == "1":
            result = _multiply_modulo(result, a, modulus, n)
    return result


def _multiply_modulo(a: list[int], b: list[int], modulus: list[int], p: int) -> list[int]:
    """The product of the polynomials a and b, modulo the polynomial `modulus` and the prime p."""
    product = [0] * (len(a) + len(b) - 1) if a and b else []
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            product[i + j] += x * y
    return divide(without_leading_zeros([c % p for c in product]), modulus, p)[1]
