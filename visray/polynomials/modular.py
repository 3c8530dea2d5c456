"""Trees along random lines over prime fields: exact arithmetic at the price of a product of two numbers each."""

from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import chain, count, islice
from random import Random

from visray.polynomials.expression import Axis, Expression, NamedConstant, Number, Parameter, Root, fold

# Modulo a prime p = -1 mod 8 * 3 * 5 * ... * 23 each of these primes is a square, and the root (p + 1) / 4 takes is
# itself a square: roots multiply as positive reals do, sqrt(12) is 2 sqrt(3).
_STEP = 8 * 3 * 5 * 7 * 11 * 13 * 17 * 19 * 23
_MERSENNE = (1 << 61) - 1
# Other primes are squares modulo every second prime, independently: 8 of them take some 2^8 primes.
MAX_TRIES = 1000


class UndefinedModulo(Exception):
    """A number of the tree does not exist in this field; it may in another."""


class Residues:
    """Numbers modulo a prime, one for each point of a line."""

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
    """1 / value modulo p."""
    if value % p == 0:
        raise UndefinedModulo
    return pow(value, -1, p)


def restrict_to_line(
    tree: Expression, parameters: dict[str, Fraction], p: int, seed: int, free: bool = False
) -> list[int]:
    """The coefficients modulo p, low to high, along a random line; the same seed is the same line and the same pi.

    Where `free`, phi and square roots are random like pi, not roots.
    """
    random = Random(seed)
    starts = [random.randrange(p) for _ in range(3)]
    steps = [random.randrange(1, p) for _ in range(3)]
    pi = random.randrange(1, p)
    points = range(tree.degree + 1)
    chosen: dict[Expression, int] = {}

    def number(value: Fraction) -> Residues:
        return Residues([value.numerator * inverse(value.denominator, p) % p] * len(points), p)

    def irrational(node: Expression) -> int:
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

    return _interpolate(fold(tree, number, leaf).values, p)


def _root(value: int, p: int) -> int:
    found = pow(value, (p + 1) // 4, p)
    if found * found % p != value % p:
        raise UndefinedModulo
    return found


def suitable_prime(tree: Expression, parameters: dict[str, Fraction]) -> int:
    """A prime about 2^61 modulo which all numbers of the tree exist."""
    candidates = (_STEP * k - 1 for k in count((1 << 61) // _STEP))
    primes = chain([] if tree.irrational else [_MERSENNE], filter(is_prime, candidates))
    for p in islice(primes, MAX_TRIES):
        try:
            for node in _constants(tree):
                if not (isinstance(node, Number) and node.value.denominator % p):
                    restrict_to_line(node, parameters, p, 1)
        except UndefinedModulo:
            continue
        return p
    raise UndefinedModulo


def _constants(tree: Expression) -> Iterator[Expression]:
    """The largest parts without x, y and z."""
    if not tree.degree:
        yield tree
        return
    for part in getattr(tree, "parts", None) or ((tree.of,) if hasattr(tree, "of") else ()):
        yield from _constants(part)


@cache
def is_prime(n: int) -> bool:
    """Whether n < 2^64 is prime (Miller and Rabin; these bases leave no doubt)."""
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
    """The polynomial modulo p with these values at 0, 1, 2, ...: Newton's differences, then Horner."""
    differences = list(values)
    for k in range(1, len(values)):
        by = inverse(k, p)
        for j in range(len(values) - 1, k - 1, -1):
            differences[j] = (differences[j] - differences[j - 1]) * by % p
    found: list[int] = []
    for k in range(len(values) - 1, -1, -1):
        found = [(a - k * b) % p for a, b in zip([0, *found], [*found, 0])]
        found[0] = (found[0] + differences[k]) % p
    return without_leading_zeros(found)


def without_leading_zeros(a: list[int]) -> list[int]:
    """Without leading zeros; the polynomial 0 is empty."""
    while a and not a[-1]:
        a.pop()
    return a


def divide(a: list[int], b: list[int], p: int) -> tuple[list[int], list[int]]:
    """Quotient and remainder."""
    a, quotient, by = list(a), [0] * max(0, len(a) - len(b) + 1), inverse(b[-1], p)
    for k in range(len(quotient) - 1, -1, -1):
        factor = quotient[k] = a[k + len(b) - 1] * by % p
        if factor:
            for j, c in enumerate(b):
                a[k + j] = (a[k + j] - factor * c) % p
    return quotient, without_leading_zeros(a)


def gcd(a: list[int], b: list[int], p: int) -> list[int]:
    """The greatest common divisor, with leading coefficient 1."""
    while b:
        a, b = b, divide(a, b, p)[1]
    by = inverse(a[-1], p)
    return [c * by % p for c in a]


def is_square_free(a: list[int], p: int) -> bool:
    """Whether a polynomial of a degree below p has no repeated factor."""
    return len(gcd(a, [k * c % p for k, c in enumerate(a)][1:], p)) == 1


def factor_degrees(a: list[int], p: int) -> list[int]:
    """The degrees of the irreducible factors of a squarefree polynomial modulo p."""
    found, power = [], [0, 1]
    for k in count(1):
        if 2 * k > len(a) - 1:
            return found + [len(a) - 1] * (len(a) > 1)
        power = _power_modulo(divide(power, a, p)[1], p, a)
        # The factors of degree k divide t^(p^k) - t.
        rest = power + [0] * (2 - len(power))
        part = gcd(a, without_leading_zeros([rest[0], (rest[1] - 1) % p, *rest[2:]]), p)
        if len(part) > 1:
            found += [k] * ((len(part) - 1) // k)
            a = divide(a, part, p)[0]


def _power_modulo(a: list[int], n: int, modulus: list[int]) -> list[int]:
    """a^n modulo n and a polynomial."""
    result = [1]
    for bit in bin(n)[2:]:
        result = _multiply_modulo(result, result, modulus, n)
        if bit == "1":
            result = _multiply_modulo(result, a, modulus, n)
    return result


def _multiply_modulo(a: list[int], b: list[int], modulus: list[int], p: int) -> list[int]:
    product = [0] * (len(a) + len(b) - 1) if a and b else []
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            product[i + j] += x * y
    return divide(without_leading_zeros([c % p for c in product]), modulus, p)[1]
