"""A scene prepared for rendering: packed into arrays, placed in the world, and its pixels ordered as lanes."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from math import prod
from typing import Any

import drjit as dr
import numpy as np

from visray import film as films
from visray import images, llvm
from visray.animation.moment import still_at
from visray.arguments import ONE_MOMENT, checked_arguments
from visray.clip_report import warn_of_clips
from visray.csg_report import warn_of_empty_csg
from visray.data_report import warn_of_data
from visray.differentiable import differentiable
from visray.environment_map import EnvironmentMap
from visray.environment_report import warn_of_environment
from visray.errors import UserError
from visray.features import Features, features
from visray.glass_report import warn_of_glass
from visray.images.environment import pack_map
from visray.kernel_scene import KernelScene, kernel_scene
from visray.material_report import warn_of_materials
from visray.mesh_report import warn_of_meshes
from visray.pack import Packed, pack
from visray.pass_timer import PassTimer
from visray.quantities import BACKENDS, Arrays
from visray.repack import repacked
from visray.scene import address as addresses
from visray.scene.film import Film
from visray.scene.scene import Scene
from visray.track_report import warn_of_tracks


@dataclass(frozen=True)
class Prepared:
    """A scene prepared for rendering. One lane is one pixel.

    scene: the scene
    a: array types
    features: effects that its kernel simulates
    packed: numbers of the scene as arrays
    kernel: the scene as kernels read it
    order: number (row * width + column) of each lane's pixel, among those that are rendered (Film.raster)
    x, y: column and row of each lane's pixel in the whole picture
    identities: names in the scene, each with the id() of its value, to detect that a dict of the scene was changed in
        place
    shutter: the moments at which samples see the scene (motion_blur.py); None without motion blur
    looked: what pictures of the scene were already looked at for (dark/); one set for all scenes that are made from it
        by `updated`
    pace: how long passes without motion blur take; one for the same scenes
    after: the scene of the next frame of an animation, for motion vectors; None for a scene of its own
    without: names of effects that are left out, whatever the scene asks for
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
    shutter: Any = None
    looked: set[str] = field(default_factory=set)
    pace: PassTimer = field(default_factory=PassTimer)
    after: Scene | None = None
    without: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Prepared: {repr(self.scene).removeprefix('Scene: ')}"

    @checked_arguments
    def updated(self, assignments: Mapping[str, Any]) -> "Prepared":
        """The prepared scene with other values at some addresses. Only what changes is checked, packed and placed
        again.

        If only numbers change, no kernel is compiled, except if a camera or light comes to lie on a surface.

        assignments: dict from address to new value
        """
        refuse_within_kernel()
        if not isinstance(assignments, Mapping) or not all(isinstance(a, str) and a for a in assignments):
            raise UserError("updated: takes a dict from addresses to values, such as {'objects.ball.radius': 2.0}")
        if _identities(self.scene) != self.identities:
            raise UserError("updated: the prepared scene's own dicts were changed in place; prepare it anew")
        if moving := [a for a in assignments if a.split(".")[0] == "animation" and assignments[a] is not None]:
            raise UserError(f"{moving[0]}: {ONE_MOMENT}, and prepare it anew")
        return self.changed_to(addresses.changed(self.scene, assignments), assignments)

    def changed_to(self, scene: Scene, changed: Collection[str]) -> "Prepared":
        """The scene `scene`, prepared as by `updated`. Domain: it is checked, and differs from `self.scene` only at the
        addresses `changed`."""
        return self._with(scene, repacked(self.packed, self.scene, scene, changed, self.a))

    def adjusted(self, scene: Scene) -> "Prepared":
        """The scene `scene`, prepared. Domain: it differs from `self.scene` only in its settings or in the size of its
        film."""
        if scene is self.scene or (scene.settings == self.scene.settings and scene.film == self.scene.film):
            return self
        made, film, old = self._with(scene, self.packed), scene.film, self.scene.film
        if (film.raster, film.corner) != (old.raster, old.corner) or len(made.order) != prod(film.raster):
            films.check_memory(*film.raster)
            order, x, y = lanes(self.a, film)
            made = replace(made, order=order, x=x, y=y)
        return replace(made, shutter=self.shutter.on(made)) if self.shutter else made

    def leaving_out(self, *effects: str) -> "Prepared":
        """The prepared scene without some effects. Nothing is packed or placed again.

        effects: names of effects, but not "area lights", which are kinds of lights
        """
        without = (*self.without, *effects)
        on, previous = features(self.scene, without=without), self.kernel
        kernel = kernel_scene(
            self.packed, self.scene, on, self.a, previous.atlas, previous.brute_force, (self.packed, previous)
        )
        return replace(self, features=on, kernel=kernel, without=without, shutter=None)

    def _with(self, scene: Scene, packed: Packed | None) -> "Prepared":
        """The scene `scene`, prepared with the packed numbers `packed`. If these are None, or if `scene` needs another
        kernel, everything is prepared again."""
        effects, previous = features(scene, without=self.without), self.kernel
        if packed is None or effects != self.features or scene.settings.precision != self.scene.settings.precision:
            options = {"brute_force": previous.brute_force, "without": self.without}
            return replace(prepare(scene, self.a.backend, **options), after=self.after)
        kernel = kernel_scene(
            packed, scene, effects, self.a, previous.atlas, previous.brute_force, (self.packed, previous)
        )
        return replace(self, scene=scene, packed=packed, kernel=kernel, identities=_identities(scene), shutter=None)


