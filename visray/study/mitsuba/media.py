"""The media on both sides of the surfaces that rays cross, by visray's kernel and by a witness.

visray's rule for solids that overlap would feed Mitsuba too, so Mitsuba cannot tell whether it is right. The witness
knows the scene file only. It asks at points between the crossings of a ray which solids contain them (membership.py).
Of several transparent solids, the one with the highest priority counts, and of equal priorities, the one with the
smallest volume, which random points measure.
"""

from collections import ChainMap
from dataclasses import dataclass, replace
from itertools import pairwise

import drjit as dr
import numpy as np

from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.features import features
from visray.geometry import gamma
from visray.interaction import interact
from visray.materials import Material
from visray.media import interface_at
from visray.primitives.mesh import Mesh
from visray.ray import NO_ROW, Ray, unit
from visray.scene.scene import Scene
from visray.study.mitsuba.membership import MeasuredVolume, inside, measured_volume
from visray.study.mitsuba.omitted_effects import MOST_TRANSPARENT
from visray.study.mitsuba.random_rays import random_rays
from visray.study.mitsuba.report import MediaDifferences
from visray.study.mitsuba.visray_scene import Rays, VisrayScene, to_numpy

# Largest numbers of rays and of crossings of a ray, and of pairs of a ray and a face of a mesh.
RAYS, CROSSINGS, PAIRS = 2000, 48, 2**18
# Volumes that differ by less than SIGMAS standard errors are not told apart. By chance, two solids come into the wrong
# order once in three million times.
SIGMAS = 5
# Answers of the witness: air, and solids whose order is not known.
AIR, UNKNOWN = -1, -2
EXAMPLES = 3


@dataclass(frozen=True)
class Crossing:
    """One crossing of each ray. Shapes: (N), or (N, 3) for the point relative to the camera.

    index: index of the object, -1 without a crossing
    p: the point
    slack: bound on the distance along the ray between p and the true crossing (world units)
    ratio: index of refraction before the crossing divided by the index behind it, as the kernel has it
    hidden: whether the surface counts as none, as the kernel has it
    """

    index: np.ndarray
    p: np.ndarray
    slack: np.ndarray
    ratio: np.ndarray
    hidden: np.ndarray


