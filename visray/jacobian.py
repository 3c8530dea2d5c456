"""Derivatives of launches.

A launch is one evaluation of a function of a scene and of some arrays, by a kernel. A long computation is cut into
launches, and each is differentiated by itself: its inputs are arrays in memory, and so are its results. So one kernel
serves all launches of the same code, and no kernel is larger than this code.

Words of the field: a tangent is the derivative of a value by the parameter (forward mode), an adjoint the derivative
of the loss by a value (reverse mode). An array is attached if it carries derivatives, and detached if it does not.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any

import drjit as dr
import numpy as np


class AttachedArrays:
    """The attached arrays of a record and of all records that it holds, and copies of the record with other arrays
    instead."""

    def __init__(self, record: Any):
        self.record = record
        self.arrays: list[Any] = []
        self._holders: dict[int, bool] = {}
        self._find(record)

    def _find(self, x: Any) -> bool:
        """Whether x is, or holds, an attached array. All that are found are added to `arrays`, each once."""
        if id(x) not in self._holders:
            self._holders[id(x)] = False
            if dr.is_array_v(x):
                self._holders[id(x)] = dr.grad_enabled(x)
                self.arrays += [x] if dr.grad_enabled(x) else []
            else:
                self._holders[id(x)] = bool(sum([self._find(y) for y in _parts(x).values()]))
        return self._holders[id(x)]

    def replaced(self, arrays: list[Any]) -> Any:
        """A copy of the record, with `arrays` instead of the attached arrays, in the same order."""
        return self._copy(self.record, {id(x): y for x, y in zip(self.arrays, arrays)})

    def _copy(self, x: Any, copies: dict[int, Any]) -> Any:
        """The copy of x; x itself if it holds no attached array. copies: copies by id()."""
        if not self._holders[id(x)]:
            return x
        if id(x) not in copies:
            parts = {name: self._copy(y, copies) for name, y in _parts(x).items()}
            if isinstance(x, (tuple, list)):
                new = type(x)(parts.values())
            elif isinstance(x, dict):
                new = parts
            else:
                new = copy(x)
                vars(new).update(parts)
            copies[id(x)] = new
        return copies[id(x)]


def _parts(x: Any) -> dict:
    """What x holds, by name; empty if it is no record, tuple, list or dict. It includes what a record keeps of what it
    has computed."""
    if isinstance(x, (type, str, np.ndarray)):
        return {}
    if isinstance(x, (tuple, list)):
        return dict(enumerate(x))
    return x if isinstance(x, dict) else getattr(x, "__dict__", {})


@contextmanager
def _atomic_sums() -> Iterator[None]:
    """Adjoints that several lanes share are summed by atomic operations. By default, Dr.Jit sums small arrays with a
    copy for each thread, whose size it writes into the kernel: each number of lanes would compile another kernel."""
    before = dr.expand_threshold()
    dr.set_expand_threshold(0)
    try:
        yield
    finally:
        dr.set_expand_threshold(before)


class Launches:
    """Launches that read the same scene.

    scene: the scene
    shared: its attached arrays
    values: the same arrays, detached
    tangents: their tangents; None in reverse mode
    adjoints: their adjoints, from all launches so far
    """

    def __init__(self, scene: Any, parameters: list[Any] | None = None):
        """parameters: attached arrays with their tangents; None in reverse mode."""
        self.scene = AttachedArrays(scene)
        self.shared = self.scene.arrays
        self.values = [dr.detach(x) for x in self.shared]
        self.detached_scene = self.scene.replaced(self.values)
        self.tangents = None
        if parameters is not None:
            dr.enqueue(dr.ADMode.Forward, parameters)
            dr.traverse(dr.ADMode.Forward, dr.ADFlag.ClearEdges)
            self.tangents = [dr.grad(x) for x in self.shared]
        self.adjoints = [dr.zeros(type(x), dr.width(x)) for x in self.values]
        dr.make_opaque(self.tangents, self.adjoints)

    def plain(self, f: Callable, *inputs: Any) -> Any:
        """f(scene, *inputs), evaluated, without derivatives."""
        result = f(self.detached_scene, *inputs)
        dr.make_opaque(result)
        return result

    def forward(self, f: Callable, inputs: tuple, tangents: tuple) -> tuple:
        """(results, tangents of the results, others).

        f: function of (scene, *inputs) that returns (tuple of results, others); `others` carry no derivatives
        tangents: those of the inputs
        """
        leaves = [type(x)(x) for x in (*inputs, *self.values)]
        dr.enable_grad(leaves)
        dr.set_grad(leaves, [*tangents, *self.tangents])
        results, others = f(self.scene.replaced(leaves[len(inputs) :]), *leaves[: len(inputs)])
        dr.enqueue(dr.ADMode.Forward, leaves)
        dr.traverse(dr.ADMode.Forward, dr.ADFlag.ClearEdges)
        tangents = dr.grad(results)
        results, others = dr.detach((results, others))
        dr.make_opaque(results, tangents, others)
        return results, tangents, others

    def reverse(self, f: Callable, inputs: tuple, adjoints: tuple, lanes: int) -> tuple:
        """Adjoints of the inputs. The adjoints of the shared arrays are added to `self.adjoints`.

        f: as in `forward`
        adjoints: those of the results
        lanes: number of lanes
        """
        # An array with one entry gets an entry for each lane, because Dr.Jit evaluates the whole adjoint where lanes
        # meet in one entry, and would cut the launch into a kernel for each such array.
        single = [dr.width(x) == 1 for x in self.values]
        values = [x + dr.zeros(type(x), lanes) if one else type(x)(x) for x, one in zip(self.values, single)]
        leaves = [*(type(x)(x) for x in inputs), *values]
        dr.enable_grad(leaves)
        results, _ = f(self.scene.replaced(leaves[len(inputs) :]), *leaves[: len(inputs)])
        for x, adjoint in zip(results, adjoints):
            if dr.grad_enabled(x):
                dr.set_grad(x, adjoint)
                dr.enqueue(dr.ADMode.Backward, x)
        with _atomic_sums():
            dr.traverse(dr.ADMode.Backward)
        found = [dr.grad(x) for x in leaves]
        dr.make_opaque(found)
        shared = [_sum(x) if one else x for x, one in zip(found[len(inputs) :], single)]
        self.adjoints = [x + y for x, y in zip(self.adjoints, shared)]
        dr.make_opaque(self.adjoints)
        return tuple(found[: len(inputs)])

    def pull(self) -> None:
        """Reverse mode, after all launches: hands the adjoints of the shared arrays on to the parameters."""
        for x, adjoint in zip(self.shared, self.adjoints):
            dr.set_grad(x, adjoint)
        dr.enqueue(dr.ADMode.Backward, self.shared)
        dr.traverse(dr.ADMode.Backward)


def _sum(x: Any) -> Any:
    """Sum over lanes of a number or a triple in each lane."""
    return type(x)(*(dr.sum(c) for c in x)) if dr.depth_v(x) > 1 else dr.sum(x)
