"""Derivatives of a picture with respect to numbers of its scene.

The numbers are named by address, such as `objects.ball.radius` (scene/address.py). An array is attached if it carries
derivatives, and detached if it does not.

The search is detached and shading is attached: which object is visible and which light is occluded is found without
derivatives; the point that is hit and its shading carry them. So a derivative contains what changes inside each visible
patch, but not what a moving silhouette or shadow edge adds. `gradient` and `derivative` warn if such edges are in view
(edges.py).
"""

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.policy import MAX_UNROLLED
from visray.address_index import AddressIndex, Slot, TableSlot
from visray.animation.moment import still_at
from visray.arguments import checked_arguments
from visray.attached_picture import SampleLoop, Sweeps
from visray.data.all_objects import address_of
from visray.edges import moves_edges, warn_of_edges
from visray.errors import UserError
from visray.jacobian import Launches
from visray.kernel_scene import KernelScene
from visray.pack import Packed
from visray.progress import Bar, Interrupts
from visray.scene.adjusted import adjusted
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.wavefront import Waves


class Derivatives:
    """A scene whose picture is differentiated.

    prepared: the scene
    slots: place of each address in the packed arrays
    parameters: arrays of these places, as the sources of all derivatives: for each address, one or more
    """

    def __init__(
        self, scene: Scene, wrt: Sequence[str], backend: str, tangents: Mapping[str, np.ndarray] | None = None
    ):
        """Raises UserError if a derivative does not exist, and warns if moving edges are in view.

        wrt: addresses of the numbers with respect to which derivatives are taken
        tangents: for forward mode, how much the numbers at each address grow, as for Slot.spread; None: reverse mode
        """
        self.slots: dict[str, Slot | TableSlot] = {}
        self.parameters: dict[str, list] = {}

        def attach(packed: Packed) -> None:
            index = AddressIndex(scene, packed)
            self.slots.update({w: index.slot(w) for w in wrt})
            for w, slot in self.slots.items():
                dr.enable_grad(*slot.arrays)
                self.parameters[w] = [type(v)(v) for v in slot.arrays]
                for array, growth in zip(slot.arrays, slot.spread(tangents[w]) if tangents else ()):
                    dr.set_grad(array, type(dr.detach(array))(growth))

        self.prepared = prepare(scene, backend, wrt=tuple(wrt), attach=attach)
        _check_coloured_shadows(scene, self.prepared.kernel, wrt)
        self.forward = tangents is not None
        warn_of_edges(scene, self.prepared.kernel, wrt, self.prepared.x, self.prepared.y)

    def traced(self, interrupts: Interrupts, bar: Bar) -> Sweeps | SampleLoop:
        """The picture, ready to be traced."""
        p = self.prepared
        if not p.kernel.in_waves:
            return SampleLoop(p, p.scene.settings.spp, self.forward)
        attached = [v for arrays in self.parameters.values() for v in arrays]
        launches = Launches(p.kernel, attached if self.forward else None)
        return Sweeps(Waves(p.kernel, p.scene.settings.spp, p.x, p.y), launches, interrupts, bar)

    def read(self) -> dict[str, Any]:
        """The gradients of the numbers at each address, after reverse mode."""
        return {w: slot.read([dr.grad(v) for v in self.parameters[w]]) for w, slot in self.slots.items()}


def _check_coloured_shadows(scene: Scene, s: KernelScene, wrt: Sequence[str]) -> None:
    """Raises UserError if derivatives are asked for that coloured shadows do not have."""
    if not s.features["coloured shadows"]:
        return
    if any(len(b) > MAX_UNROLLED for b in s.batches):
        limit = f"derivatives through coloured shadows work for up to {MAX_UNROLLED} objects or triangles of a kind"
        raise UserError(f"objects: {limit}; take fewer objects, or materials without kt")
    names = [name for b in s.batches if (b.kind.finds_roots or b.kind.walks) and b.kind.closed for name in b.names]
    searched_solids = {name: scene.bodies.get(name) or scene.all_objects[name] for name in names}
    transmissive = {name for name, material in scene.materials.items() if any(material.kt)}
    transmissive_solids = (
        (name, x) for name, x in searched_solids.items() if not transmissive.isdisjoint(scene.materials_of(x))
    )
    name, obj = next(transmissive_solids, (None, None))
    if obj is not None and any(moves_edges(scene, w) for w in wrt):
        problem = "no derivative with respect to motion passes through its coloured shadow"
        raise UserError(f"{address_of(name)}: {problem}; give this {obj.type} a material without kt")


