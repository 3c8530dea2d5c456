"""Passes of a kernel without tracing: what Dr.Jit recorded in a first pass is played again with new numbers.

Python traces a pass, that is, records its operations for the kernel. This takes 10 to 120 ms, for a picture of any
size. While a camera moves or a slider is dragged, only the numbers in the arrays change, and not the operations. So
each structure of a scene is traced once, in a function that Dr.Jit freezes (dr.freeze).

The structure is all that a kernel scene contains but the numbers in its arrays. It is compared in full: if anything
differs, the pass is traced anew. The bits are those of a pass that is traced (tests/test_live_replay.py).
"""

import gc
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator
from visray.accel.origin import Geometry, ListCache
from visray.columns import Names
from visray.features import Features
from visray.kernel_scene import KernelScene
from visray.moments import Moments
from visray.sampling import SamplePlan
from visray.scene.garbage import uncollected
from visray.setup import Prepared

# Number of structures whose recordings are kept. A slider that switches an effect on and off has two.
KEPT = 12
# A structure that must be recorded more often than this is traced each time: replaying it saves nothing.
MOST_RECORDINGS = 6
# Values that are compared as they are.
PLAIN = (bool, int, float, str, bytes, frozenset, type)
# A hole in a structure, where an array was.
HOLE = object()
# What kernels read of these types, as a mark; their other contents are not looked at.
READ: dict[type, Callable[[Any], Any]] = {
    Names: len,
    Features: lambda x: (tuple(f.name for f in x.listed if f.on), x.shininess_bits),
    ListCache: lambda x: None,
}


class Replays:
    """Recordings of passes, by the structure of their scenes.

    compiled: number of passes so far that were recorded, and may have been compiled
    """

    def __init__(self) -> None:
        self._recorded: OrderedDict[tuple, _Recorded] = OrderedDict()
        self._parts: dict[str, tuple[Any, list, tuple]] = {}
        self._last: tuple[KernelScene, list, tuple] | None = None
        self._geometries: OrderedDict[int, tuple[Geometry, list, tuple]] = OrderedDict()
        self.compiled = 0

    def knows(self, prepared: Prepared) -> bool:
        """Whether a pass of the scene needs no compilation."""
        return (prepared.a, self._taken(prepared.kernel)[1]) in self._recorded

    def sampled(
        self, prepared: Prepared, x: Any, y: Any, moments: Moments, first: int, count: int
    ) -> tuple[Moments, bool]:
        """The moments of pixels after more samples, and whether the pass was recorded. Dr.Jit computes them meanwhile.

        x, y: columns and rows of the pixels
        moments: moments of these pixels before
        first: number of samples of each pixel before
        count: number of new samples of each pixel
        """
        a, settings = prepared.a, prepared.scene.settings
        plan = SamplePlan.of(a, settings.seed, settings.spp, first, count)
        arrays, marks = self._taken(prepared.kernel)
        key = a, marks
        recorded = self._recorded.get(key)
        if recorded is None:
            recorded = self._recorded[key] = _Recorded(prepared.kernel)
            while len(self._recorded) > KEPT:
                self._recorded.popitem(last=False)
        self._recorded.move_to_end(key)
        before = recorded.count
        new = recorded(arrays, plan, x, y, moments)
        is_new = recorded.count != before
        self.compiled += is_new
        return new, is_new

    def _taken(self, kernel: KernelScene) -> tuple[list, tuple]:
        """The arrays of a kernel scene, each once, and the structure without them. Fields that are those of the kernel
        scene before are not taken apart again."""
        if self._last is not None and self._last[0] is kernel:
            return self._last[1:]
        places: dict[int, int] = {}
        arrays: list = []
        marks: list = []
        for name, value in vars(kernel).items():
            known = self._parts.get(name)
            if known is None or known[0] is not value:
                own: list = []
                known = self._parts[name] = value, own, tuple(_marks(value, own, {}, self._geometry))
            marks.append(known[2])
            for array in known[1]:
                if id(array) not in places:
                    places[id(array)] = len(arrays)
                    arrays.append(array)
                marks.append(places[id(array)])
        self._last = kernel, arrays, tuple(marks)
        return self._last[1:]

    def _geometry(self, geometry: Geometry) -> tuple[list, tuple]:
        """The arrays and the marks of a geometry. Most kernel scenes have that of one before."""
        known = self._geometries.get(id(geometry))
        # The tree may have been built since then.
        if known is None or known[0] is not geometry or len(known[2][1]) != len(vars(geometry)):
            own: list = []
            fields, numbers = dict(sorted(vars(geometry).items())), {}
            marks = [m for part in fields.values() for m in _marks(part, own, numbers, self._geometry)]
            known = self._geometries[id(geometry)] = geometry, own, (Geometry, tuple(fields), tuple(marks))
            while len(self._geometries) > KEPT:
                self._geometries.popitem(last=False)
        return known[1:]


