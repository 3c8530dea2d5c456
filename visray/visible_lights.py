"""Area lights that are seen: rays find their shapes beside the objects of the scene.

A visible light is no object. Rays from the camera see it, and rays that mirrors and glass send on. Rays of paths that
matte surfaces have scattered do not, because these surfaces get its light directly. Shadow rays pass through it.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import gamma, l1_norm
from visray.lights.light import Light
from visray.pack import LightColumns
from visray.primitives import KINDS
from visray.primitives.primitive import Primitive
from visray.pytree import detached, evaluated, rows
from visray.quantities import Arrays, record
from visray.ray import NO_ROW, NOTHING_KNOWN, Hit, Ray

BY_TYPE = {kind.type: kind for kind in KINDS}


@dataclass(frozen=True)
class VisibleLights:
    """The visible lights of one kind, as kernels read them.

    kind: the primitive that has their shape
    placed: their shapes, as Primitive.placed returns them
    size: size of their coordinates, from which rounding bounds are computed
    colour: colour of each light
    number: number of each light in the scene
    count: number of the lights, as opaque data
    """

    kind: type[Primitive]
    placed: Any
    size: Any
    colour: Any
    number: Any
    count: Any


def visible_lights(lights: tuple[LightColumns, ...], seen: list[bool], a: Arrays) -> tuple[VisibleLights, ...]:
    """The visible lights of a scene, kind by kind. seen: for each light of the scene, whether it is visible"""
    found = []
    for columns in lights:
        visible = [row for row, number in enumerate(columns.scene_index) if seen[number]]
        if not visible:
            continue
        # A table of one entry is another kernel.
        index = a.put(a.U, np.array(visible if len(visible) > 1 else 2 * visible, np.uint32))
        table = rows(columns.numbers, index)
        kind, shape = shape_of(columns.kind, table)
        size = l1_norm(dr.detach(table.position)) + dr.detach(table.radius_bound())
        numbers = a.put(a.U, np.array(columns.scene_index, np.uint32)[np.array(index)])
        colour = table.intensity * table.Id
        count = dr.opaque(a.U, len(visible))
        found.append(evaluated(VisibleLights(kind, shape.placed(None), size, colour, numbers, count)))
    return tuple(found)


def shape_of(kind: type[Light], table: Any) -> tuple[type[Primitive], Any]:
    """The primitive that has the shape of a kind of light, and the shapes of some lights as a table of this primitive.

    table: the lights
    """
    name, fields = kind.shape
    primitive = BY_TYPE[name]
    return primitive, record(primitive, {ours: getattr(table, theirs) for ours, theirs in fields.items()})


@dataclass(frozen=True)
class SeenLight:
    """The visible light that a ray meets before anything else.

    met: mask of the rays that meet one
    number: its number in the scene; NO_ROW where none is met
    colour: its colour, with derivatives; black where none is met
    distance: its distance, with derivatives; where none is met, that of what the ray hits, without
    """

    met: Any
    number: Any
    colour: Any
    distance: Any

    def over(self, colour: Any) -> Any:
        """The colour along the rays: that of the light, or else `colour`."""
        return dr.select(self.met, self.colour, colour)


def nearest_light(lights: tuple[VisibleLights, ...], ray: Ray, hit: Hit) -> SeenLight:
    """The nearest visible light on rays, if it is nearer than what they hit.

    ray: rays in double precision

    A light that lies on a surface, to within rounding, is nearer than the surface: a lamp on a ceiling is seen.
    Error: the distances of both are off by gamma(8) of the coordinates' sizes at most (tests/test_visible_lights.py).
    """
    attached, ray = ray, detached(ray)
    n = ray.lanes
    u, v = dr.uint32_array_t(type(ray.o.x)), type(dr.detach(lights[0].colour))
    best, number, colour = dr.detach(hit.t) + dr.zeros(type(ray.o.x), n), dr.full(u, NO_ROW, n), dr.zeros(v, n)
    begin, distance = ray.begin(NOTHING_KNOWN), best
    for group in lights:

        def step(i: Any, best: Any, index: Any, group: VisibleLights = group) -> tuple:
            placed, size = rows((detached(group.placed), group.size), i)
            crossing = group.kind.crossing(group.kind.seen(placed, ray.o), ray, begin, None, NOTHING_KNOWN)
            error = gamma(16) * (l1_norm(ray.o) + crossing.t + size)
            nearer = crossing.met & (crossing.t <= best + error)
            return i + 1, dr.select(nearer, crossing.t, best), dr.select(nearer, i, index)

        start = dr.zeros(u, n), best, dr.full(u, NO_ROW, n)
        more = lambda i, *_, group=group: i < group.count  # noqa: E731 - the condition
        _, best, index = dr.while_loop(start, more, step, label="visible lights")
        met = index != NO_ROW
        at = dr.select(met, index, 0)
        number = dr.select(met, dr.gather(u, group.number, at), number)
        colour = dr.select(met, rows(group.colour, at), colour)
        distance = dr.select(met, _attached(group.kind, rows(group.placed, at), attached, best), distance)
    return SeenLight(number != NO_ROW, number, colour, distance)


def _attached(kind: type[Primitive], placed: Any, ray: Ray, t: Any) -> Any:
    """The distance t of a shape along rays, with the derivatives that it has by the implicit function theorem.

    placed: the shape of each lane
    """
    f, g = kind.surface_at(placed, dr.fma(t, ray.d, ray.o), None)
    return t - (f - dr.detach(f)) / dr.detach(dr.dot(g, ray.d)) if dr.grad_enabled(f) else t
