"""Controls of scenes: each continuous value has one, and what it reaches fits into the scene."""

import contextlib
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from light_samples import LIGHT_NAMES, light_sample
from samples import NAMES, SAMPLES
from test_updated import compiled

import visray as vr
from visray import camera, lights, textures
from visray.data import base
from visray.errors import UserError
from visray.live.controls import Control, control
from visray.live.fields import Limits
from visray.live.ranges import nice, range_of
from visray.live.search import Controls, search
from visray.output.curves import curve
from visray.scene.address import changed, numeric_addresses, value
from visray.scene.check import checked

SCENES = Path(__file__).resolve().parents[1] / "scenes"
MATERIALS = {"red": vr.Material(kd=(0.8, 0.1, 0.1), ks=(0.3, 0.3, 0.3), kt=(0.2, 0.2, 0.2))}
TABLE = {"lon": [0.0, 10.0, 20.0], "lat": [50.0, 51.0, 52.0], "rain": [3.0, 1.0, 2.0], "name": ["Ulm", "Bonn", "Jena"]}
BASES = {kind.__dataclass_fields__["type"].default: kind() for kind in base.KINDS}


def rained(**more) -> vr.Scene:
    """A scene with rain in three towns."""
    layer = {"source": TABLE, "value": "rain", "gizmo": "cylinder", "radius": 0.1, **more}
    return checked(vr.Scene(data=vr.Data(layers={"rain": vr.DataLayer(**layer)}), camera=vr.Camera(), lights={}))


def scene_of(what: str) -> vr.Scene:
    """A scene with one thing of a kind."""
    if what in NAMES:
        posed = SAMPLES[what].posed
        thing = replace(posed, material="red", transform=(vr.Rotate(rotate=10.0), vr.Scale(scale=2.0)))
        return checked(vr.Scene(materials=MATERIALS, objects={"it": thing}, camera=vr.Camera(), lights={}))
    if what in LIGHT_NAMES:
        return checked(vr.Scene(lights={"it": light_sample(what).posed}, camera=vr.Camera()))
    if what in BASES:
        return checked(replace(rained(), data=replace(rained().data, base=BASES[what])))
    kinds = {kind.type: kind for kind in camera.KINDS}
    if what in kinds:
        return checked(vr.Scene(camera=kinds[what](shutter=vr.Shutter()), lights={}))
    checker = textures.CheckerTexture()
    return checked(
        vr.Scene(
            materials=MATERIALS, textures={"it": checker}, background=(0.1, 0.2, 0.3), camera=vr.Camera(), lights={}
        )
    )


WHAT = [*NAMES, *LIGHT_NAMES, *BASES, *(kind.type for kind in camera.KINDS), "material"]


def reached(c: Control) -> dict[str, object]:
    """Values that a control reaches: its ends and between."""
    count = len(c.value) if type(c.value) is tuple else 0
    at = [c.low, c.low + 0.4 * (c.high - c.low), c.high]
    if not c.has_slider:
        at = [x if math.isfinite(x) else c.value for x in at]
    if c.kind == "range":
        return {"whole": (c.low, c.high), "part": (at[1], c.high)}
    return {name: (x,) * count if count else x for name, x in zip(("low", "between", "high"), at)}


@pytest.mark.parametrize("what", WHAT)
def test_each_number_of_a_scene_has_a_control(what):
    scene = scene_of(what)
    controls = Controls(scene)
    for address in numeric_addresses(scene):
        now = value(scene, address)
        # A mesh has a table of vertices, which no slider changes.
        if now is None or not isinstance(now, (float, tuple)) or not controls.texts.keys() & {address}:
            unread = type(scene.lights.get("it")) is vr.DirectionalLight and address.split(".")[-1] in "bc"
            assert now is None or not isinstance(now, (float, tuple)) or unread, address
            continue
        c = controls.at(address)
        assert c.value == now
        numbers = now if isinstance(now, tuple) else (now,)
        assert all(c.low <= x <= c.high for x in numbers)
        assert 0 < c.step <= c.high - c.low
        assert c.label and c.owner and address in c.hint


