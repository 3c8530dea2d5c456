"""Five solids made of balls, blocks and rods, for visray, for POV-Ray and for a test in extended precision.

Each operand is written once, here: as an object of visray, as text for POV-Ray, and as the interval of a ray inside it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import numpy as np

Colour = tuple[float, float, float]
Point = tuple[float, float, float]
YELLOW, RED, PALE, BLUE, GREY = (0.9, 0.7, 0.2), (0.8, 0.2, 0.2), (0.9, 0.9, 0.8), (0.3, 0.4, 0.8), (0.6, 0.6, 0.6)
COLOURS = {"yellow": YELLOW, "red": RED, "pale": PALE, "blue": BLUE, "grey": GREY}
# Positions of the eye and the lamp in units of the solid's bounding radius, as in bench_povray.py.
EYE, LAMP, UP, FOV = (1.87, -2.06, 1.11), (-1.0, -2.5, 3.0), (0.0, 0.0, 1.0), 40.0
AMBIENT, DIFFUSE, BACKGROUND = 0.1, 0.7, (0.05, 0.08, 0.2)
Intervals = tuple[np.ndarray, np.ndarray]


def vector(v: Any) -> str:
    """Text of a vector in POV-Ray's syntax."""
    return "<" + ", ".join(repr(float(x)) for x in v) + ">"


def _pigment(colour: str) -> str:
    return f"pigment {{ rgb {vector(COLOURS[colour])} }} finish {{ ambient {AMBIENT} diffuse {DIFFUSE} }}"


def _slab(o: np.ndarray, d: np.ndarray, low: float, high: float) -> Intervals:
    """The interval of each ray between two values of a coordinate. o, d: this coordinate of origin and direction."""
    a, b = (low - o) / d, (high - o) / d
    return np.minimum(a, b), np.maximum(a, b)


def _in_circle(u: list[np.ndarray], v: list[np.ndarray], radius: float) -> Intervals:
    """The interval of each ray in which |u + t v| < radius; the first value is larger if there is none."""
    vv = sum(x * x for x in v)
    middle = -sum(x * y for x, y in zip(u, v)) / vv
    off = sum((x + middle * y) ** 2 for x, y in zip(u, v))
    # Extended precision: np.longdouble, as the arrays that are passed.
    half = np.sqrt(np.maximum((u[0].dtype.type(radius) ** 2 - off) / vv, 0))
    miss = off >= u[0].dtype.type(radius) ** 2
    return np.where(miss, np.inf, middle - half), np.where(miss, -np.inf, middle + half)


@dataclass(frozen=True)
class Ball:
    """A ball. colour: a name in COLOURS."""

    center: Point
    radius: float
    colour: str

    def ours(self) -> Any:
        return vr.Sphere(center=self.center, radius=self.radius, material=self.colour)

    def povray(self) -> str:
        return f"sphere {{ {vector(self.center)}, {self.radius!r} {_pigment(self.colour)} }}"

    def interval(self, o: np.ndarray, d: np.ndarray) -> Intervals:
        """The interval of each ray inside. o, d: origins and directions. Shapes: (3, N)."""
        return _in_circle([o[i] - self.center[i] for i in range(3)], list(d), self.radius)

    def normal(self, p: np.ndarray) -> np.ndarray:
        """Unit normals at points of the surface, outwards. Shapes: (3, N)."""
        return (p - np.array(self.center, p.dtype)[:, None]) / self.radius


@dataclass(frozen=True)
class Block:
    """A block between two corners, turned by `turn` degrees about the y axis through the origin."""

    low: Point
    high: Point
    colour: str
    turn: float = 0.0

    def axes(self) -> tuple[float, float]:
        """Cosine and sine of the angle, as visray computes them."""
        return float(np.cos(np.radians(self.turn))), float(np.sin(np.radians(self.turn)))

    def ours(self) -> Any:
        steps = (vr.Rotate(rotate=self.turn, axis=(0.0, 1.0, 0.0)),) if self.turn else ()
        return vr.Box(min=self.low, max=self.high, material=self.colour, transform=steps)

    def povray(self) -> str:
        c, s = self.axes()
        turned = f" matrix {vector((c, 0, -s, 0, 1, 0, s, 0, c, 0, 0, 0))}" if self.turn else ""
        return f"box {{ {vector(self.low)}, {vector(self.high)} {_pigment(self.colour)}{turned} }}"

    def _local(self, v: np.ndarray) -> np.ndarray:
        c, s = self.axes()
        return np.stack([c * v[0] - s * v[2], v[1], s * v[0] + c * v[2]]) if self.turn else v

    def interval(self, o: np.ndarray, d: np.ndarray) -> Intervals:
        o, d = self._local(o), self._local(d)
        ends = [_slab(o[i], d[i], self.low[i], self.high[i]) for i in range(3)]
        return np.maximum.reduce([a for a, _ in ends]), np.minimum.reduce([b for _, b in ends])

    def normal(self, p: np.ndarray) -> np.ndarray:
        low, high = (np.array(v, p.dtype)[:, None] for v in (self.low, self.high))
        q = (2 * self._local(p) - low - high) / 2
        face = np.argmin((high - low) / 2 - abs(q), axis=0)
        n = np.where(np.arange(3)[:, None] == face, np.sign(q), 0)
        c, s = self.axes()
        return np.stack([c * n[0] + s * n[2], n[1], -s * n[0] + c * n[2]]) if self.turn else n


