"""Data layers whose rows show CSG: the same bits as one object for each row, materials of operands, and palettes."""

from dataclasses import replace
from itertools import product

import drjit as dr
import numpy as np
import pytest
from samples import NAMES, SAMPLES

import visray as vr
from visray.data_columns import data_columns
from visray.feature_rules import used_materials
from visray.features import features
from visray.overlap_report import overlaps
from visray.pack import object_columns
from visray.scene.check import checked
from visray.setup import arrays
from visray.study.pixel.why import why
from visray.written_out import written_out

N = 12
RNG = np.random.default_rng(3)
LON, LAT = np.arange(N) * 360.0 / N - 175.0, RNG.uniform(-40, 60, N)
RAIN, HEAT = RNG.uniform(1, 9, N), RNG.uniform(0, 30, N)
TETRAHEDRON = vr.Mesh(
    vertices=[[1, 0, 0], [-0.5, 0, 0.8], [-0.5, 0, -0.8], [0, 1, 0]], faces=[[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]
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


def with_rows(shape: vr.Csg, **fields) -> tuple[vr.Scene, vr.Image, list[str]]:
    """A scene of pixels with one sample, its picture, and the names of the objects by their numbers."""
    made = replace(scene(shape, **fields), settings=vr.Settings(spp=1))
    return made, vr.render(made, progress=False), [None, *made.all_objects]


def test_palettes_colour_the_operands_in_the_material_of_the_layer() -> None:
    """The others keep their own: that of the operand, and that of the faces that are cut."""
    made, image, names = with_rows(DRILLED)
    colors = dict(zip(made.data.rows["rain"].number.tolist(), made.data.rows["rain"].color.T))
    ids, albedo = np.array(image["id"]).reshape(36, 48), image["albedo"]
    seen = set()
    for pixel in zip(*np.nonzero(ids)):
        name = names[ids[pixel]]
        if not name.startswith("data.rain."):
            continue
        row = int(name.removeprefix("data.rain."))
        found = {"paint": colors[row], "red": MATERIALS["red"].kd, "blue": MATERIALS["blue"].kd}
        (material,) = [m for m, kd in found.items() if np.allclose(albedo[pixel], kd, atol=1e-6)]
        seen.add((material, row))
    assert {material for material, _ in seen} == {"paint", "red", "blue"}
    assert len({row for material, row in seen if material == "paint"}) > 3


def test_rows_without_colours_have_the_materials_of_the_operands() -> None:
    """Those of the geometry, if the layer names no material; else that of the layer where an operand names none."""
    inner = replace(DRILLED, of=DRILLED.of | {"block": replace(BLOCK, material="red")}, cut_material=None)
    for fields, others in (({"material": "default"}, "default"), ({}, "paint")):
        of_data = scene(inner, color=None, **fields)
        assert not differences(of_data, written_out(of_data))
        (columns,) = data_columns(of_data, arrays("llvm", "single"))
        names = ["default", *of_data.materials]
        looks = [names[int(columns.looks.material[int(i)])] for i in columns.looks.of]
        # The bore has the material of its own object, which is that of the first operand if the layer has none.
        assert looks == ["red", "red" if others == "default" else others, "red"] * N and columns.looks.row is None
        assert {names[i] for i in np.array(columns.material)} == {"red" if others == "default" else others}


def test_the_derivative_by_a_rows_colour_is_that_of_differences() -> None:
    """Only the operands in the layer's material depend on it."""
    made = replace(scene(DRILLED), settings=vr.Settings(spp=1, precision="double", shadows=False))
    seen = [name for name in made.all_objects if name.startswith("data.rain.")]
    address = f"{seen[N // 2]}.color"
    attached = vr.derivative(made, address, progress=False)
    assert np.abs(attached).max() > 1e-3
    assert attached == pytest.approx(vr.difference(made, address), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("data.rain.6.height", "; those of data are a row's lon, lat, height, radius and color, where the layer takes "
         "them from columns, and are no geometries"),
        ("geometries.shape.of.bore.radius", ", as rows of data.layers.rain show this geometry"),
        ("geometries.shape.of.dent.center", ", as rows of data.layers.rain show this geometry"),
    ],
)  # fmt: skip
def test_numbers_without_a_derivative_are_refused(address: str, reason: str) -> None:
    """An object that shows the geometry, too, does not make up for the rows."""
    made = scene(DRILLED)
    made = replace(made, objects=made.objects | {"one": vr.Instance(geometry="shape")})
    with pytest.raises(vr.UserError) as caught:
        vr.gradient(made, [address])
    assert caught.value.lines == (f"{address}: has no derivative{reason}",)


CHANGES = {
    "data.rain.6.height": 4.0,
    "data.rain.6.color": 3.0,
    "data.layers.rain.radius.range": (0.1, 0.4),
    "materials.blue.kd": (0.1, 0.5, 0.6),
    "geometries.shape.of.bore.radius": 0.4,
    "geometries.shape.of.dent.transform": TURNED,
}


def test_updates_have_the_bits_of_new_scenes_and_compile_nothing() -> None:
    prepared = vr.prepare(scene(DRILLED))
    for address, value in CHANGES.items():
        if address != "geometries.shape.of.dent.transform":
            vr.render(prepared.updated({address: value}), progress=False)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        pictures = {a: vr.render(prepared.updated({a: value}), progress=False)["RGB"] for a, value in CHANGES.items()}
        missed = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT and not k["cache_hit"]]
    assert not missed
    plain = vr.render(prepared, progress=False)["RGB"]
    for address, value in CHANGES.items():
        assert np.array_equal(
            pictures[address], vr.render(vr.replaced(scene(DRILLED), address, value), progress=False)["RGB"]
        )
        assert not np.array_equal(pictures[address], plain), address


