"""Derivatives of a picture by the numbers of its scene, named by address.

Found detached, felt attached: which object is seen, and which light is blocked, is looked for without derivatives;
where the winner is hit and how it is shaded carries them. So a derivative holds what happens inside every visible
patch, and not what a moving silhouette or shadow edge adds: where that is left out, `gradient` and `derivative` warn.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, modes
from visray.accel.intersect import closest
from visray.accel.policy import MAX_UNROLLED
from visray.direct import LightSample, light_sample
from visray.errors import UserError
from visray.images import Atlas
from visray.interaction import interact
from visray.kernel_scene import KernelScene
from visray.pack import AddressIndex, Packed, Slot
from visray.passes import expose
from visray.render import adjusted
from visray.sampling import SamplePlan
from visray.scene import address as addresses
from visray.scene.scene import Scene, Settings
from visray.setup import prepare


class EdgeWarning(UserWarning):
    """A derivative leaves out what moving silhouettes or shadow edges add."""


@dataclass(frozen=True)
class Trace:
    """One differentiable rendering: the slots of the addresses, and the picture that hangs on them."""

    slots: dict[str, Slot]
    picture: Any
    order: np.ndarray


# Fields of lights and materials that move the edges of what is lit, or of what is seen.
MOVERS = {"position", "direction", "angle", "width", "height", "normal", "radius", "ior"}


def _moves(scene: Scene, address: str) -> bool:
    movers = MOVERS | {"shininess"} if _stepped(scene.settings) else MOVERS
    return address.startswith(("objects.", "camera.")) or not movers.isdisjoint(address.split(".")[2:3])


def _stepped(settings: Settings) -> bool:
    """Whether reflected light jumps, as in a cartoon."""
    model = modes.BY_NAME[settings.shading].model
    return model is not None and model.stepped


def _traced(scene: Scene, wrt: Sequence[str], spp: int, mark: Callable[[Slot], None], backend: str) -> Trace:
    """The picture, attached to the arrays that `mark` has enabled. Shape: (3, H W), in the order of lanes."""
    slots: dict[str, Slot] = {}

    def attach(packed: Packed) -> None:
        index = AddressIndex(scene, packed)
        slots.update({w: index.slot(w) for w in wrt})
        for slot in slots.values():
            mark(slot)

    prepared = prepare(scene, backend, wrt=tuple(wrt), attach=attach)
    s = prepared.kernel
    if s.features["coloured shadows"] and any(len(b) > MAX_UNROLLED for b in s.batches):
        most = MAX_UNROLLED
        raise UserError(f"objects: derivatives through shadows in colour are had for up to {most} objects of a kind")
    solids = [name for b in s.batches if b.kind.finds_roots and b.kind.closed for name in b.names]
    through = {name for name, material in scene.materials.items() if any(material.kt)}
    clear = [name for name in solids if scene.objects[name].material in through]
    if s.features["coloured shadows"] and clear and any(_moves(scene, w) for w in wrt):
        what = scene.objects[clear[0]].type
        text = (
            f"no derivative by what moves goes through the coloured shadow of a {what}; give it a material without kt"
        )
        raise UserError(f"objects.{clear[0]}: {text}")
    if any(_moves(scene, w) for w in wrt) and (edges := _edges(s, prepared.x, prepared.y)):
        warnings.warn(f"{edges}: the derivative leaves out what their motion adds", EdgeWarning, stacklevel=3)
    plan = SamplePlan.of(prepared.a, scene.settings.seed, spp, 0, spp)
    return Trace(slots, integrator.attached_mean(s, plan, prepared.x, prepared.y), prepared.order)


def _edges(s: KernelScene, x: Any, y: Any) -> str:
    """What edges there are in what is seen, or nothing: then no derivative is missing but within a pixel."""
    ray = integrator.camera_ray(s, s.a.F(x) + 0.5, s.a.F(y) + 0.5)
    hit = closest(s.origin, ray)
    here = interact(s, ray, hit, integrator.single_sample_state(s, dr.width(x)))
    lit = [_fully(light_sample(s, here, light)) for light in s.lights if not light.kind.has_area]
    found = []
    seen = np.unique(np.array(hit.row))
    shown = [b.kind for b in s.batches if ((seen >= b.first_row) & (seen < b.first_row + len(b))).any()]
    # What a line crosses more than twice may hide a part of itself.
    if len(seen) > 1 or any(kind.smooth and kind.max_crossings > 2 for kind in shown):
        found.append("silhouettes")
    if not all(kind.smooth for kind in shown):
        found.append("creases")
    if any(np.any(np.array(l)) and not np.all(np.array(l)) for l in lit):
        found.append("shadow edges")
    if s.features["textures"] and _has_steps(s.atlas):
        found.append("texture edges")
    if _stepped(s.settings):
        found.append("steps of a cartoon")
    # What samples, or rays by way of other surfaces, meet has edges of its own, unless there is nothing to meet.
    others = {"penumbras": "area lights", "occlusion": "sky occlusion", "closeness": "near occlusion", "paths": "paths"}
    if sum(map(len, s.batches)) > 1:
        found += [what for what, effect in others.items() if s.features[effect]]
    return " and ".join(found) + " are in view" if found else ""


def _fully(b: LightSample) -> Any:
    """Where all of the light arrives."""
    if (t := b.transmittance) is None:
        return b.arrives
    return b.arrives & (t.x == 1) & (t.y == 1) & (t.z == 1)


def _has_steps(atlas: Atlas) -> bool:
    """Whether the colour of a texture jumps: from square to square, or from pixel to pixel."""
    return atlas.rows.a is not None or not np.all(np.array(atlas.rows.smooth))


def gradient(
    scene: Scene,
    wrt: Sequence[str],
    loss: Callable[[Any], Any] | None = None,
    *,
    spp: int | None = None,
    precision: str = "double",
    backend: str = "llvm",
) -> dict[str, Any]:
    """Reverse mode: the derivative of a loss by each address, a number or an array of three.

    loss: takes the picture, a Dr.Jit triple of H * W entries row by row, to one number; by default its mean over pixels
    and channels.
    """
    scene = adjusted(scene, precision=precision, spp=spp)
    wrt = [wrt] if isinstance(wrt, str) else list(wrt)
    trace = _traced(scene, wrt, scene.settings.spp, lambda p: dr.enable_grad(*p.arrays), backend)
    picture = trace.picture
    if loss is not None:
        back = np.empty(len(trace.order), np.uint32)
        back[trace.order] = np.arange(len(back), dtype=np.uint32)
        picture = dr.gather(type(picture), picture, dr.uint32_array_t(dr.detached_t(type(picture.x)))(back))
    worth = (loss or _mean)(picture)
    if not dr.is_array_v(worth) or not dr.grad_enabled(worth):
        # Nothing that was asked for reaches the loss: all derivatives are 0.
        return {w: p.read([np.zeros(np.array(v).shape) for v in p.arrays]) for w, p in trace.slots.items()}
    dr.backward(worth)
    return {w: p.read([dr.grad(v) for v in p.arrays]) for w, p in trace.slots.items()}


def derivative(
    scene: Scene, address: str, *, spp: int | None = None, precision: str = "double", backend: str = "llvm"
) -> np.ndarray:
    """Forward mode: the derivative of every pixel by the number at one address. Shape: (H, W, 3).

    For an address of three numbers: the derivative as all three grow alike; name one with `.0`, `.1` or `.2`.
    """
    scene = adjusted(scene, precision=precision, spp=spp)

    def mark(p: Slot) -> None:
        for array, hot in zip(p.arrays, p.one_hot()):
            dr.enable_grad(array)
            dr.set_grad(array, type(dr.detach(array))(hot))

    trace = _traced(scene, [address], scene.settings.spp, mark, backend)
    slope = np.zeros((len(trace.order), 3))
    if dr.grad_enabled(trace.picture):
        slope[:] = np.array(dr.forward_to(trace.picture)).T
    picture = np.empty_like(slope)
    picture[trace.order] = slope
    return picture.reshape(scene.film.height, scene.film.width, 3)


def difference(scene: Scene, address: str, step: float = 1e-6, *, spp: int | None = None) -> np.ndarray:
    """The slow twin of `derivative`: central differences in double, with the same samples. Shape: (H, W, 3).

    Error: step^2 times the third derivative, and 1e-16 / step of rounding; edges count here.
    """
    scene = adjusted(scene, precision="double", spp=spp)
    middle = np.array(addresses.value(scene, address), float)
    width = step * max(1.0, float(np.max(np.abs(middle))))
    sides = []
    for sign in (1, -1):
        moved = middle + sign * width
        prepared = prepare(addresses.replaced(scene, address, tuple(moved) if moved.ndim else float(moved)))
        mean = np.array(expose(prepared)[0].mean).T
        sides.append(np.empty_like(mean))
        sides[-1][prepared.order] = mean
    return ((sides[0] - sides[1]) / (2 * width)).reshape(scene.film.height, scene.film.width, 3)


def _mean(picture: Any) -> Any:
    return dr.mean(picture.x + picture.y + picture.z) / 3
