"""A part of a picture has the bits of the whole one, and its place in files; a scaled picture has its size."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.film import Film as Samples
from visray.passes import expose, identity_of, subset
from visray.scene.film import film_flaw
from visray.setup import prepare

LEFT, TOP, RIGHT, BOTTOM = REGION = (5, 3, 18, 12)
CROP = np.s_[TOP:BOTTOM, LEFT:RIGHT]


def scene(sampler: str = "stratified", **film) -> vr.Scene:
    return vr.Scene(
        camera=vr.Camera(),
        film=vr.Film(**({"width": 24, "height": 16} | film)),
        lights={"key": vr.SphereLight(position=(3, 4, 5), radius=0.5, samples=2)},
        materials={"glass": vr.Material(kt=(0.8, 0.8, 0.8), ior=1.5), "mirror": vr.Material(kr=(0.5, 0.5, 0.5))},
        objects={"ball": vr.Sphere(material="glass"), "floor": vr.Plane(point=(0, -1, 0), material="mirror")},
        settings=vr.Settings(spp=5, sampler=sampler),
    )


def render(scene: vr.Scene, **more) -> vr.Image:
    return vr.render(scene, progress=False, **more)


@pytest.mark.parametrize("filter", ["box", "mitchell"])
@pytest.mark.parametrize("sampler", ["stratified", "sobol", "independent"])
def test_a_region_has_the_bits_of_the_whole_picture(sampler, filter):
    whole, part = (render(vr.replaced(scene(sampler, region=r), "film.filter", filter)) for r in (None, REGION))
    assert set(whole.layers) == set(part.layers)
    for name, values in part.layers.items():
        assert np.array_equal(values, whole[name][CROP]), name
    assert part.metadata["worldToNDC"] == whole.metadata["worldToNDC"]


def test_a_prepared_scene_gets_a_region_and_loses_it():
    made = vr.prepare(scene())
    part = made.updated({"film.region": REGION})
    assert np.array_equal(render(part)["RGB"], render(scene())["RGB"][CROP])
    for other in (part.updated({"film.region": None}), part.updated({"film.region": (0, 0, 24, 16)})):
        assert np.array_equal(render(other)["RGB"], render(made)["RGB"])
    moved = part.updated({"film.region": (6, 3, 19, 12)})
    assert np.array_equal(render(moved)["RGB"], render(made)["RGB"][3:12, 6:19])


def test_a_region_is_rendered_adaptively_to_its_own_error():
    image = render(scene(region=REGION, transparent=True), error=0.1, layers=("RGB", "A", "error", "samples"))
    assert image["RGB"].shape == (9, 13, 3) and image.metadata["error_high"] <= 0.1


def test_derivatives_have_the_shape_of_the_region():
    flat = replace(scene(), objects={"ball": vr.Sphere(radius=3.0)}, settings=vr.Settings(spp=2))
    part = vr.replaced(flat, "film.region", REGION)
    address = "lights.key.intensity"
    whole = vr.derivative(flat, address, progress=False)
    assert np.allclose(vr.derivative(part, address, progress=False), whole[CROP], rtol=1e-12, atol=1e-12)
    assert np.allclose(vr.difference(part, address), whole[CROP], atol=1e-6)
    assert vr.gradient(part, address, progress=False)[address] == pytest.approx(whole[CROP].mean(), rel=1e-9)


def test_tiles_and_checkpoints_of_a_region(tmp_path):
    made = prepare(scene(region=REGION))
    n = len(made.order)
    film, _ = expose(made)
    halves = [expose(subset(made, np.arange(a, b)))[0] for a, b in ((0, 50), (50, n))]
    merged = Samples.merged(halves)
    for a, b in zip(film.arrays().values(), merged.arrays().values()):
        assert np.array_equal(a, b)
    film.save(tmp_path / "film")
    loaded = Samples.load(made.a, tmp_path / "film", identity_of(made))
    assert np.array_equal(np.array(loaded.mean), np.array(film.mean))
    other = prepare(scene(region=(5, 3, 18, 13)))
    with pytest.raises(vr.UserError, match=r"is of region \[5, 3, 18, 12\], not \[5, 3, 18, 13\]"):
        Samples.load(made.a, tmp_path / "film", identity_of(other))
    with pytest.raises(vr.UserError, match=r"is of region .*, not no region"):
        Samples.load(made.a, tmp_path / "film", identity_of(prepare(scene())))
    with pytest.raises(vr.UserError, match="is of another scene"):
        tent = vr.replaced(scene(region=REGION), "film.filter", "tent")
        Samples.load(made.a, tmp_path / "film", identity_of(prepare(tent)))


def test_files_say_where_a_region_is(tmp_path):
    image = render(scene(region=REGION))
    image.write(tmp_path / "a.exr", float32=True)
    image.write(tmp_path / "a.png")
    with Pillow.open(tmp_path / "a.png") as png:
        assert png.size == (RIGHT - LEFT, BOTTOM - TOP)
    header = OpenEXR.File(str(tmp_path / "a.exr")).header()
    windows = [[tuple(int(v) for v in corner) for corner in header[f"{w}Window"]] for w in ("data", "display")]
    assert windows == [[(LEFT, TOP), (RIGHT - 1, BOTTOM - 1)], [(0, 0), (23, 15)]]
    back = vr.Image.read(tmp_path / "a.exr")
    assert np.array_equal(back["Z"], image["Z"]) and back.metadata["region"] == "5 3 18 12"
    assert back.metadata["whole"] == "24 16"
    back.write(tmp_path / "b.exr")
    assert [int(v) for v in OpenEXR.File(str(tmp_path / "b.exr")).header()["dataWindow"][0]] == [LEFT, TOP]
    render(scene()).write(tmp_path / "c.exr")
    assert "region" not in vr.Image.read(tmp_path / "c.exr").metadata


@pytest.mark.slow
def test_a_legend_of_a_region_is_a_part_of_that_of_the_whole(tmp_path):
    (tmp_path / "t.csv").write_text("lon,lat,rain\n10,50,3\n20,45,7\n5,40,1\n")
    made = vr.data_scene(tmp_path / "t.csv", size=(400, 300), spp=1)
    region = (0, 20, 400, 220)
    whole = render(made, layers=("RGB", "legend"))
    part = render(vr.replaced(made, "film.region", region), layers=("RGB", "legend"))
    assert np.array_equal(part["RGB"], whole["RGB"][20:220])
    assert part["legend"].shape == (200, 400, 4)
    assert np.array_equal(part["legend"][..., 3], whole["legend"][20:220, :, 3])


@pytest.mark.parametrize(
    "scale, size", [(0.5, (12, 8)), (0.3, (7, 5)), (1 / 48, (1, 1)), (1e-6, (1, 1)), (2.5, (60, 40))]
)
def test_a_scale_multiplies_the_size(scale, size):
    film = vr.Film(width=24, height=16, scale=scale)
    assert film.size == film.raster == size
    picture = render(vr.replaced(scene(), "film.scale", scale), spp=1, layers="RGB")
    plain = render(scene(width=size[0], height=size[1]), spp=1, layers="RGB")
    assert np.array_equal(picture["RGB"], plain["RGB"])


def test_a_size_replaces_the_scale_and_keeps_the_region():
    small = vr.replaced(scene(), "film.scale", 0.5)
    assert render(small, size=(20, 10), spp=1)["RGB"].shape == (10, 20, 3)
    part = render(scene(region=REGION), size=(48, 32), spp=1)
    assert np.array_equal(part["RGB"], render(scene(), size=(48, 32), spp=1)["RGB"][CROP])


WRONG = {
    (10, 0, 0, 9): "must be left, top, right, bottom, of at least one pixel; write [0, 0, 10, 9]",
    (
        5,
        5,
        5,
        9,
    ): "must be left, top, right, bottom, of at least one pixel; right is beyond left, and bottom below top; "
    "the picture has 24 x 16 pixels",
    (10, 10, -1, -1): "must be left, top, right, bottom, of at least one pixel; right is beyond left, and bottom below "
    "top; the picture has 24 x 16 pixels",
    (20, 0, 30, 9): "reaches beyond the picture: the picture has 24 x 16 pixels; inside of it is [20, 0, 24, 9]",
    (-9, -9, -1, -1): "reaches beyond the picture: the picture has 24 x 16 pixels; give a region in [0, 0, 24, 16]",
}


@pytest.mark.parametrize("region", WRONG)
def test_wrong_regions_are_refused(region):
    assert film_flaw(replace(vr.Film(width=24, height=16), region=region))[2] == WRONG[region]
    with pytest.raises(vr.UserError) as error:
        render(scene(region=region))
    assert error.value.lines == (f"film.region = {[*region]}: {WRONG[region]}",)


@pytest.mark.parametrize(
    "raw, text",
    [
        ({"region": (1, 2, 3)}, "film.region = [1, 2, 3]: must be 4 whole numbers"),
        ({"region": (1.5, 2, 3, 4)}, "film.region.0 = 1.5: must be a whole number"),
        ({"scale": 0}, "film.scale = 0: must be greater than 0"),
        ({"scale": 1e9}, "film.scale = 1000000000.0: must be at most 1000"),
    ],
)
def test_wrong_films_are_refused(raw, text):
    with pytest.raises(vr.UserError) as error:
        vr.replaced(vr.Scene(camera=vr.Camera(), lights={}), f"film.{next(iter(raw))}", next(iter(raw.values())))
    assert error.value.lines == (text,)


def test_a_scale_beyond_memory_is_refused():
    with pytest.raises(vr.UserError, match=r"^film = 640000 x 480000: needs about .* GiB"):
        render(vr.replaced(vr.Scene(camera=vr.Camera(), lights={}), "film.scale", 1000))


def test_a_pixels_story_counts_in_the_whole_picture():
    whole, part = (vr.why(scene(region=r), 9, 7) for r in (None, REGION))
    assert str(whole) == str(part)