def prepare(
    scene: Scene,
    backend: str = "llvm",
    everything: bool = False,
    brute_force: bool = False,
    wrt: tuple[str, ...] = (),
    attach: Callable[[Packed], None] | None = None,
    without: tuple[str, ...] = (),
) -> Prepared:
    """Prepares a scene for rendering; of an animated scene its beginning.

    everything: whether all effects are simulated, even those that are zero; a reference that `features` is tested
        against
    brute_force: whether every row is tested, without guards or trees; a reference that the search is tested against
    wrt: addresses of the numbers with respect to which derivatives are taken
    attach: function that enables derivatives in the packed numbers, before anything is computed from them
    without: names of effects that are left out
    """
    warn_of_tracks(scene)
    scene = still_at(scene, None)
    a = arrays(backend, scene.settings.precision)
    refuse_within_kernel()
    films.check_memory(*scene.film.raster)
    warn_of_meshes(scene)
    warn_of_clips(scene)
    warn_of_empty_csg(scene)
    warn_of_data(scene)
    warn_of_environment(scene)
    effects, packed = features(scene, wrt, everything, without), pack(differentiable(scene, wrt) if wrt else scene, a)
    warn_of_materials(scene, effects)
    warn_of_glass(scene, effects)
    if attach is not None:
        attach(packed)
    sky = scene.background
    panorama = pack_map(a, sky) if isinstance(sky, EnvironmentMap) else None
    kernel = kernel_scene(packed, scene, effects, a, _atlas(scene, packed, a), brute_force, panorama=panorama)
    return Prepared(
        scene, a, effects, packed, kernel, *lanes(a, scene.film), _identities(scene), without=tuple(without)
    )


def refuse_within_kernel() -> None:
    """Raises UserError while Dr.Jit records a loop, a branch or a call of a caller's kernel: what visray evaluates then
    would end the process."""
    if dr.flag(dr.JitFlag.SymbolicScope):
        problem = "visray was called while Dr.Jit records a loop, a branch or a function as part of a kernel"
        raise UserError(f"{problem}; call it outside, or use a loop of Python or dr.while_loop with mode='evaluated'")


def _atlas(scene: Scene, packed: Packed, a: Arrays) -> images.Atlas | None:
    """The textures of a scene in arrays, or None. packed: its packed numbers."""
    v_ends = any(batch.kind.v_ends for batch in packed.batches)
    return images.pack(a, scene.textures, v_ends, any(m.keeps_ka for m in scene.materials.values()))


def _identities(scene: Scene) -> tuple:
    """All names in a scene, each with the id() of its value, as a tuple of pairs."""
    layers = {} if scene.data is None else scene.data.layers
    sections = scene.textures, scene.materials, scene.lights, scene.geometries, scene.objects, layers
    return tuple((name, id(value)) for section in sections for name, value in section.items())


def arrays(backend: str, precision: str) -> Arrays:
    """The array types of a backend. Raises UserError if the backend is not available."""
    if backend not in BACKENDS:
        raise UserError(f"backend = {backend!r}: is none of {', '.join(BACKENDS)}")
    if backend == "llvm":
        llvm.require()
    elif not dr.has_backend(getattr(dr.JitBackend, {"cuda": "CUDA", "metal": "Metal"}[backend])):
        raise UserError(f"backend = {backend!r}: this machine has no such device; use --backend llvm")
    return Arrays.of(backend, precision)


def lanes(a: Arrays, film: Film) -> tuple[np.ndarray, Any, Any]:
    """Number (row * width + column) of each lane's pixel among those that are rendered, and its column and row in the
    whole picture, as three arrays."""
    width, height = film.raster
    order = films.tile_order(width, height)
    y, x = np.divmod(order, width)
    x, y = (a.put(a.U, (v + first).astype(np.uint32)) for v, first in zip((x, y), film.corner))
    dr.eval(x, y)
    return order, x, y


def set_threads(threads: int) -> None:
    """Sets the number of threads of the LLVM backend."""
    if not isinstance(threads, int) or not 1 <= threads <= 1024:
        raise UserError(f"threads = {threads}: must be a whole number from 1 to 1024")
    dr.set_thread_count(threads)
