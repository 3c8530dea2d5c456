"""Motion blur against sharp pictures of the same moments, and the sweeps of samples against a loop over samples."""

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import visray as vr
from visray.film import Film
from visray.motion_blur import PARTS, Sweeps, opened, values_while_open
from visray.passes import empty_film, expose, exposed_once, subset

SIZE = 48, 32


def moving(shutter=None, settings=None, tracks=None, **more):
    """A ball that goes from left to right over a floor in two seconds, and a frame every half a second."""
    go = vr.KeysTrack(address="objects.ball.center", times=(0, 2), values=((-2.0, 0.5, 0.0), (2.0, 0.5, 0.0)))
    return vr.Scene(
        camera=vr.Camera(origin=(0, 1.5, 7), target=(0, 0.7, 0), fov=30, shutter=shutter or vr.Shutter(close=1)),
        film=vr.Film(width=SIZE[0], height=SIZE[1]),
        lights={"lamp": vr.PointLight(position=(3, 5, 4))},
        objects={"floor": vr.Plane(), "ball": vr.Sphere(center=(0, 0.5, 0), radius=0.5)},
        settings=settings or vr.Settings(),
        animation=vr.Animation(duration=2, fps=2, tracks=tracks or {"go": go}),
        **more,
    )


def prepared_at(scene, t):
    return opened(vr.prepare(vr.at(scene, t)), scene, t)


def mean_of_sharp(scene, t, spp):
    """Mean of sharp pictures of the moments of the shutter, each with its own noise, and the variance of this mean."""
    times = scene.camera.shutter.times(t, 1 / scene.animation.fps)
    layers = "RGB", "variance"
    pictures = [
        vr.render(vr.at(scene, x), seed=seed, spp=spp, progress=False, layers=layers) for seed, x in enumerate(times, 1)
    ]
    noise = sum(p["variance"] for p in pictures) / spp / len(pictures) ** 2
    return np.mean([p["RGB"].astype(float) for p in pictures], 0), noise


@given(
    moments=st.integers(1, 70),
    spp=st.integers(1, 90) | st.none(),
    shifts=st.lists(st.integers(0, PARTS - 1), min_size=1, max_size=4),
    cuts=st.lists(st.integers(0, 60), max_size=4),
)
def test_each_sample_sees_the_moment_of_its_index(moments, spp, shifts, cuts):
    """Rationale: the ends of moments are computed in whole numbers. Expected: those of a loop over all samples."""
    sweeps, shift, end = Sweeps(moments, spp), np.array(shifts, np.int64), 60
    seen = np.full((len(shift), end), -1)
    for begin, last in sweeps.ranges(end):
        for i in range(begin, min(last, end)):
            seen[:, i] = (((i - begin) * PARTS + shift) * moments) // ((last - begin) * PARTS)
    assert (seen >= 0).all() and (seen < moments).all()
    for low, high in zip([0, *sorted(cuts)], [*sorted(cuts), end]):
        covered = np.full((len(shift), end), -1)
        for begin, last in sweeps.ranges(high):
            done, stop = (np.clip(x, begin, last) for x in (np.full(len(shift), low), np.full(len(shift), high)))
            for number in range(moments):
                now = np.clip(sweeps.end_of(number, begin, last, shift), done, stop)
                for lane in range(len(shift)):
                    covered[lane, done[lane] : now[lane]] = number
                done = now
        assert np.array_equal(covered[:, low:high], seen[:, low:high])


@pytest.mark.parametrize("moments, spp", [(8, 64), (64, 64), (32, 2)])
def test_samples_of_a_sweep_are_spread_evenly(moments, spp):
    """Over all shifts, each moment has the same number of samples; in a pixel they differ by at most one."""
    sweeps, shift = Sweeps(moments, spp), np.arange(0, PARTS, 64)
    ends = np.array([sweeps.end_of(k, 0, spp, shift) for k in range(-1, moments)])
    counts = np.diff(ends, axis=0)
    assert counts.sum(0).tolist() == [spp] * len(shift)
    assert np.ptp(counts, axis=0).max() <= 1
    assert np.allclose(counts.mean(1), spp / moments)


@pytest.mark.slow
def test_blur_is_the_mean_of_sharp_pictures():
    """Rationale: a sample sees one of 64 moments. Expected: the mean of 64 sharp pictures, within the noise of both."""
    scene = moving(vr.Shutter(close=1, moments=64))
    image = vr.render(scene, at=1.0, spp=256, progress=False)
    sharp, noise = mean_of_sharp(scene, 1.0, 16)
    noise = noise + image["variance"] / 256
    excess = np.square(image["RGB"] - sharp).mean() / noise.mean()
    # Stratified samples have less noise than the variance says, so the ratio is at most 1, and not 0 by chance.
    assert 0.005 < excess < 1
    assert abs((image["RGB"] - sharp).mean()) < 4 * np.sqrt(noise.mean() / sharp.size)
    assert np.abs(vr.render(vr.at(scene, 1.0), spp=64, progress=False)["RGB"] - sharp).max() > 0.1


