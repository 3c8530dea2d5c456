"""A live picture: its states, its film, and what it says of its error."""

from dataclasses import replace

import numpy as np
import pytest
from live_support import small_scene

import visray as vr
from visray.live.closeness import Closeness
from visray.live.grids import grains, grid
from visray.live.pace import Pace
from visray.live.picture import LivePicture
from visray.live.replay import Replays
from visray.live.screen import DARK, LIGHT, Screen, displayed
from visray.live.seeing import seen
from visray.moments import Moments
from visray.output.curves import LUMINANCE
from visray.passes import expose
from visray.quantities import Arrays
from visray.scene.adjusted import adjusted
from visray.setup import prepare

WIDTH, HEIGHT = 50, 34


@pytest.fixture(scope="module")
def base():
    """A scene, prepared, and recordings of it."""
    return seen(prepare(adjusted(small_scene(), sampler="sobol")), None, (WIDTH, HEIGHT), True), Replays()


def rendered(prepared, spp):
    """The film of a render, and its colours as they are shown. Shape: (H, W, 3)."""
    scene = adjusted(prepared.scene, spp=spp)
    film, _ = expose(prepare(scene))
    light = np.empty((WIDTH * HEIGHT, 3))
    light[film.pixels] = np.array(film.mean).T
    return film, light.reshape(HEIGHT, WIDTH, 3)


def states(picture, most=60):
    """The states of a picture until it is finished, or the first of them."""
    found = []
    while not picture.finished and len(found) < most:
        found.append(picture.step())
    return found


def same_film(one, other):
    arrays = zip(one.moments.arrays, other.moments.arrays)
    return np.array_equal(one.counts, other.counts) and all(np.array_equal(np.array(a), np.array(b)) for a, b in arrays)


def test_the_film_is_that_of_a_render(base):
    prepared, replays = base
    picture = LivePicture(prepared, 1e-9, Pace(), replays)
    full = [f for f in states(picture, 9) if f.grain == 1]
    count = picture.parts[0].count
    film, light = rendered(prepared, count)
    assert full[-1].samples == count > 1
    assert same_film(film, picture.film)
    assert np.array_equal(full[-1].rgb, displayed(light))


