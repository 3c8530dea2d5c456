"""Data scenes: what rows become, their addresses, their numbers in pictures, and their derivatives."""

import warnings
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray.data.gizmos import GIZMOS
from visray.errors import UserError
from visray.scene.check import checked
from visray.setup import prepare
from visray.written_out import written_out

RNG = np.random.default_rng(7)
N = 40
LON, LAT = RNG.uniform(-170, 170, N), np.degrees(np.arcsin(RNG.uniform(-0.95, 0.95, N)))
RAIN, HEAT = RNG.uniform(1, 9, N), RNG.uniform(-5, 30, N)
SOLIDS = tuple(name for name in GIZMOS if name not in ("line", "geometry"))
BASES = {"globe": vr.GlobeBase(radius=1.0), "map": vr.MapBase(width=4.0), "plane": vr.PlaneBase(width=4.0)}
TETRAHEDRON = vr.Mesh(
    vertices=[[1, 0, 0], [-0.5, 0, 0.8], [-0.5, 0, -0.8], [0, 1, 0]], faces=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)


def layer(gizmo: str, **fields) -> vr.DataLayer:
    source = {"lon": LON, "lat": LAT, "rain": RAIN, "heat": HEAT}
    sizes = {"radius": vr.SizeRule(column="rain", range=(0.02, 0.12))}
    if "height" in GIZMOS[gizmo].sizes:
        sizes["height"] = vr.SizeRule(column="rain", range=(0.1, 0.6))
    if gizmo == "geometry":
        sizes["geometry"] = "shape"
    return vr.DataLayer(**{"source": source, "gizmo": gizmo, "color": "heat", "material": "paint"} | sizes | fields)


def scene(gizmo: str, base: str = "globe", shape: vr.Sphere | None = None, **fields) -> vr.Scene:
    made = vr.Scene(
        camera=vr.Camera(origin=(2.5, 2.2, 3.0), fov=40),
        film=vr.Film(width=48, height=36),
        lights={"key": vr.PointLight(position=(4, 6, 5))},
        # Colours replace kd; products with them may have other last bits (test_colored.py).
        materials={"paint": vr.Material(ks=(0.3, 0.3, 0.3), shininess=16.0, colored=("kd",))},
        geometries={"shape": shape or TETRAHEDRON} if gizmo == "geometry" else {},
        objects={"ball": vr.Sphere(center=(0, 1.6, 0), radius=0.2)},
        data=vr.Data(base=BASES[base], layers={"rain": layer(gizmo, **fields)}),
        settings=vr.Settings(spp=4),
    )
    return checked(made)


CASES = [(gizmo, base) for gizmo in (*SOLIDS, "geometry") for base in ("globe", "map")]


@pytest.mark.parametrize(("gizmo", "base"), CASES)
def test_a_layer_has_the_bits_of_objects_that_are_written_out(gizmo: str, base: str) -> None:
    of_data, twin = scene(gizmo, base), written_out(scene(gizmo, base))
    assert len(twin.objects) == N + 2 and twin.data is None
    a, b = (vr.render(x, progress=False) for x in (of_data, twin))
    assert list(a.layers) == list(b.layers)
    for name in a.layers:
        assert np.array_equal(a[name], b[name], equal_nan=True), name
    assert np.unique(a["id"]).size > 5  # rows are in the picture


def test_other_geometries_are_gizmos_too() -> None:
    shape = vr.Torus(major=0.8, minor=0.2, transform=(vr.Rotate(rotate=30, axis=(1, 0, 0)),))
    of_data = scene("geometry", shape=shape)
    a, b = (vr.render(x, progress=False)["RGB"] for x in (of_data, written_out(of_data)))
    assert np.array_equal(a, b)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("gizmo", SOLIDS)
