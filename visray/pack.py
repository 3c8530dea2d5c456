"""The numbers of a scene as arrays: read by kernels, differentiated, and changed by updates.

`pack` turns a Scene into columns: one batch for objects that share their code, and one for lights that do. Names become
numbers. `Packed` is a Dr.Jit PyTree, so derivatives are taken by its arrays. `AddressIndex` finds addresses in them.
"""

from collections.abc import Iterable
from dataclasses import dataclass, is_dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import numpy as np

from visray.camera import Camera
from visray.errors import UserError
from visray.geometry import Frame
from visray.lights.light import Light
from visray.materials import Material
from visray.primitives.primitive import Primitive
from visray.pytree import evaluated, leaves, mapped
from visray.quantities import Arrays, quantities, stacked
from visray.scene import address as addresses
from visray.scene.scene import Occlusion, Scene, SkyGradient
from visray.transforms import compose

NO_TEXTURE = 0xFFFFFFFF


class Names:
    """Names of a batch's rows: a list, or a prefix and a number."""

    def __init__(self, listed: tuple[str, ...] = (), prefix: str = "", count: int | None = None):
        self.listed, self.prefix, self.count = listed, prefix, len(listed) if count is None else count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, row: int) -> str:
        if not 0 <= row < self.count:
            raise IndexError(row)
        return self.listed[row] if self.listed else f"{self.prefix}{row}"

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {name: row for row, name in enumerate(self.listed)}

    def row(self, name: str) -> int | None:
        """The row with this name, or None."""
        if self.listed:
            return self._rows.get(name)
        number = name.removeprefix(self.prefix)
        fits = name.startswith(self.prefix) and number.isdecimal() and str(int(number)) == number
        return int(number) if fits and int(number) < self.count else None


@dataclass(frozen=True)
class Columns:
    """Rows of one kind that share their code, as arrays. They come from the objects of a scene, or from any other
    source of columns.

    kind: class of the rows; rows with a transform and rows without form two batches
    names: names of the rows
    numbers: the kind's table
    outer: transforms of the rows, or None
    material, texture: number of each row's material and texture
    object: number of each row's object, in the order of the scene
    """

    kind: type[Primitive]
    names: Names
    numbers: Any
    outer: Frame | None
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
    numbers: table of the kind
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
    """All numbers of a scene. Arrays have one entry for each row, material, or light of a kind; camera, background,
    ambient light and occlusion have one entry."""

    batches: tuple[Columns, ...]
    lights: tuple[LightColumns, ...]
    materials: Material
    camera: Camera
    background: SkyGradient
    ambient: Any
    occlusion: Occlusion


def batch_key(obj: Primitive) -> tuple[type[Primitive], bool]:
    """What objects of one batch share: their kind, and whether they have a transform."""
    return obj.kind, bool(obj.transform)


def pack(scene: Scene, a: Arrays) -> Packed:
    """The scene's numbers as arrays. Batches are in the order of their first objects."""
    materials = _materials(scene)
    objects: dict[tuple, list[tuple[int, str]]] = {}
    for number, (name, obj) in enumerate(scene.objects.items()):
        objects.setdefault(batch_key(obj), []).append((number, name))
    lights: dict[type, list[tuple[int, str]]] = {}
    for number, (name, light) in enumerate(scene.lights.items()):
        lights.setdefault(type(light), []).append((number, name))
    sky = scene.background
    sky = sky if isinstance(sky, SkyGradient) else SkyGradient(top=sky, bottom=sky)
    return evaluated(
        Packed(
            batches=tuple(_batch(scene, a, kind, members) for (kind, _), members in objects.items()),
            lights=tuple(_lights(scene, a, kind, members) for kind, members in lights.items()),
            materials=stacked(a, Material, list(materials.values())),
            camera=stacked(a, Camera, [scene.camera]),
            background=stacked(a, SkyGradient, [sky]),
            ambient=a.put(a.V, np.array(scene.ambient, float)[:, None]),
            occlusion=stacked(a, Occlusion, [scene.settings.occlusion]),
        )
    )


