"""The engine of the live picture: wishes from other threads, viewers, errors, and kernels."""

import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import drjit as dr
import numpy as np
import pytest
from live_support import Watcher, small_scene, until

import visray as vr
from visray.live.engine import Engine
from visray.live.picture import LivePicture
from visray.live.screen import displayed
from visray.pass_timer import Compilations
from visray.scene.adjusted import adjusted

SIZE = (48, 32)


@contextmanager
def running(scene=None, target=0.2, watchers=1, **options):
    """An engine with viewers that have their first whole picture."""
    engine, watching = Engine(scene or small_scene(), target=target), [Watcher(SIZE) for _ in range(watchers)]
    engine.told, engine.busy = [], []
    engine.on_error(engine.told.append)
    engine.on_busy(engine.busy.append)
    with engine:
        for one in watching:
            engine.add(one.viewer)
        for one in watching:
            assert until(lambda one=one: any(f.grain == 1 and f.share == 1 for f in one.frames))
        yield (engine, *watching)


def finished(watcher, engine):
    """The finished state of the newest change."""
    assert until(lambda: watcher.frames and watcher.frames[-1].finished and watcher.frames[-1].change == engine.changes)
    return watcher.frames[-1]


def pixel_light(scene, n, size=SIZE):
    """What a render with n samples of each pixel shows."""
    return displayed(vr.render(adjusted(scene, sampler="sobol"), spp=n, size=size, progress=False)["RGB"])


def test_the_picture_is_that_of_a_render():
    with running() as (engine, watcher):
        frame = finished(watcher, engine)
    shown = pixel_light(small_scene(), round(frame.samples))
    # Layer RGB is in single precision, so few numbers round differently.
    assert (frame.rgb != shown).mean() < 1e-3
    assert frame.seconds > 0
    assert frame.error <= 0.2


def test_the_newest_value_wins():
    with running() as (engine, watcher):
        before, sent = engine.changes, len(watcher.frames)
        for i in range(1000):
            engine.assign({"objects.ball.radius": 0.2 + 0.0004 * i})
        assert until(lambda: engine.edits.get("objects.ball.radius") == 0.2 + 0.0004 * 999)
        frame = finished(watcher, engine)
        assert engine.changes - before < 900
        assert {f.change for f in watcher.frames[sent:]} <= set(range(before, engine.changes + 1))
        assert not engine.told
    scene = vr.replaced(small_scene(), "objects.ball.radius", 0.2 + 0.0004 * 999)
    assert (frame.rgb != pixel_light(scene, round(frame.samples))).mean() < 1e-3


def test_two_viewers_have_their_own_camera_and_size():
    other = vr.Camera(origin=(4.0, 2.0, 3.0))
    with running(watchers=2) as (engine, one, two):
        two.viewer.look(camera=other, size=(40, 20))
        assert until(lambda: two.frames[-1].size == (40, 20) and two.frames[-1].finished)
        mine, yours = finished(one, engine), two.frames[-1]
    assert mine.size == SIZE
    shown = pixel_light(small_scene(camera=other), round(yours.samples), (40, 20))
    assert (yours.rgb != shown).mean() < 1e-3
    assert (mine.rgb != pixel_light(small_scene(), round(mine.samples))).mean() < 1e-3


def test_a_viewer_that_is_removed_gets_nothing_more():
    with running(watchers=2) as (engine, one, two):
        engine.remove(two.viewer)
        assert engine.ask(lambda prepared: True).result(60)
        sent = len(two.frames)
        engine.assign({"objects.ball.radius": 0.3})
        finished(one, engine)
        assert len(two.frames) == sent


def test_a_viewer_whose_function_fails_holds_up_nobody():
    with running() as (engine, watcher):
        broken = Watcher(SIZE)
        broken.viewer.send = lambda frame: 1 / 0
        engine.add(broken.viewer)
        assert until(lambda: broken.told)
        assert broken.told == [("internal error: ZeroDivisionError: division by zero",)]
        engine.remove(broken.viewer)
        engine.assign({"objects.ball.radius": 0.4})
        finished_after(watcher, engine, 1)
        assert engine.told == watcher.told == []


def test_an_error_of_one_view_is_told_there_alone_until_it_is_good_again():
    with running(watchers=2) as (engine, one, two):
        two.viewer.look(camera=vr.Camera(origin=(0.0, 0.0, 1e-320)))
        assert until(lambda: two.told)
        assert two.told[0][0].startswith("camera.target = ")
        engine.assign({"objects.ball.radius": 0.4})
        finished_after(one, engine, 1)
        assert len(two.told) == 1
        two.viewer.look(camera=vr.Camera(origin=(0.0, 2.0, 6.0)))
        finished(two, engine)
        assert two.told[1:] == [()]
        assert engine.told == one.told == []