@dataclass(frozen=True)
class Rod:
    """A cylinder with caps along the x, y or z axis. axis: 0, 1 or 2."""

    center: Point
    axis: int
    radius: float
    height: float
    colour: str

    def ours(self) -> Any:
        along = tuple(float(i == self.axis) for i in range(3))
        center, radius, height = self.center, self.radius, self.height
        return vr.Cylinder(center=center, axis=along, radius=radius, height=height, material=self.colour)

    def ends(self) -> tuple[float, float]:
        """Coordinates of the caps along the axis."""
        return self.center[self.axis] - self.height / 2, self.center[self.axis] + self.height / 2

    def povray(self) -> str:
        caps = (tuple(end if i == self.axis else x for i, x in enumerate(self.center)) for end in self.ends())
        text = ", ".join(map(vector, caps))
        return f"cylinder {{ {text}, {self.radius!r} {_pigment(self.colour)} }}"

    def interval(self, o: np.ndarray, d: np.ndarray) -> Intervals:
        across = [i for i in range(3) if i != self.axis]
        wall = _in_circle([o[i] - self.center[i] for i in across], [d[i] for i in across], self.radius)
        slab = _slab(o[self.axis], d[self.axis], *self.ends())
        return np.maximum(wall[0], slab[0]), np.minimum(wall[1], slab[1])

    def normal(self, p: np.ndarray) -> np.ndarray:
        q = p - np.array(self.center, p.dtype)[:, None]
        along = np.arange(3)[:, None] == self.axis
        across = np.where(along, 0, q)
        distance = np.sqrt((across * across).sum(0))
        on_wall = abs(distance - self.radius) < abs(abs(q[self.axis]) - self.height / 2)
        return np.where(on_wall, across / distance, np.where(along, np.sign(q), 0))


@dataclass(frozen=True)
class Node:
    """An operation on operands. op: union, merge, intersection or difference; of: operands."""

    op: str
    of: tuple

    def ours(self) -> vr.Csg:
        return vr.Csg(op=self.op, of=tuple(x.ours() for x in self.of))

    def povray(self) -> str:
        return f"{self.op} {{\n" + "\n".join(x.povray() for x in self.of) + "\n}"

    def leaves(self) -> list:
        """All operands that are no operation, in order."""
        return [leaf for x in self.of for leaf in (x.leaves() if isinstance(x, Node) else [x])]

    def inside(self, parts: Iterator[np.ndarray]) -> np.ndarray:
        """Whether points are inside. parts: whether they are inside each of the leaves, in order."""
        each = [x.inside(parts) if isinstance(x, Node) else next(parts) for x in self.of]
        if self.op == "difference":
            return each[0] & ~np.logical_or.reduce(each[1:])
        return (np.logical_or if self.op in ("union", "merge") else np.logical_and).reduce(each)


def scene(objects: dict[str, Any], radius: float, size: int, spp: int, **settings: Any) -> vr.Scene:
    """A scene for visray with a light.

    objects: objects of visray by name, with materials in COLOURS
    radius: that of a ball about the origin that contains them
    settings: fields of vr.Settings
    """
    position = {name: tuple(radius * x for x in p) for name, p in {"eye": EYE, "lamp": LAMP}.items()}
    return vr.Scene(
        camera=vr.Camera(origin=position["eye"], target=(0.0, 0.0, 0.0), up=UP, fov=FOV),
        film=vr.Film(width=size, height=size),
        background=BACKGROUND,
        materials={
            name: vr.Material(ka=tuple(AMBIENT * x for x in c), kd=tuple(DIFFUSE * x for x in c))
            for name, c in COLOURS.items()
        },
        objects=objects,
        lights={"lamp": vr.PointLight(position=position["lamp"])},
        settings=vr.Settings(spp=spp, **settings),
    )


