"""Materials of a VisRayTrace scene, as plain dicts of visray's fields."""

from dataclasses import dataclass
from typing import Any

from visray.quantities import FARTHEST
from visray.scene.legacy.entry import BLACK, Entry, Log
from visray.scene.legacy.keys import MATERIAL, MATERIALS
from visray.scene.legacy.textures import Textures
from visray.scene.messages import line

WHITE = (1.0, 1.0, 1.0)
# Refractive index of air, which VisRayTrace's glass had where the file gave none.
AIR = 1.000293


@dataclass(frozen=True)
class EnabledEffects:
    """Effects of materials that a setup enables."""

    reflections: bool = True
    refractions: bool = True
    textures: bool = True


class Materials:
    """Materials of a scene and their textures. A material has the name of the first object that uses it.

    effects: the effects that the setup enables. textures: the textures of the scene. by_name: the materials.
    """

    def __init__(self, effects: EnabledEffects, textures: Textures):
        self.effects, self.textures = effects, textures
        self.by_name: dict[str, dict] = {}

    def name(self, raw: dict, object_name: str, log: Log) -> str:
        """Name of the material of an object; adds the material unless there is an equal one.

        raw: the JSON object of the object.
        """
        material = self._material(_entry(raw, f"objects.{object_name}", log))
        name = next((known for known, other in self.by_name.items() if other == material), object_name)
        self.by_name.setdefault(name, material)
        return name

    def _material(self, e: Entry) -> dict[str, Any]:
        """Fields of a material."""
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
        """Texture of a textured material, or kd where it has none."""
        if e.text("textureFile") is None:
            e.log.warn(f"{e.at('textureFile')}: is missing; kd is black, as in VisRayTrace")
            return {"kd": BLACK}
        texture = self.textures.name(e, "textureFile")
        return {} if texture is None else {"texture": texture}


def _entry(raw: dict, address: str, log: Log) -> Entry:
    """JSON object of an object's material; an empty one with a warning where the object has none."""
    owner = Entry({"material": raw["material"]} if "material" in raw else {}, address, {"material": ()}, log)
    e = owner.nested("material", MATERIAL)
    if e is None:
        log.warn(f"{address}: has no material; ka, kd, ks are 1 and shininess is 1, as in VisRayTrace")
        e = Entry({}, address, MATERIAL, log)
    return e


def _transparent(e: Entry) -> dict[str, Any]:
    """Fields of a transparent material.

    VisRayTrace paired a ray's entry and exit by the material's `id`, and so took two objects with the same id for one.
    visray knows from the geometry which object a ray is inside, and needs no `id`.
    """
    kt = _clamped(e, "kt", e.vector("kt", BLACK), "a surface lets through from 0 to 1; the nearest is used")
    material = {"kt": kt, "ior": e.number("nut", AIR)}
    dmax = e.number("dmax", FARTHEST)
    return material | ({} if dmax >= FARTHEST else {"dmax": dmax})


def _clamped(e: Entry, key: str, values: tuple[float, ...], why: str) -> tuple[float, ...]:
    """Values clamped to 0..1, with a warning that says `why` if any changes."""
    clamped = tuple(min(max(value, 0.0), 1.0) for value in values)
    if clamped != values:
        e.log.warn(line(e.at(key), values, why))
    return clamped
