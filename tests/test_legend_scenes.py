"""Legends of scenes: what they say about the data, and how they get into pictures and files."""

import json
import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.data.base import GlobeBase, MapBase
from visray.errors import LegendWarning, UserError
from visray.legend.content import legend_content
from visray.legend.drawing import drawn
from visray.legend.fonts import BASE
from visray.output.layers import names_from
from visray.projection import projected
from visray.scene.load import checked
from visray.scene.scene import Film, Scene, Settings

CITIES = {
    "lon": [2.2, -3.7, 2.3, 12.5, 13.4, 174.8],
    "lat": [41.4, 40.4, 48.9, 41.9, 52.5, -36.9],
    "city": ["Barcelona", "Madrid", "Paris", "Roma", "Berlin", "Auckland"],
    "rain": [612.0, 421.0, 637.0, 799.0, 591.0, 1200.0],
    "people": [1.6e6, 3.3e6, 2.1e6, 2.8e6, 3.7e6, None],
}
FILM = Film(width=320, height=200)
EUROPE = MapBase(extent=(-12.0, 34.0, 34.0, 62.0))


def scene_of(layers=None, base=None, camera=None, film: Film = FILM, legend=None, **more) -> Scene:
    base = base or GlobeBase()
    if layers is None:
        layers = {"rain": vr.DataLayer(source=CITIES, height="rain", color="rain")}
    camera = camera or vr.Camera(origin=(2.5, 3.0, -0.6))
    data = vr.Data(base=base, layers=layers, legend=legend or vr.Legend(title="Rain", **more))
    lights = {"sun": vr.DirectionalLight(direction=(-1.0, -2.0, 0.5))}
    return checked(Scene(camera=camera, film=film, data=data, settings=Settings(spp=1), lights=lights))


def labels_of(scene: Scene) -> tuple[list[str], list[str]]:
    content = legend_content(scene)
    return [bar.label for bar in content.bars], [scale.label for scale in content.sizes]


# What it says


def test_keys_are_named_by_their_columns_or_as_the_legend_says() -> None:
    assert labels_of(scene_of()) == (["rain"], ["rain"])
    named = scene_of(labels={"rain": "Rain per year"}, units={"rain": "mm"})
    assert labels_of(named) == (["Rain per year (mm)"], ["Rain per year (mm)"])
    assert labels_of(scene_of(bars=False)) == ([], ["rain"])
    assert labels_of(scene_of(sizes=False)) == (["rain"], [])
    place = {"lon": CITIES["lon"], "lat": CITIES["lat"]}
    layers = {"wind": vr.DataLayer(**place, value=CITIES["rain"]), "plain": vr.DataLayer(**place, color="#ff6347")}
    assert labels_of(scene_of(layers, units={"wind": "m/s"})) == (["wind (m/s)"], ["wind (m/s)"])


def test_two_layers_with_one_rule_have_one_bar() -> None:
    one = vr.DataLayer(source=CITIES, color="rain", gizmo="sphere")
    same = replace(one, gizmo="disk")
    other = replace(one, color=vr.ColorRule(column="rain", palette="magma"))
    assert labels_of(scene_of({"a": one, "b": same}))[0] == ["rain"]
    assert labels_of(scene_of({"a": one, "b": other}))[0] == ["rain", "rain"]


def test_missing_values_have_a_patch_only_if_there_are_some() -> None:
    rain, people = (
        legend_content(scene_of({"x": vr.DataLayer(source=CITIES, color=c, gizmo="sphere")}))
        for c in ("rain", "people")
    )
    assert rain.bars[0].missing is None and people.bars[0].missing is not None


def test_heights_are_as_long_as_bars_in_the_picture() -> None:
    """A map seen from the side, without perspective: the picture of a bar is as long as the key says, to two pixels."""
    source = {"lon": [0.0], "lat": [0.0], "v": [40.0]}
    layers = {"x": vr.DataLayer(source=source, height=vr.SizeRule(column="v", range=(0.0, 1.0)), radius=0.1)}
    side = vr.OrthographicCamera(origin=(0.0, 0.0, 9.0), height=8.0)
    scene = scene_of(layers, MapBase(), side)
    (scale,) = legend_content(scene).sizes
    assert scale.shape == "bar" and dict(scale.entries)["40"] == pytest.approx(200 / 8)
    values, sizes = zip(*((float(text), size) for text, size in scale.entries))
    assert np.allclose(np.array(sizes) / values, 200 / 8 / 40)
    ids = vr.render(scene, progress=False, layers=("id",))["id"]
    assert abs((ids == 2).any(axis=1).sum() - dict(scale.entries)["40"]) <= 2
    # Seen at a slant of 60 degrees from above, a bar is half as long, and from above it has no length.
    slant = vr.OrthographicCamera(origin=(0.0, 9 * np.sin(np.pi / 3), 4.5), height=8.0)
    (scale,) = legend_content(replace(scene, camera=slant)).sizes
    assert dict(scale.entries)["40"] == pytest.approx(12.5)
    above = vr.OrthographicCamera(origin=(0.0, 9.0, 0.0), up=(0.0, 0.0, -1.0), height=8.0)
    content = legend_content(replace(scene, camera=above))
    assert not content.sizes
    assert content.notes == ("legend: the heights of v have no key, because they are too large or too small",)


