"""A machine whose seconds are made up: they go by the work that is done, so that what hangs on time comes out the same
on each real one, whatever else that does."""

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np
import pytest

from visray import clock, integrator
from visray.kernel_scene import KernelScene
from visray.sampling import SamplePlan


class Machine:
    """Seconds pass where samples are traced, `tracing` each time, and where kernels are waited for, by their samples:
    `rate` for each and each ray of light and sky that goes with it, times what `slow` says of this pass.

    now: the seconds that have passed; passes: how many were traced.
    """

    def __init__(
        self,
        patch: pytest.MonkeyPatch,
        tracing: float = 0.01,
        rate: float = 1e-7,
        slow: Callable[[], float] = lambda: 1.0,
    ):
        self.now, self.passes, self.slow = 1e4, 0, slow
        self.pending = self.last = 0.0
        sample, sync = integrator.sample, dr.sync_thread

        def sampled(kernel: KernelScene, plan: SamplePlan, x: Any, y: Any, moments: Any, *window: Any) -> Any:
            rays = sum(int(np.array(points.count).sum()) for points in kernel.sample_sets.values())
            samples = int(np.broadcast_to(np.array(plan.count), dr.width(x)).sum())
            self.pending += rate * samples * (1 + rays / 3)
            self.now += tracing
            self.passes += 1
            return sample(kernel, plan, x, y, moments, *window)

        def synced() -> None:
            sync()
            self.last, self.pending = self.pending * self.slow(), 0.0
            self.now += self.last

        patch.setattr(integrator, "sample", sampled)
        patch.setattr(dr, "sync_thread", synced)
        patch.setattr(clock, "now", lambda: self.now)
        patch.setattr(clock, "kernel_seconds", lambda kernels: self.last)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(monkeypatch)
