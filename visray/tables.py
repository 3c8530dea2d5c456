"""The scene as tables of numbers: what a kernel reads.

`pack` turns a Scene into Tables: each kind's rows stacked into arrays, names replaced by indices. Tables is a Dr.Jit
PyTree: derivatives are taken with respect to its arrays. `prepare` computes what depends on no ray, once a render.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.tree import Tree, build
from visray.camera import Camera
from visray.geometry import Frame
from visray.images import Atlas
from visray.lights.light import Light
from visray.materials import Material
from visray.primitives.primitive import Primitive
from visray.quantities import Arrays, stacked
from visray.scene.scene import Gradient, Occlusion, Scene
from visray.transforms import compose
from visray.trees import detached, rows

# The guards of up to this many objects of a kinship are written out one by one in the kernel; more hang in a tree.
# Written out they cost a few cycles each, but each takes a millisecond to compile, wherever rays start anew.
WRITTEN_OUT = 32
# For rays that share their origin it pays for twice as many.
GATHERED = 64
# Up to this many, not only their guards but all that is done with them.
FEW = 12
NO_TEXTURE = 0xFFFFFFFF


@dataclass(frozen=True)
class Kinship:
    """Objects that share a kind and either have a transform or have none: they share their code."""

    kind: type[Primitive]
    moved: bool
    names: tuple[str, ...]


def kinships(scene: Scene) -> tuple[Kinship, ...]:
    """The families of the scene's objects, in the order of first appearance."""
    found: dict[tuple, list[str]] = {}
    for name, thing in scene.objects.items():
        found.setdefault((thing.kind, bool(thing.transform)), []).append(name)
    return tuple(Kinship(kind, moved, tuple(names)) for (kind, moved), names in found.items())


@dataclass(frozen=True)
class Tables:
    """The numbers of a scene. Shapes: one entry an object, a material or a light of one kind; one entry for camera,
    background and settings."""

    objects: tuple[Primitive, ...]
    outers: tuple[Frame | None, ...]
    material_of: tuple[Any, ...]
    materials: Material
    lights: tuple[Light, ...]
    camera: Camera
    background: Gradient
    ambient: Any
    occlusion: Occlusion
    texture_of: tuple[Any, ...]


@dataclass(frozen=True)
class Troop:
    """Lights of one kind."""

    kind: type[Light]
    names: tuple[str, ...]


def troops(scene: Scene) -> tuple[Troop, ...]:
    """The lights of the scene by kind, in the order of first appearance."""
    found: dict[type, list[str]] = {}
    for name, light in scene.lights.items():
        found.setdefault(type(light), []).append(name)
    return tuple(Troop(kind, tuple(names)) for kind, names in found.items())


def pack(scene: Scene, a: Arrays) -> Tables:
    """The scene's numbers as arrays."""
    materials = {"default": Material()} | scene.materials
    index = {name: i for i, name in enumerate(materials)}
    groups = [[scene.objects[n] for n in k.names] for k in kinships(scene)]
    sky = scene.background
    sky = sky if isinstance(sky, Gradient) else Gradient(top=sky, bottom=sky)
    texture = {name: i for i, name in enumerate(scene.textures)} | {None: NO_TEXTURE}
    painted = {name: texture[m.texture] for name, m in materials.items()}
    tables = Tables(
        objects=tuple(g[0].kind.table(a, g) for g in groups),
        outers=tuple(_outer(a, g) for g in groups),
        material_of=tuple(a.put(a.U, np.array([index[x.material] for x in g], np.uint32)) for g in groups),
        materials=stacked(a, Material, list(materials.values())),
        lights=tuple(stacked(a, t.kind, [scene.lights[n] for n in t.names]) for t in troops(scene)),
        camera=stacked(a, Camera, [scene.camera]),
        background=stacked(a, Gradient, [sky]),
        ambient=a.put(a.V, np.array(scene.ambient, float)[:, None]),
        occlusion=stacked(a, Occlusion, [scene.settings.occlusion]),
        texture_of=tuple(a.put(a.U, np.array([painted[x.material] for x in g], np.uint32)) for g in groups),
    )
    dr.eval(tables)
    return tables


def _outer(a: Arrays, group: list[Primitive]) -> Frame | None:
    if not group[0].transform:
        return None
    matrices = np.stack([compose(x.transform) for x in group])
    return Frame(*(a.put(a.W, matrices[:, :, column].T) for column in range(4)))


@dataclass(frozen=True)
class Group:
    """Objects of one kinship, ready for rays: placement, a sphere around each, its material and the number
    of its texture, and a tree over many."""

    placed: Any
    centre: Any
    radius: Any
    material: Material
    texture: Any
    tree: Tree | None


