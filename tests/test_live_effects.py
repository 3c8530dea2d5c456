"""What effects cost in the live picture: measured in short pieces, with their noise, and switched off and on."""

from dataclasses import replace

import numpy as np
import pytest
from test_features import ALL, FULL, MATTE, STEPS, folder, kernel

import visray as vr
from visray.features import features
from visray.live import measuring
from visray.live.measuring import EffectCost, Measurement, fitting, samples_of, sized
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.study.leaving_out import less, prepared_without
from visray.study.spread import Spread
from visray.study.timed_picture import TimedPicture

__all__ = ["folder"]  # the fixture
LIT = Scene(
    camera=vr.Camera(origin=(0, 1, 5), target=(0, 0.5, 0)),
    film=vr.Film(width=48, height=32),
    lights={"lamp": vr.SphereLight(position=(3, 5, 4), radius=0.8)},
    materials={"red": vr.Material(kd=(0.7, 0.1, 0.1), ks=(0.4, 0.4, 0.4))},
    objects={"floor": vr.Plane(material="red"), "ball": vr.Sphere(center=(0, 0.5, 0), radius=0.5, material="red")},
)


def small(scene: Scene) -> Scene:
    return replace(scene, film=replace(scene.film, width=8, height=6))


@pytest.mark.parametrize("effect", ["shadows", "specular", pytest.param("scatter", marks=pytest.mark.slow)])
def test_an_effect_is_left_out_of_a_prepared_scene(effect: str) -> None:
    """The kernel and the pixels are those of a scene that is prepared without the effect."""
    scene = small(STEPS[effect][1](MATTE))
    made, expected = prepare(scene).leaving_out(effect), prepared_without(scene, effect)
    assert made.features == expected.features and not made.features[effect]
    assert kernel(made)["hash"] == kernel(expected)["hash"]


def test_area_lights_are_left_out_of_a_prepared_scene() -> None:
    made = less(prepare(LIT), "area lights")
    assert [type(light) for light in made.scene.lights.values()] == [vr.PointLight]
    assert made.scene.lights["lamp"].position == LIT.lights["lamp"].position


def test_several_effects_are_left_out() -> None:
    full = ALL(FULL)
    made = prepared_without(full, "area lights", "shadows")
    assert not any(made.features[e] for e in ("area lights", "shadows", "coloured shadows"))
    assert not any(light.has_area for light in made.scene.lights.values())
    assert made.without == ("shadows",)


def test_a_picture_fits_in_its_time() -> None:
    made = prepare(replace(LIT, film=vr.Film(width=640, height=480)))
    trial = sized(made, 24, 1)
    assert (trial.scene.film.width, trial.scene.film.height) == (24, 18) and samples_of(trial) == 432
    # At a microsecond a sample there is room for 50,000: 256 x 192 pixels. At most 64 times the trial.
    assert samples_of(fitting(made, trial, 432e-6)) <= 432 * 64
    trial = sized(made, 128, 1)
    found = fitting(made, trial, 128 * 96 * 1e-6)
    assert (found.scene.film.width, found.scene.film.height, found.scene.settings.spp) == (256, 192, 1)
    found = fitting(made, trial, 128 * 96 * 2.5e-7)
    assert (found.scene.film.width, found.scene.settings.spp) == (256, 4)
    # Seconds for a sample: still one pixel.
    assert samples_of(fitting(made, trial, 1e6)) == 1


def test_costs_are_measured_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """A made-up clock: each effect costs what its number says. All pictures are one kernel each."""
    weights = {"shadows": 4.0, "specular": 2.0, "diffuse": 1.0}
    ran = []

    def seconds(picture: TimedPicture) -> float:
        ran.append(samples_of(picture.prepared))
        on = picture.prepared.features
        return 1e-7 * samples_of(picture.prepared) * (3 + sum(w for e, w in weights.items() if on[e]))

    monkeypatch.setattr(TimedPicture, "seconds", seconds)
    monkeypatch.setattr(TimedPicture, "kernels", lambda self: [])
    measurement = Measurement(prepare(LIT))
    shares = []
    for _ in measurement.pieces():
        shares.append(measurement.share_done)
    assert shares == sorted(shares) and measurement.share_done == 1 and measurement.doing == ""
    assert list(measurement.costs) == features(LIT).names()
    pixels = 48 * 32
    cost = measurement.costs["specular"]
    np.testing.assert_allclose([cost.seconds.low, cost.seconds.middle, cost.seconds.high], 2e-7 * pixels)
    assert cost.share.middle == pytest.approx(0.2) and cost.along == ()
    assert measurement.costs["area lights"].seconds.in_noise
    assert measurement.total.middle == pytest.approx(1e-6 * pixels)
    # So many differences for each effect, and two trials.
    assert len(ran) == 2 + len(measurement.costs) * (2 * measuring.RUNS + 1)