def test_error_of_a_blurred_picture_is_true():
    scene = moving(vr.Shutter(close=1, moments=16))
    image = vr.render(scene, at=1.0, error=0.02, progress=False)
    truth, _ = mean_of_sharp(scene, 1.0, 256)
    luminance = (truth @ [0.2126, 0.7152, 0.0722]).mean()
    error = np.sqrt(np.square(image["RGB"] - truth).mean()) / luminance
    assert error < image.metadata["error_high"] < 0.0201
    assert error > image.metadata["error_low"] / 2


def test_bits_do_not_depend_on_passes_or_tiles():
    prepared = prepared_at(moving(settings=vr.Settings(spp=20)), 1.0)
    whole = expose(prepared)[0]
    film = empty_film(prepared)
    for targets in (1, np.arange(len(prepared.order)) % 20, 20):
        film = exposed_once(prepared, film, np.maximum(film.counts, targets))
    tiles = [expose(subset(prepared, lanes))[0] for lanes in np.split(np.arange(len(prepared.order)), [1, 500])]
    for other in (film, Film.merged(tiles)):
        assert all(np.array_equal(np.array(x), np.array(y)) for x, y in zip(whole.moments.arrays, other.moments.arrays))


def test_a_film_of_another_shutter_is_refused(tmp_path):
    half, whole = (prepared_at(moving(vr.Shutter(close=x)), 1.0) for x in (0.5, 1))
    expose(half)[0].save(tmp_path / "film")
    film = Film.load(half.a, tmp_path / "film", empty_film(half).identity)
    assert film.counts.min() == 16
    with pytest.raises(vr.UserError, match="is of another scene"):
        Film.load(half.a, tmp_path / "film", empty_film(whole).identity)


@pytest.mark.parametrize("sampler", ["stratified", "sobol", "independent"])
def test_later_frames_compile_nothing(sampler):
    scene = moving(settings=vr.Settings(sampler=sampler, spp=6))
    vr.render(scene, at=0.0, progress=False)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        images = [vr.render(scene, at=x, progress=False) for x in (0.5, 1.0)]
        compiled = [k for k in dr.kernel_history([dr.KernelType.JIT]) if not k["cache_hit"] or k["cache_disk"]]
    assert compiled == [] and not np.array_equal(images[0]["RGB"], images[1]["RGB"])


def test_without_motion_there_is_no_blur():
    """Off costs nothing: the scene has no moments, and the picture has the bits of the plain scene."""
    rest = vr.KeysTrack(address="objects.ball.radius", times=(0, 1, 2), values=(0.5, 0.5, 0.6))
    scene = moving(tracks={"rest": rest})
    assert values_while_open(scene, 0.0) == () and len(values_while_open(scene, 1.0)) == 16
    assert values_while_open(replace(scene, camera=replace(scene.camera, shutter=None)), 1.0) == ()
    blurred, sharp = (vr.render(x, progress=False) for x in (scene, vr.at(scene, 0.0)))
    assert np.array_equal(blurred["RGB"], sharp["RGB"])
    assert blurred.metadata["scene_hash"] == sharp.metadata["scene_hash"]
    assert blurred.metadata["time"] == 0.0 and "time" not in sharp.metadata


TRACKS = {
    "camera": vr.OrbitTrack(turns=0.25),
    "light": vr.KeysTrack(address="lights.lamp.intensity", times=(0, 2), values=(0.0, 4.0)),
    "transform": vr.SpinTrack(of="objects.box", turns=1),
    "material": vr.KeysTrack(address="materials.red.kd", times=(0, 2), values=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
}


@pytest.mark.parametrize("name", TRACKS)
def test_everything_that_moves_is_blurred(name):
    box = vr.Box(min=(-1, 0, -1), max=(1, 1, 1), material="red")
    scene = moving(vr.Shutter(close=1, moments=4), tracks={name: TRACKS[name]})
    scene = replace(scene, objects=scene.objects | {"box": box}, materials={"red": vr.Material(kd=(0.5, 0.1, 0.1))})
    image = vr.render(scene, at=1.0, spp=64, progress=False)
    sharp, noise = mean_of_sharp(scene, 1.0, 16)
    assert np.square(image["RGB"] - sharp).mean() < (noise + image["variance"] / 64).mean()
    still = vr.render(vr.at(scene, 1.0), spp=64, progress=False)["RGB"]
    assert np.abs(still - sharp).max() > 0.01