class Witness:
    """What the scene file says of its transparent solids.

    names: names of the objects in the order of their indices; in place of a union that is drawn as bodies, these
    solids: indices of the transparent solids
    """

    def __init__(self, scene: Scene, names: tuple[str, ...], centre: np.ndarray, seed: int):
        self.names, self.centre = names, centre
        materials = {"default": Material()} | scene.materials
        drawn = ChainMap(scene.bodies, scene.objects)
        self.objects = [scene.placed_shape(drawn[name]) for name in names]
        self.material = [materials[scene.materials_of(drawn[name])[0]] for name in names]
        clear = [any(m.kt) for m in self.material]
        self.clear = np.array([*clear, False])
        self.closed = np.array([*(thing.closed for thing in self.objects), False])
        self.solids = [i for i in range(len(names)) if clear[i] and self.closed[i]]
        self.ior = np.array([*(m.ior for m in self.material), 1.0])
        rng = np.random.default_rng(seed)
        volumes = {i: measured_volume(self.objects[i], rng) for i in self.solids}
        self.beats = {(i, j): self._beats(i, j, volumes) for i in self.solids for j in self.solids if i != j}

    def _beats(self, i: int, j: int, volumes: dict[int, MeasuredVolume]) -> bool:
        """Whether solid i counts where both solids are. False for both orders if that is not known."""
        priorities = self.material[i].priority, self.material[j].priority
        if priorities[0] != priorities[1]:
            return priorities[0] > priorities[1]
        error = np.hypot(volumes[i].error, volumes[j].error)
        return volumes[j].volume - volumes[i].volume > SIGMAS * error

    def medium(self, p: np.ndarray) -> np.ndarray:
        """Index of the solid whose medium is at each point, AIR or UNKNOWN. p: points relative to the camera."""
        members = np.array([inside(self.objects[i], p + self.centre) for i in self.solids])
        found = np.where(members.any(0), UNKNOWN, AIR)
        for k, i in enumerate(self.solids):
            counts = members[k].copy()
            for m, j in enumerate(self.solids):
                if j != i and not self.beats[i, j]:
                    counts &= ~members[m]
            found[counts] = i
        return found

    def between(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The medium on the way from `low` to `high`; UNKNOWN if it is not the same at three points of the way."""
        found = [self.medium(low + share * (high - low)) for share in (0.25, 0.5, 0.75)]
        return np.where((found[0] == found[1]) & (found[1] == found[2]), found[1], UNKNOWN)


def crossings(ours: VisrayScene, rays: Rays) -> list[Crossing]:
    """The crossings of straight rays with all surfaces, in order, with the interfaces that the kernel finds there."""
    a, s, n = ours.a, ours.kernel, len(rays.d)
    o = ours.triples(ours.centre + np.broadcast_to(rays.o.astype(float), (n, 3)))
    d = unit(ours.triples(rays.direction()), a.W)
    ray, found = Ray(o, d), []
    for _ in range(CROSSINGS):
        hit = closest(RayOrigin(s.geometry, ray.o, shared=False), ray)
        si = interact(s, ray, hit)
        interface = interface_at(s, si)
        hidden = dr.full(a.B, False, n) if interface.hidden is None else interface.hidden
        cosine = dr.abs(dr.dot(a.W(si.surface.exact), d))
        ray = replace(si.spawn_ray(d, cosine).exact(), inside=~si.from_inside)
        dr.eval(ray, hit, si.surface.p, interface.ratio, hidden, cosine)
        row = np.array(hit.row)
        index = ours.object_of_row[np.where(row == NO_ROW, -1, row.astype(np.int64))]
        error, slope = (np.broadcast_to(np.array(x, float), n) for x in (si.surface.error, cosine))
        slack = np.divide(error, slope, out=np.full(n, np.inf), where=slope > 0)
        ratio, mask = (np.broadcast_to(np.array(x), n) for x in (interface.ratio, hidden))
        found.append(Crossing(index, to_numpy(si.surface.p) - ours.centre, slack, ratio, mask))
        if (index < 0).all():
            break
    return found


def compare(scene: Scene, declared: Scene, seed: int) -> tuple[MediaDifferences, list[str], list[str]]:
    """Compares the media at the crossings of pixel rays and of random rays with those of the witness. Returns the
    differences, a line of text for each of the first mismatches, and notes for the user.

    scene: the scene in visray
    declared: the scene that the witness reads, with objects of the same names
    seed: seed of the random rays, and of the random points that measure volumes
    """
    solids = _solids(scene)
    if not solids or not features(scene)["refraction"]:
        return MediaDifferences(), [], []
    if len(solids) > MOST_TRANSPARENT:
        return MediaDifferences(), [], [f"not compared: media ({len(solids)} transparent solids)"]
    ours = VisrayScene(scene)
    witness = Witness(declared, ours.names, ours.centre, seed)
    faces = sum(x.row_count() for i in witness.solids if isinstance(x := witness.objects[i], Mesh))
    count = min(RAYS, max(16, PAIRS // max(faces, 1)))
    placed = replace(scene, objects={name: scene.placed_shape(x) for name, x in scene.objects.items()})
    counts, examples, rays_of = np.zeros(4, int), [], (_some(ours.pixel_rays(), count),
                                                       random_rays(placed, ours.centre, count, seed))  # fmt: skip
    for rays in rays_of:
        of_rays, lines = _compare_rays(witness, rays, crossings(ours, rays))
        counts, examples = counts + of_rays, examples + lines
    total = sum(len(rays.d) for rays in rays_of)
    return MediaDifferences(total, *map(int, counts)), examples[:EXAMPLES], []


def _some(rays: Rays, count: int) -> Rays:
    """About `count` of the rays, evenly."""
    step = -(-len(rays.d) // count)
    return Rays(rays.o if len(rays.o) == 1 else rays.o[::step], rays.d[::step])


def _compare_rays(witness: Witness, rays: Rays, found: list[Crossing]) -> tuple[np.ndarray, list[str]]:
    """Numbers of crossings of transparent surfaces, of those that are compared, of those whose media have no known
    order, and of mismatches; and a line of text for each of the first mismatches."""
    counts, examples = np.zeros(4, int), []
    before, slack = np.broadcast_to(rays.o.astype(float), rays.d.shape), np.zeros(len(rays.d))
    near = witness.between(before, found[0].p)
    for crossing, after in pairwise(found):
        # Behind the last crossing of a ray, the medium does not change.
        end = np.where((after.index >= 0)[:, None], after.p, crossing.p + rays.direction())
        far = witness.between(crossing.p, end)
        clear, closed = witness.clear[crossing.index], witness.closed[crossing.index]
        next_slack = np.where(after.index >= 0, after.slack, 0)
        apart = (np.linalg.norm(crossing.p - before, axis=1) > 4 * (slack + crossing.slack)) & (
            np.linalg.norm(end - crossing.p, axis=1) > 4 * (crossing.slack + next_slack)
        )
        unknown = clear & ((near == UNKNOWN) | (far == UNKNOWN))
        compared = clear & apart & ~unknown
        ratio = witness.ior[near] / witness.ior[far]
        hidden = closed & (near == far)
        wrong = compared & ((hidden != crossing.hidden) | (~hidden & (np.abs(crossing.ratio / ratio - 1) > gamma(4))))
        counts += [clear.sum(), compared.sum(), (unknown & apart).sum(), wrong.sum()]
        for lane in np.flatnonzero(wrong)[: EXAMPLES - len(examples)]:
            examples.append(_example(witness, crossing, lane, near[lane], far[lane]))
        before, slack, near = crossing.p, crossing.slack, far
    return counts, examples


def _example(witness: Witness, crossing: Crossing, lane: int, near: int, far: int) -> str:
    """A line of text about a mismatch. near, far: the media before and behind the crossing, by the witness."""
    names = (*witness.names, "air")
    expected = f"from {names[near]} to {names[far]}, ratio {witness.ior[near] / witness.ior[far]:.6g}"
    kernel = "hidden" if crossing.hidden[lane] else f"ratio {float(crossing.ratio[lane]):.6g}"
    p = (witness.centre + crossing.p[lane]).tolist()
    return f"media at {p} on {names[crossing.index[lane]]}: visray {kernel}, by the scene {expected}"


def _solids(scene: Scene) -> list[str]:
    """Names of the transparent solids of a scene."""
    materials = {"default": Material()} | scene.materials
    clear = {name for name, m in materials.items() if any(m.kt)}
    objects = scene.parts()
    return [name for name, x in objects if scene.materials_of(x)[0] in clear and scene.shape_of(x).closed]
