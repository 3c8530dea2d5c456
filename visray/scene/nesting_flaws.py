"""Objects and geometries that contain themselves, or too many operands."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from visray.operands import ROLES, named_operands
from visray.primitives.csg_operands import Operand
from visray.primitives.instance import Instance
from visray.scene.messages import line
from visray.scene.scene import Scene

# Largest number of shapes that one object is made of, and of levels of operands in each other.
MOST_OPERANDS, MOST_LEVELS = 10_000, 100
TOO_DEEP = f"its operands are nested deeper than {MOST_LEVELS} levels, or it contains itself; write them as one list"


@dataclass(frozen=True)
class _Size:
    """Size of an object or a geometry as it is written.

    shapes, levels: number of shapes in it, and of levels of operands in each other.
    instances: for each instance in it: its address, the name of its geometry, and the number of levels around it.
    """

    shapes: int
    levels: int
    instances: tuple[tuple[str, str, int], ...]

    @staticmethod
    def of(walk: list[Operand]) -> "_Size":
        """Size of an object or a geometry. walk: its operands, as they are written"""
        level, shapes, instances = {}, 0, []
        for o in walk:
            level[o.address] = 0 if o.around is None else level[o.around.address] + 1
            shapes += o.is_leaf
            if isinstance(o.shape, Instance):
                instances.append((o.address, o.shape.geometry, level[o.address]))
        return _Size(shapes, max(level.values()), tuple(instances))

    def joined(self, whole: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
        """Number of shapes and of levels, with those of the geometries of the instances. whole: these of each
        geometry."""
        inner = [(*whole[name], level) for _, name, level in self.instances if name in whole]
        shapes = self.shapes + sum(n for n, _, _ in inner)
        return shapes, max([self.levels, *(level + levels for _, levels, level in inner)])


# A shape without operands.
SIMPLE = _Size(1, 0, ())


def nesting_flaws(scene: Scene, made: Mapping[str, list[Operand]]) -> Iterator[str]:
    """Yields a line for the first geometry that contains itself, or for the first one with too many operands or levels
    of operands; without these, a line for each such object.

    made: the objects and geometries with operands, each with its operands as they are written, by address.
    """
    sizes = dict.fromkeys(scene.geometries, SIMPLE)
    sizes |= {address.partition(".")[2]: _Size.of(made[address]) for address in made if address.startswith("geom")}
    whole, cycles = _whole(sizes)
    yield from cycles
    if cycles:
        return
    # All geometries that contain a geometry that is too large are too large, too.
    large = [text for name, x in whole.items() if (text := _too_large(f"geometries.{name}", *x))]
    yield from large[:1]
    if large:
        return
    for address, walk in made.items():
        if address.startswith("objects.") and (text := _too_large(address, *_Size.of(walk).joined(whole))):
            yield text


def _whole(sizes: Mapping[str, _Size]) -> tuple[dict[str, tuple[int, int]], list[str]]:
    """Number of shapes and levels of each geometry, with those of all geometries in it; and a list with a line about
    the first geometry that contains itself or that has far too many levels, if there is one."""
    whole: dict[str, tuple[int, int]] = {}
    left, rounds = dict(sizes), 0
    while left:
        ready = [name for name, size in left.items() if not any(at in left for _, at, _ in size.instances)]
        if not ready:
            return whole, [_cycle(left)]
        # What is ready in the n-th round has at least n levels below it.
        rounds += 1
        if rounds > MOST_LEVELS + 1:
            return whole, [f"geometries.{ready[0]}: {TOO_DEEP}"]
        for name in ready:
            whole[name] = left.pop(name).joined(whole)
    return whole, []


def _cycle(left: Mapping[str, _Size]) -> str:
    """The line about a geometry that contains itself. left: geometries that each contain another one of them."""
    way, steps = [next(iter(left))], []
    while way[-1] not in way[:-1]:
        address, name, _ = next(x for x in left[way[-1]].instances if x[1] in left)
        steps.append((address, name))
        way.append(name)
    first = way.index(way[-1])
    said = ", ".join(f"{a} contains {b}" for a, b in zip(way[first:], way[first + 1 :]))
    address, name = steps[first]
    return line(f"{address}.geometry", name, f"a geometry cannot contain itself: {said}; take another geometry")


def _too_large(address: str, shapes: int, levels: int) -> str | None:
    """The line about an object or a geometry with too many operands or levels; None if it has not."""
    if levels > MOST_LEVELS:
        return f"{address}: {TOO_DEEP}"
    if shapes > MOST_OPERANDS:
        many = f"{shapes:,}" if shapes < 10**9 else "more than 1,000,000,000"
        return f"{address}: has {many} operands; at most {MOST_OPERANDS:,} are possible, so make several objects"
    return None


def too_deep(raw: dict) -> list[str]:
    """List with a line for each object and each geometry with too many levels of operands. An object of Python may even
    contain itself. Other functions could not even look at it.

    raw: the scene as dicts, lists and instances.
    """
    sections = ((name, raw.get(name)) for name in ("geometries", "objects"))
    entries = ((f"{name}.{key}", x) for name, part in sections if isinstance(part, dict) for key, x in part.items())
    return [f"{address}: {TOO_DEEP}" for address, entry in entries if _is_too_deep(entry)]


def _is_too_deep(entry: Any) -> bool:
    """Whether an object has too many levels of operands. entry: a dict or an instance, or anything else"""
    ahead = [(entry, 0)]
    while ahead:
        x, level = ahead.pop()
        if level > MOST_LEVELS:
            return True
        for role in ROLES:
            inner = x.get(role) if isinstance(x, dict) else getattr(x, role, None)
            if isinstance(inner, (dict, list, tuple)):
                ahead += ((y, level + 1) for y in named_operands(inner).values())
    return False
