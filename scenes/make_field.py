"""Writes scenes/field.json: a field of tulips, two instances for each, of two geometries.

    python scenes/make_field.py

The same every time: all that is random has a seed.
"""

import json
from pathlib import Path

import numpy as np

PER_ROW = 28
COLOURS = {
    "red": (0.65, 0.05, 0.04), "yellow": (0.85, 0.65, 0.08), "white": (0.82, 0.8, 0.75), "pink": (0.8, 0.3, 0.42),
    "violet": (0.32, 0.1, 0.42), "orange": (0.85, 0.32, 0.05),
}  # fmt: skip
# Colour of each strip of the field, from the nearest one to the farthest one, and its number of rows.
STRIPS = (("red", 5), ("yellow", 4), ("pink", 4), ("white", 4), ("violet", 4), ("orange", 4))


def plants() -> list[tuple[list[dict], str]]:
    """The transform and the colour of each tulip."""
    rng = np.random.default_rng(5)
    found = []
    colours = [colour for colour, rows in STRIPS for _ in range(rows)]
    for row, colour in enumerate(colours):
        for place in range(PER_ROW):
            x = 0.34 * (place - 0.5 * (PER_ROW - 1)) + rng.normal(0, 0.05)
            z = -0.34 * row - 0.3 * STRIPS.index(next(s for s in STRIPS if s[0] == colour)) + rng.normal(0, 0.04)
            lean, turn, size = rng.normal(0, 5), rng.uniform(0, 360), rng.uniform(0.85, 1.15)
            steps = [
                {"scale": round(size, 2)}, {"rotate": round(lean, 1), "axis": [1, 0, 0]}, {"rotate": round(turn)},
                {"translate": [round(x, 2), 0, round(z, 2)]},
            ]  # fmt: skip
            found.append((steps, colour))
    return found


def text(field: list[tuple[list[dict], str]]) -> str:
    """The scene file."""
    scene = {
        "$schema": "schema.json",
        "camera": {"origin": [1.5, 3.3, 3.6], "target": [-0.1, 0.35, -3.1], "fov": 36},
        "film": {"width": 640, "height": 420},
        "background": {"top": [0.25, 0.45, 0.8], "bottom": [0.85, 0.9, 0.95]},
        "ambient": [0.7, 0.75, 0.85],
        "settings": {"spp": 36},
        "materials": {
            "soil": {"ka": [0.09, 0.07, 0.05], "kd": [0.26, 0.19, 0.12]},
            "leaf": {"ka": [0.05, 0.09, 0.04], "kd": [0.15, 0.36, 0.12], "ks": [0.12, 0.12, 0.12], "shininess": 20},
        },
        "lights": {"sun": {"type": "directional", "direction": [-0.6, -1.0, -0.35], "Id": [1.0, 0.96, 0.88]}},
        "geometries": {
            "green": {"type": "mesh", "file": "meshes/tulip.obj", "part": "green"},
            "blossom": {"type": "mesh", "file": "meshes/tulip.obj", "part": "blossom"},
        },
        "objects": {"ground": {"type": "plane", "material": "soil"}},
    }
    for name, kd in COLOURS.items():
        scene["materials"][name] = {"ka": [round(0.3 * c, 3) for c in kd], "kd": list(kd)}
    for number, (steps, colour) in enumerate(field):
        for geometry, material in (("green", "leaf"), ("blossom", colour)):
            instance = {"type": "instance", "geometry": geometry, "material": material, "transform": steps}
            scene["objects"][f"{geometry} {number}"] = instance
    sections = []
    for key, value in scene.items():
        if key in ("materials", "geometries", "objects"):
            rows = [f"    {json.dumps(name)}: {json.dumps(entry)}" for name, entry in value.items()]
            sections.append(f"  {json.dumps(key)}: {{\n" + ",\n".join(rows) + "\n  }")
        else:
            sections.append(f"  {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(sections) + "\n}\n"


if __name__ == "__main__":
    path = Path(__file__).parent / "field.json"
    path.write_text(text(plants()))
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
