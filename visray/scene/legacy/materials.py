"""Materials of a VisRayTrace scene, as plain dicts of visray's fields."""

from dataclasses import dataclass
from typing import Any

from visray.quantities import FARTHEST
from visray.scene.legacy.entry import BLACK, Entry, Log
from visray.scene.legacy.keys import MATERIAL, MATERIALS
from visray.scene.legacy.textures import Textures
from visray.scene.messages import line

WHITE = (1.0, 1.0, 1.0)
# Refractive index of air. VisRayTrace used it for glass if the file gave no index.
AIR = 1.000293


@dataclass(frozen=True)
class EnabledEffects:
    """Whether a setup enables each of the effects of materials."""

    reflections: bool = True
    refractions: bool = True
    textures: bool = True


class Materials:
    """Materials of a scene and their textures. A material has the name of the first object that uses it.

    effects: whether the setup enables each effect.
    textures: textures of the scene.
    by_name: dict of the materials by name.
    addresses: for each material, its address in the file.
    """

    def __init__(self, effects: EnabledEffects, textures: Textures):
        self.effects, self.textures = effects, textures
        self.by_name: dict[str, dict] = {}
        self.addresses: dict[str, str] = {}

    def name(self, raw: dict, owner: str, address: str, log: Log, colored: bool = False) -> str:
        """Name of the material of an object. Adds the material unless there is an equal one.

        raw: the object as the file gives it.
        owner: name of the object, and of its material if that is new.
        address: address of the object in the file.
        colored: whether the colours of data take the place of kd.
        """
        e = _entry(raw, address, log)
        material = self._colored(e) if colored else self._material(e)
        name = next((known for known, other in self.by_name.items() if other == material), owner)
        if name not in self.by_name:
            self.by_name[name], self.addresses[name] = material, e.address
        return name

    def _colored(self, e: Entry) -> dict[str, Any]:
        """Fields of a material for gizmos in the colours of data. As in VisRayTrace it has no texture.

        e: the material as the file gives it.
        """
        written = e.text("type")
        if written is not None and written.strip().casefold() == "materialtextura":
            e.log.warn(line(e.at("type"), written, "gizmos have the colours of their data, and no texture"))
            e.values["type"] = "lambertian"
        return self._material(e) | self.textures.colored_fields

    def _material(self, e: Entry) -> dict[str, Any]:
        """Fields of a material. `e`: the material as the file gives it."""
        kind = e.choice("type", MATERIALS)
        material: dict[str, Any] = {key: e.vector(key, WHITE) for key in ("ka", "kd", "ks")}
        material["shininess"] = e.number("shininess", 1.0)
        if kind == "metal" and self.effects.reflections:
            why = "a mirror reflects at most 1; its highlights keep ks"
            material["kr"] = _clamped(e, "ks", material["ks"], why)
        elif kind == "transparent" and self.effects.refractions:
            material |= _transparent(e)
        elif kind == "materialtextura" and self.effects.textures:
            material |= self._textured(e)
        return material

    def _textured(self, e: Entry) -> dict[str, Any]:
        """Dict with the field `texture` of a textured material. If the material names no image, kd is black instead; if
        there is no such image, {} with an error in the log."""
        if e.text("textureFile") is None:
            e.log.warn(f"{e.at('textureFile')}: is missing; kd is black, as in VisRayTrace")
            return {"kd": BLACK}
        texture = self.textures.name(e, "textureFile")
        return {} if texture is None else {"texture": texture} | self.textures.material_fields


def _entry(raw: dict, address: str, log: Log) -> Entry:
    """The material of an object as the file gives it. If there is none, an empty material and a warning.

    raw: the object as the file gives it.
    """
    owner = Entry({"material": raw["material"]} if "material" in raw else {}, address, {"material": ()}, log)
    e = owner.nested("material", MATERIAL)
    if e is None:
        log.warn(f"{address}: has no material; ka, kd, ks are 1 and shininess is 1, as in VisRayTrace")
        e = Entry({}, address, MATERIAL, log)
    return e


def _transparent(e: Entry) -> dict[str, Any]:
    """Fields of a transparent material.

    The key `id` is ignored. VisRayTrace compared ids to find where a ray leaves an object, and so took two objects with
    the same id for one. visray knows from the geometry which objects a ray is inside.
    """
    kt = _clamped(e, "kt", e.vector("kt", BLACK), "a surface lets through from 0 to 1; the nearest is used")
    material = {"kt": kt, "ior": e.number("nut", AIR)}
    dmax = e.number("dmax", FARTHEST)
    return material | ({} if dmax >= FARTHEST else {"dmax": dmax})


def _clamped(e: Entry, key: str, values: tuple[float, ...], why: str) -> tuple[float, ...]:
    """Values clamped to [0, 1]. If this changes a value, there is a warning with the text `why`."""
    clamped = tuple(min(max(value, 0.0), 1.0) for value in values)
    if clamped != values:
        e.log.warn(line(e.at(key), values, why))
    return clamped
