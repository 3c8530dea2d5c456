"""Radiance and data layers along camera rays. The code of an effect is in the kernel only if the scene needs this
effect."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr

from visray import indirect, media, sampling, warp
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.background import background
from visray.batches import Batch
from visray.camera import ParallelView
from visray.geometry import UNIT_ROUNDOFF
from visray.interaction import interact
from visray.kernel_scene import KernelScene
from visray.moments import BLOCK, Moments, index_in_block
from visray.pytree import rows
from visray.ray import NO_ROW, NOTHING_KNOWN, Hit, Ray, unit
from visray.sampling import SampleState
from visray.shading import shade

# Random dimension of the point on the lens (sampling.py).
LENS = 1


@dataclass(frozen=True)
class Window:
    """A part of each lane's pixel, a rectangle of the unit square.

    left, top: corner of the rectangle
    width, height: its sides

    With a filter, the unit square is that of the random numbers that the places of samples are computed from.
    """

    left: Any
    top: Any
    width: Any
    height: Any


def camera_direction(s: KernelScene, x: Any, y: Any) -> Any:
    """Unit direction of the camera ray through the point (x, y) of the picture, in pixels from its top left corner. It
    is in single precision if shading is."""
    d = dr.normalize(s.view.corner + x * s.view.pixel_right + y * s.view.pixel_down)
    return d if s.a.precision == "single" else unit(d, s.a.W)


def camera_ray(s: KernelScene, x: Any, y: Any) -> Ray:
    """Ray of a camera without a lens through the point (x, y) of the picture, in pixels from its top left corner."""
    if isinstance(s.view, ParallelView):
        return parallel_ray(s, sheet_point(s, x, y))
    return Ray(s.view.o, camera_direction(s, x, y)).exact()


def sheet_point(s: KernelScene, x: Any, y: Any) -> Any:
    """Origin of the ray of an orthographic camera through the point (x, y) of the picture, in pixels from its top left
    corner."""
    view, number = s.view, s.a.D
    return view.o + (view.corner + number(x) * view.pixel_right + number(y) * view.pixel_down)


def parallel_ray(s: KernelScene, o: Any) -> Ray:
    """Ray of an orthographic camera that starts at o. It shares its direction with all other rays of the camera."""
    forward = s.view.forward
    return Ray(o, forward, clearance=s.view.clearance, d_single=None if s.a.V is s.a.W else s.a.V(forward))


def camera_origin(s: KernelScene, ray: Ray) -> RayOrigin:
    """The origin of camera rays without a lens."""
    return s.origin or RayOrigin(s.geometry, ray.o, shared=False).along(s.camera_lists)


def lens_ray(s: KernelScene, x: Any, y: Any, u: Any, v: Any) -> Ray:
    """Ray of a camera with a lens, for the point (x, y) of the picture. It starts at the lens point for (u, v) in the
    unit square. It runs through the point at which the pinhole's ray for (x, y) meets the plane in focus."""
    a = s.a
    disk_x, disk_y = warp.disk(a.D(u), a.D(v))
    offset = disk_x * s.view.lens_right + disk_y * s.view.lens_up
    through_pinhole = s.view.corner + x * s.view.pixel_right + y * s.view.pixel_down
    d = dr.normalize(through_pinhole - a.V(offset * s.view.inverse_focus))
    return Ray(s.view.o + offset, d if a.precision == "single" else unit(d, a.W)).exact()


def single_sample_state(s: KernelScene, n: int) -> SampleState:
    """Random numbers for n pixels with a single sample each. They are used if the caller passes none."""
    a = s.a
    plan = sampling.SamplePlan.of(a, 0, 1, 0, 1)
    lanes = dr.arange(a.U, n)
    return SampleState(s.settings.sampler, a.F, plan, sampling.hash32(lanes), plan.first + 0 * lanes, 0 * lanes)