@dataclass(frozen=True)
class View:
    """The camera, ready for rays: origin, the steps of one pixel to the right and down and the top left corner, at the
    distance 1 along the view; the lens's radius to the right and up; 1 over the distance of focus; that of the target.
    """

    o: Any
    right: Any
    down: Any
    corner: Any
    forward: Any
    aside: Any
    above: Any
    sharp: Any
    middle: Any


@dataclass(frozen=True)
class Ready:
    """Everything a kernel reads. glow: the ambient light of all lights; reach: how far near occlusion looks."""

    groups: tuple[Group, ...]
    lights: tuple[Light, ...]
    view: View
    background: Gradient
    ambient: Any
    glow: Any
    reach: Any
    blank: Material
    atlas: Atlas | None


def prepare(
    tables: Tables, kin: tuple[Kinship, ...], film: tuple[int, int], a: Arrays, atlas: Atlas | None = None
) -> Ready:
    """What of the scene depends on no ray, evaluated. Derivatives flow through it."""
    groups = []
    of_objects = tables.objects, tables.outers, tables.material_of, tables.texture_of
    for k, table, outer, material, texture in zip(kin, *of_objects):
        centre, radius = table.sphere(outer) if k.kind.bounded else (None, None)
        centre, radius = detached((centre, radius))
        groups.append(Group(table.placed(outer), centre, radius, rows(tables.materials, material), texture, None))
    groups = _with_tree(groups, kin, tables, a)
    ready = Ready(
        groups=tuple(groups),
        lights=tables.lights,
        view=_view(tables.camera, film, a),
        background=tables.background,
        ambient=tables.ambient,
        glow=_glow(tables.lights, a),
        reach=tables.occlusion.distance,
        blank=rows(tables.materials, a.U(0)),
        atlas=atlas,
    )
    dr.eval(ready)
    return ready


def _with_tree(groups: list[Group], kin: tuple[Kinship, ...], tables: Tables, a: Arrays) -> list[Group]:
    """The groups, with one tree over all rows of those that are too many to be written out; each of these holds it."""
    of, base = [], 0
    for number, (k, group, table, outer) in enumerate(zip(kin, groups, tables.objects, tables.outers)):
        if group.radius is not None and len(k.names) > WRITTEN_OUT:
            of.append((number, base + np.arange(len(k.names)), *_boxes(k.kind, group, table, outer)))
        base += len(k.names)
    if not of:
        return groups
    numbers, index, low, high = zip(*of)
    batch = np.repeat(numbers, [len(i) for i in index])
    tree = build(a, np.concatenate(low), np.concatenate(high), batch, np.concatenate(index))
    return [replace(g, tree=tree) if number in numbers else g for number, g in enumerate(groups)]


def _boxes(kind: type, group: Group, table: Primitive, outer: Frame | None) -> tuple[np.ndarray, np.ndarray]:
    """A box around each object of a group: of its corners, its frame or its sphere."""
    if kind.__name__ == "Triangle":
        corners = np.array([np.array(c).T for c in (group.placed.a, group.placed.b, group.placed.c)])
        return corners.min(axis=0), corners.max(axis=0)
    centre, radius = np.array(group.centre).T, np.array(group.radius)[:, None]
    if kind.__name__ == "Box":
        whole = table.frame().then(outer)
        radius = sum(np.abs(np.array(v)).T for v in (whole.x, whole.y, whole.z))
    return centre - radius, centre + radius


def _glow(lights: tuple[Light, ...], a: Arrays) -> Any:
    """The ambient light of all lights together."""
    total = a.V(0)
    for table in lights:
        each = table.intensity * table.Ia
        total = total + a.V(*(dr.sum(c) for c in each))
    return total


def _view(camera: Camera, film: tuple[int, int], a: Arrays) -> View:
    # One difference for both: in forward mode Dr.Jit wants no way from the origin that leads to nothing in the picture.
    view = camera.target - camera.origin
    forward, middle = dr.normalize(view), dr.norm(view)
    right = dr.normalize(dr.cross(forward, camera.up))
    up = dr.cross(right, forward)
    width, height = (dr.opaque(a.D, float(x)) for x in film)
    pixel = 2 * dr.tan(camera.fov * (0.5 * dr.pi / 180)) / height
    corner = forward - (0.5 * pixel * width) * right + (0.5 * pixel * height) * up
    focus = dr.select(camera.focus > 0, camera.focus, middle)
    lens = (0.5 * camera.aperture) * right, (0.5 * camera.aperture) * up
    steps = (a.V(v) for v in (pixel * right, -pixel * up, corner, forward))
    return View(camera.origin, *steps, *lens, dr.rcp(focus), a.F(middle))
