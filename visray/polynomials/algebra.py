"""A polynomial as a product of factors without repeated parts, each as it was written wherever that is possible."""

from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from itertools import count

from visray.polynomials import fields
from visray.polynomials.expansion import Coefficients, Terms, TooLong, expand, horner
from visray.polynomials.tree import (
    BITS,
    ONE,
    Named,
    Negative,
    Number,
    Parameter,
    Power,
    Product,
    Reciprocal,
    Root,
    Sum,
    Tree,
    negated,
    negligible,
    rational,
    simplified,
)
from visray.polynomials.wrong import Wrong

# What an expansion or a factoring may take: about a second.
MAX_PRODUCTS = 200_000
MAX_TERMS = {True: 600, False: 300}  # where a factoring must be, and where it only makes rendering faster
MAX_ALGEBRAIC_TERMS = 60
# After so many primes a polynomial that none of them proves irreducible most likely is not.
PRIMES = 14


@dataclass(frozen=True)
class Part:
    """A factor without repeated parts, its degree along a generic line, and whether its multiplicity is even."""

    tree: Tree
    degree: int
    even: bool


def split(tree: Tree, parameters: dict[str, Fraction]) -> tuple[tuple[Part, ...], int]:
    """The factors, and a sign: sign * the product of those that are not even has the sign of the tree everywhere."""
    tree = simplified(tree)
    line = _along(tree, parameters)
    if not line:
        raise Wrong("it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0")
    if len(line) == 1:
        raise Wrong("it is a constant, nowhere 0; a surface has x, y or z in its polynomial")
    found: list[list] = []
    for factor, n in _written(tree):
        for part, m in _parts(factor, parameters):
            _add(found, part, n * m, parameters)
    found = _apart(found, parameters)
    parts = tuple(Part(t, len(_along(t, parameters)) - 1, n % 2 == 0) for t, n in found)
    return parts, _sign(tree, parts, parameters)


def _along(tree: Tree, parameters: dict[str, Fraction], p: int = 0) -> list[int]:
    return fields.restricted(tree, parameters, p or _field(tree, parameters), 1)


def _field(tree: Tree, parameters: dict[str, Fraction]) -> int:
    try:
        return fields.field(tree, parameters)
    except fields.Singular:
        raise Wrong("it has too many different square roots; write some of them as decimal numbers") from None


def _written(tree: Tree) -> list[tuple[Tree, int]]:
    """The factors of a tree that is written as a product or a power, without constants."""
    match tree:
        case _ if not tree.degree:
            return []
        case Negative(of):
            return _written(of)
        case Power(of, exponent=n):
            return [(t, m * n) for t, m in _written(of)]
        case Product(parts):
            return [found for p in parts for found in _written(p)]
    return [(tree, 1)]


def _add(found: list[list], part: Tree, n: int, parameters: dict[str, Fraction]):
    """Adds a factor, or to the multiplicity of one that differs from it by a constant."""
    for entry in found:
        if entry[0] == part:
            entry[1] += n
            return
        both = Product((entry[0], part))
        p = _field(both, parameters)
        a, b = _along(entry[0], parameters, p), _along(part, parameters, p)
        if len(a) == len(b) and all((x * b[-1] - y * a[-1]) % p == 0 for x, y in zip(a, b)):
            entry[1] += n
            return
    found.append([part, n])


def _apart(found: list[list], parameters: dict[str, Fraction]) -> list[list]:
    """The factors where no two have a part in common: such a part exists only where roots are involved."""
    whole = Product(tuple(t for t, _ in found))
    p = _field(whole, parameters)
    if len(found) == 1 or fields.squarefree(_along(whole, parameters, p), p):
        return found
    apart: list[list] = []
    tree = simplified(Product(tuple(Power(t, n) for t, n in found)))
    for part, n in _algebraic(tree, parameters):
        _add(apart, part, n, parameters)
    return apart


def _parts(tree: Tree, parameters: dict[str, Fraction]) -> list[tuple[Tree, int]]:
    """The factors of one written factor, with their multiplicities."""
    p = _field(tree, parameters)
    line = _along(tree, parameters, p)
    degree = len(line) - 1
    if degree < 1:
        return []
    if degree < tree.degree:
        tree = _lowered(tree, parameters, degree)
    free = fields.squarefree(line, p)
    if free and (degree == 1 or _irreducible(tree, parameters, degree)):
        return [(tree, 1)]
    try:
        factors = _factored(tree, parameters, needed=not free)
    except TooLong:
        if free:
            return [(tree, 1)]
        raise _repeated() from None
    if not free:
        return [found for t, n in factors for found in _checked(t, n, parameters)]
    return factors if len(factors) > 1 else [(tree, 1)]