def test_a_listener_to_errors_of_a_view_may_fail():
    with running() as (engine, watcher):
        watcher.viewer.fail = lambda lines: 1 / 0
        watcher.viewer.look(camera=vr.Camera(origin=(0.0, 0.0, 1e-320)))
        assert until(lambda: engine.told)
        assert engine.told[-1] == ("internal error: ZeroDivisionError: division by zero",)
        assert engine.ask(lambda prepared: 3).result(60) == 3


def test_refused_values_are_told_and_the_others_count():
    with running() as (engine, watcher):
        engine.assign({"objects.ball.radius": -1.0})
        assert until(lambda: engine.told)
        assert engine.told[-1][0].startswith("objects.ball.radius = -1")
        assert engine.edits == {}
        with engine._lock:
            engine.assign({"objects.ball.radius": 0.5, "materials.red.kd": "redd", "objects.ball.center.0": 0.25})
        assert until(lambda: len(engine.edits) == 2)
        assert until(lambda: engine.told[-1][0].startswith("materials.red.kd"))
        assert engine.scene.objects["ball"].radius == 0.5
        engine.assign({"objects.ball.radius": 0.4})
        assert until(lambda: engine.told[-1] == ())
        finished(watcher, engine)


def test_work_is_done_in_the_thread_that_renders():
    with running() as (engine, watcher):
        watcher.viewer.look(size=(20, 12))
        assert until(lambda: watcher.frames[-1].size == (20, 12))
        seen = engine.ask(lambda prepared: (threading.current_thread().name, prepared.scene.film), watcher.viewer)
        name, film = seen.result(60)
        assert name == "visray live"
        assert (film.width, film.height) == (20, 12)
        assert engine.ask(lambda prepared: prepared.scene.film.width).result(60) == vr.Film().width
        with pytest.raises(ZeroDivisionError):
            engine.ask(lambda prepared: 1 / 0).result(60)
        assert engine.ask(lambda prepared: 5).result(60) == 5
    assert engine.ask(lambda prepared: 6).cancelled()


def test_effects_are_left_out():
    changes = []
    with running() as (engine, watcher):
        engine.on_scene(changes.append)
        finished(watcher, engine)
        engine.leave_out(("shadows",))
        frame = finished_after(watcher, engine, 1)
        assert engine.left_out == ("shadows",)
        assert not engine.ask(lambda prepared: prepared.features["shadows"]).result(60)
        engine.leave_out(())
        again = finished_after(watcher, engine, 2)
        assert engine.ask(lambda prepared: prepared.features["shadows"]).result(60)
    assert [change.kind for change in changes] == ["effects", "effects"]
    assert frame.rgb.astype(int).sum() > again.rgb.astype(int).sum()


def finished_after(watcher, engine, changes):
    """The finished state after so many changes."""
    assert until(lambda: engine.changes >= changes)
    return finished(watcher, engine)


def test_another_scene_is_shown_and_edits_are_forgotten():
    with running() as (engine, watcher):
        engine.assign({"objects.ball.radius": 0.3})
        finished_after(watcher, engine, 1)
        other = small_scene(objects={"box": vr.Box()})
        engine.show(other)
        frame = finished_after(watcher, engine, 2)
        assert engine.edits == {}
        assert list(engine.scene.objects) == ["box"]
    assert (frame.rgb != pixel_light(other, round(frame.samples))).mean() < 1e-3


def test_moments_of_an_animation():
    track = vr.KeysTrack(address="objects.ball.center", times=(0.0, 1.0), values=((0.0, 0.6, 0.0), (1.0, 0.6, 0.0)))
    scene = small_scene(animation=vr.Animation(duration=1.0, tracks={"roll": track}))
    changes = []
    with running(scene) as (engine, watcher):
        engine.on_scene(changes.append)
        engine.seek(0.5)
        frame = finished_after(watcher, engine, 1)
        assert engine.time == 0.5
        engine.seek(7.0)
        finished_after(watcher, engine, 2)
        assert engine.time == 1.0
        assert engine.scene.animation is not None
    assert [change.kind for change in changes] == ["time", "time"]
    assert (frame.rgb != pixel_light(vr.at(scene, 0.5), round(frame.samples))).mean() < 1e-3