def _materials(scene: Scene) -> dict[str, Material]:
    """The materials by name, with the default one first."""
    return {"default": Material()} | scene.materials


def _batch(scene: Scene, a: Arrays, kind: type[Primitive], members: list[tuple[int, str]]) -> Columns:
    """Columns of some objects that share their code, given by number in the scene and name."""
    numbers, names = np.array([number for number, _ in members], np.uint32), tuple(name for _, name in members)
    objects = [scene.objects[name] for name in names]
    materials = _materials(scene)
    index = {name: i for i, name in enumerate(materials)}
    texture = {name: i for i, name in enumerate(scene.textures)} | {None: NO_TEXTURE}
    texture_of = {name: texture[m.texture] for name, m in materials.items()}
    outer = None
    if objects[0].transform:
        matrices = np.stack([compose(x.transform) for x in objects])
        outer = Frame(*(a.put(a.W, matrices[:, :, column].T) for column in range(4)))
    return Columns(
        kind=kind,
        names=Names(names),
        numbers=kind.table(a, objects),
        outer=outer,
        material=a.put(a.U, np.array([index[x.material] for x in objects], np.uint32)),
        texture=a.put(a.U, np.array([texture_of[x.material] for x in objects], np.uint32)),
        object=a.put(a.U, numbers),
    )


def _lights(scene: Scene, a: Arrays, kind: type[Light], members: list[tuple[int, str]]) -> LightColumns:
    """Columns of some lights of one kind, given by number in the scene and name."""
    lights = [scene.lights[name] for _, name in members]
    return LightColumns(
        kind=kind,
        names=Names(tuple(name for _, name in members)),
        numbers=stacked(a, kind, lights),
        samples=tuple(getattr(x, "samples", 1) for x in lights),
        scene_index=tuple(number for number, _ in members),
    )


@dataclass(frozen=True)
class Slot:
    """The place of one address in the packed arrays.

    arrays: arrays that hold the number; a plain background has two, top and bottom
    row: entry in the arrays
    component: 0, 1 or 2, or None for the whole entry
    """

    arrays: tuple[Any, ...]
    row: int
    component: int | None

    def read(self, values: tuple | list) -> Any:
        """The entry in `values`, which are shaped like `arrays`, summed over all of them."""
        entry = sum(np.array(v, float)[..., self.row] for v in values)
        return float(entry) if entry.ndim == 0 else entry if self.component is None else float(entry[self.component])

    def one_hot(self) -> list[np.ndarray]:
        """Arrays that are 1 at the entry and 0 elsewhere."""
        hot = [np.zeros(np.array(v).shape) for v in self.arrays]
        for h in hot:
            h[(Ellipsis, self.row) if self.component is None else (self.component, self.row)] = 1
        return hot