@pytest.mark.parametrize("what", WHAT)
def test_what_a_control_reaches_is_taken_or_refused_for_a_reason(what):
    scene = scene_of(what)
    taken = 0
    for c in Controls(scene):
        for new in reached(c).values():
            try:
                after = changed(scene, c.assignments(new))
            except UserError as error:
                # Only fields that depend on each other refuse values; the message is about the right thing.
                assert all(line.split(".")[0] == c.address.split(".")[0] for line in error.lines), error.lines
                continue
            assert value(after, c.address) == pytest.approx(c.centred(new))
            taken += 1
    assert taken


@pytest.mark.parametrize("what", WHAT)
def test_limits_of_single_numbers_hold(what):
    # A number that does not depend on others is never refused; a shutter closes after it opens.
    scene = scene_of(what)
    for c in Controls(scene):
        if type(c.value) is float and c.group in ("light", "camera", "material") and "shutter" not in c.label:
            for new in reached(c).values():
                assert value(changed(scene, c.assignments(new)), c.address) == pytest.approx(new)


def test_kinds():
    spot, plane = light_sample("SpotLight").posed, vr.Plane(transform=(vr.Rotate(rotate=3.0),))
    scene = checked(vr.Scene(materials=MATERIALS, lights={"it": spot}, objects={"it": plane}, camera=vr.Camera()))
    at = {a: Controls(scene).at(a) for a in Controls(scene).texts}
    kinds = {a: c.kind for a, c in at.items()}
    assert kinds["materials.red.kd"] == "color" and kinds["materials.red.kr"] == "share"
    assert kinds["objects.it.normal"] == "direction" and kinds["objects.it.point"] == "vector"
    assert kinds["camera.fov"] == kinds["lights.it.angle"] == kinds["objects.it.transform.0.rotate"] == "angle"
    assert kinds["lights.it.intensity"] == "number"
    assert (at["objects.it.transform.0.rotate"].low, at["objects.it.transform.0.rotate"].high) == (-180, 180)
    assert (at["camera.fov"].group, at["camera.fov"].owner, at["camera.fov"].label) == ("camera", "camera", "fov")
    red = at["materials.red.kd"]
    assert (red.group, red.owner, red.label) == ("material", "materials.red", "kd")
    assert (at["ambient"].owner, at["background.top"].label) == ("scene", "background.top")
    # An unlimited length has no slider.
    assert not at["materials.red.dmax"].has_slider
    assert control(scene, "objects.it.material", 1.0) is None
    assert control(scene, "objects.no.radius", 1.0) is None


colours = st.tuples(*[st.floats(0, 1)] * 3)


@given(colours)
def test_a_colour_that_is_not_touched_keeps_all_digits(rgb):
    scene = checked(vr.Scene(ambient=rgb, camera=vr.Camera(), lights={}))
    c = control(scene, "ambient", 1.0)
    assert c.picked(c.picker) == rgb
    # The picker shows sRGB, rounded to 8 bits.
    assert np.abs(np.array(c.picker) - 255 * curve(np.array(rgb), "srgb")).max() <= 0.5 + 1e-9


@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_a_picked_colour_is_shown_as_it_was_picked(rgb):
    c = control(vr.Scene(camera=vr.Camera(), lights={}), "ambient", 1.0)
    light = c.picked(rgb)
    assert c.with_value(light).picker == rgb
    assert max(light) <= 1


def test_a_bright_colour_keeps_its_brightness():
    scene = checked(vr.Scene(lights={"it": vr.PointLight(position=(0, 5, 0), Id=(4.0, 2.0, 1.0))}, camera=vr.Camera()))
    c = control(scene, "lights.it.Id", 1.0)
    assert c.scale == 4 and c.picker[0] == 255
    assert c.picked((255, 255, 255)) == (4.0, 4.0, 4.0)
    # A darker colour does not make the picker brighter.
    assert c.with_value((1.0, 1.0, 1.0)).scale == 4


def test_colours_of_data_are_those_of_a_screen():
    c = Controls(rained(color=(0.2, 0.4, 0.6))).at("data.layers.rain.color")
    assert (c.kind, c.shown, c.picker) == ("share", "srgb", (51, 102, 153))
    assert c.picked((255, 0, 51)) == (1.0, 0.0, 0.2)


@pytest.mark.parametrize("x, expected", [(1, 1), (1.2, 2), (2, 2), (3, 5), (7, 10), (0.03, 0.05), (1e-7, 1e-7)])
def test_nice_numbers(x, expected):
    assert nice(x) == pytest.approx(expected)