def test_gizmos_stand_on_the_base(gizmo: str, base: str) -> None:
    for sunk in (0.0, 0.25):
        made = scene(gizmo, base, sunk=sunk)
        rows = made.data.rows["rain"]
        ground = made.data.base.place(LON, LAT)
        for i in range(0, N, 7):
            low, high = heights(rows.object(i), ground.point[i], ground.up[i])
            tall = 2 * rows.stand.radius[i] if gizmo == "sphere" else rows.stand.height[i]
            if GIZMOS[gizmo].flat:
                assert low == pytest.approx(high) and 0 < low < 0.01
            else:
                assert (low, high) == pytest.approx((-sunk * tall, (1 - sunk) * tall), abs=1e-9)


def heights(thing: vr.Sphere, foot: np.ndarray, up: np.ndarray) -> tuple[float, float]:
    """Least and greatest height of an object above its foot, along `up`, by the support of each kind."""
    if isinstance(thing, vr.Sphere):
        middle, half = np.array(thing.center), thing.radius
    elif isinstance(thing, vr.Disk):
        middle, half = np.array(thing.center), 0.0
    elif isinstance(thing, vr.Triangle):
        corners = (np.array([thing.a, thing.b, thing.c]) - foot) @ up
        return corners.min(), corners.max()
    elif isinstance(thing, vr.Box):
        matrix = np.array(thing.transform[0].matrix)
        middle, half = matrix[:, 3], np.abs(up @ matrix[:, :3]).sum()
    else:
        axis = np.array(thing.axis)
        assert np.abs(np.cross(axis, up)).max() < 1e-12
        start = np.array(thing.base) if isinstance(thing, vr.Cone) else np.array(thing.center) - axis * thing.height / 2
        return (start - foot) @ up, (start - foot) @ up + thing.height
    return (middle - foot) @ up - half, (middle - foot) @ up + half


def test_negative_values_hang_down() -> None:
    change = np.where(np.arange(N) % 2 == 0, RAIN, -RAIN)
    made = scene("cylinder", "map", source={"lon": LON, "lat": LAT, "rain": change, "heat": HEAT}, radius=0.05)
    rows = made.data.rows["rain"]
    for i in range(N):
        low, high = heights(rows.object(i), rows.ground.point[i], rows.ground.up[i] * rows.stand.sign[i])
        # A bar that hangs begins a little below the map: its end would lie in it.
        below = 0.001 * made.data.base.size if change[i] < 0 else 0.0
        assert low == pytest.approx(below, abs=1e-12) and high - low == pytest.approx(rows.stand.height[i])
        assert rows.object(i).center[1] * change[i] > 0
    rule = vr.SizeRule(column="rain", negative="refuse")
    with pytest.raises(UserError, match=r"data\.layers\.rain\.height\.\w+.*row 1 "):
        scene("cylinder", source={"lon": LON, "lat": LAT, "rain": change, "heat": HEAT}, radius=0.05, height=rule)


def test_missing_numbers_are_counted() -> None:
    rain, heat, lat = RAIN.copy(), HEAT.copy(), LAT.copy()
    rain[3], rain[4], heat[5], lat[6] = np.nan, 0.0, np.nan, np.nan
    made = scene("cylinder", source={"lon": LON, "lat": lat, "rain": rain, "heat": heat}, radius=0.05,
                 height=vr.SizeRule(column="rain", range=(0.0, 0.5)))  # fmt: skip
    rows = made.data.rows["rain"]
    assert rows.number.tolist() == [i for i in range(N) if i not in (3, 4, 6)]
    assert rows.counts == {"without a position": 1, "without a height": 1, "of height 0": 1,
                           "in the colour of missing values": 1}  # fmt: skip
    with pytest.warns(UserWarning, match=r"data\.layers\.rain: 37 rows are shown, and not: 1 without a position"):
        prepare(made)
    names = list(made.all_objects)
    assert names[:4] == ["ball", "data.base", "data.rain.0", "data.rain.1"] and "data.rain.3" not in names
    assert len(names) == len(made.all_objects) == 39
    assert [name in made.all_objects for name in ("data.rain.5", "data.rain.6", "data.snow.1")] == [True, False, False]


