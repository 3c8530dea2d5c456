"""Writes the scenes of CSG that have many operands: scenes/csg-die.json, csg-gear.json and csg-shell.json.

    python scenes/make_csg.py
    python scenes/make_csg.py gear -o somewhere/else

The same every time.
"""

import argparse
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path

TEETH, SPOKES = 24, 5
ROWS_OF_HOLES = 13


def point(*coordinates: float) -> list[float]:
    """A point, rounded to four decimals."""
    return [round(x, 4) + 0.0 for x in coordinates]


def pips() -> dict[str, dict]:
    """The 21 pips of a die with the corners (-1, -1, -1) and (1, 1, 1). Opposite faces have 7 pips together."""
    step, depth, radius = 0.48, 1.08, 0.21
    diagonal = [(-step, -step), (step, step)]
    corners = [*diagonal, (-step, step), (step, -step)]
    places = {
        1: [(0, 0)], 2: diagonal, 3: [*diagonal, (0, 0)], 4: corners, 5: [*corners, (0, 0)],
        6: [*corners, (-step, 0), (step, 0)],
    }  # fmt: skip
    # For each number of pips the axis of its face, and on which side of the origin the face is.
    faces = {1: (1, 1), 6: (1, -1), 2: (2, 1), 5: (2, -1), 3: (0, 1), 4: (0, -1)}
    balls = {}
    for number, (axis, side) in faces.items():
        for place, (u, v) in enumerate(places[number], 1):
            center = [u, v]
            center.insert(axis, side * depth)
            balls[f"pip {number} {place}"] = {"type": "sphere", "center": point(*center), "radius": radius}
    return balls


def die() -> dict:
    """Three dice: cubes without corners, and without the balls that are their pips."""
    body = {
        "type": "csg", "op": "intersection",
        "of": {
            "cube": {"type": "box", "min": [-1, -1, -1], "max": [1, 1, 1]},
            "ball": {"type": "sphere", "radius": 1.46},
        },
    }  # fmt: skip
    turns = {
        "red": ([{"rotate": 24}], [-0.75, 1, 0.5]),
        "white": ([{"rotate": 90, "axis": [1, 0, 0]}, {"rotate": -34}], [1.75, 1, -0.3]),
        "blue": ([{"rotate": -90, "axis": [0, 0, 1]}, {"rotate": 52}], [0.55, 3, -0.1]),
    }
    return {
        "camera": {"origin": [0.9, 5.6, 11.5], "target": [0.5, 1.65, 0], "fov": 27},
        "film": {"width": 640, "height": 480},
        "background": {"top": [0.3, 0.4, 0.38], "bottom": [0.16, 0.34, 0.26]},
        "ambient": [0.55, 0.56, 0.58],
        "settings": {"spp": 64, "sampler": "sobol", "occlusion": {"sky": 2}},
        "materials": {
            "felt": {"ka": [0.06, 0.3, 0.17], "kd": [0.06, 0.28, 0.16]},
            "red": {"ka": [0.44, 0.02, 0.03], "kd": [0.7, 0.04, 0.05], "ks": [0.6, 0.55, 0.55], "shininess": 120},
            "white": {"ka": [0.68, 0.66, 0.6], "kd": [0.55, 0.53, 0.48], "ks": [0.5, 0.5, 0.5], "shininess": 120},
            "blue": {"ka": [0.03, 0.12, 0.42], "kd": [0.05, 0.2, 0.66], "ks": [0.6, 0.6, 0.6], "shininess": 120},
            "gold": {"ka": [0.62, 0.44, 0.1], "kd": [0.7, 0.5, 0.12], "ks": [0.4, 0.35, 0.2], "shininess": 40},
        },
        "lights": {
            "lamp": {
                "type": "rectangle", "position": [-5, 10, 7], "width": [2.2, 0, 1.4], "height": [-0.8, 1.2, 1.8],
                "samples": 4, "Id": [0.85, 0.83, 0.8],
            },
            "fill": {"type": "point", "position": [9, 5, 6], "Id": [0.35, 0.35, 0.38], "Is": [0.2, 0.2, 0.2]},
        },
        "geometries": {
            "die": {"type": "csg", "op": "difference", "of": {"body": body, **pips()}, "cut_material": "gold"},
        },
        "objects": {
            "felt": {"type": "plane", "material": "felt"},
            **{
                name: {
                    "type": "instance", "geometry": "die", "material": name,
                    "transform": [*steps, {"translate": place}],
                }
                for name, (steps, place) in turns.items()
            },
        },
    }  # fmt: skip