@pytest.mark.parametrize(("gizmo", "shape"), [("sphere", "disk"), ("box", "square"), ("cylinder", "disk")])
def test_widths_are_those_of_gizmos_in_the_picture(gizmo: str, shape: str) -> None:
    """Areas as the values: at a quarter of the value, the width is half of that. The largest is as wide as in the
    picture, to two pixels."""
    source = {"lon": [0.0], "lat": [0.0], "v": [100.0]}
    rule = vr.SizeRule(column="v", scale="sqrt", range=(0.0, 0.4))
    scene = scene_of({"x": vr.DataLayer(source=source, gizmo=gizmo, radius=rule)}, MapBase(),
                     vr.OrthographicCamera(origin=(0.0, 0.0, 9.0), height=8.0))  # fmt: skip
    scale = legend_content(scene).sizes[-1]
    assert scale.shape == shape
    for text, size in scale.entries:
        assert size == pytest.approx(0.8 * 25 * np.sqrt(float(text) / 100))
    ids = vr.render(scene, progress=False, layers=("id",))["id"]
    assert abs((ids == 2).any(axis=0).sum() - dict(scale.entries)["100"]) <= 2


def test_constant_and_empty_columns_have_keys_too() -> None:
    place = {"lon": [1.0, 2.0], "lat": [3.0, 4.0]}
    for values, scale in (([5.0, 5.0], "linear"), ([5.0, 5.0], "log"), ([5.0, 5.0], "sqrt")):
        rule = vr.SizeRule(column="v", scale=scale, range=(0.1, 0.1) if scale == "log" else None)
        layer = vr.DataLayer(source=place | {"v": values}, height=rule, color="v")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = legend_content(scene_of({"x": layer}, MapBase(), vr.Camera(origin=(0.0, 5.0, 9.0))))
            assert [t.text for t in content.bars[0].ticks] == ["5"]
            values = [float(text) for found in content.sizes for text, _ in found.entries]
            assert all(0 < v <= 5 for v in values) and (scale != "log" or values == [5])
            drawn(content, 320, 200)


# Places


def test_sizes_of_a_domain_that_begins_above_zero_are_those_of_the_data() -> None:
    quakes = {"lon": [0.0, 10.0, 20.0], "lat": [0.0, 0.0, 0.0], "magnitude": [4.0, 5.2, 6.4]}
    rule = vr.SizeRule(column="magnitude", domain=(4.0, 7.0), range=(0.05, 0.2))
    made = scene_of({"quakes": vr.DataLayer(source=quakes, gizmo="sphere", radius=rule)})
    (scale,) = legend_content(made).sizes
    numbers, widths = [float(text) for text, _ in scale.entries], [width for _, width in scale.entries]
    assert numbers and min(numbers) >= 4 and max(numbers) <= 6.4
    assert widths == sorted(widths)


def test_places_are_named_where_they_are_and_only_if_they_are_seen() -> None:
    scene = scene_of(places="all")
    content = legend_content(scene)
    # Auckland is behind the globe. The others follow each other by their rain.
    assert [place.name for place in content.places] == ["Roma", "Paris", "Barcelona", "Berlin", "Madrid"]
    for place in content.places:
        i = CITIES["city"].index(place.name)
        ground = scene.data.base.place([CITIES["lon"][i]], [CITIES["lat"][i]])
        found = projected(scene, ground.point)
        assert (place.x, place.y) == pytest.approx((found.x[0], found.y[0]), rel=1e-12) and not place.dotted
    assert not legend_content(scene_of()).places


def test_chosen_places_and_further_points() -> None:
    points = {"Zürich": (8.5, 47.4), "St. Gallen": (9.4, 47.4), "Sydney": (151.2, -33.9)}
    content = legend_content(scene_of(places=("Paris", "Berlln", "Auckland"), points=points))
    assert [(place.name, place.dotted) for place in content.places] == [
        ("Zürich", True), ("St. Gallen", True), ("Paris", False)
    ]  # fmt: skip
    assert content.notes == ('legend: no row that is shown has the name "Berlln"; did you mean "Berlin"?',)
    on_map = legend_content(scene_of(base=EUROPE, camera=vr.Camera(origin=(0.0, 9.0, 5.0)), points=points))
    assert [place.name for place in on_map.places] == ["Zürich", "St. Gallen"]
    assert 'legend: the point "Sydney" lies outside of the map' in on_map.notes