class _Recorded:
    """A pass of scenes of one structure. As a function, it returns the new moments."""

    def __init__(self, kernel: KernelScene):
        self.counted = kernel.features["coverage"]
        places: dict[int, int] = {}
        order: list[int] = []

        def hole(array: Any) -> Any:
            order.append(places.setdefault(id(array), len(places)))
            return HOLE

        # One field after the other, as Replays takes kernel scenes apart.
        self.skeleton = {name: _copied(value, hole, {}) for name, value in vars(kernel).items()}
        self.order = tuple(order)
        self.frozen = dr.freeze(self._traced)
        self.recordings = 0

    @property
    def count(self) -> int:
        """Number of recordings so far; one more after each pass that is traced."""
        return self.frozen.n_recordings + self.recordings

    def __call__(self, arrays: list, plan: SamplePlan, x: Any, y: Any, moments: Moments) -> Moments:
        numbers = tuple(vars(plan).values())
        if self.frozen.n_recordings > MOST_RECORDINGS:
            self.recordings += 1
            made = self._traced(arrays, numbers, x, y, moments.arrays)
        else:
            # If an array that reads NumPy's memory ends while Dr.Jit records, the process is ended.
            if not self.frozen.n_recordings:
                gc.collect()
            with uncollected():
                made = self.frozen(arrays, numbers, x, y, moments.arrays)
        if self.counted:
            return Moments(*made)
        return Moments(*made[:2], moments.coverage, *made[2:], moments.open_coverage)

    def _traced(self, arrays: list, numbers: tuple, x: Any, y: Any, moments: tuple) -> tuple:
        """The arrays of the new moments, without those that do not change."""
        source = iter([arrays[i] for i in self.order])
        kernel = object.__new__(KernelScene)
        fill = lambda _: next(source)  # noqa: E731 - the next array for each hole
        vars(kernel).update({name: _copied(value, fill, {}) for name, value in self.skeleton.items()})
        made = integrator.sample(kernel, SamplePlan(*numbers), x, y, Moments(*moments)).arrays
        return made if self.counted else (*made[:2], *made[3:6])


def _is_record(x: Any) -> bool:
    """Whether a value is an object of visray with fields, and no class or function."""
    kind = type(x)
    return kind.__module__.startswith("visray.") and kind not in READ and hasattr(x, "__dict__")


def _marks(x: Any, arrays: list, known: dict[int, int], geometry: Callable) -> list:
    """What a value contains beside arrays, as a list of marks that can be compared. Its arrays are added to `arrays`.

    known: numbers of the values that were met before, by identity
    geometry: function that returns the arrays and the marks of a geometry
    """
    if dr.is_array_v(x):
        arrays.append(x)
        return [type(x)]
    if x is None or isinstance(x, PLAIN):
        return [x]
    if id(x) in known:
        return [("again", known[id(x)])]
    known[id(x)] = len(known)
    kind = type(x)
    if kind is Geometry:
        own, marks = geometry(x)
        arrays.extend(own)
        return [marks]
    if kind in READ:
        return [kind, READ[kind](x)]
    if isinstance(x, tuple | list):
        return [kind, len(x), *(m for part in x for m in _marks(part, arrays, known, geometry))]
    if isinstance(x, dict):
        return [kind, tuple(x), *(m for part in x.values() for m in _marks(part, arrays, known, geometry))]
    if _is_record(x):
        fields = vars(x)
        return [kind, tuple(fields), *(m for part in fields.values() for m in _marks(part, arrays, known, geometry))]
    if isinstance(x, np.ndarray):
        return [kind, x.shape, x.tobytes()]
    # Anything else, such as a function, is the same only if it is identical.
    return [_Identity(x)]


class _Identity:
    """A mark that is equal only to marks of the same object. It keeps the object, so that no other has its identity."""

    def __init__(self, x: Any):
        self.x = x

    def __eq__(self, other: Any) -> bool:
        return isinstance(other, _Identity) and self.x is other.x

    def __hash__(self) -> int:
        return id(self.x)


def _copied(x: Any, change: Callable[[Any], Any], known: dict[int, Any]) -> Any:
    """A copy of a value with `change` applied to each array and each hole, in the order of _marks.

    known: copies of the values that were met before, by identity
    """
    if dr.is_array_v(x) or x is HOLE:
        return change(x)
    if x is None or isinstance(x, PLAIN):
        return x
    if id(x) in known:
        return known[id(x)][0]
    if isinstance(x, tuple | list):
        parts = [_copied(part, change, known) for part in x]
        made = parts if isinstance(x, list) else type(x)(*parts) if hasattr(x, "_fields") else tuple(parts)
    elif isinstance(x, dict):
        made = {name: _copied(part, change, known) for name, part in x.items()}
    elif _is_record(x):
        made = object.__new__(type(x))
        fields, own = vars(x).items(), known
        if type(x) is Geometry:
            # It is taken apart on its own. The order in which its parts were computed does not matter.
            fields, own = sorted(fields), {}
        vars(made).update({name: _copied(part, change, own) for name, part in fields})
    else:
        made = x
    # The value is kept, too, so that no other gets its identity.
    known[id(x)] = made, x
    return made
