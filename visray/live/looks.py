"""Words for how the things of a scene look, which are not in their names: red, ball, lamp."""

import colorsys
from typing import Any

import numpy as np

from visray.materials import Material
from visray.output.curves import curve
from visray.scene.scene import Scene

# Most objects that are looked at, and most of their words that a material gets.
MOST, MOST_WORDS = 2000, 40
# Words for kinds of objects, beside the name of the kind.
KINDS = {
    "sphere": "ball", "box": "cube crate", "plane": "floor ground wall", "cylinder": "tube pillar column",
    "torus": "ring", "disk": "circle", "polynomial": "surface formula",
}  # fmt: skip
LAMP = "light lamp"
# Hues in degrees at which each colour ends.
HUES = ((15, "red"), (45, "orange"), (70, "yellow"), (165, "green"), (195, "cyan"), (260, "blue"),
        (300, "purple violet"), (345, "pink"), (360, "red"))  # fmt: skip
# Largest number of a colour as it is shown below which it is black, from which on grey is white, and the share of it
# that a grey may have of a hue.
BLACK, WHITE, GREY = 0.15, 0.85, 0.15


def words_of(scene: Scene) -> dict[str, str]:
    """Words by address: of objects, of materials and of lights."""
    found: dict[str, str] = {f"lights.{name}": LAMP for name in scene.lights}
    colors = {name: color_word(material) for name, material in scene.materials.items()}
    users: dict[str, set[str]] = {name: set() for name in colors}
    for name, obj in list(scene.objects.items())[:MOST]:
        kind = f"{obj.type} {KINDS.get(obj.type, '')}".strip()
        materials = scene.materials_of(obj)
        found[f"objects.{name}"] = " ".join([kind, *(colors[m] for m in materials if m in colors)])
        for material in materials:
            if material in users and len(users[material]) < MOST_WORDS:
                users[material].update([*kind.split(), name.lower()])
    return found | {f"materials.{m}": " ".join([color, *sorted(users[m])]) for m, color in colors.items()}


def color_word(material: Material) -> str:
    """Words for the colour of a material as it is shown on a screen, such as red."""
    if any(np.array(material.kt) > 0.3):
        return f"glass transparent {_word(material.kt)}"
    mirror = "mirror " if any(np.array(material.kr) > 0.3) else ""
    return mirror + _word(material.kd)


def _word(color: Any) -> str:
    """Words for a linear colour."""
    shown = curve(np.clip(np.array(color, float), 0, 1), "srgb")
    hue, saturation, value = colorsys.rgb_to_hsv(*map(float, shown))
    if value < BLACK:
        return "black dark"
    if saturation < GREY:
        return "white" if value > WHITE else "grey gray"
    word = next(word for end, word in HUES if 360 * hue <= end)
    return (
        f"{word} brown"
        if word == "orange" and value < 0.7
        else f"{word} gold"
        if word in ("orange", "yellow")
        else word
    )