def test_a_place_of_two_layers_is_named_once() -> None:
    bars = vr.DataLayer(source=CITIES, height="rain")
    layers = {"bars": bars, "disks": vr.DataLayer(source=CITIES, gizmo="disk", radius=0.02)}
    places = legend_content(scene_of(layers, places="all")).places
    assert len(places) == len({place.name for place in places}) == 5
    # It keeps off the wider gizmo.
    narrow = legend_content(scene_of({"bars": bars}, places="all")).places
    assert all(wide.radius > thin.radius > 0 for wide, thin in zip(places, narrow))


# Pictures and files


def test_a_render_has_the_legend_as_a_layer() -> None:
    scene = scene_of()
    image = vr.render(scene, progress=False)
    assert list(image.layers)[-1] == "legend"
    below = image["RGB"].astype(float)
    expected = drawn(legend_content(scene), 320, 200, below).pixels
    assert image["legend"].tobytes() == expected.tobytes() and expected.any()
    without = vr.render(scene, progress=False, legend=False)
    assert list(without.layers) == [name for name in image.layers if name != "legend"]
    assert all(image[name].tobytes() == without[name].tobytes() for name in without.layers)
    kept = set(image.metadata) - {"render_seconds"}
    assert {key: image.metadata[key] for key in kept} == {key: without.metadata[key] for key in kept}


def test_scenes_without_a_legend_have_no_such_layer() -> None:
    data = replace(scene_of().data, legend=None)
    for scene in (replace(scene_of(), data=None), replace(scene_of(), data=data)):
        assert legend_content(scene) is None
        assert not set(vr.render(scene, progress=False, layers=("RGB", "legend")).layers) & set(names_from("overlay"))


@pytest.mark.slow
def test_only_legends_load_matplotlib(tmp_path) -> None:
    path = tmp_path / "ball.json"
    path.write_text('{"objects": {"ball": {"type": "sphere", "radius": 1}}, "film": {"width": 16, "height": 16}}')
    code = f"import sys, visray as vr; vr.render({str(path)!r}, spp=1, progress=False).png()"
    code += "; print('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


def test_a_prepared_scene_keeps_its_legend_when_data_change() -> None:
    prepared = vr.prepare(scene_of(places=("Roma",)))
    first = vr.render(prepared, progress=False)["legend"]
    turned = prepared.updated({"camera.origin": (2.5, 3.0, 0.6)})
    second = vr.render(turned, progress=False)["legend"]
    assert second.tobytes() == vr.render(turned.scene, progress=False)["legend"].tobytes() != first.tobytes()


def test_an_exr_file_has_the_legend_in_half(tmp_path) -> None:
    image = vr.render(scene_of(), progress=False)
    image.write(tmp_path / "a.exr")
    image.write(tmp_path / "float.exr", float32=True)
    found = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    assert {found[f"legend.{letter}"].pixels.dtype for letter in "RGBA"} == {np.dtype(np.float16)}
    half, single = (vr.Image.read(tmp_path / name)["legend"] for name in ("a.exr", "float.exr"))
    assert np.abs(half - image["legend"]).max() <= 2.0**-11
    assert (single == image["legend"]).all()
    assert np.abs(vr.Image.read(tmp_path / "a.exr").display().astype(int) - image.display().astype(int)).max() <= 1


def test_a_film_that_is_too_small_gets_a_note_and_an_empty_layer() -> None:
    with pytest.warns(LegendWarning, match="^legend: left out, because 32 x 20 pixels are too few for text") as noted:
        image = vr.render(scene_of(film=Film(width=32, height=20)), progress=False)
    assert not image["legend"].any()
    assert noted[0].filename == __file__


def test_the_text_suits_the_picture_below() -> None:
    """Dark on a white background, light on a black one; a transparent film counts as white."""

    def brightest(background: float, transparent: bool = False) -> float:
        scene = replace(scene_of(sizes=False, bars=False), background=(background,) * 3)
        scene = replace(scene, film=replace(FILM, transparent=transparent))
        legend = vr.render(scene, progress=False)["legend"]
        opaque = legend[..., 3] == 1
        return float(np.median(legend[opaque][:, :3]))

    assert brightest(1.0) < 0.1 < 0.8 < brightest(0.0)
    assert brightest(0.0, transparent=True) < 0.1


def test_derivatives_leave_the_legend_out() -> None:
    scene = scene_of({"rain": vr.DataLayer(source=CITIES, height=vr.SizeRule(column="rain"), color="rain")})
    plain = replace(scene, data=replace(scene.data, legend=None))
    address = "data.rain.0.height"
    found, expected = (vr.derivative(s, address, spp=1) for s in (scene, plain))
    pair = [np.asarray(x[1] if isinstance(x, tuple) else x) for x in (found, expected)]
    assert pair[0].tobytes() == pair[1].tobytes()


