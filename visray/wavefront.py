"""Paths with derivatives, traced in waves: one launch takes the rays of all paths to their next surface and beyond.

A path continues as in the picture itself (indirect.py): where a surface reflects and refracts, one way is chosen at
random, and the light is divided by the detached probability of the choice. So the work is linear in the depth, and the
derivative has no bias. Random numbers are those of the picture: the derivative is that of the picture with the same
seed, to rounding, including all samples of area lights.

Dr.Jit 1.5 does not differentiate loops inside loops. So samples of pixels are lanes, surfaces of a path are launches of
the same kernel, and samples of lights are the only loop of this kernel, as a sum. Paths that have ended leave the wave.

lane: one path of one sample of a pixel
level: number of the surface along its path, 0 where the camera ray hits

Alternatives. Surfaces and samples of lights unrolled in one kernel: no first derivative in 10 minutes for 6 surfaces
and a light of 16 samples, which takes 12 s in waves and 1 s from the second time on (reference/bench_gradients.py).
A loop of the kernel over surfaces, with one sample of each light: adds noise, and a derivative no longer agrees with
vr.difference. It is one long launch too, which shows no progress and does not see Ctrl-C.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray import indirect, integrator, media, sampling
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.background import background
from visray.interaction import Interaction, interact
from visray.kernel_scene import KernelScene
from visray.ray import Hit, Ray
from visray.sampling import SampleSet, SampleState
from visray.shading import shade

# Number of rays of one launch: it takes less than a second at a few million rays per second.
RAYS = 2**20
# Numbers of lanes are multiples of this. A single lane would need another kernel.
MULTIPLE = 16


@dataclass(frozen=True)
class Chunk:
    """Some paths, one for each lane, as NumPy arrays.

    count: number of paths. Lanes beyond it repeat the last path, and do not count
    pixel: number of the lane's pixel
    index: number of the sample in its pixel
    path: number of the path, among those that start where the camera ray hits
    """

    count: int
    pixel: np.ndarray
    index: np.ndarray
    path: np.ndarray


@dataclass(frozen=True)
class Wave:
    """What is known of the paths on their way to the next surface, without derivatives. One entry per lane.

    lane: number of the path in its chunk
    key, index, stratum: random numbers of the sample
    path: number of the path, among those that start where the camera ray hits
    specular_left, scatters_left: numbers of bounces that are still allowed
    """

    lane: Any
    key: Any
    index: Any
    stratum: Any
    path: Any
    specular_left: Any
    scatters_left: Any


@dataclass(frozen=True)
class Arrival:
    """A wave at its surfaces: what one launch reads.

    count: number of lanes that count
    level: number of the surfaces along their paths, as opaque data
    wave: the wave
    hit: what its rays have hit
    carried: origins and directions of its rays, and the weight of the light along them. These have derivatives
    before: for each lane that counts, its lane at the level before, as a NumPy array
    """

    count: int
    level: Any
    wave: Wave
    hit: Hit
    carried: tuple[Any, Any, Any]
    before: np.ndarray


class Waves:
    """The paths of a picture.

    s: the scene
    spp: samples per pixel
    x, y: columns and rows of the pixels
    """

    def __init__(self, s: KernelScene, spp: int, x: Any, y: Any):
        self.s, self.spp, self.x, self.y = s, spp, np.array(x), np.array(y)
        self.plan = sampling.SamplePlan.of(s.a, s.settings.seed, spp, 0, spp)
        self.paths_per_sample = s.settings.scatter.rays if s.features["scatter"] else 1
        specular = s.features["reflection"] or s.features["refraction"]
        self.last_level = s.settings.depth * specular + s.settings.scatter.depth * s.features["scatter"]

    @property
    def chunk_size(self) -> int:
        """Number of paths in a chunk, such that a launch has at most about RAYS rays, or fewer if they take longer. It
        does not depend on the clock, because sums over lanes depend on it."""
        s, occlusion = self.s, self.s.settings.occlusion
        rays = 1 + sum(dr.width(steps.batch) for steps in s.light_steps)
        rays += occlusion.sky * s.features["sky occlusion"] + occlusion.near * s.features["near occlusion"]
        rays *= 2 if s.features["coloured shadows"] else 1
        rays *= 8 if s.geometry.plan("nothing").tree else 1
        rays *= 64 if any(b.kind.finds_roots for b in s.batches) else 1
        return max(RAYS // rays // MULTIPLE, 1) * MULTIPLE

    def chunks(self) -> list[Chunk]:
        """All paths, sample by sample, in chunks."""
        total, size = len(self.x) * self.spp * self.paths_per_sample, self.chunk_size
        return [self._chunk(begin, min(size, total - begin)) for begin in range(0, total, size)]

    def _chunk(self, begin: int, count: int) -> Chunk:
        """The chunk of `count` paths from number `begin`."""
        lanes = begin + np.minimum(np.arange(count + -count % MULTIPLE), count - 1)
        sample, path = np.divmod(lanes, self.paths_per_sample)
        return Chunk(count, *np.divmod(sample, self.spp), path)

    def start(self, chunk: Chunk) -> tuple[Wave, Callable]:
        """The wave of camera rays, and the launch that generates them. It has no inputs. Its results are origins and
        directions, and `others` is the hit."""
        s, a, n = self.s, self.s.a, len(chunk.pixel)

        def put(v: np.ndarray) -> Any:
            return a.put(a.U, v.astype(np.uint32))

        plan = sampling.SamplePlan.of(a, s.settings.seed, self.spp, chunk.index, 1)
        x, y = put(self.x[chunk.pixel]), put(self.y[chunk.pixel])
        key = sampling.pixel_key(plan, x, y)
        limits = [dr.full(a.U, 0, n) + limit for limit in s.bounce_limits]
        stratum = sampling.first_stratum(plan, key, a.F)
        wave = Wave(put(np.arange(n)), key, put(chunk.index), stratum, put(chunk.path), *limits)
        dr.make_opaque(wave, x, y)

        def launch(s: KernelScene) -> tuple:
            pixels = integrator.Pixels(s, plan, x, y)
            ray, lens = pixels.whole_ray(*pixels.ray(self._sample(wave))), s.features["defocus"]
            origin = RayOrigin(s.geometry, ray.o, shared=False) if lens else integrator.camera_origin(s, ray)
            hit, ray = closest(origin, ray, s.brute_force), ray.exact()
            return (_wide(ray.o, n), _wide(ray.d, n)), hit

        return wave, launch

    def _sample(self, wave: Wave) -> SampleState:
        """Random numbers at the first surface."""
        return SampleState(self.s.settings.sampler, self.s.a.F, self.plan, wave.key, wave.index, wave.stratum)

    def weight(self, wave: Wave) -> Any:
        """Weights of the samples of paths by the filter, as colours."""
        n = dr.width(wave.lane)
        weight = integrator.weight_of(self.s, self._sample(wave))
        return dr.full(self.s.a.V, 1, n) if weight is None else _wide(self.s.a.V(weight), n)

    def surface(self, at: Arrival) -> Callable:
        """The launch at the surfaces of a wave. Its inputs are `carried`. Its results are the light that the paths
        bring to their pixels from these surfaces, and `carried` of the rays that leave them. `others` is (mask of the
        paths that continue, wave, rest of the rays).

        In scenes without paths, the light is the only result.
        """
        wave, hit = at.wave, at.hit

        def launch(s: KernelScene, o: Any, d: Any, weight: Any) -> tuple:
            n, first, ray = dr.width(o), at.level == 0, Ray(o, d)
            sample = self._sample(wave)
            later = sample.derived(1 + wave.path + ((at.level - 1) << 16))
            si = interact(s, ray, hit, replace(sample, key=dr.select(first, wave.key, later.key)))
            colour, sky = shade(s, si), s.a.V(0) if s.transparent else background(s, d)
            lamp = indirect.light_before(s, ray, hit, wave.scatters_left if s.features["scatter"] else None)
            if not s.features["paths"]:
                colour = dr.select(hit.valid, colour, sky)
                colour = colour if lamp is None else lamp.over(colour)
                return (_wide(colour if s.filter is None else weight * colour, n),), ()
            interface = media.interface_at(s, si)
            own_weight = media.local_weight(s, si, interface)
            if (passed := media.transmitted(s, si, interface, lamp)) is not None:
                weight = weight * passed
            colour = colour if own_weight is None else colour * own_weight
            colour = dr.select(hit.valid, colour, dr.select(first, sky, indirect.miss_radiance(s, d)))
            colour = colour if lamp is None else lamp.over(colour)
            # All paths of a sample share its first surface.
            colour = dr.select(first & (wave.path > 0), 0, weight * colour)
            bounce, after = _bounce(s, si, ray, interface, wave, first)
            alive = bounce.alive if lamp is None else bounce.alive & ~lamp.met
            results = colour, bounce.ray.o, bounce.ray.d, weight * bounce.weight
            rest = replace(dr.detach(bounce.ray), o=None, d=None)
            return tuple(_wide(x, n) for x in results), (alive, after, rest)

        return launch


def _bounce(
    s: KernelScene, si: Interaction, ray: Ray, interface: media.Interface | None, wave: Wave, first: Any
) -> tuple[indirect.Bounce, Wave]:
    """How the paths continue, and the wave after it. first: whether the surface is the first one."""
    a = s.a
    if not s.features["scatter"]:
        b = indirect.bounce(s, si, ray, interface, wave.specular_left, None)
        return b, replace(wave, specular_left=indirect.limits_after(a, b, wave.specular_left, None)[0])
    # At later surfaces, one path continues: a set of one.
    starts = s.sample_sets["scatter"]
    starts = SampleSet(*(dr.select(first, x, type(x)(1)) for x in (starts.count, starts.strata, starts.side)))
    j = dr.select(first, wave.path, 0)
    b = indirect.bounce(s, si, ray, interface, wave.specular_left, wave.scatters_left, j, starts)
    left = indirect.limits_after(a, b, wave.specular_left, wave.scatters_left)
    # Several paths start only where the first surface scatters.
    share = dr.select(b.scattered, dr.rcp(a.F(starts.count)), 1)
    b = replace(b, weight=b.weight * share, alive=b.alive & (b.scattered | (j == 0)))
    return b, replace(wave, specular_left=left[0], scatters_left=left[1])


def _wide(x: Any, n: int) -> Any:
    """The array x with n entries."""
    return x + dr.zeros(dr.detached_t(type(x)), n)


def search(s: KernelScene, ray: Ray) -> Hit:
    """What rays that leave surfaces hit."""
    return closest(RayOrigin(s.geometry, ray.o, shared=False), ray, s.brute_force)