def radiance(s: KernelScene, ray: Ray, state: SampleState | None = None) -> tuple[Any, Any]:
    """The colour along a camera ray, and its coverage (alpha). The coverage is 1 if an object is hit. If nothing is
    hit, it is 0 for a transparent film and 1 for an opaque one.

    state: random numbers of the sample
    """
    effects = s.features
    state = state or single_sample_state(s, ray.lanes)
    origin = RayOrigin(s.geometry, ray.o, shared=False) if effects["defocus"] else camera_origin(s, ray)
    hit, ray = closest(origin, ray, s.brute_force), ray.exact()
    si = interact(s, ray, hit, state)
    lamp, colour = indirect.light_before(s, ray, hit, None), shade(s, si)
    if effects["paths"]:
        interface = media.interface_at(s, si)
        own_weight = media.local_weight(s, si, interface)
        colour = (colour if own_weight is None else colour * own_weight) + indirect.indirect(s, si, ray, interface)
    sky, covered = s.a.V(0) if s.transparent else background(s, ray.d), hit.valid
    if lamp is not None:
        colour, sky, covered = lamp.over(colour), lamp.over(sky), covered | lamp.met
    if effects["paths"] and (passed := media.transmitted(s, si, interface, lamp)) is not None:
        colour = colour * passed
    return dr.select(hit.valid, colour, sky), dr.select(covered, 1, s.coverage)


def sample(
    s: KernelScene, plan: sampling.SamplePlan, x: Any, y: Any, moments: Moments, window: Window | None = None
) -> Moments:
    """The moments of the pixels (x, y) after one more pass. Each lane is one pixel.

    plan: samples that the pass takes
    moments: moments before the pass
    window: part of each pixel that the samples are taken in; None for the whole pixel

    A symbolic loop runs over blocks of samples (moments.py), and an inner one over the samples of a block. Values that
    no sample changes are not part of the loop state, because Dr.Jit would trace the whole loop once more to remove
    them. The ray of the next sample is generated while the current sample is traced, so that neither has to wait for
    the other.
    """
    a, end, has_coverage = s.a, plan.first + plan.count, s.features["coverage"]
    pixels = Pixels(s, plan, x, y, window)
    step = partial(_with_sample, s, plan, pixels)

    def block(i: Any, stratum: Any, d: Any, o: Any, mean: Any, squares: Any, coverage: Any, *sums: Any) -> tuple:
        stop = dr.minimum(end, (i | (BLOCK - 1)) + 1)
        i, stratum, d, o, *sums = dr.while_loop(
            (i, stratum, d, o, *sums), lambda i, *_: i < stop, step, label="samples"
        )
        joined = Moments(mean, squares, coverage, *sums).block_joined(a, index_in_block(i) == 0, i - BLOCK, BLOCK)
        return i, stratum, d, o, *joined.arrays

    used_moments = moments if has_coverage else replace(moments, coverage=None, open_coverage=None)
    first = dr.zeros(a.U, dr.width(x)) + plan.first, sampling.first_stratum(plan, pixels.key, a.F)
    start = *first, *pixels.ray(pixels.state(*first)), *used_moments.arrays
    _, _, _, _, *arrays = dr.while_loop(start, lambda i, *_: i < end, block, label="blocks")
    result = Moments(*arrays)
    return result if has_coverage else replace(result, coverage=moments.coverage, open_coverage=moments.open_coverage)


def _with_sample(
    s: KernelScene, plan: sampling.SamplePlan, pixels: "Pixels", i: Any, stratum: Any, d: Any, o: Any, *sums: Any
) -> tuple:
    """The state of the loop over samples after one more.

    i, stratum: index and stratum of the sample
    d, o: direction and origin of its camera ray
    sums: sums of the open block (moments.py)
    """
    state, next_stratum = pixels.state(i, stratum), sampling.next_stratum(plan, stratum)
    next_ray = pixels.ray(pixels.state(i + 1, next_stratum))
    colour, covered = radiance(s, pixels.whole_ray(d, o), state)
    if (weight := pixels.weight(state)) is not None:
        colour, covered = colour * weight, covered * weight
    block_sums = Moments(None, None, None, *sums).with_sample(index_in_block(i) == 0, colour, covered)
    return i + 1, next_stratum, *next_ray, *block_sums.arrays[3:]