# The command line


def written(scene: Scene, folder) -> str:
    path = folder / "scene.json"
    path.write_text(vr.dump(scene))
    return str(path)


def pixels(path) -> np.ndarray:
    return np.asarray(Pillow.open(path)).astype(int)


def test_the_command_line_draws_the_legend_alone_or_not_at_all(tmp_path, capsys) -> None:
    path = written(scene_of(), tmp_path)
    outputs = {name: str(tmp_path / name) for name in ("a.png", "a.exr", "key.png", "b.png", "b.exr", "c.png", "d.exr")}
    assert (
        main(["render", path, "-o", outputs["a.png"], "-o", outputs["a.exr"], "--legend", outputs["key.png"], "--json"])
        == 0
    )
    report = json.loads(capsys.readouterr().out)
    assert report["outputs"] == [outputs[name] for name in ("a.png", "a.exr", "key.png")]
    assert report["layers"][-1] == "legend"
    assert main(["render", path, "-o", outputs["b.png"], "-o", outputs["b.exr"], "--no-legend", "--quiet"]) == 0
    assert main(["render", path, "-o", outputs["d.exr"], "--layers", "Z", "--quiet"]) == 0
    assert list(vr.Image.read(outputs["d.exr"]).layers) == ["RGB", "A", "Z", "legend"]
    assert "legend" in vr.Image.read(outputs["a.exr"]).layers
    assert "legend" not in vr.Image.read(outputs["b.exr"]).layers
    key = Pillow.open(outputs["key.png"])
    assert key.mode == "RGBA" and key.size == (320, 200)
    below = Pillow.open(outputs["b.png"]).convert("RGBA")
    below.alpha_composite(key)
    assert np.abs(np.asarray(below)[..., :3].astype(int) - pixels(outputs["a.png"])).max() <= 1
    assert main(["render", path, "-o", outputs["c.png"], "--no-legend", "--legend", outputs["key.png"], "--quiet"]) == 0
    assert (pixels(outputs["c.png"]) == pixels(outputs["b.png"])).all()
    assert (np.asarray(Pillow.open(outputs["key.png"])) == np.asarray(key)).all()


@pytest.mark.parametrize(
    ("file", "has", "says"),
    [
        ("a.png", False, "--legend = 'a.png': the scene has no legend; give it data.legend"),
        ("a.exr", True, "--legend = 'a.exr': must be a .png file; an EXR file has the legend as a layer"),
        ("no/a.png", True, "no/a.png: the folder 'no' does not exist; create it first"),
    ],
)
def test_a_legend_that_cannot_be_written_is_refused_before_the_render(
    file, has, says, tmp_path, capsys, monkeypatch
) -> None:
    scene = scene_of() if has else replace(scene_of(), data=None)
    path = written(scene, tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["render", path, "-o", "b.png", "--legend", file]) == 2
    assert capsys.readouterr().err == f"visray: {says}\n"
    assert sorted(x.name for x in tmp_path.iterdir()) == ["scene.json"]


BAD = {
    "titel": ({"titel": "x"}, "data.legend.titel: unknown key; did you mean 'title'?"),
    "position": ({"position": "rigth"}, 'data.legend.position = "rigth": unknown value; did you mean "right"?'),
    "places": ({"places": "some"}, 'data.legend.places = "some": unknown value; one of none, all'),
    "size": ({"size": 0}, "data.legend.size = 0: must be at least 0.5"),
    "point": ({"points": {"a": [0, 100]}}, "data.legend.points.a.1 = 100: must be at most 90"),
    "title": ({"title": 3}, "data.legend.title = 3: must be a string"),
}


def test_what_is_no_legend_is_refused_with_the_fields_of_one(tmp_path) -> None:
    path = tmp_path / "scene.json"
    path.write_text('{"data": {"legend": 3}}')
    with pytest.raises(
        UserError, match=r": data\.legend = 3: must be an object \{\.\.\.\} with the keys title, .*, or null$"
    ):
        vr.load(path)


@pytest.mark.parametrize("name", BAD)
def test_a_wrong_field_is_refused_in_one_line(name: str, tmp_path) -> None:
    legend, says = BAD[name]
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"data": {"legend": legend}, "camera": {}, "lights": {}}))
    with pytest.raises(UserError) as caught:
        vr.load(path)
    assert str(caught.value).startswith(f"{path}: {says}")


def test_a_scene_file_keeps_its_legend(tmp_path) -> None:
    scene = scene_of(places=("Paris",), points={"St. Gallen": (9.4, 47.4)}, units={"rain": "mm"}, font=BASE, size=1.5)
    assert vr.load(written(scene, tmp_path)).data.legend == scene.data.legend
