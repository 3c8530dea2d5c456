"""Coloured shadows by visray and by Mitsuba: what transparent objects leave of the light on its way to what is seen.

Mitsuba has no such shadows. But of each object alone it says where a way first meets it, from one end and from the
other; as objects are convex, the path inside is what is between.
"""

from dataclasses import dataclass, replace

import numpy as np

from visray.geometry import gamma
from visray.primitives.primitive import Primitive, bounding_box
from visray.study.mitsuba import light_arrival as arrivals
from visray.study.mitsuba import light_emission as emission
from visray.study.mitsuba.comparison import Comparison, most, part
from visray.study.mitsuba.report import Tints
from visray.study.mitsuba.rounding import UNRESOLVED
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.shadows import Found, Lit, moved
from visray.study.mitsuba.visray_scene import VisrayScene

# The share is a product over objects, each with a quotient, a difference and two products, in single precision.
ROUNDINGS = 4


@dataclass(frozen=True)
class Tint:
    """The share of light that gets along ways, by Mitsuba, and a bound of its error. Shapes: (N, 3), (N)."""

    share: np.ndarray
    error: np.ndarray


def compare(seen: Comparison, coloured: VisrayScene, dark: Found) -> tuple[Tints, np.ndarray, list[np.ndarray]]:
    """The findings, which pixels are near an edge, and of each light the share that arrives by Mitsuba.

    seen and dark: of the scene with all objects opaque; coloured: the scene as it is.
    """
    near, arrive, found = np.zeros(len(seen.a.t), bool), [], np.zeros(4)
    for light, edge, arrival in zip(dark.lit, dark.near, arrivals.beams(coloured, seen.look)):
        theirs = _tint(seen, light)
        share = np.where(arrival.reached[:, None], arrival.share, 0)
        # Where nothing is between, shares are 1: the other comparison of shadows is of these.
        rays = light.facing & ~(light.met & light.reached)
        change = _change(seen, coloured, light, rays)
        close = rays & (edge | (change > UNRESOLVED) | (theirs.error > UNRESOLVED))
        apart, sure = np.abs(share - theirs.share).max(1), rays & ~close
        counts = [rays.sum(), close.sum(), most(apart, sure), most(apart, sure, change + theirs.error)]
        found = np.append(found[:2] + counts[:2], np.maximum(found[2:], counts[2:]))
        near |= close
        arrive.append(theirs.share)
    return Tints(int(found[0]), int(found[1]), float(found[2]), float(found[3])), near, arrive


def _change(seen: Comparison, coloured: VisrayScene, light: Lit, rays: np.ndarray) -> np.ndarray:
    """How much the share changes where rays are moved by Mitsuba's rounding; inf where a ray is too flat to be sure."""
    straight = arrivals.shares(coloured, seen.look, light.ways, rays)
    change = np.where(np.isinf(light.longest) | (light.ways.length == 0), np.inf, 0)
    for ways in moved(light.ways, seen.theirs.extents.largest(len(rays))):
        change = np.maximum(change, np.abs(arrivals.shares(coloured, seen.look, ways, rays) - straight).max(1))
        change[rays & (arrivals.sends(coloured, light.light, ways) != (emission.aim(light.twin, ways.l) > 0))] = np.inf
    return change


def _tint(seen: Comparison, light: Lit) -> Tint:
    """What Mitsuba says of the ways to a light, object by object."""
    things, names = seen.theirs.scene.objects, seen.ours.names
    materials = [seen.theirs.materials[things[name].material] for name in names]
    clear = [any(m.kt) for m in materials]
    share = np.repeat((light.met | (emission.aim(light.twin, light.others.l) > 0))[:, None], 3, 1).astype(float)
    error = np.full(len(share), gamma(ROUNDINGS * len(names), "single"))
    dark = np.flatnonzero(light.facing & ~light.met)
    ways = part(light.others, dark).begun(light.margin[dark])
    if opaque := tuple(name for name, through in zip(names, clear) if not through):
        hidden = np.isfinite(seen.theirs.first(ways, opaque)[0])
        share[dark[hidden]] = 0
        dark, ways = dark[~hidden], part(ways, ~hidden)
    for i in np.flatnonzero(clear):
        met, inside, off = _passed(seen, i, light, dark, ways)
        faded, blurred = (np.minimum(x / materials[i].dmax, 1) for x in (inside, off))
        share[dark] *= np.where(met[:, None], materials[i].kt * (1 - faded)[:, None], 1)
        error[dark] += np.where(met, max(materials[i].kt) * blurred, 0)
    return Tint(share, error)


def _passed(
    seen: Comparison, i: int, light: Lit, lanes: np.ndarray, ways: ShadowRays
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether ways from the pixels `lanes`, begun off their surfaces, meet object i, how long they are in it, and how
    well that is known."""
    name, theirs, margin = seen.ours.names[i], seen.theirs, light.margin[lanes]
    thing: Primitive = theirs.scene.objects[name]
    t, cosine = theirs.first(ways, (name,))
    met, nothing = np.isfinite(t), np.zeros(len(t))
    if not thing.closed:
        return met, nothing, nothing
    low, high = (np.array(corner) - theirs.centre for corner in bounding_box(thing))
    # From beyond the object back to where the way began.
    beyond = np.linalg.norm(0.5 * (low + high) - ways.p, axis=1) + np.linalg.norm(high - low)
    whole = ways.cut(beyond)
    back, other = theirs.first(replace(whole, p=whole.end, l=-ways.l), (name,))
    entry = np.where(seen.a.index[lanes] == i, -margin, t)
    leave = whole.length - back
    if i in light.on:
        # The light, though the ways are cut off before it.
        leave = ShadowRays.to(seen.points()[lanes], light.twin, theirs.centre).length - margin
    inside = np.where(met & np.isfinite(entry) & np.isfinite(leave), np.maximum(leave - entry, 0), 0)
    shift = theirs.extents.shift(np.full(len(t), i))
    off, grazing = shift.start(ways.p) + shift.slope() * whole.length, np.minimum(cosine, other)
    return met, inside, 2 * np.divide(off, grazing, out=np.full_like(off, np.inf), where=grazing > 0)