@dataclass(frozen=True)
class Solid:
    """A scene: one solid. radius: that of a ball about the origin that contains it."""

    node: Node
    radius: float

    def ours(self, size: int, spp: int, **settings: Any) -> vr.Scene:
        """The scene for visray. settings: fields of vr.Settings."""
        return scene({"solid": self.node.ours()}, self.radius, size, spp, **settings)


def _rounded_cube() -> Node:
    return Node("intersection", (Block((-1.0,) * 3, (1.0,) * 3, "yellow"), Ball((0.0,) * 3, 1.4, "yellow")))


def cube() -> Solid:
    """A rounded cube without three cylinders."""
    rods = tuple(Rod((0.0,) * 3, axis, 0.6, 3.0, "red") for axis in range(3))
    return Solid(Node("difference", (_rounded_cube(), *rods)), 1.45)


def die() -> Solid:
    """A rounded cube with 21 pips, the ones of opposite faces being 7."""
    far, near = 0.5, 1.06
    middle, corners = [(0.0, 0.0)], [(-far, -far), (far, far), (-far, far), (far, -far)]
    sides = [(-far, 0.0), (far, 0.0)]
    spots = {1: middle, 2: corners[:2], 3: middle + corners[:2], 4: corners, 5: middle + corners, 6: corners + sides}
    pips = []
    for axis, (low, high) in enumerate(((1, 6), (2, 5), (3, 4))):
        for count, sign in ((low, 1), (high, -1)):
            for u, v in spots[count]:
                center = [u, v]
                center.insert(axis, sign * near)
                pips.append(Ball(tuple(center), 0.2, "pale"))
    return Solid(Node("difference", (_rounded_cube(), *pips)), 1.45)


def lens() -> Solid:
    """Two balls' intersection with a hole and a notch, in a ring."""
    balls = tuple(Ball((0.0, y, 0.0), 1.9, "pale") for y in (-1.5, 1.5))
    hole, notch = Rod((0.0,) * 3, 1, 0.25, 2.0, "red"), Block((0.6, -1.0, -0.2), (2.0, 1.0, 0.2), "blue")
    glass = Node("difference", (Node("intersection", balls), hole, notch))
    ring = Node("difference", (Rod((0.0,) * 3, 1, 1.35, 0.5, "grey"), Rod((0.0,) * 3, 1, 1.12, 0.7, "grey"), notch))
    return Solid(Node("union", (glass, ring)), 1.4)


def gear() -> Solid:
    """A gear with 24 teeth, a hole for its axle, eight round holes and a groove on both sides."""
    teeth = [Block((0.9, -0.18, -0.06), (1.25, 0.18, 0.06), "grey", 15.0 * i) for i in range(24)]
    disk = Node("union", (Rod((0.0,) * 3, 1, 1.0, 0.4, "grey"), *teeth))
    angles = [2 * np.pi * i / 8 for i in range(8)]
    holes = [Rod((float(0.6 * np.cos(a)), 0.0, float(0.6 * np.sin(a))), 1, 0.15, 1.0, "red") for a in angles]
    groove = Node("difference", (Rod((0.0,) * 3, 1, 0.9, 1.0, "blue"), Rod((0.0,) * 3, 1, 0.91, 0.3, "blue")))
    axle = Rod((0.0,) * 3, 1, 0.3, 1.0, "yellow")
    return Solid(Node("difference", (disk, axle, groove, *holes)), 1.28)


def sponge() -> Solid:
    """A cube without 75 square bars, 25 along each axis."""
    places = (-0.8, -0.4, 0.0, 0.4, 0.8)
    bars = []
    for axis, (half, colour) in enumerate(((0.1, "red"), (0.11, "pale"), (0.12, "blue"))):
        for u in places:
            for v in places:
                low, high = [u - half, v - half], [u + half, v + half]
                low.insert(axis, -1.1)
                high.insert(axis, 1.1)
                bars.append(Block(tuple(low), tuple(high), colour))
    return Solid(Node("difference", (Block((-1.0,) * 3, (1.0,) * 3, "yellow"), *bars)), 1.74)


SOLIDS = {"cube": cube, "die": die, "lens": lens, "gear": gear, "sponge": sponge}