@checked_arguments
def gradient(
    scene: Scene,
    wrt: Sequence[str],
    loss: Callable[[Any], Any] | None = None,
    *,
    spp: int | None = None,
    precision: str = "double",
    backend: str = "llvm",
    progress: bool = True,
) -> dict[str, Any]:
    """Derivatives of a loss with respect to the numbers at some addresses, by reverse-mode differentiation. Returns a
    dict from address to a number, to an array of three if the address names a triple, or to an array of shape (N, 3) if
    it names the N vertices of a mesh.

    wrt: the addresses, or a single one
    loss: function from the picture to one number, computed with Dr.Jit. The picture is a Dr.Jit triple whose H * W
        entries are the pixels, row by row. By default the loss is the mean over pixels and channels
    spp: samples per pixel; by default those of the scene
    progress: whether a progress bar is shown, after two seconds
    """
    scene = still_at(adjusted(scene, precision=precision, spp=spp), None)
    wrt = [wrt] if isinstance(wrt, str) else list(wrt)
    with Interrupts() as interrupts, Bar("differentiating", 1, progress, before="compiling derivatives") as bar:
        d = Derivatives(scene, wrt, backend)
        traced, order, a = d.traced(interrupts, bar), d.prepared.order, d.prepared.a
        mean, _ = traced.picture()
        rows = np.empty_like(mean)
        rows[:, order] = mean
        picture = a.put(a.V, rows)
        dr.enable_grad(picture)
        loss_value = (loss or _mean)(picture)
        _check_loss(loss_value)
        dr.backward(loss_value)
        traced.pull(np.array(dr.grad(picture), float)[:, order])
    return d.read()


def _check_loss(loss_value: Any) -> None:
    """Raises UserError if the value that a loss returned is not one number that carries the picture's derivatives."""
    advice = (
        "return one number computed with Dr.Jit from the picture, such as dr.mean(dr.squared_norm(picture - target))"
    )
    if not dr.is_array_v(loss_value):
        kind = type(loss_value).__name__
        raise UserError(f"loss: returned a value of type {kind}, which carries no derivatives; {advice}")
    if (count := prod(dr.shape(loss_value))) != 1:
        raise UserError(f"loss: returned {count} numbers, not one; {advice}")
    if not dr.grad_enabled(loss_value):
        raise UserError(f"loss: its result carries no derivatives: NumPy and dr.detach lose them; {advice}")


@checked_arguments
def derivative(
    scene: Scene,
    address: str,
    *,
    spp: int | None = None,
    precision: str = "double",
    backend: str = "llvm",
    progress: bool = True,
) -> np.ndarray:
    """Derivative of every pixel with respect to the number at one address, by forward-mode differentiation. Shapes: (H,
    W, 3).

    If the address names several numbers, all grow by the same amount; `.0`, `.1` or `.2` after the address of a triple
    names a single number.

    spp: samples per pixel; by default those of the scene
    progress: whether a progress bar is shown, after two seconds
    """
    scene = still_at(adjusted(scene, precision=precision, spp=spp), None)
    with Interrupts() as interrupts, Bar("differentiating", 1, progress, before="compiling derivatives") as bar:
        d = Derivatives(scene, [address], backend, {address: np.array(1.0)})
        _, tangent = d.traced(interrupts, bar).picture()
    picture = np.empty_like(tangent.T)
    picture[d.prepared.order] = tangent.T
    return picture.reshape(*scene.film.raster[::-1], 3)


def _mean(picture: Any) -> Any:
    """Mean of a picture over pixels and channels."""
    return dr.mean(picture.x + picture.y + picture.z) / 3
