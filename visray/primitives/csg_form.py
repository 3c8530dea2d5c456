"""The structure of CSG objects: which operands they have, and how these are combined.

An object is a tree of operands. It is brought into negation normal form: a difference becomes an intersection with
complements, and complements are moved down to the leaves (De Morgan's laws), so that the inner nodes are intersections
and unions. Nested intersections are joined into one, and so are nested unions. A leaf is an operand that is not CSG.
An example, with complements as ~x: a - ((b | c) - d) is a & (~(b | c) | d), and that is a & ((~b & ~c) | d).

Leaves are numbered from 0, in the order in which they are written. The number of a leaf is the part of the object's
surface that it contributes.

A site is a place in the structure of a kernel: what is known of an operand when code is generated, such as that it is a
sphere that is taken away, in contrast to its numbers. All objects with the same sites share their code. Children of a
node with equal sites form a group. A small group is written out, and a large one is a loop over rows, so that its size
is data.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from visray.primitives.csg_operands import CUTTING, NO_MATERIAL, operands, own_material
from visray.primitives.primitive import Primitive
from visray.transforms import Transform

# Largest number of children with equal sites that are written out in a kernel.
MAX_WRITTEN_OUT = 4
# The number of bits for own parts is a multiple of this one.
PART_BITS = 4


@dataclass(frozen=True)
class Leaf:
    """An operand that is not CSG.

    shape: the operand, without its transform.
    steps: its transform, followed by those of the objects around it.
    material: name of its material.
    negated: whether its complement is meant.
    number: its number in the object.
    """

    shape: Primitive
    steps: tuple[Transform, ...]
    material: str
    negated: bool
    number: int

    @cached_property
    def site(self) -> "LeafSite":
        """The site of the leaf."""
        kind = self.shape.operand_kind
        return LeafSite(kind, self.negated, bool(self.steps) and not kind.own_frames)


@dataclass(frozen=True)
class Node:
    """The intersection of its children if `both`, else their union.

    groups: the children, those with equal sites side by side.
    looped: whether the kernel loops over groups of any size. If not, it loops over large ones only.
    """

    both: bool
    groups: tuple[tuple[Any, ...], ...]
    looped: bool = False

    @staticmethod
    def of(both: bool, children: list) -> Any:
        """The node of some children. A single child stands for itself, and nested nodes of the same sort are joined."""
        flat = [y for x in children for y in (x.children if isinstance(x, Node) and x.both == both else (x,))]
        if len(flat) == 1:
            return flat[0]
        groups: dict[Any, list] = {}
        for x in flat:
            groups.setdefault(x.site, []).append(x)
        # Searches of roots and walks are long. They come last, because the others often make them unnecessary.
        ordered = sorted(groups.values(), key=lambda group: group[0].site.searches)
        return Node(both, tuple(map(tuple, ordered)))

    @property
    def children(self) -> tuple:
        """All children."""
        return tuple(x for group in self.groups for x in group)

    @cached_property
    def site(self) -> "NodeSite":
        """The site of the node."""
        limit = 0 if self.looped else MAX_WRITTEN_OUT
        sizes = [len(g) if len(g) <= limit else None for g in self.groups]
        return NodeSite(self.both, tuple(Group(g[0].site, size) for g, size in zip(self.groups, sizes)))


@dataclass(frozen=True)
class LeafSite:
    """A place for leaves.

    kind: class whose methods serve the operands.
    negated: whether their complements are meant.
    moved: whether they have transforms that the table of the kind does not contain.
    """

    kind: type[Primitive]
    negated: bool
    moved: bool

    @property
    def searches(self) -> bool:
        """Whether crossings are found by a search, in contrast to the interval of a convex solid."""
        return not hasattr(self.kind, "intervals")

    @property
    def finds_roots(self) -> bool:
        """Whether crossings are searched roots, some of which may stay unresolved."""
        return self.kind.finds_roots

    @property
    def outside(self) -> bool:
        """Whether points far away are meant."""
        return self.negated

    @property
    def localized(self) -> bool:
        """Whether all points are meant, or none, outside of some ball."""
        return self.kind.bounded

    @property
    def leaves(self) -> tuple["LeafSite", ...]:
        """All places for leaves, in order."""
        return (self,)


@dataclass(frozen=True)
class Group:
    """Children of a node with equal sites. size: their number; None if the kernel loops over them."""

    site: Any
    size: int | None


@dataclass(frozen=True)
class NodeSite:
    """A place for nodes. both, groups: as in Node."""

    both: bool
    groups: tuple[Group, ...]

    @property
    def searches(self) -> bool:
        """Whether some leaf searches."""
        return any(group.site.searches for group in self.groups)

    @property
    def finds_roots(self) -> bool:
        """Whether some leaf finds roots."""
        return any(group.site.finds_roots for group in self.groups)

    @property
    def outside(self) -> bool:
        """As LeafSite.outside."""
        return (all if self.both else any)(group.site.outside for group in self.groups)

    @property
    def localized(self) -> bool:
        """As LeafSite.localized. An intersection is bounded if one of its sets is, and a union has a bounded complement
        if one of its sets has."""
        one_is_enough = self.outside != self.both
        of_this_side = [g.site.localized for g in self.groups if g.site.outside == self.outside]
        return any(of_this_side) if one_is_enough else all(of_this_side)

    @property
    def leaves(self) -> tuple[LeafSite, ...]:
        """All places for leaves, in order. Each child of a group that is written out has its own."""
        return tuple(leaf for g in self.groups for _ in range(g.size or 1) for leaf in g.site.leaves)


@dataclass(frozen=True)
class Form:
    """The structure of an object.

    surface: tree whose surface is seen.
    within: tree of the points at which this surface is kept; None if all of it is kept.
    leaves: all leaves, by number.
    medium: name of the object's own material, which says what its inside does to light.
    steps: the object's own transform, which all leaves have last.
    body: the object without it and without a material: objects with equal bodies differ by their transforms alone.
    """

    surface: Any
    within: Any
    leaves: tuple[Leaf, ...]
    medium: str
    steps: tuple[Transform, ...]
    body: Primitive

    @property
    def closed(self) -> bool:
        """Whether the object is a solid."""
        return self.within is None and all(leaf.shape.operand_kind.closed for leaf in self.leaves)

    @property
    def part_bits(self) -> int:
        """Number of bits that the operands' own parts need, rounded up so that few numbers make a new kernel."""
        most = max(map(_own_parts, self.leaves))
        return -(-(most - 1).bit_length() // PART_BITS) * PART_BITS


def _own_parts(leaf: Leaf) -> int:
    """Number of parts of a leaf's own surface that a search must tell apart. For a mesh, one more stands for none of
    its triangles (CsgBody.part_at)."""
    kind = leaf.shape.operand_kind
    return leaf.shape.row_count() + 1 if kind.own_frames else kind.parts if kind.uses_part else 1


def form_of(csg: Primitive) -> Form:
    """The structure of a CSG object without instances and cuts (csg_resolved.py)."""
    leaves: list[Leaf] = []
    materials = [x.material for x in operands("", csg, {}) if x.is_leaf]
    surface, within = _parts(csg, (), materials, False, leaves)
    body = csg.with_fields(transform=(), material=NO_MATERIAL)
    return Form(surface, within, tuple(leaves), own_material(csg, {}), csg.transform, body)


def _parts(obj: Primitive, steps: tuple, materials: list[str], negated: bool, leaves: list) -> tuple[Any, Any]:
    """(surface, within) of an object, as in Form.

    steps: transform of the objects around it.
    materials: names of the materials of all leaves, by number.
    negated: whether the complement of the object is meant.
    leaves: list to which the leaves are added.
    """
    steps = obj.transform + steps
    if not obj.composite:
        leaf = Leaf(obj.with_fields(transform=()), steps, materials[len(leaves)], negated, len(leaves))
        leaves.append(leaf)
        return leaf, None
    first, *others = obj.of
    both, difference = obj.op in CUTTING, obj.op == "difference"
    surface, within = _parts(first, steps, materials, negated, leaves)
    rest = [_parts(x, steps, materials, negated ^ difference, leaves)[0] for x in others]
    if within is None and obj.closed:
        return Node.of(both ^ negated, [surface, *rest]), None
    return surface, Node.of(True, [*([] if within is None else [within]), *rest])


def renumbered(tree: Any, first: int) -> Any:
    """The tree with `first` added to the numbers of its leaves."""
    if isinstance(tree, Leaf):
        return replace(tree, number=first + tree.number)
    groups = tuple(tuple(renumbered(x, first) for x in group) for group in tree.groups)
    return Node(tree.both, groups, tree.looped)