def test_rows_have_addresses_numbers_and_names() -> None:
    made = scene("cylinder")
    assert vr.value(made, "data.rain.12.height") == RAIN[12] and vr.value(made, "data.rain.12.color") == HEAT[12]
    other = vr.replaced(made, "data.rain.12.height", 2.5)
    assert vr.value(other, "data.rain.12.height") == 2.5 and vr.value(other, "data.rain.13.height") == RAIN[13]
    assert other.data.rows["rain"].values["radius"][12] == RAIN[12]  # another property of the same column
    assert other.hash() != made.hash()
    image = vr.render(made, progress=False)
    names = {number: name for name, number in __import__("json").loads(image.metadata["objects"]).items()}
    seen = [names[i] for i in np.unique(image["id"]) if i]
    assert any(name.startswith("data.rain.") for name in seen) and {*seen} <= {*made.all_objects}
    for name in seen:
        assert list(made.all_objects)[next(i for i, n in names.items() if n == name) - 1] == name


@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("data.rain.99.height", "shows no row 99; it shows 40 rows, from 0 to 39"),
        ("data.rain.3.width", "has no 'width'"),
        ("data.rain", "data.layers.rain"),
        ("data.rain.gizmo", "below data.layers.rain"),
        ("data.snow.3.height", "has no 'snow'"),
    ],
)
def test_wrong_addresses_of_rows(address: str, text: str) -> None:
    with pytest.raises(UserError, match=text.replace(".", r"\.")):
        vr.value(scene("cylinder"), address)


CHANGES = {
    "data.rain.12.height": 4.0, "data.rain.12.lon": 20.0, "data.rain.30.color": 3.0, "data.base.radius": 1.1,
    "data.layers.rain.height.range": (0.2, 0.8), "materials.paint.ks": (0.5, 0.5, 0.5), "objects.ball.radius": 0.3,
}  # fmt: skip


@pytest.mark.parametrize("address", CHANGES)
def test_an_update_has_the_bits_of_a_new_scene_and_compiles_nothing(address: str) -> None:
    prepared = vr.prepare(scene("cylinder"))
    vr.render(prepared, progress=False)
    vr.render(prepared.updated({address: CHANGES[address]}), progress=False)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        updated = vr.render(prepared.updated({address: CHANGES[address]}), progress=False)
        missed = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT and not k["cache_hit"]]
    assert not missed
    assert np.array_equal(updated["RGB"], vr.render(vr.replaced(scene("cylinder"), address, CHANGES[address]),
                                                    progress=False)["RGB"])  # fmt: skip


@pytest.mark.parametrize("name", ["height", "radius", "color", "lon", "lat"])
@pytest.mark.parametrize("base", ["globe", "map"])
def test_fields_have_the_derivatives_of_differences(name: str, base: str) -> None:
    for gizmo in SOLIDS:
        made = scene(gizmo, base)
        rows = made.data.rows["rain"]
        if name not in rows.values:
            continue
        step = 1e-6 * max(1.0, abs(rows.values[name][12]))
        sides = []
        for sign in (1, -1):
            other = vr.replaced(made, f"data.rain.12.{name}", float(rows.values[name][12] + sign * step))
            # The rules' domains are those of the data; here they must not change.
            found = other.data.rows["rain"]
            sides.append(found)
        if name == "color":
            slope = (sides[0].color[:, 12] - sides[1].color[:, 12]) / (2 * step)
            assert rows.slopes["color"][:, 12] == pytest.approx(slope, rel=1e-4, abs=1e-6)
            continue
        a = vr.prepare(made).a
        value = a.put(a.D, rows.values[name])
        dr.enable_grad(value)
        table = replace_value(vr.prepare(made), name, value)
        now, outer = table._now()
        arrays = {f: getattr(now, f) for f in rows.fields if f != "frame"}
        if outer is not None:
            arrays |= {f"frame.{i}": getattr(outer, f) for i, f in enumerate("xyzo")}
        for field, array in arrays.items():
            dr.set_grad(value, a.put(a.D, np.eye(N)[12]))
            dr.enqueue(dr.ADMode.Forward, value)
            dr.traverse(dr.ADMode.Forward, dr.ADFlag.ClearInterior)
            found = np.array(dr.grad(array), float).reshape(-1, N)[:, 12]
            pair = [s.fields[field] if "." not in field else s.fields["frame"][int(field[-1])] for s in sides]
            expected = np.atleast_1d((pair[0][..., 12] - pair[1][..., 12]) / (2 * step))
            assert found == pytest.approx(expected, rel=1e-5, abs=1e-7), (gizmo, field)
            break