def test_an_update_of_a_geometry_inside_the_geometry_of_rows_is_seen() -> None:
    made, address = scene(SHAPES["instance"]), "geometries.inner.of.bore.radius"
    prepared = vr.prepare(made)
    updated = vr.render(prepared.updated({address: 0.3}), progress=False)["RGB"]
    assert np.array_equal(updated, vr.render(vr.replaced(made, address, 0.3), progress=False)["RGB"])
    assert not np.array_equal(updated, vr.render(prepared, progress=False)["RGB"])


def test_an_operand_that_names_the_material_of_the_layer_has_no_colour() -> None:
    """So its own kd is seen, even if all colours are black."""
    named = replace(DRILLED, of=DRILLED.of | {"dent": replace(DRILLED.of["dent"], material="paint")})
    of_data = scene(named, color=(0.0, 0.0, 0.0))
    assert used_materials(of_data)["paint"].kd == MATERIALS["paint"].kd != (0.0, 0.0, 0.0)
    assert not differences(of_data, written_out(of_data))


def test_colours_that_no_operand_shows_are_reported() -> None:
    """They are not, if one operand has no material of its own."""
    every = {name: replace(x, material="red") for name, x in DRILLED.of.items()}
    text = "data.layers.rain.color: is not seen, as all operands of geometries.shape have materials of their own"
    assert text in vr.explain(scene(replace(DRILLED, of=every))).notes
    assert not [note for note in vr.explain(scene(DRILLED)).notes if "is not seen" in note]


def test_rows_have_names_and_labels() -> None:
    made, image, names = with_rows(DRILLED)
    seen = {names[i] for i in np.unique(image["id"]) if i}
    rows = {name for name in seen if name.startswith("data.rain.")}
    assert len(rows) > 3 and rows < {f"data.rain.{i}" for i in range(N)}
    assert made.data.row("rain", "row 7") == 7
    large = replace(made, data=replace(made.data, legend=vr.Legend()), film=vr.Film(width=240, height=180))
    assert "legend" in vr.render(large, progress=False).layers


def test_rows_of_glass_are_nested_as_written_out_ones() -> None:
    """Where two overlap, the smaller counts. One row is measured, and the others have its volume times that of their
    frames. Closed form: a block minus half a ball."""
    clear = {"kt": (0.9, 0.9, 0.9), "ior": 1.4}
    glass = {"paint": vr.Material(**clear, colored=("ks",)), "red": vr.Material(**clear | {"kt": (0.5, 0.9, 0.9)})}
    shape = vr.Csg(op="difference", of=(BLOCK, vr.Sphere(center=(0, 1, 0), radius=0.5, material="red")))
    of_data = scene(shape, glass, lon=np.linspace(30, 60, N), lat=np.full(N, 30.0), color=None)
    assert not differences(of_data, written_out(of_data))
    (columns,) = data_columns(of_data, arrays("llvm", "single"))
    volume, error = columns.kind.volumes(columns.numbers, None)
    frames = np.stack([v.T for v in of_data.data.rows["rain"].fields["frame"][:3]], axis=2)
    factor = np.abs(np.linalg.det(frames))
    assert np.all(np.abs(volume - (4 - np.pi / 12) * factor) < error) and np.all(error < 0.02 * volume)
    assert np.ptp(volume / factor) < 1e-12 * volume[0] / factor[0]


# Solids of two kinds that overlap, a half-space among them, with one of a material of its own.
GLASSES = vr.Csg(
    op="union",
    of={
        "ball": vr.Sphere(center=(0, 0.5, 0), radius=0.6),
        "inner": vr.Sphere(center=(0.2, 0.6, 0.2), radius=0.5, material="red"),
        "block": replace(BLOCK, cut=(vr.Plane(point=(0.5, 0, 0), normal=(-1, 0, 0)),)),
    },
)


# Geometries, and the materials of their operands, by the ends of their addresses; None for an object that has none.
STORIES = {
    "drilled": (DRILLED, {".of.block": "paint", ".of.bore": "blue", ".of.dent": "red"}),
    "union": (GLASSES, {".of.ball": "paint", ".of.inner": "red", ".of.block": "paint", ".of.block.cut.0": "paint"}),
    "plain": (BLOCK, {None: "paint"}),
}


