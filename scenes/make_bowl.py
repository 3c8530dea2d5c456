"""Writes scenes/bowl.json: 10,000 balls of three sizes that rest in a bowl.

    python scenes/make_bowl.py         # takes some minutes

The balls start as a cloud above the bowl. In each step they fall a little, and then are pushed out of each other and
out of the bowl, again and again, until they lie still. The same every time: all that is random has a seed.
"""

import json
import sys
from pathlib import Path

import numpy as np

COUNT, BOWL = 10_000, 1.0
SIZES = np.array([0.0255, 0.0305, 0.0355])
COLOURS = {
    "red": (0.62, 0.05, 0.04), "orange": (0.8, 0.3, 0.04), "yellow": (0.82, 0.62, 0.1), "green": (0.12, 0.42, 0.12),
    "blue": (0.06, 0.2, 0.55), "white": (0.8, 0.78, 0.72),
}  # fmt: skip
# One cell of the grid that finds neighbours holds a ball of the largest size.
CELL = 2 * SIZES.max()
# Half of the 26 neighbours of a cell, and the cell itself: each pair of cells comes once.
AROUND = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) >= (0, 0, 0)]


def near_pairs(p: np.ndarray) -> np.ndarray:
    """Pairs of balls in the same cell or in cells side by side. Shapes: p (N, 3); result (P, 2)."""
    cell = np.floor(p / CELL).astype(np.int64) + 200
    key = (cell * [160_000, 400, 1]).sum(axis=1)
    order = np.argsort(key, kind="stable")
    sorted_keys, pairs = key[order], []
    for x, y, z in AROUND:
        other = key + x * 160_000 + y * 400 + z
        first, last = (np.searchsorted(sorted_keys, other, side) for side in ("left", "right"))
        sizes = last - first
        ball = np.repeat(np.arange(len(p)), sizes)
        place = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes) + np.repeat(first, sizes)
        pairs.append(np.stack([ball, order[place]], axis=1))
    joined = np.concatenate(pairs)
    same = joined[: len(pairs[0])]
    joined[: len(pairs[0])] = np.where((same[:, 0] < same[:, 1])[:, None], same, -1)
    return joined[joined[:, 0] >= 0]


def overlaps(p: np.ndarray, r: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Those pairs whose balls overlap, the unit vectors between their centres, and how deep.

    Shapes: p (N, 3), r (N).
    """
    i, j = pairs.T
    between = p[i] - p[j]
    square, least = (between**2).sum(axis=1), r[i] + r[j]
    deep = square < least**2
    distance = np.sqrt(square[deep])
    return pairs[deep], between[deep] / distance[:, None], least[deep] - distance


def settled(rng: np.random.Generator, r: np.ndarray, steps: int) -> np.ndarray:
    """Centres of balls with the radii r that have come to rest in a bowl around the origin. Shape: (N, 3)."""
    radius, turn = 0.75 * np.sqrt(rng.random(len(r))), 2 * np.pi * rng.random(len(r))
    p = np.stack([radius * np.cos(turn), rng.uniform(-0.6, 2.4, len(r)), radius * np.sin(turn)], axis=1)
    previous = p.copy()
    for step in range(steps):
        # Balls keep a part of their speed. The fall becomes slower, so that at last they hardly overlap.
        fall = 0.0015 * (1 - step / steps) ** 2
        p, previous = p + 0.9 * (p - previous) - [0, fall, 0], p
        pairs = near_pairs(p)
        for _ in range(4):
            found, towards, depth = overlaps(p, r, pairs)
            count = np.maximum(np.bincount(found.ravel(), minlength=len(p)), 1)
            push = np.zeros_like(p)
            for k in range(3):
                half = 0.5 * depth * towards[:, k]
                push[:, k] = np.bincount(found[:, 0], half, len(p)) - np.bincount(found[:, 1], half, len(p))
            p = p + push / np.sqrt(count)[:, None]
            # Below the rim the bowl is a half ball, and above it a tube.
            low = p * [1, 1, 1]
            low[:, 1] = np.minimum(low[:, 1], 0)
            distance = np.linalg.norm(low, axis=1)
            p += low * (np.minimum((BOWL - r) / np.maximum(distance, 1e-9), 1) - 1)[:, None]
        if step % 100 == 0:
            sys.stderr.write(f"step {step}: height {p[:, 1].max():.3f}, deepest overlap {depth.max(initial=0):.5f}\n")
    return p


def balls() -> list[tuple[list[float], float, str]]:
    """Centre, radius and colour of each ball."""
    rng = np.random.default_rng(1)
    r = SIZES[rng.integers(len(SIZES), size=COUNT)]
    p = settled(rng, r, 1500)
    _, _, depth = overlaps(p, r, near_pairs(p))
    # What is left of overlaps is taken off all radii.
    shown = np.floor(1e4 * (r - 0.5 * depth.max() - 1e-4)) / 1e4
    names = list(COLOURS)
    colours = [names[number] for number in rng.integers(len(names), size=COUNT)]
    return list(zip(np.round(p, 4).tolist(), shown.tolist(), colours))


def text(settled_balls: list[tuple[list[float], float, str]]) -> str:
    """The scene file. The bowl is the lower half of a shell, cut off by a box: f < 0 between two spheres."""
    scene = {
        "$schema": "schema.json",
        "camera": {"origin": [0.4, 2.7, 2.9], "target": [0, -0.36, 0], "fov": 33},
        "film": {"width": 640, "height": 480},
        "background": {"top": [0.4, 0.55, 0.75], "bottom": [0.95, 0.93, 0.9]},
        "ambient": [0.55, 0.55, 0.58],
        "settings": {"spp": 36},
        "materials": {
            "table": {"ka": [0.16, 0.15, 0.14], "kd": [0.42, 0.38, 0.34]},
            "clay": {"ka": [0.14, 0.15, 0.16], "kd": [0.62, 0.66, 0.7], "ks": [0.4, 0.4, 0.4], "shininess": 60},
        },
        "lights": {"lamp": {"type": "point", "position": [-3, 6, 3]}},
        "objects": {
            "table": {"type": "plane", "point": [0, -1.06, 0], "material": "table"},
            "bowl": {
                "type": "polynomial",
                "expression": "(x^2 + y^2 + z^2 - 1) * (x^2 + y^2 + z^2 - 1.12)",
                "clip": {"type": "box", "min": [-1.1, -1.1, -1.1], "max": [1.1, 0, 1.1]},
                "ends": "capped",
                "material": "clay",
            },
        },
    }
    for name, kd in COLOURS.items():
        ka = [round(0.25 * c, 3) for c in kd]
        scene["materials"][name] = {"ka": ka, "kd": list(kd), "ks": [0.35, 0.35, 0.35], "shininess": 50}
    for number, (center, radius, colour) in enumerate(settled_balls):
        ball = {"type": "sphere", "center": center, "radius": radius, "material": colour}
        scene["objects"][f"ball {number}"] = ball
    sections = []
    for key, value in scene.items():
        if key in ("materials", "objects"):
            rows = [f"    {json.dumps(name)}: {json.dumps(entry)}" for name, entry in value.items()]
            sections.append(f"  {json.dumps(key)}: {{\n" + ",\n".join(rows) + "\n  }")
        else:
            sections.append(f"  {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(sections) + "\n}\n"


if __name__ == "__main__":
    path = Path(__file__).parent / "bowl.json"
    path.write_text(text(balls()))
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