def wheel() -> dict:
    """A gear about the z axis, with a radius of 1.2: the rim and its teeth, without the holes."""
    # A tooth is the outer half of a rhombus, cut off by the ball.
    teeth = {
        f"tooth {i + 1}": {
            "type": "box", "min": [-0.5, -0.5, -0.15], "max": [0.5, 0.5, 0.15],
            "transform": [
                {"rotate": 45, "axis": [0, 0, 1]}, {"scale": [0.99, 0.17, 1]}, {"translate": [0.8, 0, 0]},
                {"rotate": i * 360 / TEETH, "axis": [0, 0, 1]},
            ],
        }
        for i in range(TEETH)
    }  # fmt: skip
    body = {"rim": {"type": "cylinder", "axis": [0, 0, 1], "radius": 1.0, "height": 0.3}, **teeth}
    outside = {"type": "ellipsoid", "radii": [1.25, 1.25, 0.62]}
    holes = {
        f"hole {i + 1}": {
            "type": "cylinder", "center": [0.61, 0, 0], "axis": [0, 0, 1], "radius": 0.19, "height": 1,
            "transform": [{"rotate": (i + 0.5) * 360 / SPOKES, "axis": [0, 0, 1]}],
        }
        for i in range(SPOKES)
    }  # fmt: skip
    return {
        "type": "csg", "op": "difference",
        "of": {
            "body": {
                "type": "csg", "op": "intersection",
                "of": {"teeth and rim": {"type": "csg", "op": "merge", "of": body}, "outside": outside},
            },
            "recess": {
                "type": "csg", "op": "difference",
                "of": [
                    {"type": "cylinder", "center": [0, 0, 0.15], "axis": [0, 0, 1], "radius": 0.86, "height": 0.2},
                    {"type": "cylinder", "axis": [0, 0, 1], "radius": 0.36, "height": 1},
                ],
            },
            "bore": {"type": "cylinder", "axis": [0, 0, 1], "radius": 0.2, "height": 1},
            "key": {"type": "box", "min": [-0.06, 0, -0.5], "max": [0.06, 0.28, 0.5]},
            **holes,
        },
    }  # fmt: skip


def gear() -> dict:
    """Two gears that mesh: one with 24 teeth of its own, and a copy of it."""
    half = 180 / TEETH
    return {
        "camera": {"origin": [-2.4, 2.0, 6.9], "target": [0.05, -0.06, 0], "fov": 26},
        "film": {"width": 720, "height": 450},
        "background": {"top": [0.55, 0.6, 0.68], "bottom": [0.7, 0.68, 0.66]},
        "ambient": [0.55, 0.55, 0.57],
        "settings": {"spp": 64, "sampler": "sobol", "occlusion": {"sky": 2}},
        "materials": {
            "wall": {"ka": [0.2, 0.3, 0.36], "kd": [0.2, 0.3, 0.36]},
            "brass": {"ka": [0.4, 0.27, 0.08], "kd": [0.6, 0.4, 0.11], "ks": [0.7, 0.58, 0.3], "shininess": 60},
            "steel": {"ka": [0.36, 0.38, 0.41], "kd": [0.44, 0.46, 0.5], "ks": [0.7, 0.7, 0.72], "shininess": 60},
            "copper": {"ka": [0.42, 0.17, 0.09], "kd": [0.62, 0.25, 0.13], "ks": [0.6, 0.45, 0.4], "shininess": 60},
        },
        "lights": {
            "lamp": {
                "type": "rectangle", "position": [-3.5, 4.5, 5], "width": [1.4, 0, 0.8], "height": [0, 1.2, -0.8],
                "samples": 4, "Id": [0.85, 0.83, 0.8],
            },
        },
        "geometries": {"gear": wheel()},
        "objects": {
            "wall": {"type": "plane", "point": [0, 0, -0.5], "normal": [0, 0, 1], "material": "wall"},
            "left": {
                "type": "instance", "geometry": "gear", "material": "brass",
                "transform": [{"rotate": 4, "axis": [0, 0, 1]}, {"translate": [-1.15, 0, 0]}],
            },
            "right": {
                "type": "instance", "geometry": "gear", "material": "steel",
                "transform": [{"rotate": half - 4, "axis": [0, 0, 1]}, {"translate": [1.15, 0, 0]}],
            },
            **{
                f"{name} axle": {
                    "type": "cylinder", "center": [x, 0, 0], "axis": [0, 0, 1], "radius": 0.19, "height": 1,
                    "material": "copper",
                }
                for name, x in (("left", -1.15), ("right", 1.15))
            },
        },
    }  # fmt: skip


