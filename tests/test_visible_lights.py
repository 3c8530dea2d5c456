"""Area lights that are seen: exactly their shapes, in front of and behind objects, in mirrors and through glass."""

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
from light_samples import AREA_NAMES, light_sample

import visray as vr
from visray.adaptive.brightness import Brightness, rms
from visray.camera import View
from visray.features import features
from visray.geometry import gamma
from visray.quantities import Arrays, stacked
from visray.ray import NO_ROW, Hit, Ray
from visray.setup import prepare
from visray.visible_lights import nearest_light

A = Arrays.of("llvm", "double")
SINGLE = 4 * float(np.finfo(np.float32).eps)
BLACK = (0.0, 0.0, 0.0)
MATTE = vr.Material(ka=BLACK, kd=(0.5, 0.25, 0.75))
LAMP = vr.SphereLight(position=(0.0, 0.0, 0.0), radius=1.0, visible=True, intensity=0.5, Id=(1.0, 0.5, 2.0))
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0.0, 0.0, 8.0), fov=30.0),
    film=vr.Film(width=24, height=16),
    background=BLACK,
    ambient=BLACK,
    materials={"matte": MATTE, "mirror": vr.Material(ka=BLACK, kd=BLACK, kr=(0.5, 0.5, 0.5))},
    lights={"lamp": LAMP},
    objects={"wall": vr.Rectangle(center=(0, 0, -4), width=(9, 0, 0), height=(0, 9, 0), material="matte")},
    settings=vr.Settings(spp=1),
)
COLOUR = np.multiply(LAMP.intensity, LAMP.Id)


def picture(scene, **more):
    return vr.render(scene, progress=False, **more)["RGB"].astype(float)


def ray_hits(light, o, d, t=np.inf):
    """Whether rays meet a light, and the distances. t: distance of what they hit else. Shapes: (N, 3)."""
    lights = prepare(replace(SCENE, lights={"lamp": light})).kernel.visible_lights
    n = len(d)
    ray = Ray(A.W(o.T), A.W(d.T))
    lamp = nearest_light(lights, ray, Hit(A.D(np.broadcast_to(t, n).copy()), dr.full(A.U, NO_ROW, n)))
    return np.array(lamp.met), np.array(lamp.distance)


def points_on(light, rng, n):
    """Random points of a light. Shapes: (N, 3)."""
    table = stacked(A, type(light), [light])
    offsets = table.point_offset(A.W, A.D(rng.uniform(size=n)), A.D(rng.uniform(size=n)))
    return np.array(light.position) + np.array(offsets).T


@pytest.mark.parametrize("name", AREA_NAMES)
def test_rays_meet_exactly_the_shape(name):
    """A ray to a point of the light meets the light there or before, at a point of the light. One beside its bounding
    ball meets none. Nothing nearer hides it, nothing behind it does."""
    rng = np.random.default_rng(1)
    light = replace(light_sample(name).posed, visible=True)
    surface = light_sample(name).surface
    p, o = points_on(light, rng, 256), rng.uniform(-9, 9, (256, 3))
    away = np.linalg.norm(p - o, axis=1)
    d = (p - o) / away[:, None]
    met, t = ray_hits(light, o, d)
    size = np.abs(o).sum(1) + away + np.abs(light.position).sum() + 4
    # A point of the rim may be missed by rounding; none of these is on it.
    assert met.all() and (t <= away + gamma(64) * size).all()
    assert (surface.away(light, o + t[:, None] * d - np.array(light.position)) <= gamma(64) * size).all()
    assert not ray_hits(light, o, d, t - gamma(64) * size)[0].any()
    assert ray_hits(light, o, d, t + gamma(64) * size)[0].all()
    # On a surface, to within rounding, it is seen.
    assert ray_hits(light, o, d, t)[0].all()
    assert not ray_hits(light, o, -d)[0][np.linalg.norm(o - np.array(light.position), axis=1) > 4].any()


