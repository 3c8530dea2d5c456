"""Packs the numbers of a scene into arrays. Kernels read these arrays, derivatives are taken with respect to them
(address_index.py), and updates change them (repack.py).

`pack` turns a Scene into columns: one batch for objects that share their code, and one for lights that do. A row is one
object, as an entry of these arrays. References by name become numbers. `Packed` is a Dr.Jit PyTree (pytree.py).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray.camera import Camera, OrthographicCamera
from visray.columns import Columns, Looks, Names, materials_of, sides
from visray.data_columns import data_columns
from visray.environment_map import EnvironmentMap
from visray.geometry import Frame
from visray.lights.light import Light
from visray.materials import FRESNEL, Material
from visray.primitives.csg_form import Leaf
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.mesh_body import MeshBody
from visray.primitives.mesh_buffers import Body
from visray.primitives.primitive import Primitive
from visray.pytree import evaluated
from visray.quantities import Arrays, stacked
from visray.scene.scene import Occlusion, Scene, SkyGradient
from visray.transforms import composed


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
    background: SkyGradient | EnvironmentMap
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
        if shape.composite:
            # The transform of an instance decides, too, which operands are moved.
            return self.scene.placed_shape(obj).kind, False
        if isinstance(shape, Mesh) and (shape is not obj or obj.material in self.transparent):
            if id(shape) not in self.body_kinds:
                self.body_kinds[id(shape)] = shape.body_kind
            return self.body_kinds[id(shape)], False
        kind = shape.kind
        return kind, bool(shape.transform or obj.transform) and not kind.own_frames


def pack(scene: Scene, a: Arrays) -> Packed:
    """The scene's numbers as arrays. Batches are in the order of their first objects; those of data layers follow."""
    materials = materials_of(scene)
    objects: dict[tuple, list[tuple[int, str]]] = {}
    batch_key = BatchKeys(scene)
    for number, name in enumerate(scene.written_objects):
        for body in scene.unions.get(name, (name,)):
            objects.setdefault(batch_key(scene.bodies[body]), []).append((number, body))
    lights: dict[type, list[tuple[int, str]]] = {}
    for number, (name, light) in enumerate(scene.lights.items()):
        lights.setdefault(type(light), []).append((number, name))
    sky = scene.background
    sky = SkyGradient(top=sky, bottom=sky) if isinstance(sky, tuple) else sky
    return evaluated(
        Packed(
            batches=(
                *(object_columns(scene, a, kind, members) for (kind, _), members in objects.items()),
                *data_columns(scene, a),
            ),
            lights=tuple(_light_columns(scene, a, kind, members) for kind, members in lights.items()),
            materials=_material_table(a, list(materials.values())),
            camera=stacked(a, type(scene.camera), [scene.camera]),
            background=stacked(a, type(sky), [sky]),
            ambient=a.put(a.V, np.array(scene.ambient, float)[:, None]),
            occlusion=stacked(a, Occlusion, [scene.settings.occlusion]),
        )
    )


def _material_table(a: Arrays, materials: list[Material]) -> Material:
    """The materials as one record of arrays. `shading` is 1 for unlit materials and 0 for all others; `fresnel` is the
    place in materials.FRESNEL."""
    unlit = a.put(a.F, np.array([m.unlit for m in materials], float))
    fresnel = a.put(a.F, np.array([FRESNEL.index(m.fresnel) for m in materials], float))
    return replace(stacked(a, Material, [m.resolved for m in materials]), shading=unlit, fresnel=fresnel)


def bodies_of(scene: Scene, names: Iterable[str]) -> list[Body]:
    """Objects that are bodies, with their meshes and transforms."""
    objects = [scene.bodies[name] for name in names]
    return [Body(scene.shape_of(x), x.transform if isinstance(x, Instance) else ()) for x in objects]


def object_columns(
    scene: Scene, a: Arrays, kind: type[Primitive], members: list[tuple[int, str]], numbers: Any = None
) -> Columns:
    """Columns of objects that share their code.

    members: number in the scene and name of each object
    numbers: the kind's table for these objects; None: it is made from the scene
    """
    order, names = np.array([number for number, _ in members], np.uint32), tuple(name for _, name in members)
    if issubclass(kind, MeshBody):
        objects: list = bodies_of(scene, names)
    else:
        objects = [scene.placed_shape(scene.bodies[name]) for name in names]
    named, looks = [scene.bodies[name].material for name in names], None
    if kind.composite:
        named = [x.form.medium for x in objects]
        looks = _looks(scene, a, [leaf for x in objects for leaf in x.form.leaves])
    outer = object_of = counts = None
    if kind.many_rows:
        counts = tuple(x.row_count() for x in objects)
        object_of = a.put(a.U, np.repeat(np.arange(len(objects), dtype=np.uint32), counts))
    elif not kind.own_frames and objects[0].transform:
        matrices = composed([x.transform for x in objects])
        outer = Frame.table(a, matrices)
    return Columns(
        kind=kind,
        names=Names(names, counts=counts),
        numbers=kind.table(a, objects) if numbers is None else numbers,
        outer=outer,
        object_of=object_of,
        **sides(scene, a, [(material, kind.v_ends) for material in named]),
        object=a.put(a.U, order),
        looks=looks,
    )


def _looks(scene: Scene, a: Arrays, leaves: list[Leaf]) -> Looks:
    """The looks of the operands of CSG objects, each look once."""
    pairs = [(x.material, x.shape.operand_kind.v_ends) for x in leaves]
    number = {pair: i for i, pair in enumerate(dict.fromkeys(pairs))}
    return Looks(a.put(a.U, np.array([number[x] for x in pairs], np.uint32)), **sides(scene, a, number))


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