def _repeated() -> Wrong:
    return Wrong("a factor in it is repeated, and it is too long to find which; write it as a power, (...)^2")


def _checked(tree: Tree, n: int, parameters: dict[str, Fraction]) -> list[tuple[Tree, int]]:
    """A factor for all values of the constants, where at their own values it may still have repeated parts."""
    p = _field(tree, parameters)
    line = _along(tree, parameters, p)
    if len(line) < 2:
        return []
    if len(line) - 1 < tree.degree:
        tree = _lowered(tree, parameters, len(line) - 1)
    if fields.squarefree(line, p):
        return [(tree, n)]
    return [(t, n * m) for t, m in _algebraic(tree, parameters)]


def _irreducible(tree: Tree, parameters: dict[str, Fraction], degree: int) -> bool:
    """Whether some primes prove that the tree is no product: no degree could be that of a factor modulo all of them.

    A factor over the rationals is one modulo every prime and along every line along which the tree keeps its degree.
    """
    possible = (1 << degree + 1) - 1
    tried = 0
    for q in count(1009, 2):
        if tried == PRIMES:
            return False
        if not fields.prime(q):
            continue
        tried += 1
        try:
            line = fields.restricted(tree, parameters, q, q, free=True)
        except fields.Singular:
            continue
        if len(line) - 1 != degree or not fields.squarefree(line, q):
            continue
        sums = 1
        for d in fields.degrees(line, q):
            sums |= sums << d
        possible &= sums
        if possible == 1 | 1 << degree:
            return True
    return False


def _atoms(tree: Tree) -> list[Tree]:
    """The constants in a tree that are not rational numbers, and what is divided by them."""
    match tree:
        case Named() | Parameter() | Root():
            return [tree]
        case Reciprocal(of) if of.irrational or of.parametric:
            return [tree]
        case Negative(of) | Reciprocal(of) | Power(of):
            return _atoms(of)
        case Sum(parts) | Product(parts):
            return list(dict.fromkeys(a for p in parts for a in _atoms(p)))
    return []


def _generic(tree: Tree, budget: int = MAX_PRODUCTS) -> tuple[Terms, list[Tree]]:
    """The terms of a tree over x, y, z and its irrational constants and parameters, as if these were variables."""
    atoms = _atoms(tree)
    size = 3 + len(atoms)
    zero = (0,) * size

    def constant(node: Tree) -> Terms:
        if node in atoms:
            e = [0] * size
            e[3 + atoms.index(node)] = 1
            return {tuple(e): Fraction(1)}
        if not node.irrational and not node.parametric:
            return {zero: rational(node, {})}
        match node:
            case Negative(of):
                return {e: -c for e, c in constant(of).items()}
            case Sum(parts):
                found: Terms = {}
                for p in parts:
                    for e, c in constant(p).items():
                        found[e] = found.get(e, 0) + c
                return found
            case Power(of, exponent=n):
                parts = (of,) * n
            case Product(parts):
                pass
        found = {zero: Fraction(1)}
        for p in parts:
            terms = constant(p)
            product: Terms = {}
            for i, c in found.items():
                for j, d in terms.items():
                    e = tuple(map(int.__add__, i, j))
                    product[e] = product.get(e, 0) + c * d
            found = product
            if len(found) > MAX_TERMS[True]:
                raise TooLong
        return found

    return expand(tree, constant, size, budget), atoms


def _coefficients(terms: Terms, atoms: list[Tree]) -> Coefficients:
    """The terms over x, y and z, their coefficients as trees; 1 and -1 are not written."""
    found: dict[tuple[int, int, int], list[Tree]] = {}
    for e, c in terms.items():
        powers = tuple(Power(a, n) if n > 1 else a for a, n in zip(atoms, e[3:]) if n)
        if abs(c) == 1:
            part = Product(powers) if c > 0 else Negative(Product(powers))
        else:
            part = Product((Number(c), *powers)) if powers else Number(c)
        found.setdefault(e[:3], []).append(part)
    return {e: _coefficient(parts) for e, parts in found.items()}


def _coefficient(parts: list[Tree]) -> Tree:
    if len(parts) > 1:
        return Sum(tuple(parts))
    return parts[0] if parts[0] in (ONE, negated(ONE)) else simplified(parts[0])


def _lowered(tree: Tree, parameters: dict[str, Fraction], degree: int) -> Tree:
    """A tree whose highest terms cancel, without them."""
    try:
        terms, atoms = _generic(tree)
    except TooLong:
        raise Wrong(
            f"its degree is {degree}, not {tree.degree} as written, and it is too long to be written anew; "
            "leave out what cancels"
        ) from None
    return _rebuilt({e: c for e, c in terms.items() if sum(e[:3]) <= degree}, atoms)