def test_what_refines_an_effect_is_left_out_along_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TimedPicture, "seconds", lambda self: 1e-3)
    monkeypatch.setattr(TimedPicture, "kernels", lambda self: [])
    measurement = Measurement(prepare(small(STEPS["coloured shadows"][1](MATTE))))
    for _ in measurement.pieces():
        pass
    assert "coloured shadows" in measurement.costs["shadows"].along


def test_a_cost_says_its_noise() -> None:
    clear = EffectCost(Spread(0.0021, 0.0018, 0.0024), Spread(0.14, 0.12, 0.16))
    assert clear.text() == "2.1 ms (1.8 to 2.4), 14 % of the picture"
    noise = EffectCost(Spread(0.0001, -0.0004, 0.0002), Spread(0.01, -0.04, 0.02))
    assert noise.text() == "in the noise, < 0.4 ms, < 4.0 %"
    large = EffectCost(Spread(0.125, 0.11, 0.14), Spread(0.5, 0.4, 0.6))
    assert large.text() == "125 ms (110 to 140), 50 % of the picture"
    wide = EffectCost(Spread(0.1, -0.2, 0.9), Spread(0.2, -0.4, 1.8))
    assert wide.text() == "in the noise, < 900 ms"
    uneven = EffectCost(Spread(0.103, 0.1028, 0.283), Spread(0.2, 0.19, 0.5))
    assert uneven.text() == "103.0 ms (102.8 to 283.0), 20 % of the picture"


def test_a_page_switches_effects() -> None:
    """Shadows, which coloured shadows refine, and area lights, whose lights become others."""
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import value_of, write

    tagged = "<b>red</b>"
    glass = {"glass": vr.Material(kt=(0.5, 0.5, 0.5)), tagged: LIT.materials["red"]}
    window = vr.Sphere(center=(1, 2, 1), radius=0.4, material="glass")
    objects = {name: replace(x, material=tagged) for name, x in LIT.objects.items()} | {"window": window}
    with vr.view(replace(LIT, materials=glass, objects=objects), error=0.5) as shown:
        engine, page = shown.live.engine, Page(shown.url)
        page.look()
        assert value_of(page, "shadows") is True
        eventually(lambda: "needed by materials.&lt;b&gt;red" in page.html())
        assert "<b>red</b>" not in page.html()
        write(page, "shadows", False)
        eventually(lambda: engine.left_out == ("shadows",))
        eventually(lambda: value_of(page, "coloured shadows", "disabled"))
        assert value_of(page, "coloured shadows") is False and value_of(page, "specular") is True
        write(page, "area lights", False)
        eventually(lambda: engine.left_out == ("shadows", "area lights"))
        lights = engine.ask(lambda prepared: prepared.scene.lights).result(60)
        assert isinstance(lights["lamp"], vr.PointLight)
        # Values of lights change all the same, also those that a point light does not have.
        engine.assign({"lights.lamp.radius": 0.5, "lights.lamp.position": (1.0, 5.0, 2.0)})
        eventually(lambda: len(engine.edits) == 2)
        lights = engine.ask(lambda prepared: prepared.scene.lights).result(60)
        assert lights["lamp"].position == (1.0, 5.0, 2.0) and engine.scene.lights["lamp"].radius == 0.5
        write(page, "shadows", True)
        write(page, "area lights", True)
        eventually(lambda: engine.left_out == ())
        assert engine.ask(lambda prepared: prepared.scene.lights).result(60)["lamp"].radius == 0.5
        eventually(lambda: value_of(page, "coloured shadows", "disabled") is False)
        page.close()


def test_a_page_measures(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import press

    monkeypatch.setattr(TimedPicture, "kernels", lambda self: [])
    monkeypatch.setattr(
        TimedPicture, "seconds", lambda self: 1e-7 * samples_of(self.prepared) * len(self.prepared.features.names())
    )
    with vr.view(LIT, error=0.5) as shown:
        page = Page(shown.url)
        page.look(window=(64, 48))
        eventually(lambda: page.pictures)
        press(page, "Measure what each costs")
        # Six effects: without one of them a picture takes 5/6 of its time.
        eventually(lambda: page.html().count("17 % of the picture") >= len(features(LIT).names()) - 1)
        eventually(lambda: "One sample of each of 64 x 48 pixels took 1.84 ms. Medians" in page.html())
        shown.live.engine.assign({"objects.ball.radius": 0.25})
        eventually(lambda: "before the last change of the scene" in page.html())
        page.close()
