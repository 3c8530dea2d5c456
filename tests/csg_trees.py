"""Random CSG: operands of all closed kinds of size about 1 near the origin, trees of them, rays at them, cut edges."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import solids
from csg_leaves import affine
from csg_truth import Solid
from samples import NAMES, SAMPLES, direction, shifted, unit

from visray.primitives import Csg, Mesh, Plane, Polynomial
from visray.primitives.clips import Ball, Block
from visray.transforms import Rotate, Scale, Transform, Translate

# Operands whose sample in samples.py is no solid, or is one of many shapes of its kind.
POLYNOMIALS = (
    ("(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3", Ball(radius=1.5)),
    ("(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3", Block(min=(-0.9, -1.0, -0.2), max=(1.1, 0.3, 1.0))),
    ("16*(x^4 + y^4 + z^4) - 20*(x^2 + y^2 + z^2) + 59/5", Ball(radius=1.4)),
    ("x^2 + y^2 - z^2 - 1/4", Ball(radius=1.1)),
    ("x*y - z", Block(min=(-0.8, -0.7, -0.9), max=(0.6, 0.8, 0.7))),
    ("x^3 + y^2 - z^2*x - 1/3", Ball(radius=1.2)),
    ("4*(phi^2*x^2 - y^2)*(phi^2*y^2 - z^2)*(phi^2*z^2 - x^2) - (1 + 2*phi)*(x^2 + y^2 + z^2 - 1)^2", Ball(radius=1.6)),
)


def near(rng: np.random.Generator, reach: float = 0.8) -> np.ndarray:
    return reach * rng.uniform(-1, 1, 3)


def _sampled(name: str) -> Callable[[np.random.Generator], Any]:
    """The random instances of a kind in samples.py, moved near the origin."""

    def drawn(rng: np.random.Generator) -> Any:
        while True:
            thing = SAMPLES[name].random(rng, 1.0)
            middle, reach = SAMPLES[name].hull(thing)
            if 0.3 < reach < 2:
                return shifted(thing, near(rng) - middle)

    return drawn


def _plane(rng: np.random.Generator) -> Plane:
    return Plane(point=tuple(near(rng).tolist()), normal=direction(rng))


def _mesh(rng: np.random.Generator) -> Mesh:
    vertices, faces = (solids.CUBE, solids.TETRAHEDRON, solids.ball(1), solids.ring(12, 6))[rng.integers(4)]
    shear = np.eye(3) + 0.3 * rng.normal(size=(3, 3))
    shear[:, 0] *= np.sign(np.linalg.det(shear))
    return Mesh(vertices=vertices @ shear.T + near(rng), faces=faces, normals="face")


def _polynomial(rng: np.random.Generator) -> Polynomial:
    expression, clip = POLYNOMIALS[rng.integers(len(POLYNOMIALS))]
    turned = (Rotate(rotate=float(rng.uniform(0, 360)), axis=direction(rng)),)
    return Polynomial(expression=expression, clip=clip, ends="capped", transform=(*turned, *moved(rng)))


OPERANDS: dict[str, Callable[[np.random.Generator], Any]] = {
    **{name: _sampled(name) for name in NAMES if SAMPLES[name].posed.closed and name != "Csg"},
    "Plane": _plane,
    "Mesh": _mesh,
    "Polynomial": _polynomial,
}
OPEN = {name for name in NAMES if not SAMPLES[name].posed.closed}
assert set(OPERANDS) | OPEN | {"Csg"} == set(NAMES), "a solid that no random tree holds"


def moved(rng: np.random.Generator) -> tuple[Transform, ...]:
    return (Translate(translate=tuple(near(rng).tolist())),)


def transform(rng: np.random.Generator) -> tuple[Transform, ...]:
    """None in half of the cases, or one to three steps of any kind."""
    steps = (
        lambda: Translate(translate=tuple(near(rng, 0.4).tolist())),
        lambda: Rotate(rotate=float(rng.uniform(0, 360)), axis=direction(rng)),
        lambda: Scale(scale=tuple((rng.choice([-1, 1], 3) * 2 ** rng.uniform(-0.6, 0.6, 3)).tolist())),
        lambda: Scale(scale=float(2 ** rng.uniform(-0.5, 0.5))),
        lambda: affine(np.eye(3) + 0.2 * rng.normal(size=(3, 3)), near(rng, 0.3)),
    )  # fmt: skip
    return tuple(steps[i]() for i in rng.integers(len(steps), size=rng.integers(1, 4) * rng.integers(2)))


def operand(rng: np.random.Generator, names: list[str]) -> Any:
    """A leaf of the next kind in a list, sometimes with solids cut away."""
    thing = OPERANDS[names.pop() if names else rng.choice(list(OPERANDS))](rng)
    thing = replace(thing, transform=(*thing.transform, *transform(rng)))
    if rng.random() < 0.15:
        cut = [OPERANDS[rng.choice(["Box", "Sphere", "Cylinder"])](rng) for _ in range(rng.integers(1, 3))]
        thing = replace(thing, cut=tuple(cut))
    return thing


def tree(rng: np.random.Generator, depth: int = 3, names: list[str] | None = None) -> Csg:
    """A tree of up to `depth` levels. names: kinds that its first leaves are of; they are taken from the list."""
    names = [] if names is None else names
    count = int(rng.integers(2, 5 if depth > 1 else 4))
    of = [
        tree(rng, depth - 1, names) if depth > 1 and rng.random() < 0.35 else operand(rng, names) for _ in range(count)
    ]
    # Operands after the first of a difference are often larger than it; then little is left.
    op = str(rng.choice(["union", "merge", "intersection", "difference"], p=[0.2, 0.15, 0.25, 0.4]))
    given = {f"part{i}": x for i, x in enumerate(of)} if rng.random() < 0.3 else tuple(of)
    return Csg(op=op, of=given, transform=transform(rng))


def leaves_apart(obj: Any, give: Callable[[], str]) -> Any:
    """The object with a material of its own for each leaf, in order. give: the next material's name."""
    if isinstance(obj, Csg):
        each = {k: leaves_apart(x, give) for k, x in obj.of.items()} if isinstance(obj.of, dict) else tuple(
            leaves_apart(x, give) for x in obj.of)  # fmt: skip
        obj = replace(obj, of=each)
    else:
        obj = replace(obj, material=give())
    return obj if obj.cut is None else replace(obj, cut=tuple(leaves_apart(x, give) for x in obj.cut))