class AddressIndex:
    """Finds the arrays and rows that hold an address of a scene: for derivatives and updates."""

    def __init__(self, scene: Scene, packed: Packed):
        self.scene, self.packed = scene, packed

    def row_of(self, section: tuple[Columns, ...] | tuple[LightColumns, ...], name: str) -> tuple[int, int]:
        """The batch of an object or a light, and its row there."""
        for number, batch in enumerate(section):
            if (row := batch.names.row(name)) is not None:
                return number, row
        raise KeyError(name)

    def slot(self, address: str) -> Slot:
        """The place of the number at `address`. Raises UserError where a picture does not depend smoothly on it."""
        parts, packed = address.split("."), self.packed
        head, name, field = (parts + ["", ""])[:3]
        if isinstance(value := addresses.value(self.scene, address), dict) or is_dataclass(value):
            raise UserError(f"{address}: is not one number or three; name one of its parts")
        if head == "ambient":
            return Slot((packed.ambient,), 0, int(name) if name else None)
        if head == "background":
            plain, sky = not isinstance(self.scene.background, SkyGradient), packed.background
            colours = (sky.top, sky.bottom) if plain else (getattr(sky, name or "top"),)
            rest = name if plain else field
            return Slot(colours, 0, int(rest) if rest else None)
        if head == "camera":
            table, row, field, rest = packed.camera, 0, name, parts[2:]
        elif head == "materials":
            table, row, rest = packed.materials, list(_materials(self.scene)).index(name), parts[3:]
        elif head == "objects":
            return self._of_object(name, parts[2:])
        elif head == "lights":
            number, row = self.row_of(packed.lights, name)
            table, rest = packed.lights[number].numbers, parts[3:]
        elif address == "settings.occlusion.distance":
            table, row, rest = packed.occlusion, 0, parts[3:]
        else:
            raise UserError(f"{address}: is not a number that a picture depends on smoothly")
        if field not in quantities(type(table)):
            raise UserError(f"{address}: has no derivative; those of {head} are {', '.join(quantities(type(table)))}")
        return Slot((getattr(table, field),), row, int(rest[0]) if rest else None)

    def _of_object(self, name: str, path: list[str]) -> Slot:
        """The place of a number of an object. path: the address after the object's name, split at dots."""
        obj = self.scene.objects[name]
        number, row = self.row_of(self.packed.batches, name)
        batch = self.packed.batches[number]
        columns = batch.kind.columns(obj, batch.numbers)
        for field, column in columns.items():
            size = len(field.split("."))
            if ".".join(path[:size]) == field:
                return Slot((column,), row, int(path[size]) if path[size:] else None)
        known = ", ".join(columns) or "none of its own"
        raise UserError(f"objects.{name}.{'.'.join(path)}: has no derivative; those of a {obj.type} are {known}")


def repacked(packed: Packed, old: Scene, new: Scene, addressed: Iterable[str], a: Arrays) -> Packed | None:
    """The packed numbers of `new`, a scene that differs from `old` at the given addresses only. Unchanged arrays are
    shared with `packed`.

    Returns None where more than numbers change, so that everything must be packed again.
    """
    paths = [address.split(".") for address in addressed]
    sections = {section for section, *_ in paths}
    if sections & {"textures", "film"} or ["objects"] in paths or _structure(old) != _structure(new):
        return None
    changes: dict[str, Any] = {}
    batches = _updated_batches(packed, old, new, {rest[0] for section, *rest in paths if section == "objects"}, a)
    if batches is None:
        return None
    if sections - {"objects"}:
        others = pack(replace(new, objects={}), a)
        fields = {"settings": "occlusion"} | {name: name for name in sections & set(Packed.__dataclass_fields__)}
        changes = {fields[s]: getattr(others, fields[s]) for s in sections if s in fields}
    return replace(packed, batches=batches, **changes)


def _structure(scene: Scene) -> tuple:
    """Names and kinds in a scene, without objects. Where they change, more than numbers changes."""
    lights = [(name, type(light)) for name, light in scene.lights.items()]
    return (
        lights,
        [(name, m.texture) for name, m in _materials(scene).items()],
        isinstance(scene.background, SkyGradient),
    )


def _updated_batches(packed: Packed, old: Scene, new: Scene, names: set[str], a: Arrays) -> tuple[Columns, ...] | None:
    """The batches with new numbers for some objects; None where one of these objects belongs to another batch now."""
    index, batches, rows = AddressIndex(old, packed), list(packed.batches), {}
    for name in names:
        before, after = old.objects[name], new.objects[name]
        if batch_key(before) != batch_key(after):
            return None
        number, row = index.row_of(packed.batches, name)
        rows.setdefault(number, {})[row] = name
    for number, named in rows.items():
        batch, indices = batches[number], a.put(a.U, np.array(list(named), np.uint32))
        replacement = _batch(new, a, batch.kind, list(enumerate(named.values())))
        batches[number] = _scattered(batch, replace(replacement, object=dr.gather(a.U, batch.object, indices)), indices)
    return tuple(batches)


def _scattered(columns: Columns, replacement: Columns, indices: Any) -> Columns:
    """The columns with the rows at `indices` replaced by `replacement`."""
    source = iter(leaves(replacement))

    def put(x: Any) -> Any:
        new = type(x)(x)
        dr.scatter(new, next(source), indices)
        return new

    return mapped(put, columns)