@given(st.floats(0, 1e7), st.floats(1e-3, 1e6))
def test_ranges_contain_the_value_and_keep_limits(x, extent):
    limits = Limits(least=0.0, most=1e9, open_least=True)
    low, high, step, has_slider = range_of("radius", (x,), limits, extent)
    assert has_slider and low <= x <= high and step > 0
    assert x == 0 or low > 0
    assert (high - low) / step <= 5000


@pytest.mark.parametrize("color, rule", [("rain", True), (None, True), (vr.ColorRule(column="rain"), False)])
def test_the_range_of_a_palette_has_a_control(color, rule):
    scene = rained(color=color)
    c = Controls(scene).at("data.layers.rain.color.domain")
    assert (c.kind, c.value, c.rule is not None) == ("range", (1.0, 3.0), rule)
    assert c.low < 1 and c.high > 3
    after = changed(scene, c.assignments((0.5, 2.5)))
    found = after.data.rows["rain"].rules["color"]
    assert (found.lo, found.hi) == (0.5, 2.5)
    assert Controls(after).at("data.layers.rain.color.domain").value == (0.5, 2.5)


def test_the_range_of_a_symmetric_palette_keeps_its_middle():
    scene = rained(color=vr.ColorRule(column="rain", norm="symmetric", center=2.0, palette="RdBu"))
    c = Controls(scene).at("data.layers.rain.color.domain")
    assert c.value == (1.0, 3.0) and c.center == 2
    # The end that moves takes the other one along.
    assert c.assignments((1.0, 4.0)) == {c.address: (0.0, 4.0)}
    assert changed(scene, c.assignments((0.5, 3.0))).data.rows["rain"].rules["color"].hi == 3.5


def test_numbers_of_rows_have_controls_and_are_found_by_name():
    controls = Controls(rained())
    found = search(controls, "bonn height", 5)
    assert [c.address for c in found.controls] == ["data.rain.1.height"]
    assert found.controls[0].value == 1.0
    assert value(changed(controls.scene, found.controls[0].assignments(2.5)), "data.rain.1.height") == 2.5
    of_row = [c.address for c in controls.of_object("data.rain.2", 10).controls]
    assert of_row[0].startswith("data.rain.2.") and any(a.startswith("materials.") for a in of_row) is False
    assert any(a.startswith("data.layers.rain.") for a in of_row)


def test_the_date_of_data_has_a_control():
    months = {"lon": [0.0, 0.0, 5.0, 5.0], "lat": [50.0, 50.0, 51.0, 51.0], "rain": [1.0, 2.0, 3.0, 4.0],
              "name": ["a", "a", "b", "b"], "month": ["2020-01", "2020-07", "2020-01", "2020-07"]}  # fmt: skip
    scene = rained(source=months, time="month")
    c = Controls(scene).at("data.date")
    assert c.value == pytest.approx(2020, abs=1e-5) and c.high == pytest.approx(2020.5, abs=0.01)
    for new in (c.low, 2020.25, c.high):
        after = changed(scene, c.assignments(new))
        assert Controls(after).at("data.date").value == pytest.approx(new, abs=1e-5)
    # Halfway between the two months is halfway between the numbers.
    assert value(changed(scene, {"data.date": 2020.2486}), "data.rain.0.height") == pytest.approx(1.5, abs=0.01)
    assert Controls(rained()).at("data.date") is None


def test_what_is_not_read_has_no_control():
    controls = Controls(rained(color=vr.ColorRule(column="rain")))
    assert not [a for a in controls.texts if a.endswith((".center", ".exponent")) and ".color." in a]
    assert [
        a for a in Controls(rained(color=vr.ColorRule(column="rain", norm="power"))).texts if a.endswith("exponent")
    ]


def test_what_a_track_moves_says_so():
    controls = Controls(vr.load(SCENES / "heart-beat.json"))
    c = controls.at("objects.heart.parameters.beat")
    assert c.track and c.track in c.hint
    assert not controls.at("camera.fov").track


BALLS = checked(vr.Scene(
    materials=MATERIALS | {"Blue": vr.Material()},
    objects={f"ball {i}": vr.Sphere(center=(float(i), 0.0, 0.0), material="Blue") for i in range(10_000)},
    camera=vr.Camera(), lights={},
))  # fmt: skip


