"""A scene prepared for rendering: packed, placed, and its pixels in the order of lanes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray import film as films
from visray import images, llvm
from visray.errors import UserError
from visray.features import Features, features
from visray.kernel_scene import KernelScene, kernel_scene
from visray.pack import Packed, pack, repacked
from visray.quantities import BACKENDS, Arrays
from visray.scene import address as addresses
from visray.scene.scene import Scene


@dataclass(frozen=True)
class Prepared:
    """A scene prepared for rendering.

    packed: its numbers. kernel: what kernels read of it. order: the pixels (row * width + column) in the order of
    lanes; x, y: their columns and rows. things: what has a name in the scene, by identity.
    """

    scene: Scene
    a: Arrays
    features: Features
    packed: Packed
    kernel: KernelScene
    order: np.ndarray
    x: Any
    y: Any
    identities: tuple

    def updated(self, assignments: Mapping[str, Any]) -> "Prepared":
        """The scene with other values at some addresses. Only what changes is checked, packed and placed anew; where
        nothing but numbers change, no kernel is compiled (but where a camera or light comes to lie on a surface)."""
        if not isinstance(assignments, Mapping) or not all(isinstance(a, str) and a for a in assignments):
            raise UserError("updated: takes a dict from addresses to values, such as {'objects.ball.radius': 2.0}")
        if _identities(self.scene) != self.identities:
            raise UserError("updated: the prepared scene's own dicts were changed in place; prepare it anew")
        scene = addresses.changed(self.scene, assignments)
        return self._with(scene, repacked(self.packed, self.scene, scene, assignments, self.a))

    def adjusted(self, scene: Scene) -> "Prepared":
        """The same for a scene that differs from this one by its settings, or by the size of its film, alone."""
        if scene is self.scene or (scene.settings == self.scene.settings and scene.film == self.scene.film):
            return self
        return self._with(scene, self.packed if scene.film == self.scene.film else None)

    def _with(self, scene: Scene, packed: Packed | None) -> "Prepared":
        """With other packed numbers; None: all is prepared anew, as where other code is called for."""
        on, old = features(scene), self.kernel
        if packed is None or on != self.features or scene.settings.precision != self.scene.settings.precision:
            return prepare(scene, self.a.backend, brute_force=old.brute_force)
        kernel = kernel_scene(packed, scene, on, self.a, old.atlas, old.brute_force, (self.packed, old))
        return replace(self, scene=scene, packed=packed, kernel=kernel, identities=_identities(scene))


def prepare(
    scene: Scene,
    backend: str = "llvm",
    everything: bool = False,
    brute_force: bool = False,
    wrt: tuple[str, ...] = (),
    attach: Callable[[Packed], None] | None = None,
    without: tuple[str, ...] = (),
) -> Prepared:
    """The scene as a kernel sees it. `everything` and `brute_force` choose the slow twins of features and search;
    `without` names effects that are left out.

    wrt: the addresses that derivatives are taken by; `attach` enables them in the packed numbers, before anything is
    computed.
    """
    a = arrays(backend, scene.settings.precision)
    width, height = scene.film.width, scene.film.height
    films.check_memory(width, height)
    on, packed = features(scene, wrt, everything, without), pack(scene, a)
    if attach is not None:
        attach(packed)
    kernel = kernel_scene(packed, scene, on, a, images.pack(a, scene.textures), brute_force)
    return Prepared(scene, a, on, packed, kernel, *lanes(a, width, height), _identities(scene))


def _identities(scene: Scene) -> tuple:
    """The names in a scene, and what they name, by identity."""
    sections = scene.textures, scene.materials, scene.lights, scene.objects
    return tuple((name, id(thing)) for section in sections for name, thing in section.items())


def arrays(backend: str, precision: str) -> Arrays:
    """The array types of a backend, or one line that says why it cannot be had."""
    if backend not in BACKENDS:
        raise UserError(f"backend = {backend!r}: is none of {', '.join(BACKENDS)}")
    if backend == "llvm":
        llvm.require()
    elif not dr.has_backend(getattr(dr.JitBackend, {"cuda": "CUDA", "metal": "Metal"}[backend])):
        raise UserError(f"backend = {backend!r}: this machine has no such device; use --backend llvm")
    return Arrays.of(backend, precision)


def lanes(a: Arrays, width: int, height: int) -> tuple[np.ndarray, Any, Any]:
    """The pixels in the order of the lanes, and their columns and rows."""
    order = films.tile_order(width, height)
    y, x = np.divmod(order, width)
    x, y = (a.put(a.U, v.astype(np.uint32)) for v in (x, y))
    dr.eval(x, y)
    return order, x, y
