"""Many operands: their number is data and not code, and a thousand of them are right."""

from typing import Any

import drjit as dr
import numpy as np
import pytest
import solids
from csg_traced import Traced

import visray as vr
from visray.primitives import csg_clusters, csg_form


def holes(count: int) -> tuple[vr.Sphere, ...]:
    """Balls around the faces of a cube of 2. Their sizes shrink with their number, so that they take away a part."""
    rng = np.random.default_rng(1)
    size = count ** (-1 / 2)
    middle = rng.uniform(-1, 1, (count, 3))
    face = rng.integers(3, size=count)
    middle[np.arange(count), face] = rng.choice([-1.0, 1.0], count)
    radius = size * rng.uniform(0.5, 1.5, count)
    return tuple(vr.Sphere(center=tuple(c.tolist()), radius=float(r)) for c, r in zip(middle, radius))


def sponge(count: int) -> vr.Csg:
    return vr.Csg(op="difference", of=(vr.Box(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0)), *holes(count)))


def scene_of(obj: Any) -> vr.Scene:
    return vr.Scene(
        camera=vr.Camera(origin=(3.0, 2.5, 4.0), target=(0.0, 0.0, 0.0), fov=40.0),
        film=vr.Film(width=48, height=36),
        lights={"key": vr.PointLight(position=(3.0, 4.0, 2.0))},
        objects={"c": obj},
    )


def kernels_of(prepared: vr.Prepared) -> list[dict]:
    """What is launched for a picture."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        vr.render(prepared, progress=False)
        return dr.kernel_history([dr.KernelType.JIT])


@pytest.mark.parametrize("counts", [
    (csg_form.MAX_WRITTEN_OUT + 1, 12, csg_clusters.UNSPLIT),
    (csg_clusters.UNSPLIT + 1, 100, 200),
], ids=["one loop", "clusters"])  # fmt: skip
def test_the_number_of_operands_is_data(counts: tuple[int, ...]) -> None:
    """The kernel of a picture is the same one: as many operations, and nothing is compiled for another number."""
    found = []
    for count in counts:
        kernels = kernels_of(vr.prepare(scene_of(sponge(count))))
        found.append(max(k["operation_count"] for k in kernels))
        if count != counts[0]:
            largest = max(kernels, key=lambda k: k["operation_count"])
            assert largest["cache_hit"]
    assert len(set(found)) == 1


@pytest.mark.filterwarnings("ignore::visray.csg_report.CsgWarning")
def test_numbers_of_operands_are_data() -> None:
    prepared = vr.prepare(scene_of(sponge(20)))
    first = vr.render(prepared.updated({"objects.c.of.5.radius": 0.31}), layers=("RGB",), progress=False)["RGB"]
    for changes in (
        {"objects.c.of.5.radius": 0.5},
        {"objects.c.of.0.max": (0.8, 0.9, 1.1), "objects.c.of.20.center": (0, 0, 1)},
    ):
        moved = prepared.updated(changes)
        assert all(k["cache_hit"] for k in kernels_of(moved))
        there = vr.render(moved, layers=("RGB",), progress=False)["RGB"]
        assert np.array_equal(there, vr.render(moved.scene, layers=("RGB",), progress=False)["RGB"])
        assert not np.array_equal(there, first)


@pytest.mark.parametrize("count", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_sponge_of_many_holes_is_right(count: int) -> None:
    """A ray goes on from the cube's face as long as it is in a ball, from ball to ball."""
    obj, rng = sponge(count), np.random.default_rng(2)
    target = rng.uniform(-1, 1, (4000, 3))
    o = target + rng.uniform(3, 20, (len(target), 1)) * solids.directions(rng, len(target))
    d = (target - o) / np.linalg.norm(target - o, axis=1, keepdims=True)
    found = Traced(obj).first(o, d)
    low, high = np.sort(np.stack([(s - o) / d for s in (-1.0, 1.0)]), 0)
    t, end = low.max(1), high.min(1)
    centre, radius = np.array([s.center for s in obj.of[1:]]), np.array([s.radius for s in obj.of[1:]])
    middle = np.einsum("nk,mk->nm", d, centre) - np.einsum("nk,nk->n", o, d)[:, None]
    nearest = o[:, None] + middle[..., None] * d[:, None] - centre
    half = np.sqrt(np.maximum(radius**2 - (nearest**2).sum(2), 0))
    near, far = np.where(half > 0, middle - half, np.inf), np.where(half > 0, middle + half, -np.inf)
    leaf, going = np.zeros(len(t), int), t < end
    for _ in range(count):
        within = (near < t[:, None]) & (far > t[:, None]) & going[:, None]
        last = np.where(within, far, -np.inf)
        moves = within.any(1)
        t, leaf = np.where(moves, last.max(1), t), np.where(moves, last.argmax(1) + 1, leaf)
        going &= t < end
        if not moves.any():
            break
    # A ray within rounding of an edge is met by chance once in 10^9.
    assert np.array_equal(found.hit, going) and 0.3 < going.mean() < 1
    assert np.array_equal(found.leaf[going], leaf[going]) and len(np.unique(leaf[going])) > count / 2
    assert np.abs(found.t - t)[going].max() < 1e-12


def test_operands_in_many_levels_are_right() -> None:
    """Each level takes away what the one around it puts back, so that a box is left."""
    box = whole = vr.Box(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0))
    for _ in range(13):
        bite = vr.Sphere(center=(1.0, 1.0, 1.0), radius=0.5)
        whole = vr.Csg(op="merge", of=(vr.Csg(op="difference", of=(whole, bite)), box))
    layers = [vr.render(scene_of(x), layers=["N", "distance"], progress=False) for x in (whole, box)]
    for name in ("N", "distance"):
        assert np.array_equal(*(x[name] for x in layers))


@pytest.mark.parametrize("levels", [30, pytest.param(99, marks=pytest.mark.slow)])
def test_a_deep_tree_is_right(levels: int) -> None:
    """Shells in shells: a ball without (a ball without (...)), so that no two levels can be joined into one."""
    radii = np.linspace(1, 0.1, levels + 1)
    obj: Any = vr.Sphere(radius=float(radii[-1]))
    for radius in radii[-2::-1]:
        obj = vr.Csg(op="difference", of=(vr.Sphere(radius=float(radius)), obj))
    obj = vr.Csg(op="difference", of=(obj, vr.Box(min=(0.0, -2.0, -2.0), max=(2.0, 2.0, 2.0))))
    rng = np.random.default_rng(3)
    target = np.concatenate([np.zeros((2000, 1)), rng.uniform(-0.8, 0.8, (2000, 2))], axis=1)
    way = solids.directions(rng, 2000)
    way[:, 0] = -np.abs(way[:, 0]) - 0.1
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    found = Traced(obj).first(target - 3 * way, way)
    # On the section, solid and hollow rings take turns from outside; in a hollow one, the next shell is seen.
    ring = (radii[None] > np.linalg.norm(target, axis=1)[:, None]).sum(1)
    solid = ring % 2 == 1
    assert np.array_equal(np.abs(found.t - 3) < 1e-12, solid) and 0.3 < solid.mean() < 0.7
    assert (found.leaf[solid] == levels + 1).all() and (found.t[~solid & found.hit] > 3).all()
    assert vr.render(scene_of(obj), layers=("RGB",), progress=False)["RGB"].std() > 0.02
