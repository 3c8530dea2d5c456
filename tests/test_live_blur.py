"""Motion blur of a live picture: when it rests, it is the picture that a render of the same moment makes."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from live_support import Watcher, small_scene, until

import visray as vr
from visray.live import picture as pictures
from visray.live.blur import moves, opened
from visray.live.engine import Engine
from visray.live.screen import displayed
from visray.live.seeing import seen
from visray.live.state import State
from visray.live.viewpoint import widened
from visray.moments import Moments
from visray.motion_blur import blurred, blurring
from visray.scene.adjusted import adjusted

SIZE, NOW = (48, 32), 0.5
BALL = vr.KeysTrack(address="objects.ball.center", times=(0.0, 1.0), values=((-2.0, 0.6, 0.0), (2.0, 0.6, 0.0)))
ORIGIN = vr.KeysTrack(address="camera.origin", times=(0.0, 1.0), values=((-1.0, 1.0, 5.0), (1.0, 1.0, 5.0)))
ZOOM = vr.KeysTrack(address="camera.fov", times=(0.0, 1.0), values=(30.0, 50.0))
CAMERA = vr.Camera(origin=(0.0, 1.0, 5.0), target=(0.0, 0.5, 0.0), shutter=vr.Shutter(moments=6))


def moving(*tracks, camera=CAMERA, **fields):
    """The scene of a ball on a floor, in which tracks move something. Ten frames a second."""
    animation = vr.Animation(duration=1.0, fps=10, tracks={f"track {i}": track for i, track in enumerate(tracks)})
    return small_scene(camera=camera, animation=animation, **fields)


@contextmanager
def resting(scene, camera=None, at=NOW, **wishes):
    """An engine with a viewer whose picture is finished."""
    engine, watcher = Engine(scene, target=0.5), Watcher(SIZE, camera)
    engine.told, engine.busy = [], []
    engine.on_error(engine.told.append)
    engine.on_busy(engine.busy.append)
    engine.seek(at)
    if wishes:
        engine.leave_out(wishes["left_out"])
    with engine:
        engine.add(watcher.viewer)
        assert until(lambda: watcher.told or (watcher.frames and watcher.frames[-1].finished))
        yield engine, watcher


def rendered(scene, frame, **options):
    """A render with as many samples as a state has, as it is shown."""
    scene = adjusted(scene, sampler="sobol")
    return displayed(vr.render(scene, spp=round(frame.samples), size=SIZE, progress=False, **options)["RGB"])


def differs(one, other):
    """Share of the numbers that differ."""
    return (one != other).mean()


def test_at_rest_it_is_the_picture_of_a_render():
    scene = moving(BALL)
    with resting(scene) as (engine, watcher):
        frame = watcher.frames[-1]
    assert frame.note == "with motion blur"
    assert frame.error <= 0.5
    assert frame.samples >= 16
    # Layer RGB is in single precision, so few numbers round differently.
    assert differs(frame.rgb, rendered(scene, frame, at=NOW)) < 1e-3
    assert differs(frame.rgb, rendered(vr.at(scene, NOW), frame)) > 0.05
    # The kernel is that of the sharp picture.
    assert engine.busy.count("compiling") == 1


def test_the_sharp_picture_comes_first(monkeypatch):
    scene = moving(BALL)
    monkeypatch.setattr(pictures, "REST", 1e9)
    with Engine(scene, target=0.5) as engine:
        watcher = Watcher(SIZE)
        engine.seek(NOW)
        engine.add(watcher.viewer)
        sharp = watcher.wait(lambda f: f.samples >= 16 and f.share == 1 and f.error is not None)
        assert sharp.error <= 0.5
        assert not sharp.finished
        assert sharp.note == "sharp; motion blur comes at rest"
        monkeypatch.setattr(pictures, "REST", 0.0)
        assert watcher.wait(lambda f: f.finished).note == "with motion blur"
    assert differs(sharp.rgb, rendered(vr.at(scene, NOW), sharp)) < 1e-3


def test_steps_in_pieces_have_the_same_bits(monkeypatch):
    scene = moving(BALL)
    monkeypatch.setattr(pictures, "LONGEST", 1e-9)
    monkeypatch.setattr(pictures, "REST", 0.0)
    with resting(scene) as (_, watcher):
        frame = watcher.frames[-1]
    # Each launch is a step of its own.
    assert sum(f.note == "with motion blur" for f in watcher.frames) > 12
    assert differs(frame.rgb, rendered(scene, frame, at=NOW)) < 1e-3


def test_a_camera_at_home_is_blurred_and_another_one_stands_still():
    scene = moving(BALL, ORIGIN, ZOOM)
    home = vr.at(scene, NOW).camera
    with resting(scene) as (_, watcher):
        frame = watcher.frames[-1]
    assert differs(frame.rgb, rendered(scene, frame, at=NOW)) < 1e-3
    away = replace(home, origin=(0.0, 2.0, 5.0))
    with resting(scene, away) as (_, watcher):
        frame = watcher.frames[-1]
    still = moving(BALL, camera=replace(away, shutter=CAMERA.shutter))
    assert frame.note == "with motion blur"
    assert differs(frame.rgb, rendered(still, frame, at=NOW)) < 1e-3


def test_a_narrow_window_widens_all_moments():
    scene = moving(ZOOM)
    state = State(scene, {}, NOW).with_preparation()
    home = state.prepared.scene.camera
    wide = opened(seen(state.prepared, widened(home, 1.5), SIZE, True), state)
    fovs = [values["camera.fov"] for values in wide.shutter.values]
    times = CAMERA.shutter.times(NOW, 0.1)
    assert fovs == pytest.approx([widened(vr.at(scene, t).camera, 1.5).fov for t in times])
    same = opened(seen(state.prepared, None, SIZE, True), state)
    assert [v["camera.fov"] for v in same.shutter.values] == pytest.approx([30 + 20 * t for t in times])


def test_an_orthographic_camera_is_blurred_too():
    height = vr.KeysTrack(address="camera.height", times=(0.0, 1.0), values=(2.0, 4.0))
    scene = moving(height, camera=vr.OrthographicCamera(origin=(0.0, 1.0, 5.0), shutter=CAMERA.shutter))
    state = State(scene, {}, NOW).with_preparation()
    wide = opened(seen(state.prepared, widened(state.prepared.scene.camera, 2.0), SIZE, True), state)
    heights = [values["camera.height"] for values in wide.shutter.values]
    assert heights == pytest.approx([2 * (2 + 2 * t) for t in CAMERA.shutter.times(NOW, 0.1)])


def test_what_does_not_move_is_sharp_and_finished():
    rests = vr.KeysTrack(
        address="objects.ball.radius", times=(0.0, 0.1, 1.0), values=(0.3, 0.6, 0.6), interpolation="step"
    )
    with resting(moving(rests)) as (_, watcher):
        frame = watcher.frames[-1]
    assert frame.finished
    assert frame.note == ""
    # Only the camera moves, and the browser looks from elsewhere.
    scene = moving(ORIGIN)
    assert moves(State(scene, {}, NOW))
    with resting(scene, vr.Camera(origin=(0.0, 2.0, 5.0))) as (_, watcher):
        frame = watcher.frames[-1]
    assert frame.finished
    assert frame.note == ""
    assert not moves(State(small_scene(camera=CAMERA), {}))


def test_the_shutter_has_sliders_that_work():
    scene = moving(BALL)
    with resting(scene) as (engine, watcher):
        narrow = watcher.frames[-1]
        engine.assign({"camera.shutter.close": 1.0})
        assert until(
            lambda: engine.edits and watcher.frames[-1].finished and watcher.frames[-1].change == engine.changes
        )
        frame = watcher.frames[-1]
        assert not engine.told
    longer = vr.replaced(scene, "camera.shutter.close", 1.0)
    assert differs(frame.rgb, rendered(longer, frame, at=NOW)) < 1e-3
    assert differs(frame.rgb, narrow.rgb) > 0.02


def test_lights_that_are_left_out_are_not_moved():
    lamp = {"lamp": vr.SphereLight(position=(3.0, 5.0, 4.0), radius=0.8)}
    track = vr.KeysTrack(address="lights.lamp.radius", times=(0.0, 1.0), values=(0.5, 1.0))
    with resting(moving(BALL, track, lights=lamp), left_out=("area lights",)) as (engine, watcher):
        frame = watcher.frames[-1]
        assert not engine.told
        assert not watcher.told
    assert frame.note == "with motion blur"


def test_a_moment_that_is_not_valid_is_told():
    state = State(moving(BALL), {}, NOW).with_preparation()
    prepared = opened(seen(state.prepared, None, SIZE, True), state)
    bad = replace(prepared.shutter, values=({"objects.ball.radius": -1.0},), kernels={})
    with pytest.raises(vr.UserError, match=r"at 0\.5 s, while the shutter is open: objects.ball.radius = -1"):
        bad.kernel(0)


def test_launches_in_parts_take_the_same_samples():
    """Stands for a kernel: the mean counts samples, and the total their indices."""
    scene = moving(BALL)
    state = State(scene, {}, NOW).with_preparation()
    prepared = opened(seen(state.prepared, None, SIZE, True), state)
    a, n, rng = prepared.a, 40, np.random.default_rng(5)
    keys, first, count = rng.integers(0, 2**32, n, np.uint32), np.zeros(n, int), np.full(n, 64)
    sizes = []

    def launch(kernel, lanes, done, more, before):
        sizes.append(int(more.sum()))
        index = sum_of(done, more)
        return Moments(before.mean + a.put(a.W, np.stack([more, index, index * 0]).astype(float)), *before.arrays[1:])

    def sum_of(done, more):
        return more * done + more * (more - 1) // 2

    whole = blurred(prepared, Moments.empty(a, n), keys, first, count, launch)
    largest = max(sizes)
    sizes.clear()
    parts = Moments(*(type(x)(x) for x in Moments.empty(a, n).arrays))
    for _ in blurring(prepared, parts, keys, first, count, launch, most=n):
        pass
    assert max(sizes) <= n < largest
    assert np.array_equal(np.array(whole.mean), np.array(parts.mean))
    assert (np.array(parts.mean)[:2] == [[64], [64 * 63 // 2]]).all()
