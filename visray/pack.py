"""Packs the numbers of a scene into arrays. Kernels read these arrays, derivatives are taken with respect to them
(address_index.py), and updates change them (repack.py).

`pack` turns a Scene into columns: one batch for objects that share their code, and one for lights that do. A row is one
object, as an entry of these arrays. References by name become numbers. `Packed` is a Dr.Jit PyTree (pytree.py).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from visray.camera import Camera, OrthographicCamera
from visray.geometry import Frame
from visray.lights.light import Light
from visray.materials import Material
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.mesh_buffers import Body
from visray.primitives.primitive import Primitive
from visray.pytree import evaluated
from visray.quantities import Arrays, stacked
from visray.scene.scene import Occlusion, Scene, SkyGradient
from visray.textures import row_number
from visray.transforms import composed

NO_TEXTURE = 0xFFFFFFFF


class Names:
    """Names of a batch's rows: either listed, or made of a prefix and the row's number, such as t0, t1, t2.

    If `counts` is given, each listed name belongs to so many rows in a row, such as the triangles of a mesh.
    """

    def __init__(
        self,
        listed: tuple[str, ...] = (),
        prefix: str = "",
        count: int | None = None,
        counts: tuple[int, ...] | None = None,
    ):
        self.listed, self.prefix = listed, prefix
        self.ends = None if counts is None else np.cumsum(counts)
        self.count = (len(listed) if count is None else count) if counts is None else int(self.ends[-1])

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, row: int) -> str:
        if not 0 <= row < self.count:
            raise IndexError(row)
        if self.ends is not None:
            return self.listed[np.searchsorted(self.ends, row, side="right")]
        return self.listed[row] if self.listed else f"{self.prefix}{row}"

    @cached_property
    def _rows(self) -> dict[str, int]:
        first = range(len(self.listed)) if self.ends is None else [0, *self.ends[:-1].tolist()]
        return dict(zip(self.listed, first))

    def row(self, name: str) -> int | None:
        """The row with this name, the first one if there are several; None if there is none."""
        if self.listed:
            return self._rows.get(name)
        number = name.removeprefix(self.prefix)
        fits = name.startswith(self.prefix) and number.isdecimal() and str(int(number)) == number
        return int(number) if fits and int(number) < self.count else None


@dataclass(frozen=True)
class Columns:
    """Objects that share their code, as arrays with one entry for each row. They come from a scene, or from any other
    source of columns.

    kind: class of the objects; objects with a transform and objects without one form two batches
    names: names of the rows
    numbers: the kind's fields, as arrays
    outer: transforms of the rows; None for a batch without transforms
    object_of: number of each row's object among the objects of the batch, if rows are parts of objects, such as the
        triangles of meshes; None if each row is an object
    material, texture: number of each object's material, and of its texture's row in the atlas (textures.row_number)
    object: number of each object, in the order of the scene
    """

    kind: type[Primitive]
    names: Names
    numbers: Any
    outer: Frame | None
    object_of: Any
    material: Any
    texture: Any
    object: Any

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True)
class LightColumns:
    """Lights of one kind as arrays.

    kind: class of the lights
    names: names of the lights
    numbers: the kind's fields, as arrays
    samples: number of samples of each light, as Python integers
    scene_index: number of each light in the scene
    """

    kind: type[Light]
    names: Names
    numbers: Light
    samples: tuple[int, ...]
    scene_index: tuple[int, ...]


@dataclass(frozen=True)
class Packed:
    """All numbers of a scene. Arrays have one entry for each row, each material, or each light of a kind. Camera,
    background, ambient light and occlusion have a single entry."""

    batches: tuple[Columns, ...]
    lights: tuple[LightColumns, ...]
    materials: Material
    camera: Camera | OrthographicCamera
    background: SkyGradient
    ambient: Any
    occlusion: Occlusion


class BatchKeys:
    """For each object of a scene, a key that is equal for all objects of one batch: their kind, and whether they have a
    transform that the table of the kind does not contain.

    A mesh is a body, so that its rows are whole meshes, if it is an instance or if its material is transparent. Each
    other mesh has one row for each triangle.
    """

    def __init__(self, scene: Scene):
        self.scene, self.body_kinds = scene, {}
        self.transparent = {name for name, m in materials_of(scene).items() if any(m.kt)}

    def __call__(self, obj: Primitive) -> tuple[type[Primitive], bool]:
        shape = self.scene.shape_of(obj)
        if isinstance(shape, Mesh) and (shape is not obj or obj.material in self.transparent):
            if id(shape) not in self.body_kinds:
                self.body_kinds[id(shape)] = shape.body_kind
            return self.body_kinds[id(shape)], False
        kind = shape.kind
        return kind, bool(shape.transform or obj.transform) and not kind.own_frames


def pack(scene: Scene, a: Arrays) -> Packed:
    """The scene's numbers as arrays. Batches are in the order of their first objects."""
    materials = materials_of(scene)
    objects: dict[tuple, list[tuple[int, str]]] = {}
    batch_key = BatchKeys(scene)
    for number, (name, obj) in enumerate(scene.objects.items()):
        objects.setdefault(batch_key(obj), []).append((number, name))
    lights: dict[type, list[tuple[int, str]]] = {}
    for number, (name, light) in enumerate(scene.lights.items()):
        lights.setdefault(type(light), []).append((number, name))
    sky = scene.background
    sky = sky if isinstance(sky, SkyGradient) else SkyGradient(top=sky, bottom=sky)
    return evaluated(
        Packed(
            batches=tuple(object_columns(scene, a, kind, members) for (kind, _), members in objects.items()),
            lights=tuple(_light_columns(scene, a, kind, members) for kind, members in lights.items()),
            materials=_material_table(a, list(materials.values())),
            camera=stacked(a, type(scene.camera), [scene.camera]),
            background=stacked(a, SkyGradient, [sky]),
            ambient=a.put(a.V, np.array(scene.ambient, float)[:, None]),
            occlusion=stacked(a, Occlusion, [scene.settings.occlusion]),
        )
    )


