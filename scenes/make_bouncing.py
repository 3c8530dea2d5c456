"""Writes scenes/bouncing-balls.json: three balls that bounce and are squashed while the camera goes round them.

    python scenes/make_bouncing.py

In the air a ball falls freely. On the floor it is pressed down like a spring, for as long as the floor pushes it, and
gets as much wider as it gets lower, so that its volume stays.
"""

import json
import math
from pathlib import Path
from typing import Any

# Seconds of the loop; the free fall, in units per second squared; the share of a bounce that a ball is on the floor.
DURATION, GRAVITY, ON_FLOOR = 6.0, 9.5, 0.16
# Most that a ball is pressed down, as a share of its radius.
DEEPEST = 0.38
# Keys of a bounce in the air and on the floor.
IN_AIR, ON_GROUND = 6, 4
# Of each ball: place on the floor, radius, number of bounces in the loop, first bounce as a share of one, whole turns.
BALLS = {
    "red": ((-0.75, 0.35), 0.5, 5, 0.0, 2),
    "yellow": ((0.75, 0.5), 0.4, 6, 0.45, -2),
    "blue": ((0.1, -0.8), 0.32, 8, 0.7, 3),
}
COLOURS = {"red": (0.75, 0.05, 0.04), "yellow": (0.9, 0.58, 0.05), "blue": (0.06, 0.2, 0.7)}
WHITE = (0.85, 0.83, 0.78)
STRIPES = 6


def lowest(radius: float, bounces: int, phase: float) -> float:
    """Height of the middle of a ball over its radius at a share of a bounce: above 0 in the air, below 0 on the
    floor, where it comes with the speed of its fall."""
    period = DURATION / bounces
    air = period * (1 - ON_FLOOR)
    if phase < ON_FLOOR:
        speed = GRAVITY * air / 2
        depth = speed * period * ON_FLOOR / math.pi
        return -min(depth, DEEPEST * radius) * math.sin(math.pi * phase / ON_FLOOR)
    t = period * (phase - ON_FLOOR)
    return GRAVITY / 2 * t * (air - t)


def shares(name: str, inside: list[float]) -> dict[float, float]:
    """Times of keys in the loop, each with its share of a bounce. inside: the shares of a bounce that get keys."""
    _, _, bounces, first, _ = BALLS[name]
    found = {DURATION * ((n + share + first) % bounces) / bounces: share for n in range(bounces) for share in inside}
    found[0.0] = found[DURATION] = -first % 1
    return dict(sorted(found.items()))


def tracks(name: str) -> dict:
    """The tracks of a ball: its height, its squash and its turning."""
    _, radius, bounces, _, turns = BALLS[name]
    floor = [ON_FLOOR * k / ON_GROUND for k in range(ON_GROUND + 1)]
    air = [ON_FLOOR + (1 - ON_FLOOR) * k / IN_AIR for k in range(1, IN_AIR)]
    heights = {t: lowest(radius, bounces, share) for t, share in shares(name, floor + air).items()}
    lower = {t: 1 + min(lowest(radius, bounces, share), 0) / radius for t, share in shares(name, floor).items()}
    scales = {t: [rounded(s**-0.5), rounded(s), rounded(s**-0.5)] for t, s in lower.items()}
    places = {t: rounded(radius + h) for t, h in heights.items()}
    address = f"objects.{name}.transform"
    return {
        f"{name}: height": track(f"{address}.2.translate.1", places) | {"interpolation": "smooth"},
        f"{name}: squash": track(f"{address}.1.scale", scales),
        f"{name}: turning": track(f"{address}.0.rotate", {0.0: 0, DURATION: 360 * turns}),
    }


def rounded(x: float) -> float:
    """A number as it is written."""
    return round(x, 3)


def track(address: str, values: dict) -> dict:
    """A track of keys. values: value by time."""
    return {"address": address, "times": [rounded(t) for t in values], "values": list(values.values())}


def text() -> str:
    """The scene file."""
    objects = {"floor": {"type": "plane", "material": "floor"}}
    moves = {"camera": {"type": "orbit"}}
    materials, textures = (
        {"floor": {"texture": "floor", "ka": [0.25, 0.25, 0.25]}},
        {"floor": {"type": "checker", "a": [0.75, 0.62, 0.42], "b": [0.62, 0.48, 0.3], "scale": [0.5, 0.5]}},
    )
    for name, ((x, z), radius, _, _, _) in BALLS.items():
        textures[name] = {"type": "checker", "a": COLOURS[name], "b": WHITE, "scale": [STRIPES / 2, 0.5]}
        materials[name] = {"texture": name, "ka": [0.25, 0.25, 0.25], "ks": [0.4, 0.4, 0.4], "shininess": 60}
        steps = [{"rotate": 0}, {"scale": [1, 1, 1]}, {"translate": [x, radius, z]}]
        objects[name] = {"type": "sphere", "radius": radius, "material": name, "transform": steps}
        moves |= tracks(name)
    scene = {
        "$schema": "schema.json",
        "camera": {
            "origin": [0, 1.9, 6.2],
            "target": [0, 0.95, 0],
            "fov": 30,
            "shutter": {"close": 0.5, "moments": 16},
        },
        "film": {"width": 480, "height": 270},
        "background": {"top": [0.35, 0.55, 0.85], "bottom": [0.85, 0.9, 0.95]},
        "ambient": [0.75, 0.8, 0.9],
        "settings": {"spp": 36},
        "textures": textures,
        "materials": materials,
        "lights": {
            "sun": {"type": "sphere", "position": [6, 13, 8], "radius": 1.2, "samples": 1, "Id": [0.85, 0.8, 0.72]},
            "sky": {"type": "directional", "direction": [1, -0.7, 1], "Id": [0.2, 0.24, 0.3], "Is": [0, 0, 0]},
        },
        "objects": objects,
        "animation": {"duration": DURATION, "fps": 25, "tracks": moves},
    }
    return "{\n" + ",\n".join(section(key, value) for key, value in scene.items()) + "\n}\n"


def section(key: str, value: Any, indent: str = "  ") -> str:
    """A part of the file: named parts have a line each."""
    if key not in ("textures", "materials", "objects", "animation", "tracks"):
        return f"{indent}{json.dumps(key)}: {json.dumps(value)}"
    rows = [section(name, entry, indent + "  ") for name, entry in value.items()]
    return f"{indent}{json.dumps(key)}: {{\n" + ",\n".join(rows) + f"\n{indent}}}"


if __name__ == "__main__":
    path = Path(__file__).parent / "bouncing-balls.json"
    path.write_text(text())
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