def test_coarse_states_show_pixels_of_the_first_sample(base):
    prepared, replays = base
    light = displayed(rendered(prepared, 1)[1])
    for pace in (Pace(per_sample=1e-3), Pace(per_sample=2e-3, fixed=0.01)):
        picture = LivePicture(prepared, 1e-9, pace, replays)
        coarse = [f for f in states(picture, 400) if f.share == 1 and f.samples <= 1]
        assert coarse[0].grain > 1
        for frame in coarse:
            rows, columns = (np.minimum(np.arange(-(-n // frame.grain)) * frame.grain + frame.grain // 2, n - 1)
                             for n in (HEIGHT, WIDTH))  # fmt: skip
            assert np.array_equal(frame.rgb, light[rows[:, None], columns])


def test_a_slow_scene_is_shown_in_parts(base, monkeypatch):
    prepared, replays = base
    # A pace that no step makes better.
    monkeypatch.setattr(Pace, "learn", lambda *_: None)
    picture = LivePicture(prepared, 1e-9, Pace(per_sample=4e-3), replays)
    found = []
    while len(found) < 2000 and (not found or found[-1].samples < 2):
        found.append(picture.step())
    shares = [f.share for f in found if f.grain == 1]
    assert found[0].grain >= 8
    assert found[0].note == "a sample of each pixel takes about 7 s"
    assert len(picture.parts) > 10
    assert max(len(part.grid.x) for part in picture.parts) <= 48
    assert 0 < shares[0] < 0.1
    assert np.all(np.diff(shares[: len(picture.parts)]) > 0)
    film, light = rendered(prepared, 2)
    assert same_film(film, picture.film)
    assert np.array_equal(found[-1].rgb, displayed(light))


def test_what_is_not_painted_shows_the_state_before():
    a = Arrays.of()
    screen = Screen(a, (8, 8), False)
    coarse, fine = grid(a, 8, 8, 2), grid(a, 8, 8, 1)
    screen.begin(coarse)
    lit = replace(Moments.empty(a, 16), reference=a.V(1.0), total=a.V(0))
    screen.paint(coarse, Moments(*(x + 0 for x in lit.arrays)), 1)
    screen.begin(fine)
    assert screen.rgb().shape == (8, 8, 3)
    assert (screen.rgb() == 255).all()


def test_an_unknown_scene_begins_with_few_pixels(base):
    prepared, _ = base
    big = seen(prepared, None, (512, 512), True)
    first = LivePicture(big, 1e-9, Pace(), Replays()).step()
    assert first.grain == 32
    assert first.rgb.shape == (16, 16, 3)


def test_the_grain_follows_the_pace():
    prepared = seen(prepare(small_scene()), None, (512, 512), True)
    for per_sample, grain in ((1e-8, 1), (1e-6, 2), (1e-5, 8), (1.0, 32)):
        assert LivePicture(prepared, 0.01, Pace(per_sample=per_sample))._next_grain(None) == grain
    steady = Pace(per_sample=1e-6, grain=3)
    assert LivePicture(prepared, 0.01, steady)._next_grain(None) == 2
    steady = Pace(per_sample=1.1e-6, grain=2)
    assert LivePicture(prepared, 0.01, steady)._next_grain(None) == 2


def test_small_pictures_have_no_lonely_lanes():
    assert grains(8, 8) == (2, 1)
    assert grains(1, 1) == (1,)
    assert grains(512, 512)[0] == 32
    assert len(grid(Arrays.of(), 7, 5, 2)) == 12


def test_pace_forgets_slow_steps_fast():
    pace = Pace()
    pace.learn(1000, 0.02, 0.01)
    assert pace.per_sample == pytest.approx(1e-5)
    assert pace.fixed == pytest.approx(0.01)
    pace.learn(1000, 0.2, 0.1)
    assert pace.per_sample == pytest.approx(2.8e-5)
    pace.learn(1000, 0.01, 0.01)
    assert pace.per_sample == pytest.approx(1.9e-5)
    assert pace.samples(0.1) == pytest.approx((0.1 - pace.fixed) / 1.9e-5)


def test_screen_shows_the_srgb_curve():
    a, rng = Arrays.of(), np.random.default_rng(2)
    light = np.concatenate([rng.uniform(-0.1, 1.1, 3 * 4000), rng.uniform(0, 0.01, 3 * 4000), np.linspace(0, 1, 24576)])
    light[:3] = np.nan, np.inf, -np.inf
    light = light.reshape(3, -1)
    n = light.shape[1]
    whole = grid(a, n, 1, 1)
    screen = Screen(a, (n, 1), False)
    screen.begin(whole)
    empty = Moments.empty(a, n)
    # 16 samples are a full block, whose mean is in double.
    mean = screen.paint(whole, replace(empty, mean=a.put(a.W, light[:, np.array(whole.cells)])), 16)
    assert np.array_equal(np.array(mean)[:, 3:], light[:, np.array(whole.cells)][:, 3:])
    assert np.array_equal(screen.rgb()[0], displayed(light.T))


def test_squares_are_seen_behind_a_transparent_picture():
    ball = small_scene(film=vr.Film(transparent=True), objects={"ball": vr.Sphere(radius=1.0, material="red")})
    prepared = seen(prepare(adjusted(ball, sampler="sobol")), vr.Camera(origin=(0, 0, 6)), (48, 48), True)
    picture = LivePicture(prepared, 1e-9, Pace())
    frame = [f for f in states(picture, 4) if f.grain == 1][-1]
    greys = displayed(np.array([DARK, LIGHT]))
    assert (frame.rgb[2, 2] == greys[0]).all()
    assert (frame.rgb[2, 14] == greys[1]).all()
    red, green, blue = frame.rgb[24, 24]
    assert red > green == blue


def test_the_error_bounds_the_true_one(base):
    prepared, replays = base
    perfect = rendered(prepared, 1024)[1]
    picture = LivePicture(prepared, 1e-9, Pace(), replays)
    known = 0
    while picture.error is None or picture.parts[0].count < 64:
        frame = picture.step()
        if frame.grain > 1 or frame.error is None:
            continue
        light = np.empty((WIDTH * HEIGHT, 3))
        light[picture.film.pixels] = np.array(picture.film.mean).T
        error = light.reshape(perfect.shape) - perfect
        true = np.sqrt(np.square(error).mean()) / (perfect @ LUMINANCE).mean()
        assert true <= 1.2 * frame.error
        assert frame.error <= 5 * true
        known += 1
    assert known > 2


def test_the_error_of_independent_samples_has_no_bias():
    a, rng = Arrays.of(), np.random.default_rng(3)
    samples = rng.normal(0.5, 0.2, (24, 3, 20000))
    closeness = Closeness()
    for count in (1, 2, 4, 8, 12, 24):
        mean = samples[:count].mean(0)
        closeness.update(a, a.put(a.W, mean), count)
        if count > 1:
            assert closeness.square / 60000 == pytest.approx(0.04 / count, rel=0.05)
    assert closeness.luminance / 20000 == pytest.approx(0.5, rel=0.01)


def test_a_finished_picture_has_its_error(base):
    prepared, replays = base
    picture = LivePicture(prepared, 0.05, Pace(), replays)
    last = states(picture, 200)[-1]
    assert last.finished
    assert last.error <= 0.05
    assert last.samples >= 16


def test_a_black_picture_is_finished_too(base):
    dark = seen(prepare(small_scene(lights={}, ambient=(0, 0, 0), background=(0, 0, 0))), None, (16, 8), True)
    picture = LivePicture(dark, 0.05, Pace())
    last = states(picture, 200)[-1]
    assert last.finished
    assert last.error is None
    assert not last.rgb.any()


def test_a_legend_is_drawn_at_rest(monkeypatch):
    pytest.importorskip("matplotlib")
    table = {"lon": [0.0, 20.0, 40.0], "lat": [10.0, 20.0, 30.0], "size": [1.0, 2.0, 3.0]}
    scene = vr.data_scene(table, height="size", title="Sizes", size=(320, 240))
    prepared = seen(prepare(adjusted(scene, sampler="sobol")), None, (320, 240), True)
    monkeypatch.setattr("visray.live.picture.LEGEND", 0.0)
    picture = LivePicture(prepared, 1e-9, Pace())
    frame = next(f for f in states(picture) if f.grain == 1 and f.share == 1)
    image = vr.render(adjusted(prepared.scene, spp=round(frame.samples)), progress=False)
    legend = image["legend"]
    clear, shown = legend[..., 3] == 0, displayed(image["RGB"])
    assert (frame.rgb[clear] == shown[clear]).mean() > 0.999
    assert (frame.rgb[~clear] != shown[~clear]).any(-1).mean() > 0.5