def replace_value(prepared: vr.Prepared, name: str, value: object) -> object:
    """The table of the rows, with an attached array of values."""
    table = prepared.packed.batches[-1].numbers
    return replace(table, values=replace(table.values, **{name: value}))


@pytest.mark.parametrize("name", ["height", "color"])
def test_a_picture_has_the_derivative_of_differences(name: str) -> None:
    rule = vr.SizeRule(column="rain", range=(0.1, 0.6), domain=(0, 10))
    color = vr.ColorRule(column="heat", domain=(-10, 40))
    made = scene("sphere", radius=replace(rule, range=(0.05, 0.15)), color=color)
    address = f"data.rain.12.{'radius' if name == 'height' else name}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        attached = vr.derivative(made, address, spp=16, progress=False)
        step = vr.difference(made, address, spp=16)
    assert np.abs(attached).max() > 0
    if name == "color":
        assert attached == pytest.approx(step, rel=1e-3, abs=1e-4 * np.abs(step).max())


def test_two_layers_with_one_file(tmp_path) -> None:
    (tmp_path / "rain.csv").write_text("name,lon,lat,rain\nA,0,0,1\nB,90,10,2\nC,-90,-20,3\n")
    text = """{"camera": {}, "lights": {}, "data": {"base": {"type": "globe"}, "layers": {
        "bars": {"source": "rain.csv", "height": "rain"},
        "balls": {"source": "rain.csv", "gizmo": "sphere", "value": "rain"}}}}"""
    (tmp_path / "scene.json").write_text(text)
    made = vr.load(tmp_path / "scene.json")
    bars, balls = made.data.rows["bars"], made.data.rows["balls"]
    assert bars.texts == ("A", "B", "C") and bars.values["height"].tolist() == [1, 2, 3]
    assert bars.color is None and balls.color is not None
    (tmp_path / "again.json").write_text(vr.dump(made, folder=tmp_path))
    assert vr.load(tmp_path / "again.json") == made
    (tmp_path / "rain.csv").write_text("name,lon,lat,rain\nA,0,0,4\n")
    assert vr.load(tmp_path / "scene.json").data.rows["bars"].values["height"].tolist() == [4]


def test_a_file_outside_of_the_folder_is_refused(tmp_path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "rain.csv").write_text("lon,lat\n0,0\n")
    (tmp_path / "inner" / "scene.json").write_text(
        '{"camera": {}, "lights": {}, "data": {"layers": {"a": {"source": "../rain.csv"}}}}'
    )
    with pytest.raises(UserError, match=r"data\.layers\.a\.source.*outside of the scene's folder"):
        vr.load(tmp_path / "inner" / "scene.json")
    assert len(vr.load(tmp_path / "inner" / "scene.json", allow_outside=True).data.rows["a"]) == 1


@pytest.mark.parametrize("more", ['"height": "rain"', '"name": "city", "lon": "x"', '"gizmo": "line", "color": "rain"'])
def test_a_file_that_must_not_be_read_has_one_error(tmp_path, more: str) -> None:
    """Its columns are not known, so nothing is said of them."""
    text = f'{{"camera": {{}}, "lights": {{}}, "data": {{"layers": {{"a": {{"source": "../rain.csv", {more}}}}}}}}}'
    (tmp_path / "scene.json").write_text(text)
    with pytest.raises(UserError) as found:
        vr.load(tmp_path / "scene.json")
    assert len(found.value.lines) == 1 and "data.layers.a.source" in found.value.lines[0]