def hulls(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Middles and reaches of a solid's leaves in the world; of planes, the part near their point."""
    found = []
    for leaf in solid.leaves:
        middle, reach = leaf.hull()
        m, offset = (x.astype(float) for x in leaf.to_world)
        found.append((m @ middle + offset, (1.0 if isinstance(leaf.thing, Plane) else reach) * np.linalg.norm(m, 2)))
    return np.array([m for m, _ in found]), np.array([r for _, r in found])


def rays(rng: np.random.Generator, solid: Solid, count: int) -> tuple[np.ndarray, np.ndarray]:
    """World rays at the balls around leaves, from 0.1 to 1000 reaches away, a fifth of them from near or inside."""
    middle, reach = hulls(solid)
    leaf = rng.integers(len(middle), size=count)
    within = unit(rng.normal(size=(count, 3))).astype(float) * rng.uniform(size=(count, 1)) ** (1 / 3)
    target = middle[leaf] + reach[leaf, None] * within
    away = np.where(
        rng.random((count, 1)) < 0.2, 10 ** rng.uniform(-1, 0, (count, 1)), 10 ** rng.uniform(0, 3, (count, 1))
    )
    o = middle[leaf] + away * reach[leaf, None] * unit(rng.normal(size=(count, 3))).astype(float)
    d = target - o
    return o, d / np.linalg.norm(d, axis=1, keepdims=True)