def materials_of(scene: Scene) -> dict[str, Material]:
    """The materials by name; the default material is the first."""
    return {"default": Material()} | scene.materials


def _material_table(a: Arrays, materials: list[Material]) -> Material:
    """The materials as one record of arrays. `shading` is 1 for unlit materials and 0 for all others."""
    unlit = a.put(a.F, np.array([m.unlit for m in materials], float))
    return replace(stacked(a, Material, materials), shading=unlit)


def bodies_of(scene: Scene, names: Iterable[str]) -> list[Body]:
    """Objects that are bodies, with their meshes and transforms."""
    objects = [scene.objects[name] for name in names]
    return [Body(scene.shape_of(x), x.transform if isinstance(x, Instance) else ()) for x in objects]


def object_columns(
    scene: Scene, a: Arrays, kind: type[Primitive], members: list[tuple[int, str]], numbers: Any = None
) -> Columns:
    """Columns of objects that share their code.

    members: number in the scene and name of each object
    numbers: the kind's table for these objects; None: it is made from the scene
    """
    order, names = np.array([number for number, _ in members], np.uint32), tuple(name for _, name in members)
    if kind.walks:
        objects: list = bodies_of(scene, names)
    else:
        objects = [scene.placed_shape(scene.objects[name]) for name in names]
    materials = materials_of(scene)
    index = {name: i for i, name in enumerate(materials)}
    number = {name: i for i, name in enumerate(scene.textures)}
    texture_of = {
        name: row_number(number[m.texture], len(number), kind.v_ends, m.keeps_ka) if m.texture else NO_TEXTURE
        for name, m in materials.items()
    }
    named = [scene.objects[name].material for name in names]
    outer = object_of = counts = None
    if kind.many_rows:
        counts = tuple(x.row_count() for x in objects)
        object_of = a.put(a.U, np.repeat(np.arange(len(objects), dtype=np.uint32), counts))
    elif not kind.own_frames and objects[0].transform:
        matrices = composed([x.transform for x in objects])
        outer = Frame(*(a.put(a.W, matrices[:, :, column].T) for column in range(4)))
    return Columns(
        kind=kind,
        names=Names(names, counts=counts),
        numbers=kind.table(a, objects) if numbers is None else numbers,
        outer=outer,
        object_of=object_of,
        material=a.put(a.U, np.array([index[m] for m in named], np.uint32)),
        texture=a.put(a.U, np.array([texture_of[m] for m in named], np.uint32)),
        object=a.put(a.U, order),
    )


def _light_columns(scene: Scene, a: Arrays, kind: type[Light], members: list[tuple[int, str]]) -> LightColumns:
    """Columns of lights of one kind.

    members: number in the scene and name of each light
    """
    lights = [scene.lights[name] for _, name in members]
    return LightColumns(
        kind=kind,
        names=Names(tuple(name for _, name in members)),
        numbers=stacked(a, kind, lights),
        samples=tuple(getattr(x, "samples", 1) for x in lights),
        scene_index=tuple(number for number, _ in members),
    )
