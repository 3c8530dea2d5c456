"""The materials of original VisRayTrace scenes as plain dicts of visray's fields."""

from dataclasses import dataclass
from typing import Any

from visray.quantities import FARTHEST
from visray.scene.legacy.entry import BLACK, Entry, Log
from visray.scene.legacy.keys import MATERIAL, MATERIALS
from visray.scene.legacy.pictures import Pictures
from visray.scene.messages import line

WHITE = (1.0, 1.0, 1.0)
# The refractive index of air, which the original's glass had where its file named none.
AIR = 1.000293


@dataclass(frozen=True)
class Effects:
    """What of the materials a setup lets count."""

    reflections: bool = True
    refractions: bool = True
    textures: bool = True


class Looks:
    """The materials of a scene, by the name of the first object that each is on, and their textures."""

    def __init__(self, effects: Effects, pictures: Pictures):
        self.effects, self.pictures = effects, pictures
        self.materials: dict[str, dict] = {}

    def name(self, found: dict, thing: str, log: Log) -> str:
        """The name of the material of an object: an equal one's, or else that of the object, `thing`."""
        material = self._material(_entry(found, f"objects.{thing}", log))
        owner = next((known for known, other in self.materials.items() if other == material), thing)
        self.materials.setdefault(owner, material)
        return owner

    def _material(self, e: Entry) -> dict[str, Any]:
        kind = e.chosen("type", MATERIALS)
        made: dict[str, Any] = {key: e.vector(key, WHITE) for key in ("ka", "kd", "ks")}
        made["shininess"] = e.number("shininess", 1.0)
        if kind == "metal" and self.effects.reflections:
            made["kr"] = _share(e, "ks", made["ks"], "a mirror reflects at most 1; its highlights keep ks")
        elif kind == "transparent" and self.effects.refractions:
            made |= _transparent(e)
        elif kind == "materialtextura" and self.effects.textures:
            made |= self._textured(e)
        return made

    def _textured(self, e: Entry) -> dict[str, Any]:
        if e.text("textureFile") is None:
            e.log.warn(f"{e.at('textureFile')}: is missing; kd is black, as in the original")
            return {"kd": BLACK}
        texture = self.pictures.texture(e, "textureFile")
        return {} if texture is None else {"texture": texture}


def _entry(found: dict, address: str, log: Log) -> Entry:
    """The JSON object of an object's material."""
    owner = Entry({"material": found["material"]} if "material" in found else {}, address, {"material": ()}, log)
    e = owner.inner("material", MATERIAL)
    if e is None:
        log.warn(f"{address}: has no material; ka, kd, ks are 1 and shininess is 1, as in the original")
        e = Entry({}, address, MATERIAL, log)
    return e


def _transparent(e: Entry) -> dict[str, Any]:
    """What lets light through. The original paired a ray's entry and exit by the `id` of a material, so that two
    objects of the same id were taken for one; here the geometry says which object a ray is in, and `id` is not needed.
    """
    through = _share(e, "kt", e.vector("kt", BLACK), "a surface lets through from 0 to 1; the nearest is used")
    made = {"kt": through, "ior": e.number("nut", AIR)}
    farthest = e.number("dmax", FARTHEST)
    return made | ({} if farthest >= FARTHEST else {"dmax": farthest})


def _share(e: Entry, key: str, written: tuple[float, ...], why: str) -> tuple[float, ...]:
    """Parts from 0 to 1; what is beyond is brought there, with a warning."""
    share = tuple(min(max(part, 0.0), 1.0) for part in written)
    if share != written:
        e.log.warn(line(e.at(key), written, why))
    return share
