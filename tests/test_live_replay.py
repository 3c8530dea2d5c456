"""Passes that are replayed: the same bits as passes that are traced, for other numbers, cameras and sizes."""

import subprocess
import sys
from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from live_support import small_scene

import visray as vr
from visray.live.replay import Replays
from visray.live.seeing import has_lists, seen
from visray.moments import Moments
from visray.passes import empty_film, exposed_once
from visray.scene.adjusted import adjusted
from visray.setup import prepare

SCENES = Path(__file__).resolve().parents[1] / "scenes"


def balls(n):
    """A scene with n balls."""
    places = np.random.default_rng(1).uniform(-1, 1, (n, 3)).tolist()
    return small_scene(objects={f"ball {i}": vr.Sphere(center=tuple(p), radius=0.1) for i, p in enumerate(places)})


def replayed(replays, prepared, *counts):
    """The moments of all pixels after samples that are taken in passes of so many samples."""
    moments, first = Moments.empty(prepared.a, len(prepared.order)), 0
    for count in counts:
        moments, _ = replays.sampled(prepared, prepared.x, prepared.y, moments, first, count)
        dr.eval(moments)
        first += count
    return moments


def same(replays, prepared, *counts):
    """Whether replayed passes have the bits of one traced pass of the scene, prepared anew."""
    fresh = prepare(prepared.scene)
    film = exposed_once(fresh, empty_film(fresh), sum(counts))
    pairs = zip(film.moments.arrays, replayed(replays, prepared, *counts).arrays)
    return all(np.array_equal(np.array(a), np.array(b)) for a, b in pairs)


def looked_at(scene, values, lists=True):
    """Whether replayed passes are right while a camera moves, the picture's size changes, and values do."""
    base, replays = prepare(adjusted(scene, sampler="sobol")), Replays()
    camera = base.scene.camera
    for step, size in enumerate([(24, 16), (40, 30), (24, 16)]):
        moved = vr.Camera(origin=(0.3 * step, 1.0, 5.0), target=camera.target, aperture=camera.aperture)
        if not same(replays, seen(base, moved if camera.type == "perspective" else None, size, lists), 1, 3):
            return False
        base = base.updated({address: numbers[step] for address, numbers in values.items()})
    return replays.compiled == 1


def test_a_moving_camera_and_values_that_change_are_replayed():
    assert looked_at(small_scene(), {"objects.ball.radius": [0.5, 0.6, 0.7], "materials.red.kd.0": [0.1, 0.2, 0.3]})


@pytest.mark.parametrize("lists", [True, False])
def test_lists_and_tree_are_replayed(lists):
    scene = balls(60)
    prepared = seen(prepare(scene), None, (16, 16), lists)
    assert has_lists(prepared) == lists
    # Lists of other lengths may make Dr.Jit record once more, which is right, too.
    assert looked_at(scene, {"lights.lamp.position.0": [1.0, 2.0, 3.0]}, lists)


def test_without_lists_the_bits_are_the_same():
    base, replays = prepare(adjusted(balls(60), sampler="sobol")), Replays()
    one, other = (replayed(replays, seen(base, None, (32, 24), lists), 2) for lists in (True, False))
    assert all(np.array_equal(np.array(a), np.array(b)) for a, b in zip(one.arrays, other.arrays))
    assert replays.compiled == 2


def test_other_effects_are_recorded_anew():
    base, replays = prepare(adjusted(small_scene(), sampler="sobol")), Replays()
    assert not replays.knows(base)
    assert same(replays, seen(base, None, (24, 16), True), 2)
    assert replays.knows(base)
    mirror = base.updated({"materials.red.kr": (0.5, 0.5, 0.5)})
    assert not replays.knows(mirror)
    assert same(replays, seen(mirror, None, (24, 16), True), 2)
    lens = seen(base, vr.Camera(origin=(0, 1, 5), aperture=0.2), (24, 16), True)
    assert same(replays, lens, 2)
    assert replays.compiled == 3


def test_a_covered_share_is_counted():
    assert looked_at(small_scene(film=vr.Film(transparent=True), objects={"ball": vr.Sphere()}), {})


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["heart", "everything", "glass-heart", "csg-cheese", "orthographic", "many-lights", "data-globe", "mesh-in-glass"],
)
def test_scenes_are_replayed(name):
    assert looked_at(vr.load(SCENES / f"{name}.json"), {})


GARBAGE = """
import sys, gc
sys.path.insert(0, {tests!r})
import numpy as np
from live_support import small_scene
from test_live_replay import replayed
from visray import integrator
from visray.live.replay import Replays
from visray.scene.adjusted import adjusted
from visray.setup import prepare

prepared, sample = prepare(adjusted(small_scene(), sampler="sobol", size=(24, 16))), integrator.sample
gc.collect()
gc.set_threshold(0)

def collecting(*arguments):
    gc.set_threshold(5)
    return sample(*arguments)

integrator.sample = collecting
for _ in range(20):
    node = [prepared.a.F(np.ones(1000, np.float32))]
    node.append(node)
del node
print(np.isfinite(np.array(replayed(Replays(), prepared, 1, 2).mean)).all())
"""


def test_garbage_is_not_collected_while_a_pass_is_recorded():
    program = GARBAGE.format(tests=str(Path(__file__).parent))
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (ended.stdout, ended.returncode) == ("True\n", 0), ended.stderr


def test_loops_over_all_rows_are_right_too():
    scene = balls(40)
    plain = prepare(adjusted(scene, sampler="sobol", accelerator="none"))
    assert plain.kernel.geometry.plan("origin").looped
    replays = Replays()
    for turn in range(10):
        moved = vr.Camera(origin=(0.2 * turn, 1.0, 5.0))
        assert same(replays, seen(plain, moved, (16, 12), True), 2)