def test_nothing_is_compiled_while_a_slider_or_the_camera_moves():
    counted = []

    def begin(prepared):
        counted.append(Compilations().__enter__())

    def end(prepared):
        counted[0].__exit__(None, None, None)
        return counted[0].count

    def moved(engine, watcher, i):
        engine.assign({"objects.ball.radius": 0.3 + 0.02 * i, "lights.lamp.position.0": 3.0 + i})
        watcher.viewer.look(camera=vr.Camera(origin=(0.1 * i, 1.5, 5.0)))
        finished_after(watcher, engine, i + 1)

    with running() as (engine, watcher):
        # The first moves meet each grain once.
        for i in range(3):
            moved(engine, watcher, i)
        engine.ask(begin).result(60)
        for i in range(3, 9):
            moved(engine, watcher, i)
        assert engine.ask(end).result(60) == 0
        assert engine.busy.count("compiling") == 1


def test_engine_tells_what_it_is_busy_with():
    with running() as (engine, watcher):
        finished(watcher, engine)
        assert engine.busy[:2] == ["preparing the scene", "compiling"]
        assert engine.busy[-1] is None


def test_errors_of_the_program_are_told(monkeypatch):
    with running() as (engine, watcher):
        finished(watcher, engine)
        with monkeypatch.context() as patch:
            patch.setattr(LivePicture, "step", lambda self: {}["lost"])
            engine.assign({"objects.ball.radius": 0.3})
            assert until(lambda: watcher.told)
            assert watcher.told == [("internal error: KeyError: 'lost'",)]
        engine.assign({"objects.ball.radius": 0.4})
        finished_after(watcher, engine, 2)
        assert watcher.told[1:] == [()]


def test_a_listener_that_fails_is_told(monkeypatch):
    with running() as (engine, watcher):
        engine.on_scene(lambda change: 1 / 0)
        engine.assign({"objects.ball.radius": 0.3})
        finished_after(watcher, engine, 1)
        assert any(lines and "ZeroDivisionError" in lines[0] for lines in engine.told)


def test_a_scene_that_cannot_be_prepared_is_told():
    bad = small_scene(camera=vr.Camera(origin=(0, 0, 0), target=(0, 0, 0)))
    told = []
    engine = Engine(bad)
    engine.on_error(told.append)
    with engine:
        watcher = Watcher(SIZE)
        engine.add(watcher.viewer)
        assert until(lambda: told and told[-1])
        engine.show(small_scene())
        assert until(lambda: watcher.frames and watcher.frames[-1].grain == 1)
        assert told[-1] == ()


def test_stop_ends_the_thread():
    engine = Engine(small_scene(), target=1e-9)
    watcher = Watcher((200, 150))
    engine.start()
    engine.add(watcher.viewer)
    assert until(lambda: any(f.grain == 1 for f in watcher.frames))
    engine.stop()
    assert not engine._thread.is_alive()
    sent = len(watcher.frames)
    engine.assign({"objects.ball.radius": 0.3})
    time.sleep(0.05)
    assert len(watcher.frames) == sent


PROGRAM = """
import sys, time
sys.path.insert(0, {tests!r})
from live_support import Watcher, small_scene
from visray.live.engine import Engine
watcher = Watcher((200, 150))
try:
    with Engine(small_scene(), target=1e-9) as engine:
        engine.add(watcher.viewer)
        while not watcher.frames:
            time.sleep(0.01)
        print("shown", flush=True)
        time.sleep(600)
except KeyboardInterrupt:
    print("ended", flush=True)
"""


def test_ctrl_c_ends_a_program(tmp_path):
    tests = __file__.rpartition("/")[0]
    program = subprocess.Popen([sys.executable, "-c", PROGRAM.format(tests=tests)], stdout=subprocess.PIPE, text=True)
    try:
        assert program.stdout.readline() == "shown\n"
        program.send_signal(signal.SIGINT)
        out, _ = program.communicate(timeout=60)
        assert out == "ended\n"
        assert program.returncode == 0
    finally:
        program.kill()


def test_seeing_a_scene_makes_only_the_view_anew():
    with running() as (engine, watcher):
        one = engine.ask(lambda prepared: prepared, watcher.viewer).result(60)
        camera = vr.Camera(origin=(1.0, 1.0, 5.0))
        watcher.viewer.look(camera=camera)
        assert until(lambda: watcher.viewer.shown and watcher.viewer.shown[0] == camera)
        other = engine.ask(lambda prepared: prepared, watcher.viewer).result(60)
    assert other.kernel.geometry.batches is one.kernel.geometry.batches
    assert other.kernel.lights is one.kernel.lights
    assert not dr.allclose(other.kernel.view.o, one.kernel.view.o)
    assert np.array_equal(other.order, one.order)