def test_search_in_a_large_scene():
    controls = Controls(BALLS)
    assert len(controls) > 20_000
    found = search(controls, "BALL radius", 7)
    assert len(found.controls) == 7 and found.more == 9_993
    assert search(controls, "ball.77.radius", 3).controls[0].address == "objects.ball 77.radius"
    assert [c.address for c in search(controls, "blue kd", 3).controls] == ["materials.Blue.kd"]
    assert [c.address for c in search(controls, "ball 9999 y", 3).controls] == ["objects.ball 9999.center.1"]
    assert search(controls, "ball 9999 y", 3).controls[0].value == 0.0
    red = search(controls, "ambient r", 3).controls
    assert [(c.address, c.value, c.high) for c in red] == [("ambient.0", 0.2, 2.0)]
    nothing = search(controls, "no such thing", 3)
    assert (nothing.controls, nothing.more) == ((), 0)
    assert search(controls, "   ", 3).controls == ()


def test_materials_and_lights_come_before_objects():
    found = Controls(BALLS).relevant(30)
    assert len(found.controls) == 30 and found.more == len(Controls(BALLS)) - 30
    owners = [c.owner for c in found.controls]
    assert "materials.Blue" in owners and "camera" in owners
    assert owners.index("camera") < next(i for i, owner in enumerate(owners) if owner.startswith("objects."))


def test_parameters_of_a_polynomial_come_first():
    heart = vr.Polynomial(expression="x^2 + y^2 - z^2 - a", parameters={"a": 0.5})
    found = Controls(checked(vr.Scene(objects={"it": heart}, camera=vr.Camera(), lights={}))).relevant(5)
    assert found.controls[0].address == "objects.it.parameters.a"
    assert (found.controls[0].low, found.controls[0].high) == (-1, 1)


def test_controls_of_an_object_have_those_of_its_materials():
    controls = Controls(BALLS)
    owners = {c.owner for c in controls.of_object("ball 3", 30).controls}
    assert owners == {"objects.ball 3", "materials.Blue"}
    assert controls.of_object("no ball", 30).controls == ()


def test_of_csg_the_clicked_operand_comes_first_and_the_materials_are_shown():
    balls = tuple(vr.Sphere(center=(float(i), 0.0, 0.0), material="red") for i in range(20))
    scene = checked(
        vr.Scene(
            materials=MATERIALS,
            objects={"all": vr.Csg(op="union", of=balls, material="red")},
            camera=vr.Camera(),
            lights={},
        )
    )
    found = Controls(scene).of_object("objects.all.of.7", 20)
    addresses = [c.address for c in found.controls]
    assert addresses[:2] == ["objects.all.of.7.center", "objects.all.of.7.radius"]
    assert "materials.red.kd" in addresses and len(addresses) == 20
    own = [a for a in Controls(scene).texts if a.startswith(("objects.all.", "materials.red."))]
    assert found.more == len(own) - 20


def test_controls_of_a_segment_of_a_line_are_those_of_its_row():
    controls = Controls(rained())
    assert controls.of_object("data.rain.2:0", 30) == controls.of_object("data.rain.2", 30)
    assert controls.of_object("data.base", 30).controls[0].owner == "data.base"


def test_rows_of_lines_have_no_controls():
    """Their numbers cannot be changed."""
    scene = vr.load(SCENES / "data-outlines.json")
    rows = [a for a in Controls(scene).texts if a.startswith("data.countries.")]
    assert rows == []
    assert len(scene.data.rows["countries"].number)
    assert any(a.startswith("data.rain.") for a in Controls(rained()).texts)


def test_a_priority_is_typed_in_whole_steps():
    for scene in (
        vr.Scene(materials={"red": vr.Material(priority=p)}, camera=vr.Camera(), lights={}) for p in (0.0, -3.0, 250.0)
    ):
        found = Controls(checked(scene)).at("materials.red.priority")
        assert not found.has_slider
        assert found.step == 1.0
        assert found.low < -1e6 and found.high > 1e6


def test_controls_of_another_scene_have_its_values():
    controls = Controls(BALLS)
    assert len(controls)
    moved = controls.with_scene(changed(BALLS, {"objects.ball 3.radius": 2.0}))
    assert moved.at("objects.ball 3.radius").value == 2.0
    assert moved.texts is controls.texts


def test_every_kind_is_tried():
    # The scenes of these tests have all fields of all kinds.
    tried = {type(part) for what in WHAT for part in things(scene_of(what))}
    wanted = {*(SAMPLES[n].kind for n in NAMES), *lights.KINDS, *camera.KINDS, vr.Material, textures.CheckerTexture}
    assert wanted <= tried