def holes_of_shell() -> Iterator[tuple[str, dict]]:
    """The balls that cut the holes of the lamp: equally spaced rows of them around the unit sphere."""
    for row in range(ROWS_OF_HOLES):
        latitude = math.pi * ((row + 0.5) / ROWS_OF_HOLES - 0.5)
        count = max(1, round(2 * ROWS_OF_HOLES * math.cos(latitude)))
        for i in range(count):
            turn = 2 * math.pi * (i + 0.5 * (row % 2)) / count
            r = math.cos(latitude)
            center = point(r * math.cos(turn), math.sin(latitude), r * math.sin(turn))
            yield f"hole {row + 1} {i + 1}", {"type": "sphere", "center": center, "radius": 0.085}


def shell() -> dict:
    """A lamp of thin metal: an open sphere with round holes, and a light inside."""
    return {
        "camera": {"origin": [1.2, 2.2, 6.6], "target": [0, 1.2, -0.3], "fov": 33},
        "film": {"width": 640, "height": 480},
        "background": [0.02, 0.02, 0.03],
        "ambient": [0.08, 0.09, 0.14],
        "settings": {"spp": 64, "sampler": "sobol"},
        "materials": {
            "floor": {"ka": [0.4, 0.38, 0.36], "kd": [0.62, 0.56, 0.5]},
            "outside": {
                "ka": [0.3, 0.5, 0.7], "kd": [0.3, 0.5, 0.8], "ks": [0.5, 0.5, 0.5], "shininess": 60,
                "back": "inside",
            },
            "inside": {"ka": [0.6, 0.4, 0.1], "kd": [0.75, 0.5, 0.12]},
            "cord": {"ka": [0.1, 0.1, 0.1], "kd": [0.1, 0.1, 0.1]},
        },
        "lights": {
            "bulb": {"type": "point", "position": [0, 1.3, 0], "Id": [1.2, 1.05, 0.8], "Is": [0, 0, 0]},
            "moon": {"type": "point", "position": [-3, 5, 5], "Id": [0.15, 0.18, 0.26], "Is": [0.4, 0.4, 0.45]},
        },
        "objects": {
            "floor": {"type": "plane", "material": "floor"},
            "wall": {"type": "plane", "point": [0, 0, -3], "normal": [0, 0, 1], "material": "floor"},
            "lamp": {
                "type": "csg", "op": "difference", "ends": "open", "material": "outside",
                "of": {"ball": {"type": "sphere"}, **dict(holes_of_shell())},
                "transform": [{"translate": [0, 1.3, 0]}],
            },
            "cord": {"type": "cylinder", "center": [0, 4.3, 0], "radius": 0.02, "height": 4, "material": "cord"},
        },
    }  # fmt: skip


def value_text(value: object, indent: str, width: int = 150) -> str:
    """JSON of a value: on one line where it fits, else an entry a line."""
    line = json.dumps(value)
    if len(indent) + len(line) <= width or not isinstance(value, dict):
        return line
    inner = indent + "  "
    rows = [f"{inner}{json.dumps(name)}: {value_text(entry, inner, width)}" for name, entry in value.items()]
    return "{\n" + ",\n".join(rows) + "\n" + indent + "}"


SCENES: dict[str, Callable[[], dict]] = {"die": die, "gear": gear, "shell": shell}


def text(name: str) -> str:
    """The text of a scene file. name: a key of SCENES."""
    return value_text({"$schema": "schema.json"} | SCENES[name](), "") + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(SCENES)}; all if none is named")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent, help="the folder")
    chosen = parser.parse_args()
    for name in set(chosen.names) - set(SCENES):
        parser.error(f"there is no {name}; there are {', '.join(SCENES)}")
    chosen.output.mkdir(parents=True, exist_ok=True)
    for name in chosen.names or SCENES:
        path = chosen.output / f"csg-{name}.json"
        path.write_text(text(name))
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