def test_colour_and_coverage():
    """The disk of the ball: its pixels have the light's colour, whatever is behind; those before it do not."""
    scene = replace(SCENE, film=replace(SCENE.film, transparent=True), objects={})
    image = vr.render(scene, progress=False)
    inside = np.abs(image["RGB"] - COLOUR).max(-1) <= SINGLE
    # A ball of radius 1 at distance 8 subtends asin(1/8).
    expected = np.pi * np.tan(np.arcsin(1 / 8)) ** 2 / (4 * np.tan(np.radians(15)) ** 2 * 1.5) * inside.size
    assert abs(inside.sum() - expected) < 0.15 * expected
    assert (np.asarray(image["A"]).squeeze() == inside).all()
    before = replace(SCENE, objects={"wall": replace(SCENE.objects["wall"], center=(0, 0, 3))})
    assert (picture(before) == picture(replace(before, lights={"lamp": replace(LAMP, visible=False)}))).all()


def test_what_it_lights_does_not_change():
    """Outside of its own shape the picture is bit for bit that with the light unseen: it casts no shadow."""
    seen, unseen = picture(SCENE), picture(replace(SCENE, lights={"lamp": replace(LAMP, visible=False)}))
    own = (np.abs(seen - COLOUR) <= SINGLE).all(-1)
    assert own.any() and not own.all() and (seen[~own] == unseen[~own]).all()


def test_layers_do_not_know_it():
    layers = ("Z", "distance", "N", "P", "UV", "albedo", "id")
    seen, unseen = (vr.render(s, progress=False, layers=layers) for s in (
        SCENE, replace(SCENE, lights={"lamp": replace(LAMP, visible=False)})))  # fmt: skip
    for name in layers:
        assert (np.asarray(seen[name]) == np.asarray(unseen[name])).all()


def test_mirrors_show_it_and_matte_surfaces_do_not_count_it_twice():
    wall = vr.Rectangle(center=(0, 0, -4), width=(9, 0, 0), height=(0, 9, 0), material="mirror")
    # The camera is between the lamp and the mirror.
    scene = replace(
        SCENE,
        camera=vr.Camera(origin=(0, 0, 2), target=(0, 0, -4), fov=1.0),
        lights={"lamp": replace(LAMP, position=(0, 0, 4))},
        objects={"wall": wall},
    )
    assert np.abs(picture(scene) - 0.5 * COLOUR).max() <= SINGLE
    matte = replace(scene, objects={"wall": replace(wall, material="matte")}, settings=vr.Settings(
        spp=4, scatter=vr.Scatter(rays=4, depth=2)))  # fmt: skip
    unseen = replace(matte, lights={"lamp": replace(scene.lights["lamp"], visible=False)})
    assert (picture(matte) == picture(unseen)).all()


def test_derivatives():
    """By the colour: the share of each pixel. In the mirror too. By the place: an outline moves, which is warned of."""
    for scene in (SCENE, replace(SCENE, settings=vr.Settings(spp=1, precision="double"), objects={
        "wall": replace(SCENE.objects["wall"], material="mirror")})):  # fmt: skip
        for address in ("lights.lamp.intensity", "lights.lamp.Id.1"):
            slope = vr.derivative(scene, address, progress=False)
            assert np.abs(slope - vr.difference(scene, address)).max() <= 1e-8
    with pytest.warns(vr.EdgeWarning, match="outlines of lights of lights.lamp"):
        vr.derivative(SCENE, "lights.lamp.position.0", progress=False)


def test_looped_lights_and_many_kinds():
    """The nearest of several lights is seen, in the order of distance and not of the file."""
    far = vr.RectangleLight(position=(0, 0, -1), width=(9, 0, 0), height=(0, 9, 0), visible=True, Id=(0.0, 1.0, 0.0))
    near = vr.DiskLight(position=(0, 0, 2), normal=(0, 0, 1), radius=0.3, visible=True, Id=(0.0, 0.0, 1.0))
    others = {f"ball {i}": replace(LAMP, position=(i - 20.0, 9.0, 0.0)) for i in range(40)}
    scene = replace(SCENE, lights={"near": near, "far": far, **others, "lamp": LAMP})
    colours = picture(scene).reshape(-1, 3)
    for colour in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), COLOUR):
        assert (np.abs(colours - colour).max(1) <= SINGLE).any()
    made = prepare(scene)
    assert isinstance(made.kernel.view, View) and len(made.kernel.visible_lights) == 3


