"""The cost of CSG against the number of operands: a sponge, a merge of balls, an intersection of half-spaces.

    python reference/csg_growth.py -o reference/csg_growth.json

512 x 512 pixels, 4 samples per pixel, one point light with shadows, 2 threads.

sponge: a block without n balls and rods. merge: n balls as one solid; objects: the same balls as n objects, as which a
union of more than 64 operands is drawn (visray/primitives/csg_bodies.py).
half-spaces: the intersection of n half-spaces that touch a ball; 2 of them are a plate without end.

prepare: from the checked scene to what kernels read. Operations, and characters of code: of the kernel that renders.
compile: the median of 3 kernels that are in no cache. run: the kernel's own time. frame: from the prepared scene to the
picture in memory, with compiled kernels. The numbers of operands alternate; medians of 7 rounds.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import numpy as np
from bench_mitsuba import with_seed
from csg_scenes import Ball, Block, Node, Rod, scene
from machine import machine
from report import report_parser

from visray.passes import expose
from visray.setup import prepare
from visray.study.timed_picture import UncachedPicture

SIZE, SPP, THREADS, RUNS, COMPILED = 512, 4, 2, 7, 3
NUMBERS = (2, 8, 32, 128)


def places(n: int) -> tuple[np.ndarray, float]:
    """n random points in the cube of side 2, and a radius with which n balls fill about a fifth of it."""
    rng = np.random.default_rng(n)
    return rng.uniform(-1, 1, (n, 3)), float((0.2 * 8 / n * 3 / (4 * np.pi)) ** (1 / 3))


def balls(n: int) -> list[Ball]:
    centers, radius = places(n)
    return [Ball(tuple(c), radius, "red") for c in centers.tolist()]


def sponge(n: int) -> dict[str, Any]:
    """A block without n / 2 balls and n / 2 rods."""
    centers, radius = places(n)
    rods = [Rod(tuple(c), i % 3, radius / 2, 3.0, "pale") for i, c in enumerate(centers[n // 2 :].tolist())]
    block = Block((-1.0,) * 3, (1.0,) * 3, "yellow")
    return {"solid": Node("difference", (block, *balls(n)[: n // 2], *rods)).ours()}


def merge(n: int) -> dict[str, Any]:
    return {"solid": Node("merge", tuple(balls(n))).ours()}


def objects(n: int) -> dict[str, Any]:
    return {f"ball {i}": ball.ours() for i, ball in enumerate(balls(n))}


def half_spaces(n: int) -> dict[str, Any]:
    """Normals go around a spiral on the ball."""
    i = np.arange(n) + 0.5
    height, angle = 1 - 2 * i / n, np.pi * (1 + 5**0.5) * i
    level = np.sqrt(1 - height * height)
    normals = np.stack([level * np.cos(angle), level * np.sin(angle), height], 1).tolist()
    planes = tuple(vr.Plane(point=tuple(v), normal=tuple(v), material="grey") for v in normals)
    return {"solid": vr.Csg(op="intersection", of=planes)}


SORTS = {"sponge": sponge, "merge": merge, "objects": objects, "half-spaces": half_spaces}


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def rows(sort: str, numbers: list[int]) -> list[dict]:
    """The figures of one sort of scene, one dict for each number of operands."""
    scenes = [scene(SORTS[sort](n), 1.74, SIZE, SPP) for n in numbers]
    figures = [{"sort": sort, "operands": n} for n in numbers]
    prepared, pictures = [], []
    for s, row in zip(scenes, figures):
        row["prepare_s"] = median(seconds(lambda s=s: prepare(s)) for _ in range(COMPILED))
        prepared.append(prepare(s))
        kernels = [UncachedPicture.of(prepared[-1]) for _ in range(COMPILED)]
        (row["operations"], _), *_ = compiled = [k.compiled() for k in kernels]
        row["compile_s"] = median(s for _, s in compiled)
        pictures.append(kernels[0])
        row["code_characters"] = max(len(k["ir"].getvalue()) for k in pictures[-1].kernels())
    runs, frames = zip(*(([], []) for _ in figures))
    for seed in range(RUNS + 1):
        for i, p in enumerate(prepared):
            frames[i].append(seconds(lambda p=p, seed=seed: expose(with_seed(p, seed))))
            runs[i].append(pictures[i].seconds())
    for row, run, frame in zip(figures, runs, frames):
        row |= {"run_s": median(run[1:]), "frame_s": median(frame[1:])}
        row["frame_quartiles_s"] = np.quantile(frame[1:], [0.25, 0.75]).tolist()
    return figures


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--numbers", type=int, nargs="*", default=NUMBERS)
    parser.add_argument("--sorts", nargs="*", choices=SORTS, default=list(SORTS))
    chosen = parser.parse_args()
    dr.set_thread_count(THREADS)
    report = machine() | {"size": SIZE, "spp": SPP, "load": os.getloadavg()[0], "cases": []}
    rows("objects", [2])  # LLVM itself starts with the first kernel
    for sort in chosen.sorts:
        for row in rows(sort, chosen.numbers):
            report["cases"].append(row)
            print(json.dumps(row), file=sys.stderr, flush=True)
    if chosen.output:
        chosen.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
