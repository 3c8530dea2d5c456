"""The animated scenes that come with visray: they move, their loops close, and later frames compile nothing."""

from pathlib import Path

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray.animation.frames import frame_times
from visray.pytree import leaves

SCENES = {
    path.stem: scene
    for path in sorted((Path(__file__).resolve().parents[1] / "scenes").glob("*.json"))
    if path.name != "schema.json" and (scene := vr.load(path)).animation is not None
}
SIZE = 32, 18
each = pytest.mark.parametrize("name", SCENES)


def numbers(scene: vr.Scene) -> list[np.ndarray]:
    """All numbers that kernels read of a scene."""
    return [np.array(x, float) for x in leaves(vr.prepare(scene).packed, shared=True)]


def differences(scene: vr.Scene, other: vr.Scene) -> list[float]:
    """The largest difference in each array of numbers of two scenes, as a share of the largest number in it."""
    pairs = list(zip(numbers(scene), numbers(other), strict=True))
    return [np.abs(a - b).max() / max(np.abs(a).max(), 1) for a, b in pairs if a.size and np.isfinite(a).all()]


def test_there_are_animated_scenes():
    assert len(SCENES) >= 5


@each
def test_the_loop_closes(name):
    """Rationale: there is no frame at the end of the animation, where the first frame is seen again. Expected: the
    numbers of the beginning, within rounding; and other numbers in between."""
    scene = SCENES[name]
    first, middle, end = (vr.at(scene, share * scene.animation.duration) for share in (0.0, 0.4, 1.0))
    assert max(differences(first, end)) < 1e-6
    assert max(differences(first, middle)) > 1e-3


@each
def test_later_frames_use_the_kernels_of_the_first_one(name):
    """So they compile nothing. Rationale: whether a kernel was compiled depends on what is in the cache, so the kernels
    themselves are compared. And the frames differ, the last one from the first one too."""
    scene, pictures, kernels = SCENES[name], [], []
    if scene.camera.shutter is not None:
        scene = vr.replaced(scene, "camera.shutter.moments", 2)
    last = len(frame_times(scene.animation)) - 1
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for image in vr.animate(scene, frames=f"0::{last // 2}", size=SIZE, spp=2, progress=False, legend=False):
            pictures.append(image["RGB"])
            kernels.append({k["hash"] for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT})
            dr.kernel_history_clear()
    assert len(pictures) >= 3 and kernels[0] and [len(found - kernels[0]) for found in kernels] == [0] * len(kernels)
    assert all((a != b).any() for i, a in enumerate(pictures) for b in pictures[:i])
