"""Packed numbers after the values at some addresses have changed. Only what changes is packed again."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from visray.address_index import AddressIndex
from visray.columns import Columns, materials_of
from visray.data.all_objects import BASE
from visray.data_columns import data_columns, layer_sizes
from visray.pack import BatchKeys, Packed, bodies_of, object_columns, pack
from visray.primitives.csg_operands import operands
from visray.primitives.mesh import Mesh
from visray.primitives.mesh_body import MeshBody
from visray.primitives.mesh_buffers import frames
from visray.primitives.primitive import Primitive
from visray.pytree import leaves, mapped
from visray.pytree import rows as gathered
from visray.quantities import Arrays
from visray.scene.scene import Scene


def repacked(packed: Packed, old: Scene, new: Scene, addressed: Iterable[str], a: Arrays) -> Packed | None:
    """The packed numbers of `new`, a scene that differs from `old` only at the given addresses. Unchanged arrays are
    shared with `packed`.

    Returns None if more than numbers changes, so that everything must be packed again.
    """
    paths = [address.split(".") for address in addressed]
    sections = {section for section, *_ in paths}
    whole_section = ["objects"] in paths or ["geometries"] in paths
    if sections & {"textures", "film"} or whole_section or _structure(old) != _structure(new):
        return None
    changes: dict[str, Any] = {}
    batches = _updated_batches(packed, old, new, _objects_of(new, paths), a)
    if batches is not None and new.data is not None:
        batches = _updated_layers(batches, old, new, paths, a)
    if batches is None:
        return None
    if sections - {"objects", "geometries", "data"}:
        without_objects = pack(replace(new, objects={}, data=None), a)
        fields = {"settings": "occlusion"} | {name: name for name in sections & set(Packed.__dataclass_fields__)}
        changes = {fields[s]: getattr(without_objects, fields[s]) for s in sections if s in fields}
    return replace(packed, batches=batches, **changes)


def _objects_of(scene: Scene, paths: list[list[str]]) -> set[str]:
    """Names of the objects that change with the values at some addresses: objects, and those that show geometries."""
    changed = {section: {rest[0] for s, *rest in paths if s == section} for section in ("objects", "geometries")}
    geometries = changed["geometries"]
    instances = {name for name, obj in scene.written_objects.items() if _shows(scene, obj, geometries)}
    base = {BASE} if any(section == "data" for section, *_ in paths) and scene.data is not None else set()
    return changed["objects"] | instances | base


def _shows(scene: Scene, obj: Primitive, geometries: set[str]) -> bool:
    """Whether an object shows one of these geometries, itself or in an operand."""
    addresses = {f"geometries.{name}" for name in geometries}
    return bool(addresses) and any(x.address in addresses for x in operands("", obj, scene.geometries))


def _structure(scene: Scene) -> tuple:
    """Parts of a scene, apart from its objects, that an update of numbers leaves unchanged, as a tuple: names and kinds
    of lights, and which are visible, names of materials with their textures, with what colours change in them and with
    their backs, the materials that make meshes bodies, the bodies of unions, the kinds of layers, the kind of
    background and its file, and the kind of camera."""
    lights = [(name, type(light), light.seen) for name, light in scene.lights.items()]
    return (
        lights,
        [
            (name, m.texture, m.textured, m.colored, m.back, scene.data is not None and m.replaced)
            for name, m in materials_of(scene).items()
        ],
        BatchKeys(scene).transparent if any(isinstance(x, Mesh) for x in scene.bodies.values()) else None,
        {name: list(bodies) for name, bodies in scene.unions.items()},
        (type(scene.background), getattr(scene.background, "file", None)),
        scene.data is None,
        [kind for kind, _ in layer_sizes(scene)],
        type(scene.camera),
    )


def _updated_batches(packed: Packed, old: Scene, new: Scene, names: set[str], a: Arrays) -> tuple[Columns, ...] | None:
    """The batches with new numbers for some objects; None if one of these objects now belongs to another batch.

    names: names of these objects
    """
    index, batches, rows = AddressIndex(old, packed), list(packed.batches), {}
    old_key, new_key = BatchKeys(old), BatchKeys(new)
    for name in (body for obj in names for body in new.unions.get(obj, (obj,))):
        before, after = old.bodies[name], new.bodies[name]
        if old_key(before) != new_key(after):
            return None
        number, row = index.row_of(packed.batches, name)
        rows.setdefault(number, {})[row] = name
    for number, named in rows.items():
        kind = batches[number].kind
        if kind.own_frames and not (issubclass(kind, MeshBody) and _same_meshes(old, new, named.values())):
            batches[number] = _anew(batches[number], new, a)
            if not _same_sizes(batches[number], packed.batches[number]):
                return None
            continue
        batch, indices = batches[number], a.put(a.U, np.array(list(named), np.uint32))
        numbers = None
        if issubclass(batch.kind, MeshBody):
            numbers = replace(gathered(batch.numbers, indices), frame=frames(a, bodies_of(new, named.values())))
        replacement = object_columns(new, a, batch.kind, list(enumerate(named.values())), numbers)
        batches[number] = _scattered(batch, replace(replacement, object=dr.gather(a.U, batch.object, indices)), indices)
    return tuple(batches)


def _updated_layers(
    batches: tuple[Columns, ...], old: Scene, new: Scene, paths: list[list[str]], a: Arrays
) -> tuple[Columns, ...] | None:
    """The batches with those of the data layers made again if they change; None if their rows or kinds are others.

    paths: addresses of the values that change, split at the dots
    """
    changed = {rest[0] for section, *rest in paths if section == "geometries"}
    # The file of a layer may have changed too. Rows that did not change are the same instances.
    is_same = old.data.rows.keys() == new.data.rows.keys() and all(
        rows is new.data.rows[name] for name, rows in old.data.rows.items()
    )
    if is_same and not any(section == "data" for section, *_ in paths):
        shown = (rows.object(0) for rows in new.data.rows.values() if rows.geometry is not None and len(rows))
        return None if any(_shows(new, obj, changed) for obj in shown) else batches
    layers = data_columns(new, a)
    first = len(batches) - len(layer_sizes(old))
    before = batches[first:]
    same = len(layers) == len(before) and all(
        x.kind is y.kind and len(x) == len(y) and _same_sizes(x, y) and (x.color is None) == (y.color is None)
        for x, y in zip(layers, before)
    )
    return (*batches[:first], *layers) if same else None


def _same_meshes(old: Scene, new: Scene, names: Iterable[str]) -> bool:
    """Whether the objects with these names have the same meshes in both scenes, apart from their transforms."""
    pairs = ((old.shape_of(old.bodies[name]), new.shape_of(new.bodies[name])) for name in names)
    return all(x is y or x.shape_of_file() is y.shape_of_file() for x, y in pairs)


def _anew(columns: Columns, scene: Scene, a: Arrays) -> Columns:
    """The columns of the same objects, packed again."""
    members = zip(np.array(columns.object).tolist(), columns.names.listed)
    return object_columns(scene, a, columns.kind, list(members))


def _same_sizes(x: Columns, y: Columns) -> bool:
    """Whether all arrays of two batches of one kind have equal widths."""
    sizes = [[dr.width(array) for array in leaves((c.numbers, c.object_of), shared=True)] for c in (x, y)]
    return sizes[0] == sizes[1]


def _scattered(columns: Columns, replacement: Columns, indices: Any) -> Columns:
    """The columns after their rows `indices` are replaced by the rows of `replacement`, in the same order."""
    source = iter(leaves(replacement))

    def put(x: Any) -> Any:
        new = type(x)(x)
        dr.scatter(new, next(source), indices)
        return new

    return mapped(put, columns)
