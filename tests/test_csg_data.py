"""Data layers whose rows show CSG: the same bits as one object for each row, materials of operands, and palettes."""

from dataclasses import replace

import numpy as np
import pytest
from samples import NAMES, SAMPLES

import visray as vr
from visray.data_columns import data_columns
from visray.pack import object_columns
from visray.scene.check import checked
from visray.setup import arrays
from visray.written_out import written_out

N = 12
RNG = np.random.default_rng(3)
LON, LAT = np.arange(N) * 360.0 / N - 175.0, RNG.uniform(-40, 60, N)
RAIN, HEAT = RNG.uniform(1, 9, N), RNG.uniform(0, 30, N)
TETRAHEDRON = vr.Mesh(
    vertices=[[1, 0, 0], [-0.5, 0, 0.8], [-0.5, 0, -0.8], [0, 1, 0]], faces=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)
TURNED = (vr.Rotate(rotate=30, axis=(1, 0, 2)), vr.Translate(translate=(0.1, 0.5, 0)))
BLOCK = vr.Box(min=(-1, 0, -1), max=(1, 1, 1))
DRILLED = vr.Csg(
    op="difference",
    of={
        "block": BLOCK,
        "bore": vr.Cylinder(center=(0, 0.5, 0), radius=0.6, height=1.2),
        "dent": vr.Sphere(center=(1, 0.5, 0), radius=0.5, material="red"),
    },
    cut_material="blue",
)
# More operands in a row than are written out in a kernel, the inner ones CSG themselves.
RINGS = tuple(
    vr.Torus(center=(0, 0.15 * i, 0), major=0.9, minor=0.2, cut=(vr.Box(min=(0, -1, 0), max=(2, 2, 2)),))
    for i in range(6)
)
HEART = vr.Polynomial(expression="x^2 + 2*y^2 + z^2 - 0.8", clip={"type": "box", "min": (-1, -1, -0.5)}, ends="capped")
SHAPES = {
    "drilled": DRILLED,
    "rows of rings": vr.Csg(op="merge", of=(*RINGS, vr.Box(min=(-0.2, 0, -0.2), max=(0.2, 1, 0.2)))),
    "mesh": vr.Csg(
        op="difference", of=(replace(TETRAHEDRON, transform=TURNED), vr.Plane(point=(0, 0.5, 0), normal=(0, -1, 0)))
    ),
    "polynomial": vr.Csg(op="intersection", of=(HEART, BLOCK), transform=TURNED),
    "shell": replace(DRILLED, ends="open", cut_material=None),
    "cut": vr.Sphere(center=(0, 0.6, 0), radius=0.8, cut={"wedge": vr.Box(min=(0, 0, 0), max=(2, 2, 2))}),
    "instance": vr.Csg(op="intersection", of=(vr.Instance(geometry="inner"), vr.Sphere(radius=1.2))),
}
MATERIALS = {
    # Colours replace kd; products with them may have other last bits (test_colored.py).
    "paint": vr.Material(ks=(0.3, 0.3, 0.3), shininess=16.0, colored=("kd",)),
    "red": vr.Material(kd=(0.8, 0.1, 0.1)),
    "blue": vr.Material(kd=(0.1, 0.1, 0.9)),
}


def scene(shape: vr.Csg, materials: dict | None = None, **fields) -> vr.Scene:
    source = {"lon": LON, "lat": LAT, "rain": RAIN, "heat": HEAT, "name": [f"row {i}" for i in range(N)]}
    sizes = {key: vr.SizeRule(column="rain", range=(0.1, most)) for key, most in (("radius", 0.3), ("height", 0.6))}
    color = vr.ColorRule(column="heat", domain=(-5, 35))
    layer = {"source": source, "gizmo": "geometry", "geometry": "shape", "color": color, "material": "paint"} | sizes
    return checked(
        vr.Scene(
            camera=vr.Camera(origin=(2.5, 2.2, 3.0), fov=40),
            film=vr.Film(width=48, height=36),
            lights={"key": vr.PointLight(position=(4, 6, 5))},
            materials=MATERIALS | (materials or {}),
            geometries={"shape": shape} | ({"inner": DRILLED} if shape is SHAPES["instance"] else {}),
            objects={"ball": vr.Sphere(center=(0, 1.6, 0), radius=0.2)},
            data=vr.Data(base=vr.GlobeBase(radius=1.0), layers={"rain": vr.DataLayer(**layer | fields)}),
            settings=vr.Settings(spp=4),
        )
    )


def differences(a: vr.Scene, b: vr.Scene) -> list[str]:
    """Names of the layers in which the pictures of two scenes differ."""
    x, y = (vr.render(s, progress=False) for s in (a, b))
    assert list(x.layers) == list(y.layers) and np.unique(x["id"]).size > 5
    return [name for name in x.layers if not np.array_equal(x[name], y[name], equal_nan=True)]


QUICK = ("drilled", "rows of rings", "mesh")


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow) for n in SHAPES])
def test_rows_have_the_bits_of_objects_that_are_written_out(name: str) -> None:
    of_data = scene(SHAPES[name])
    assert not differences(of_data, written_out(of_data))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_rows_that_are_made_of_any_kind_have_the_bits_of_written_out_ones(name: str) -> None:
    ball = vr.Sphere(center=(0, 0.1, 0), radius=0.9)
    raised = (vr.Translate(translate=(0, 0.6, 0)),)
    of_data = scene(vr.Csg(op="intersection", of=(SAMPLES[name].posed, ball), transform=raised))
    assert not differences(of_data, written_out(of_data))


@pytest.mark.parametrize("name", SHAPES)
def test_tables_are_those_of_written_out_rows(name: str) -> None:
    """Boxes, balls, operands and looks."""
    of_data, a = scene(SHAPES[name]), arrays("llvm", "single")
    twin = written_out(of_data)
    members = [(i, x) for i, x in enumerate(twin.objects) if x.startswith("data:rain")]
    (mine,) = data_columns(of_data, a)
    theirs = object_columns(twin, a, mine.kind, members)
    assert mine.kind.composite and len(mine) == len(theirs) == N
    x, y = (c.numbers.bounds(None) for c in (mine, theirs))
    for key in ("low", "high", "centre", "radius"):
        assert np.allclose(getattr(x, key), getattr(y, key), rtol=1e-13, atol=1e-13), key
    for number in ("site_of", "row_of"):
        assert np.array_equal(getattr(mine.numbers, number), getattr(theirs.numbers, number))
    names = [list(s.materials) for s in (of_data, twin)]
    for leaf, (i, j) in enumerate(zip(mine.looks.of, theirs.looks.of)):
        here, there = ((["default"] + n)[c.looks.material[int(k)]] for n, c, k in zip(names, (mine, theirs), (i, j)))
        row = mine.looks.row[int(i)]
        assert (here, row) == (there, 0xFFFFFFFF) or (here, there) == ("paint", f"data:rain:{row}")
        assert row in (0xFFFFFFFF, leaf // (len(mine.looks.of) // N))
