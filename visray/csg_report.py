"""Notes about CSG objects: of what each is made, whether it is unbounded, and whether it is empty."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from visray.geometry import gamma
from visray.primitives.csg_operands import Operand, has_operands, operands
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive, bounding_box
from visray.scene.scene import Scene
from visray.warn import warn

# Number of objects of which it is said of what they are made.
SHOWN = 50
# Number of operands for which it is found, before a render, whether they reach what they cut: each takes a while.
MOST_BEFORE_RENDER = 1000
EVERYWHERE = np.array([[-np.inf] * 3, [np.inf] * 3])


class CsgWarning(UserWarning):
    """Warning that a CSG object, or an operand of one, is empty, or that an operand does not reach what it cuts."""


def warn_of_empty_csg(scene: Scene) -> None:
    """Warns of CSG objects and operands that are empty, and of operands that do not reach what they cut. Each is shown
    once."""
    looked_at = 0
    for address, obj in _objects(scene):
        walk = list(operands(address, obj, scene.geometries))
        looked_at += len(walk)
        few = looked_at <= MOST_BEFORE_RENDER
        # Without an intersection, no box can be empty.
        if few or any(x.shape.composite and x.shape.op == "intersection" for x in walk):
            boxes = _Boxes.of(walk)
            for text in boxes.empty() + (boxes.out_of_reach() if few else []):
                warn(text, CsgWarning)


def csg_notes(scene: Scene) -> list[str]:
    """List of sentences about CSG objects, each of which begins with an address."""
    notes, empty, made = [], [], list(_objects(scene))
    apart = {f"objects.{name}": len(bodies) for name, bodies in scene.unions.items()}
    for i, (address, obj) in enumerate(made):
        walk = list(operands(address, obj, scene.geometries))
        boxes = _Boxes.of(walk)
        bodies = f"; drawn as {apart[address]} bodies" if address in apart else ""
        unbounded = "; it is unbounded" if np.isinf(boxes[walk[0]]).any() and not boxes.is_empty(walk[0]) else ""
        notes += [f"{address}: {_contents(walk)}{bodies}{unbounded}"] if i < SHOWN else []
        empty += boxes.empty() + boxes.out_of_reach()
    if len(made) > SHOWN:
        notes.append(f"objects: {len(made) - SHOWN:,} CSG objects more are not listed here")
    return notes + list(dict.fromkeys(empty))


def _objects(scene: Scene) -> Iterator[tuple[str, Primitive]]:
    """Yields the address and the shape of each geometry and each object with operands."""
    for section, shapes in (("geometries", scene.geometries), ("objects", scene.objects)):
        yield from ((f"{section}.{name}", shape) for name, shape in shapes.items() if has_operands(shape))


def _contents(walk: list[Operand]) -> str:
    """Of what an object is made, in words. walk: its operands at all depths"""
    whole, leaves = walk[0], [x for x in walk if x.is_leaf]
    cut = [x for x in leaves if _is_cut(x, whole)]
    rest = [x for x in leaves if not _is_cut(x, whole)]
    if whole.shape.composite:
        text = f"{_with_article(whole.shape.op)} of {len(rest):,} shapes: {_kinds(rest)}"
    else:
        of = f" of {walk[1].address}" if isinstance(whole.shape, Instance) else ""
        text = f"{_with_article(whole.shape.type)}{of}"
    return f"{text}, from which {_kinds(cut)} {'is' if len(cut) == 1 else 'are'} taken away" if cut else text


def _is_cut(operand: Operand, whole: Operand) -> bool:
    """Whether an operand belongs to what is taken away from an object as a whole."""
    while operand.around is not None and operand.around is not whole:
        operand = operand.around
    return operand.role == "cut"


def _with_article(word: str) -> str:
    """A word with its indefinite article."""
    return f"{'an' if word[0] in 'aeio' else 'a'} {word}"


def _kinds(leaves: list[Operand]) -> str:
    """How many shapes of each kind there are, such as `1 box, 3 spheres`."""
    return ", ".join(_counted(count, kind) for kind, count in Counter(x.shape.type for x in leaves).items())


def _counted(count: int, kind: str) -> str:
    """A number of shapes of a kind."""
    return f"{count:,} {kind}" if count == 1 else f"{count:,} {kind}{'es' if kind.endswith(('s', 'x', 'sh')) else 's'}"


@dataclass(frozen=True)
class _Boxes:
    """Bounding boxes of an object and its operands at all depths.

    walk: the operands, each before its own.
    inner: operands of each operand that make it up, without cuts.
    boxes: box of each operand, as its low and its high corner. It is infinite where it is unbounded, and inside out
        where it is empty. Shape: (2, 3).

    inner and boxes are dicts by the identities of the operands.
    """

    walk: list[Operand]
    inner: dict[int, list[Operand]]
    boxes: dict[int, np.ndarray]

    @staticmethod
    def of(walk: list[Operand]) -> "_Boxes":
        """The boxes of the operands of a walk (csg_operands.operands)."""
        result = _Boxes(walk, {id(x): [] for x in walk}, {})
        for x in walk[1:]:
            result.inner[id(x.around)] += [x] if x.role != "cut" else []
        for x in reversed(walk):
            result.boxes[id(x)] = result._box(x)
        return result

    def __getitem__(self, operand: Operand) -> np.ndarray:
        return self.boxes[id(operand)]

    def _box(self, operand: Operand) -> np.ndarray:
        """The box of an operand. Domain: the boxes of its own operands are known."""
        inner = [self[x] for x in self.inner[id(operand)]]
        if not inner:
            box = bounding_box(operand.shape.with_fields(transform=operand.steps))
            return EVERYWHERE if box is None else np.array(box)
        op = operand.shape.op if operand.shape.composite else "difference"
        if op == "difference":
            return inner[0]
        low, high = np.stack(inner, axis=1)
        if op == "intersection":
            return np.stack([low.max(axis=0), high.min(axis=0)])
        some = np.array([not _is_empty(box) for box in inner])
        return np.stack([low[some].min(axis=0), high[some].max(axis=0)]) if some.any() else inner[0]

    def is_empty(self, operand: Operand) -> bool:
        """Whether the box of an operand is empty."""
        return _is_empty(self[operand])

    def empty(self) -> list[str]:
        """List with a sentence about each empty operand that is in no other one that is empty."""
        found = [x for x in self.walk if self.is_empty(x) and (x.around is None or not self.is_empty(x.around))]
        texts = []
        for x in found:
            first, second = (y.address for y in self._apart(x))
            texts.append(f"{x.address}: is empty, as the boxes of {first} and {second} do not meet")
        return list(dict.fromkeys(texts))

    def out_of_reach(self) -> list[str]:
        """List with a sentence about each object that operands are to cut, but which they do not reach."""
        found: dict[int, list[Operand]] = {}
        for x in self.walk:
            taken_away = x.cuts and (x.role == "cut" or x.around.shape.op == "difference")
            if (
                taken_away
                and not self.is_empty(x)
                and not self.is_empty(x.around)
                and _gap(self[x], self[x.around]) > 0
            ):
                found.setdefault(id(x.around), []).append(x)
        texts = []
        for first, *more in found.values():
            many = f" and {len(more):,} more" if more else ""
            verb, it = ("do", "they take") if more else ("does", "it takes")
            texts.append(f"{first.address}{many} {verb} not reach the object around; {it} nothing away")
        return list(dict.fromkeys(texts))

    def _apart(self, operand: Operand) -> tuple[Operand, Operand]:
        """Two operands whose boxes do not meet, and which make another operand empty. If boxes do not all meet in one
        point, there are two that do not meet (Helly)."""
        while True:
            inner = self.inner[id(operand)]
            empty = next((x for x in inner if self.is_empty(x)), None)
            if empty is None:
                pairs = combinations(inner, 2)
                return max(pairs, key=lambda pair: _gap(self[pair[0]], self[pair[1]]))
            operand = empty


def _is_empty(box: np.ndarray) -> bool:
    """Whether a box is empty by more than the rounding errors of its corners."""
    return _gap(box, box) > 0


def _gap(box: np.ndarray, other: np.ndarray) -> float:
    """Distance between two boxes along the axis along which they are farthest apart, less the rounding errors of their
    corners, which have a few roundings each; at most 0 if the boxes may meet."""
    low, high = np.maximum(box[0], other[0]), np.minimum(box[1], other[1])
    apart = np.isfinite(low) & np.isfinite(high)
    slack = gamma(32) * (np.abs(low) + np.abs(high))
    return float(np.max((low - high - slack)[apart], initial=-np.inf))