@pytest.mark.parametrize("name", STORIES)
def test_the_story_of_a_pixel_names_the_operand_of_a_row_and_its_material(name: str) -> None:
    shape, materials = STORIES[name]
    clear = {"kt": (0.4, 0.4, 0.4), "ior": 1.1}
    glass = {"paint": vr.Material(**clear, colored=("kd",)), "red": vr.Material(**clear, kd=(0.8, 0.1, 0.1))}
    made = scene(shape, glass if name == "union" else {})
    prepared = vr.prepare(replace(made, settings=vr.Settings(depth=0), lights={}))
    rows, found = prepared.scene.data.rows["rain"], {}
    for x, y in product(range(6, 48, 6), range(6, 36, 6)):
        (first, *_) = why(prepared, x, y).surfaces
        if first.object and first.object.startswith("data.rain."):
            operand = first.operand and first.operand.removeprefix("geometries.shape")
            material = found[operand] = first.material["address"].removeprefix("materials.")
            own = rows.color[:, rows.index(int(first.object.split(".")[2]))]
            kd = own if material == "paint" else prepared.scene.materials[material].kd
            assert np.allclose(first.material["kd"], kd, atol=1e-6)
    assert len(found) > (name != "plain") and found.items() <= materials.items()


def glasses() -> vr.Scene:
    clear = {"kt": (0.4, 0.5, 0.5), "kd": (0.2, 0.2, 0.2)}
    return scene(
        GLASSES, {"paint": vr.Material(**clear, ior=1.2, colored=("kd",)), "red": vr.Material(**clear, ior=1.5)}
    )


def test_rows_that_are_unions_of_glass_are_several_bodies() -> None:
    """As an object that is written. All bodies of a row have its number and its name."""
    of_data = glasses()
    twin = written_out(of_data)
    assert features(of_data).names() == features(twin).names()
    columns = data_columns(of_data, arrays("llvm", "single"))
    assert [(len(x.bodies), x.color is not None) for x in columns] == [(1, True), (1, False), (1, True)]
    assert all(list(x.object) == list(range(2, N + 2)) for x in columns)
    assert [x.names[N - 1] for x in columns] == 3 * [f"data.rain.{N - 1}"]
    assert overlaps(of_data)[1] == overlaps(twin)[1] >= 3 * N


@pytest.mark.slow
@pytest.mark.parametrize("address", ["data.rain.6.height", "materials.red.ior", "geometries.shape.of.ball.radius"])
def test_updates_of_unions_of_glass_have_the_bits_of_new_scenes(address: str) -> None:
    value = {"data.rain.6.height": 4.0, "materials.red.ior": 1.3, "geometries.shape.of.ball.radius": 0.5}[address]
    updated = vr.render(vr.prepare(glasses()).updated({address: value}), progress=False)["RGB"]
    assert np.array_equal(updated, vr.render(vr.replaced(glasses(), address, value), progress=False)["RGB"])


@pytest.mark.slow
def test_rows_become_several_bodies_when_they_become_transparent() -> None:
    clear = dict.fromkeys(("materials.paint.kt", "materials.red.kt"), (0.4, 0.5, 0.5))
    of_glass = {"glass": vr.Material(kt=(0.5, 0.5, 0.5))}
    made = scene(GLASSES, of_glass)
    made = replace(made, objects={"ball": replace(made.objects["ball"], material="glass")})
    new = made
    for address, value in clear.items():
        new = vr.replaced(new, address, value)
    a, b = (vr.render(x, progress=False)["RGB"] for x in (vr.prepare(made).updated(clear), new))
    assert np.array_equal(a, b)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drilled", "rows of rings", "mesh"])
def test_all_accelerators_find_the_same_rows(name: str) -> None:
    """Of so many rows that they are in lists, or in a tree."""
    count = 150
    angle = np.arange(count) * 137.5
    source = {"lon": angle % 360 - 180, "lat": np.degrees(np.arcsin(np.linspace(-0.9, 0.9, count))), "rain": angle + 1}
    of_data = scene(SHAPES[name], source=source, color=None, height=0.3, radius=0.1)
    pictures = [
        vr.render(vr.replaced(of_data, "settings.accelerator", way), progress=False)
        for way in ("none", "lists", "tree", "auto")
    ]
    assert np.unique(pictures[0]["id"]).size > 60
    for other in pictures[1:]:
        assert all(np.array_equal(pictures[0][k], other[k], equal_nan=True) for k in other.layers)


@pytest.mark.slow
def test_unions_of_glass_have_the_bits_and_the_derivatives_of_written_out_ones() -> None:
    of_data, address = glasses(), "data.rain.6.color"
    assert not differences(of_data, written_out(of_data))
    seen = replace(of_data, settings=vr.Settings(spp=1, precision="double", shadows=False))
    attached = vr.derivative(seen, address, progress=False)
    assert np.abs(attached).max() > 1e-4
    assert attached == pytest.approx(vr.difference(seen, address), rel=1e-6, abs=1e-9)