def block_sums(s: KernelScene, plan: sampling.SamplePlan, x: Any, y: Any) -> tuple:
    """Sums of the samples of one block (moments.py) in each lane, not joined to others: reference, total, squares and
    coverage, as they are before the block is joined. The coverage is None if the scene does not count it.

    plan: samples that are taken. Domain: all samples of a lane are of one block, whose first sample is the first.
    """
    n, end, pixels = dr.width(x), plan.first + plan.count, Pixels(s, plan, x, y)
    *sums, coverage = (dr.zeros(kind, n) for kind in Moments.types(s.a)[3:])
    sums.append(coverage if s.features["coverage"] else None)
    first = dr.zeros(s.a.U, n) + plan.first, sampling.first_stratum(plan, pixels.key, s.a.F)
    start = *first, *pixels.ray(pixels.state(*first)), *sums
    step = partial(_with_sample, s, plan, pixels)
    return dr.while_loop(start, lambda i, *_: i < end, step, label="samples")[4:]


def attached_mean(s: KernelScene, plan: sampling.SamplePlan, x: Any, y: Any) -> Any:
    """Mean colour of the samples of one pass over the pixels (x, y), with derivatives. Shapes: (3, N).

    One loop runs over all samples, with sums as its only state, because Dr.Jit 1.5 does not differentiate loops inside
    loops.
    """
    a, n = s.a, dr.width(x)
    pixels = Pixels(s, plan, x, y)

    def step(i: Any, stratum: Any, reference: Any, total: Any) -> tuple:
        state = pixels.state(i + plan.first, stratum)
        colour, _ = radiance(s, pixels.whole_ray(*pixels.ray(state)), state)
        colour = colour if (weight := pixels.weight(state)) is None else colour * weight
        reference = dr.select(i == 0, dr.detach(colour), reference)
        return i + 1, sampling.next_stratum(plan, stratum), reference, total + (colour - reference)

    start = dr.zeros(a.U, n), sampling.first_stratum(plan, pixels.key, a.F), dr.zeros(a.V, n), dr.zeros(a.V, n)
    _, _, reference, total = dr.while_loop(
        start, lambda i, *_: i < plan.count, step, max_iterations=-1, label="samples"
    )
    return reference + total * (1 / a.F(plan.count))


def _numbers(s: KernelScene, state: SampleState, window: Window | None) -> tuple[Any, Any, Any]:
    """The numbers from 0 to 1 that say where in its pixel a sample lies: two for places, and one that chooses signs
    (filters.Table), or None. window: as in sample"""
    u, v = state.pixel()
    if window is not None:
        return window.left + window.width * u, window.top + window.height * v, None
    return u, v, state.turn() if s.filter is not None and s.filter.is_signed else None


def weight_of(s: KernelScene, state: SampleState, window: Window | None = None) -> Any:
    """Weight of a sample by the filter; None if all weights are 1. window: as in sample"""
    if s.filter is None or not s.filter.is_signed:
        return None
    return s.filter.weight(*_numbers(s, state, window))


class Pixels:
    """Random numbers and camera rays for the samples of the pixels (x, y) in one pass."""

    def __init__(self, s: KernelScene, plan: sampling.SamplePlan, x: Any, y: Any, window: Window | None = None):
        self.s, self.plan, self.key, self.window = s, plan, sampling.pixel_key(plan, x, y), window
        self.left, self.top = s.a.F(x), s.a.F(y)

    def state(self, index: Any, stratum: Any) -> SampleState:
        """Random numbers of the sample with this index and stratum, in each lane."""
        return SampleState(self.s.settings.sampler, self.s.a.F, self.plan, self.key, index, stratum)

    def ray(self, state: SampleState) -> tuple[Any, Any]:
        """Direction and origin of a sample's camera ray. Either is None if all camera rays share it."""
        u, v, turn = _numbers(self.s, state, self.window)
        if self.s.filter is not None:
            u, v = self.s.filter.places(u, v, turn)
        x, y = self.left + u, self.top + v
        if isinstance(self.s.view, ParallelView):
            return None, sheet_point(self.s, x, y)
        if not self.s.features["defocus"]:
            return camera_direction(self.s, x, y), None
        ray = lens_ray(self.s, x, y, *state.dimension(LENS).point())
        return ray.d if ray.d_single is None else ray.d_single, ray.o

    def weight(self, state: SampleState) -> Any:
        """Weight of a sample; None if all weights are 1."""
        return weight_of(self.s, state, self.window)

    def whole_ray(self, d: Any, o: Any) -> Ray:
        """The camera ray with the direction and the origin that `ray` returned."""
        if d is None:
            return parallel_ray(self.s, o)
        return Ray(self.s.view.o, d) if o is None else Ray(o, d).exact()