def _rebuilt(terms: Terms, atoms: list[Tree]) -> Tree:
    return simplified(horner(_coefficients(terms, atoms)))


def _factored(tree: Tree, parameters: dict[str, Fraction], needed: bool) -> list[tuple[Tree, int]]:
    """The factors over the rationals, whatever the values of parameters and irrational constants."""
    terms, atoms = _generic(tree)
    if len(terms) > MAX_TERMS[needed]:
        raise TooLong
    from sympy import QQ, Poly, symbols

    used = [k for k in range(3 + len(atoms)) if any(e[k] for e in terms)]
    names = symbols(f"v:{3 + len(atoms)}")
    poly = Poly.from_dict(
        {tuple(e[k] for k in used): QQ(c.numerator, c.denominator) for e, c in terms.items()},
        *(names[k] for k in used),
        domain=QQ,
    )
    found = []
    for factor, n in poly.factor_list()[1]:
        inner = {}
        for e, c in factor.terms():
            full = [0] * (3 + len(atoms))
            for k, i in zip(used, e):
                full[k] = i
            inner[tuple(full)] = Fraction(int(c.p), int(c.q))
        if any(any(e[:3]) for e in inner):
            # The number that is there most often becomes a 1, which costs nothing.
            often = Counter(map(abs, inner.values())).most_common(1)[0][0]
            found.append(({e: c / often for e, c in inner.items()}, n))
    found.sort(key=lambda f: (max(sum(e[:3]) for e in f[0]), len(f[0]), sorted(f[0].items())))
    return [(_rebuilt(inner, atoms), n) for inner, n in found]


def _algebraic(tree: Tree, parameters: dict[str, Fraction]) -> list[tuple[Tree, int]]:
    """The parts of each multiplicity at the values of the constants: roots are roots here, parameters are numbers."""
    try:
        terms, atoms = _generic(tree)
    except TooLong:
        raise _repeated() from None
    if len(terms) > MAX_ALGEBRAIC_TERMS:
        raise _repeated()
    import sympy

    def value(node: Tree) -> sympy.Expr:
        match node:
            case Number(v):
                return sympy.Rational(v.numerator, v.denominator)
            case Parameter(name):
                return sympy.Rational(parameters[name].numerator, parameters[name].denominator)
            case Named("pi"):
                return pi
            case Named():
                return (1 + sympy.sqrt(5)) / 2
            case Root(of):
                return sympy.sqrt(value(of))
            case Reciprocal(of):
                return 1 / value(of)
            case Negative(of):
                return -value(of)
            case Power(of, exponent=n):
                return value(of) ** n
            case Sum(parts):
                return sympy.Add(*map(value, parts))
        return sympy.Mul(*map(value, node.parts))

    axes, pi = sympy.symbols("x y z"), sympy.Symbol("pi")
    values = [value(a) for a in atoms]
    whole = sympy.Add(
        *(
            sympy.Rational(c.numerator, c.denominator) * sympy.Mul(*(b**n for b, n in zip((*axes, *values), e)))
            for e, c in terms.items()
        )
    )
    roots = [v for v in values if v.has(sympy.Pow) and not v.has(pi)]
    symbols = (*axes, *([pi] if any(v.has(pi) for v in values) else []))
    options = {"extension": roots} if roots else {"domain": sympy.QQ}
    try:
        parts = sympy.Poly(whole, *symbols, **options).sqf_list()[1]
    except (sympy.PolynomialError, NotImplementedError):
        raise _repeated() from None
    found = []
    for part, n in parts:
        inner: Terms = {}
        for e, c in part.terms():
            inner[(*e, 0)[:4]] = _number(c)
        if any(any(e[:3]) for e in inner):
            found.append((_rebuilt(inner, [Named("pi")]), n))
    return found


def _number(c) -> Fraction:
    """A real number of sympy as a rational, good to BITS where it is irrational."""
    if c.is_Rational:
        return Fraction(int(c.p), int(c.q))
    return Fraction(str(c.evalf(BITS * 3 // 10)))


def _sign(tree: Tree, parts: tuple[Part, ...], parameters: dict[str, Fraction]) -> int:
    """The sign of the tree over that of the factors that change theirs, at a point where none is 0."""
    odd = [p.tree for p in parts if not p.even]
    for k in range(1, 100):
        point = (Fraction(3 * k, 7), Fraction(5, 11 * k), Fraction(-2 * k, 13))
        values = [(rational(t, parameters, point), t) for t in (tree, *odd)]
        if not any(negligible(v, t, parameters, point) for v, t in values):
            return (-1) ** sum(v < 0 for v, _ in values)
    raise Wrong("its sign is lost in the rounding of its irrational constants; write them as decimal numbers")