def test_moving_it_compiles_nothing():
    made = vr.prepare(SCENE)
    vr.render(made, progress=False)
    moved = made.updated({"lights.lamp.position.0": 0.5, "lights.lamp.radius": 0.7, "lights.lamp.intensity": 0.9})
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        found = picture(moved)
        entries = dr.kernel_history((dr.KernelType.JIT,))
    assert entries and all(entry["cache_hit"] and not entry["cache_disk"] for entry in entries)
    assert (found == picture(moved.scene)).all()
    assert (picture(made.updated({"lights.lamp.visible": False})) == picture(
        replace(SCENE, lights={"lamp": replace(LAMP, visible=False)}))).all()  # fmt: skip


def test_the_effect_is_needed_by_visible_lights_alone():
    assert features(SCENE)["visible lights"]
    dark = replace(SCENE, lights={"lamp": replace(LAMP, intensity=0.0)})
    assert not features(dark)["visible lights"] and features(dark, wrt=("lights.lamp.intensity",))["visible lights"]
    assert not features(replace(SCENE, lights={"lamp": replace(LAMP, visible=False)}))["visible lights"]


def test_the_story_of_a_pixel_names_it():
    story = vr.why(SCENE, 12, 8)
    assert story.surfaces[0].object == "lights.lamp" and np.abs(np.subtract(story.colour, COLOUR)).max() <= SINGLE
    assert "meets the visible light lights.lamp after 7" in str(story)


def test_it_counts_as_brightness():
    bright = Brightness.of(prepare(replace(SCENE, lights={"lamp": replace(LAMP, intensity=50.0)})))
    assert bright.hidden >= rms(50 * np.array(LAMP.Id)) and "lights.lamp" in bright.cause


def test_lights_without_an_area_cannot_be_seen():
    with pytest.raises(vr.UserError, match=r"lights.sun.visible"):
        vr.replaced(SCENE, "lights", {"sun": {"type": "point", "position": (0.0, 1.0, 0.0), "visible": True}})


def test_in_coloured_glass_it_is_seen_through_what_is_before_it():
    """A lamp of radius 1/4 in the middle of a ball of radius 1 and of ior 1: its light runs 3/4 in the glass."""
    absorption = (0.5, 1.0, 2.0)
    glass = vr.Material(ka=BLACK, kd=BLACK, kt=(1.0, 1.0, 1.0), ior=1.0, absorption=absorption)
    for depth in (1.0, 3.0):
        scene = replace(
            SCENE,
            camera=vr.Camera(origin=(0, 0, 8), fov=0.01),
            lights={"lamp": replace(LAMP, radius=0.25)},
            materials={"glass": glass},
            objects={"ball": vr.Sphere(radius=depth, material="glass")},
        )
        expected = COLOUR * np.exp(-np.multiply(absorption, depth - 0.25))
        seen = picture(scene)
        assert np.abs(seen - expected).max() <= 4 * SINGLE
        assert np.abs(vr.derivative(scene, "lights.lamp.intensity", progress=False) - 2 * seen).max() <= 4 * SINGLE
        # The camera in the glass.
        inside = replace(scene, camera=vr.Camera(origin=(0, 0, depth / 2), fov=0.01))
        assert np.abs(picture(inside) - COLOUR * np.exp(-np.multiply(absorption, depth / 2 - 0.25))).max() <= 4 * SINGLE


def test_the_way_to_it_in_coloured_glass_has_derivatives():
    """exp(-absorption (R - 1/4)) in a ball of radius R about a lamp of radius 1/4. Edges are outside of the picture."""
    absorption = np.array((0.5, 1.0, 2.0))
    glass = vr.Material(ka=BLACK, kd=BLACK, kt=(1.0, 1.0, 1.0), ior=1.0, absorption=tuple(absorption))
    scene = replace(
        SCENE,
        camera=vr.Camera(origin=(0, 0, 8), fov=0.01),
        lights={"lamp": replace(LAMP, radius=0.25)},
        materials={"glass": glass},
        objects={"ball": vr.Sphere(radius=2.0, material="glass")},
    )
    slope = absorption * picture(scene)
    for address, sign in (("objects.ball.radius", -1), ("objects.ball.center.2", -1), ("lights.lamp.position.2", 1),
                          ("lights.lamp.radius", 1)):  # fmt: skip
        with pytest.warns(vr.EdgeWarning):
            found = vr.derivative(scene, address, progress=False)
        # Rays run up to 9e-4 beside the axis of a lamp of radius 1/4, and change by the square of this share.
        assert np.abs(found - sign * slope).max() <= (9e-4 / 0.25) ** 2 * slope.max()