def first_hit(s: KernelScene, x: Any, y: Any) -> dict[str, Any]:
    """Layers of the first hit on the ray through each pixel's centre: a dict from the name of a layer
    (output/layers.py) to its values.

    If nothing is hit, distances are inf and all other values are 0. The layers of the certificate are present only if
    the scene contains kinds whose crossings are searched roots (polynomial surfaces and tori).
    """
    a = s.a
    ray = camera_ray(s, a.F(x) + 0.5, a.F(y) + 0.5)
    hit = closest(camera_origin(s, ray), ray)
    si = interact(s, ray, hit)

    def shown(value: Any) -> Any:
        return dr.select(hit.valid, value, 0)

    layers = {
        "Z": a.F(hit.t * dr.dot(ray.d, a.W(s.view.forward))),
        "distance": a.F(hit.t),
        "N": shown(si.n),
        "P": shown(a.V(si.surface.p)),
        "UV": (shown(si.u), shown(si.v)),
        "albedo": shown(si.material.kd),
        # 0 means no object: NO_ROW + 1 is 0 in 32 bits.
        "id": object_of(s, hit) + 1,
    }
    return layers | certificate(s, ray, hit, si.surface.p)


def object_of(s: KernelScene, hit: Hit) -> Any:
    """Number in the scene of the object that is hit; NO_ROW if nothing is hit."""
    index = dr.full(s.a.U, NO_ROW, dr.width(hit.row))
    for batch in s.batches:
        in_batch = batch.has(hit.row)
        row = dr.select(in_batch, hit.row - batch.first_row, 0)
        objects = dr.gather(s.a.U, batch.object, batch.object_at(row))
        index = dr.select(in_batch, objects, index)
    return index


def certificate(s: KernelScene, ray: Ray, hit: Hit, p: Any) -> dict[str, Any]:
    """Layers of the certificate: a dict of two arrays that say how surely crossings of polynomial surfaces and tori are
    known. It is empty in scenes without such kinds.

    unresolved: number of pieces of the ray in which rounding hides whether there is a crossing
    residual: distance of the visible point p from its surface, to first order, in units in the last place of the
        largest coordinate of p and of the ray's origin
    """
    a, searched = s.a, [b for b in s.batches if b.kind.finds_roots]
    if not searched:
        return {}
    unresolved, residual, begin = dr.zeros(a.U, ray.lanes), dr.zeros(a.F, ray.lanes), ray.begin(NOTHING_KNOWN)
    for batch in searched:

        def step(i: Any, total: Any, batch: Batch = batch) -> tuple:
            seen = batch.kind.seen(rows(batch.placed, i), ray.o)
            return (total + batch.kind.crossing(seen, ray, begin, None, NOTHING_KNOWN).unresolved,)

        n = len(batch)
        unresolved = s.loop(dr.opaque(a.U, n), a.B(True), (unresolved,), step)[0]
        in_batch = batch.has(hit.row)
        placed = rows(batch.placed, dr.select(in_batch, hit.row - batch.first_row, 0))
        f, _ = batch.kind.surface_at(placed, p, batch.part(hit.part))
        largest = [dr.maximum(dr.maximum(dr.abs(v.x), dr.abs(v.y)), dr.abs(v.z)) for v in (p, ray.o)]
        ulp = 2 * UNIT_ROUNDOFF["double"] * dr.maximum(*largest)
        residual = dr.select(in_batch, a.F(dr.abs(f) / dr.select(in_batch, ulp, 1)), residual)
    return {"unresolved": unresolved, "residual": residual}
