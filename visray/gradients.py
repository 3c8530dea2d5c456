"""Derivatives of a picture by the numbers of its scene, named by address.

Found detached, felt attached: which object is seen, and which light is blocked, is looked for without derivatives;
where the winner is hit and how it is shaded carries them. So a derivative holds what happens inside every visible
patch, and not what a moving silhouette or shadow edge adds: where that is left out, `gradient` and `derivative` warn.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, is_dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, tables
from visray.errors import UserError
from visray.exposure import expose, set_up
from visray.images import Atlas
from visray.lighting import Beam, beam
from visray.primitives.flat import Flat
from visray.primitives.sphere import Sphere
from visray.quantities import quantities
from visray.render import adjusted
from visray.sampling import Plan
from visray.scene import address as addresses
from visray.scene.scene import Gradient, Scene
from visray.scenery import site
from visray.search import closest


class EdgeWarning(UserWarning):
    """A derivative leaves out what moving silhouettes or shadow edges add."""


@dataclass(frozen=True)
class Place:
    """Where the tables hold the number of an address: the arrays, the row, and the component or None for all three."""

    arrays: tuple[Any, ...]
    row: int
    part: int | None

    def read(self, values: Sequence[Any]) -> Any:
        """The entry, out of arrays shaped like `arrays`, summed over them."""
        entry = sum(np.array(v, float)[..., self.row] for v in values)
        return float(entry) if entry.ndim == 0 else entry if self.part is None else float(entry[self.part])

    def one_hot(self) -> list[np.ndarray]:
        """Arrays that are 1 at the entry and 0 elsewhere."""
        hot = [np.zeros(np.array(v).shape) for v in self.arrays]
        for h in hot:
            h[(Ellipsis, self.row) if self.part is None else (self.part, self.row)] = 1
        return hot


def place(scene: Scene, kin: tuple[tables.Kinship, ...], t: tables.Tables, address: str) -> Place:
    """Where the tables hold the number at `address`."""
    parts = address.split(".")
    head, name, field = (parts + ["", ""])[:3]
    if isinstance(found := addresses.value(scene, address), dict) or is_dataclass(found):
        raise UserError(f"{address}: is not one number or three; name one of its parts")
    if head == "ambient":
        return Place((t.ambient,), 0, int(name) if name else None)
    if head == "background":
        flat = not isinstance(scene.background, Gradient)
        both = (t.background.top, t.background.bottom) if flat else (getattr(t.background, name or "top"),)
        rest = name if flat else field
        return Place(both, 0, int(rest) if rest else None)
    if head == "camera":
        table, row, field, rest = t.camera, 0, name, parts[2:]
    elif head == "materials":
        table, row, rest = t.materials, list({"default": None} | scene.materials).index(name), parts[3:]
    elif head == "objects":
        return _of_object(scene, kin, t, name, parts[2:])
    elif head == "lights":
        families, all_of = tables.troops(scene), t.lights
        number = next(i for i, f in enumerate(families) if name in f.names)
        table, row, rest = all_of[number], families[number].names.index(name), parts[3:]
    elif address == "settings.occlusion.distance":
        table, row, rest = t.occlusion, 0, parts[3:]
    else:
        raise UserError(f"{address}: is not a number that a picture depends on smoothly")
    if field not in quantities(type(table)):
        raise UserError(f"{address}: has no derivative; those of {head} are {', '.join(quantities(type(table)))}")
    return Place((getattr(table, field),), row, int(rest[0]) if rest else None)


def _of_object(scene: Scene, kin: tuple[tables.Kinship, ...], t: tables.Tables, name: str, rest: list[str]) -> Place:
    """Where the tables hold a number of an object."""
    thing = scene.objects[name]
    number = next(i for i, k in enumerate(kin) if name in k.names)
    columns = thing.kind.columns(thing, t.objects[number])
    for field, column in columns.items():
        size = len(field.split("."))
        if ".".join(rest[:size]) == field:
            part = int(rest[size]) if rest[size:] else None
            return Place((column,), kin[number].names.index(name), part)
    known = ", ".join(columns) or "none of its own"
    raise UserError(f"objects.{name}.{'.'.join(rest)}: has no derivative; those of a {thing.type} are {known}")


@dataclass(frozen=True)
class Trace:
    """One differentiable rendering: the places of the addresses, and the picture that hangs on them."""

    places: dict[str, Place]
    picture: Any
    order: np.ndarray


# Fields of lights and materials that move the edges of what is lit, or of what is seen.
MOVERS = {"position", "direction", "angle", "width", "height", "normal", "radius", "ior"}


def _moves(scene: Scene, address: str) -> bool:
    movers = MOVERS | {"shininess"} if scene.settings.shading == "toon" else MOVERS
    return address.startswith(("objects.", "camera.")) or not movers.isdisjoint(address.split(".")[2:3])


def _traced(scene: Scene, wrt: Sequence[str], spp: int, mark: Callable[[Place], None], backend: str) -> Trace:
    """The picture, attached to the arrays that `mark` has enabled. Shape: (3, H W), in the order of lanes."""
    places: dict[str, Place] = {}

    def attach(kin: tuple[tables.Kinship, ...], packed: tables.Tables) -> None:
        places.update({w: place(scene, kin, packed, w) for w in wrt})
        for p in places.values():
            mark(p)

    made = set_up(scene, backend, wrt=tuple(wrt), attach=attach)
    s = made.stage.scenery
    if s.features["coloured shadows"] and any(len(k.names) > tables.WRITTEN_OUT for k in s.kin):
        most = tables.WRITTEN_OUT
        raise UserError(f"objects: derivatives through shadows in colour are had for up to {most} objects of a kind")
    clear = [k for k in s.kin if k.kind.searched and k.kind.closed]
    if s.features["coloured shadows"] and clear and any(_moves(scene, w) for w in wrt):
        name = clear[0].names[0]
        raise UserError(f"objects.{name}: derivatives through the coloured shadow of a capped polynomial are not had")
    if any(_moves(scene, w) for w in wrt) and (edges := _edges(made.stage, made.x, made.y)):
        warnings.warn(f"{edges}: the derivative leaves out what their motion adds", EdgeWarning, stacklevel=3)
    plan = Plan.of(made.a, scene.settings.seed, spp, 0, spp)
    return Trace(places, integrator.attached(made.stage, plan, made.x, made.y), made.order)


def _edges(stage: integrator.Stage, x: Any, y: Any) -> str:
    """What edges there are in what is seen, or nothing: then no derivative is missing but within a pixel."""
    s = stage.scenery
    ray = integrator.camera_ray(stage, s.a.F(x) + 0.5, s.a.F(y) + 0.5)
    hit = closest(stage.watch, ray)
    here = site(s, ray, hit, integrator.first_draw(stage, dr.width(x)))
    lit = [_fully(beam(s, here, lamp)) for lamp in s.lamps if not lamp.kind.wide]
    found = []
    seen = np.unique(np.array(hit.index))
    if len(seen) > 1:
        found.append("silhouettes")
    kinds = [k.kind for k in s.kin for _ in k.names]
    if any(not issubclass(kinds[i], (Flat, Sphere)) for i in seen if i < len(kinds)):
        found.append("creases")
    if any(np.any(np.array(l)) and not np.all(np.array(l)) for l in lit):
        found.append("shadow edges")
    if s.features["textures"] and _has_steps(s.atlas):
        found.append("texture edges")
    if s.settings.shading == "toon":
        found.append("steps of a cartoon")
    # What samples, or rays by way of other surfaces, meet has edges of its own, unless there is nothing to meet.
    others = {"penumbras": "area lights", "occlusion": "sky occlusion", "closeness": "near occlusion", "paths": "paths"}
    if len(kinds) > 1:
        found += [what for what, effect in others.items() if s.features[effect]]
    return " and ".join(found) + " are in view" if found else ""


def _fully(b: Beam) -> Any:
    """Where all of the light arrives."""
    return b.reached if b.share is None else b.reached & (b.share.x == 1) & (b.share.y == 1) & (b.share.z == 1)


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
        return {w: p.read([np.zeros(np.array(v).shape) for v in p.arrays]) for w, p in trace.places.items()}
    dr.backward(worth)
    return {w: p.read([dr.grad(v) for v in p.arrays]) for w, p in trace.places.items()}


def derivative(
    scene: Scene, address: str, *, spp: int | None = None, precision: str = "double", backend: str = "llvm"
) -> np.ndarray:
    """Forward mode: the derivative of every pixel by the number at one address. Shape: (H, W, 3).

    For an address of three numbers: the derivative as all three grow alike; name one with `.0`, `.1` or `.2`.
    """
    scene = adjusted(scene, precision=precision, spp=spp)

    def mark(p: Place) -> None:
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
        made = set_up(addresses.replaced(scene, address, tuple(moved) if moved.ndim else float(moved)))
        mean = np.array(expose(made)[0].mean).T
        sides.append(np.empty_like(mean))
        sides[-1][made.order] = mean
    return ((sides[0] - sides[1]) / (2 * width)).reshape(scene.film.height, scene.film.width, 3)


def _mean(picture: Any) -> Any:
    return dr.mean(picture.x + picture.y + picture.z) / 3