def things(scene: vr.Scene) -> list:
    """The entries of a scene."""
    return [
        scene.camera, *scene.objects.values(), *scene.lights.values(), *scene.materials.values(),
        *scene.textures.values(),
    ]  # fmt: skip


# Fields in which 0 leaves an effect out: moving them from 0, or to 0, needs another kernel. What compiles at each new
# value has no slider (controls.is_code). A camera that comes to lie on a surface has another kernel as well.
CROSSING = ("aperture", "ks", "kr", "kt", "kd", "ka", "a", "b", "c", "Id", "Is", "Ia", "intensity", "ambient")
SMALL = checked(vr.Scene(
    film=vr.Film(width=16, height=12),
    materials={"red": vr.Material(kd=(0.8, 0.1, 0.1), ks=(0.3, 0.3, 0.3), shininess=20.0)},
    lights={"key": vr.PointLight(position=(3, 5, 4)), "spot": vr.SpotLight(position=(2, 4, 3), direction=(-1, -2, -1))},
    objects={
        "floor": vr.Plane(point=(0, -1, 0)),
        "ball": vr.Sphere(radius=0.7, material="red", transform=(vr.Rotate(rotate=5.0), vr.Scale(scale=1.1))),
        "egg": vr.Polynomial(expression="x^2 + a*y^2 + z^2 - b", parameters={"a": 0.7, "b": 0.9}, clip=vr.Ball()),
    },
    settings=vr.Settings(spp=1), camera=vr.Camera(),
))  # fmt: skip


def moved(c: Control) -> list:
    """Values of a control at three places within its range."""
    at = [c.low + share * (c.high - c.low) for share in (0.37, 0.61, 0.83)]
    if c.kind == "range":
        return [(c.value[0], x) for x in at if x > c.value[0]]
    if type(c.value) is tuple:
        return [tuple(v if i else x for i, v in enumerate(c.value)) for x in at]
    return at


def compilations(scene: vr.Scene) -> dict[str, list[int]]:
    """By the address of each slider how many kernels each of its values compiles. Of controls that are alike in all but
    the name of their entry, one is tried."""
    prepared = vr.prepare(replace(scene, film=SMALL.film, settings=replace(scene.settings, spp=1)))
    vr.render(prepared, progress=False, legend=False)
    result, alike = {}, set()
    for c in Controls(prepared.scene):
        form = (c.group, c.label, type(prepared.scene.objects.get(c.owner.removeprefix("objects."))))
        crosses = c.group == "camera" or (c.group != "object" and c.label in CROSSING)
        if crosses or not c.has_slider or form in alike:
            continue
        alike.add(form)
        counts = result[c.address] = []
        for new in moved(c):
            with contextlib.suppress(UserError):  # a value that does not fit to others
                after = prepared.updated(c.assignments(new))
                counts.append(compiled(lambda after=after: vr.render(after, progress=False, legend=False)))
    return result


def test_moving_a_slider_compiles_nothing():
    counts = compilations(SMALL)
    assert {"objects.egg.parameters.a", "objects.ball.radius", "materials.red.shininess"} <= counts.keys()
    # The first value may compile what packs values of its kind. Expected: the others find it.
    assert {a: n for a, n in counts.items() if any(n[1:])} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["showcase", "heart-beat", "data-globe"])
def test_moving_a_slider_of_a_large_scene_compiles_nothing(name):
    counts = compilations(vr.load(SCENES / f"{name}.json"))
    assert len(counts) > 10
    assert {a: n for a, n in counts.items() if any(n[1:])} == {}


def test_a_kd_says_whether_ka_follows():
    materials = {"a": vr.Material(color="red"), "b": vr.Material(ka=(1, 0, 0), kd=(1, 0, 0))}
    materials["c"] = replace(materials["b"], shading="unlit")
    objects = {name: vr.Sphere(material=name) for name in materials}
    controls = Controls(vr.Scene(camera=vr.Camera(), lights={}, materials=materials, objects=objects))
    assert controls.at("materials.a.ka") is None and "ka" not in controls.at("materials.a.kd").hint
    assert controls.at("materials.b.kd").hint.endswith("; ka is written, so that ambient light keeps its colour")
    assert "ka" not in controls.at("materials.c.kd").hint and "ka" not in controls.at("materials.b.ks").hint
