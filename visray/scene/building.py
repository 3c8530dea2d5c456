"""Methods of a scene that return another scene with one more entry, or without some entries.

An entry is a texture, a material, a light, a geometry or an object. The records that are given were checked when they
were made. References by name are checked with the whole scene, when it is rendered, so entries can be given in any
order.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Self

from visray.errors import UserError
from visray.hints import hint
from visray.quantities import NAME_PATTERN
from visray.references import is_entry, operands_of, references
from visray.terminal import printable

# The sections of entries, each with the `section` that the classes of its entries have, and an example. A name without
# a section is looked for in this order.
SECTIONS = {
    "objects": ("geometries", "an object, such as vr.Sphere()"),
    "lights": ("lights", "a light, such as vr.PointLight((4, 6, 5))"),
    "materials": ("materials", "a material, such as vr.Material()"),
    "textures": ("textures", "a texture, such as vr.CheckerTexture()"),
    "geometries": ("geometries", "a shape, such as vr.Sphere()"),
}
# Parts of a scene that can be left out as a whole.
OPTIONAL = ("data", "animation")


class Buildable:
    """Methods of scenes. None of them changes the scene itself."""

    def with_object(self, name: str, entry: Any) -> Self:
        """The scene with one more object; an object that has the name already is replaced.

        scene.with_object("ball", vr.Sphere((0, 1, 0), 1, material=vr.Material(kd=(0.8, 0.2, 0.1))))

        A material that is given in place of its name gets a name of its own: that of the object.
        """
        return self._with("objects", name, entry)

    def with_light(self, name: str, entry: Any) -> Self:
        """The scene with one more light; a light that has the name already is replaced."""
        return self._with("lights", name, entry)

    def with_material(self, name: str, entry: Any) -> Self:
        """The scene with one more material; a material that has the name already is replaced."""
        return self._with("materials", name, entry)

    def with_texture(self, name: str, entry: Any) -> Self:
        """The scene with one more texture; a texture that has the name already is replaced."""
        return self._with("textures", name, entry)

    def with_geometry(self, name: str, entry: Any) -> Self:
        """The scene with one more geometry; a geometry that has the name already is replaced."""
        return self._with("geometries", name, entry)

    def with_camera(self, camera: Any) -> Self:
        """The scene seen by another camera."""
        return replace(self, camera=camera)

    def without(self, *names: str) -> Self:
        """The scene without some entries. Raises UserError for a name that the scene does not have, and for an entry
        that others still refer to, such as the material of an object that stays.

        names: names, such as "ball", or addresses, such as "materials.red"; also "data" or "animation". A name alone is
            that of an object; if there is none, that of a light, a material, a texture or a geometry.
        """
        left = {section: dict(getattr(self, section) or {}) for section in SECTIONS}
        optional = {}
        gone = []
        for name in names:
            section, key = self._place(name, left)
            if section is None:
                optional[key] = None
            else:
                del left[section][key]
                gone.append((section, key))
        changed = {section for section, _ in gone}
        made = replace(self, **{section: left[section] for section in left if section in changed}, **optional)
        for section, key in gone:
            if user := next(_users(made, section, key), None):
                text = f"{user} refers to it; remove that too, or let it refer to another one"
                raise UserError(printable(f"{section}.{key}: {text}"))
        return made

    def _with(self, section: str, name: str, entry: Any) -> Self:
        """The scene with one more entry."""
        method = "with_" + {"geometries": "geometry"}.get(section, section[:-1])
        if not (isinstance(name, str) and re.fullmatch(NAME_PATTERN, name)):
            rule = "a name is a text that is not empty, has no dot, and has no space at either end"
            raise UserError(printable(f"{method}: {name!r} is not a valid name; {rule}"))
        own, example = SECTIONS[section]
        if not is_entry(entry, own):
            raise UserError(printable(f"{method}: {name}: must be {example}, not of type {type(entry).__name__}"))
        return replace(self, **{section: {**(getattr(self, section) or {}), name: entry}})

    def _place(self, name: Any, left: dict[str, dict]) -> tuple[str | None, str]:
        """Section and name of an entry; the section is None for a whole part of the scene. left: entries by section."""
        section, dot, key = name.partition(".") if isinstance(name, str) else ("", "", "")
        if dot and key in left.get(section, {}):
            return section, key
        for section in left:
            if isinstance(name, str) and name in left[section]:
                return section, name
        if name in OPTIONAL:
            return None, name
        section, dot, key = str(name).partition(".")
        if dot and section in left:
            right = hint(key, left[section])
            raise UserError(printable(f"without: {section} has no {key!r}; {right}"))
        choices = dict.fromkeys(x for own in left.values() for x in own)
        raise UserError(printable(f"without: the scene has no {name!r}; {hint(name, choices)}"))


def _users(scene: Any, section: str, name: str) -> Iterator[str]:
    """Yields the addresses of what refers to an entry."""
    for own in SECTIONS:
        for key, entry in (getattr(scene, own) or {}).items():
            yield from _references_to(f"{own}.{key}", entry, section, name)
    if (data := scene.data) is not None:
        for key, layer in data.layers.items():
            yield from _references_to(f"data.layers.{key}", layer, section, name)
        yield from _references_to("data.base", data.base, section, name)


def _references_to(address: str, record: Any, section: str, name: str) -> Iterator[str]:
    """Yields the addresses of those fields of a record, and of its operands, that refer to an entry."""
    for field, referred in references(type(record)).items():
        if referred == section and getattr(record, field) == name:
            yield f"{address}.{field}"
    for role, key, operand in operands_of(record):
        yield from _references_to(f"{address}.{role}.{key}", operand, section, name)
