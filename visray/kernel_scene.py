"""A scene as kernels read it: one record, made from the packed numbers.

The kinds, lights and effects of a scene determine the code of a kernel. All numbers enter it as opaque data: the code
does not contain them, so that new numbers compile no new kernel. Lights and rows are unrolled if the kernel contains
code for each of them, and looped if the same code runs for one after the other.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray import nesting
from visray.accel.lists import camera_sheet
from visray.accel.origin import Geometry, RayOrigin
from visray.accel.parallel_lists import ParallelLists
from visray.batches import Batch, place, repainted
from visray.camera import ParallelView, View
from visray.features import Features
from visray.filter_places import Line, Roof, Table
from visray.images import Atlas
from visray.images.environment import Environment, Panorama, environment
from visray.materials import Material
from visray.needed_materials import asked_fields, needed, with_needed
from visray.pack import Packed
from visray.prepared_lights import (
    LightBatch,
    LightSteps,
    PreparedLight,
    ambient_of_lights,
    light_steps,
    loops_lights,
    parallel_lists_of,
    prepared_lights,
)
from visray.pytree import evaluated, leaves, mapped, rows
from visray.quantities import Arrays, stacked
from visray.ray_families import shared_by
from visray.sampling import SampleSet
from visray.scene.scene import Scene, Settings, SkyGradient
from visray.visible_lights import VisibleLights, visible_lights


@dataclass(frozen=True)
class KernelScene:
    """All data of a scene that kernels read. Parameters named `s` are of this type.

    a: array types
    features: effects that are simulated
    settings: settings of the scene
    geometry: batches and the tree over them
    view: the camera
    origin: the camera as origin of rays; None if it is orthographic, since its rays have no common origin
    camera_lists: lists of rows for the rays of an orthographic camera; None for other cameras, or without lists
    lights: lights that are unrolled in the kernel
    looped_lights: lights that the kernel loops over
    visible_lights: area lights that are seen
    light_steps: samples of all lights, if the kernel visits them in loops with derivatives; else empty
    most_rows: largest number of rows of a batch, as opaque data
    sky: background: a gradient or a colour, or an environment map
    ambient: ambient light of the scene
    lights_ambient: ambient light of all lights together
    occlusion_distance: distance beyond which surfaces do not count in near occlusion
    zero_material: material with all numbers 0, for lanes without a hit
    bounce_limits: largest numbers of bounces of a path: of reflections and refractions, and of scatterings
    atlas: images of the textures, or None
    sample_sets: for "sky", "near" and "scatter", the set of rays from a point that are stratified together
    coverage: coverage (alpha) of a sample that hits nothing: 0 if the film is transparent, else 1
    transparent: whether the film is transparent
    filter: inverse distribution of the pixels' filter; None if samples lie in the pixel's square
    attached: whether derivatives are asked for
    in_waves: whether paths are traced in waves (wavefront.py); else derivatives are those of a loop over samples
    asked: names of the fields of materials that carry derivatives
    brute_force: whether every row is tested, without guards or trees, as a reference for tests
    """

    a: Arrays
    features: Features
    settings: Settings
    geometry: Geometry
    view: View | ParallelView
    origin: RayOrigin | None
    camera_lists: ParallelLists | None
    lights: tuple[PreparedLight, ...]
    looped_lights: tuple[LightBatch, ...]
    visible_lights: tuple[VisibleLights, ...]
    light_steps: tuple[LightSteps, ...]
    most_rows: Any
    sky: SkyGradient | Environment
    ambient: Any
    lights_ambient: Any
    occlusion_distance: Any
    zero_material: Material
    bounce_limits: tuple[Any, Any]
    atlas: Atlas | None
    sample_sets: dict[str, SampleSet]
    coverage: Any
    transparent: bool
    filter: Line | Roof | Table | None
    attached: bool
    in_waves: bool
    asked: frozenset[str]
    brute_force: bool

    @property
    def batches(self) -> tuple[Batch, ...]:
        """The batches of the scene."""
        return self.geometry.batches

    @property
    def rays_leave_surfaces(self) -> bool:
        """Whether shadow rays or occlusion rays start at the points that are shaded. The rays of paths are not
        considered."""
        effects = self.features
        from_points = any(l.origin is None for l in self.lights) or self.looped_lights or self.light_steps
        return bool(from_points and effects["shadows"]) or effects["sky occlusion"] or effects["near occlusion"]

    def loop(self, count: Any, active: Any, state: tuple, body: Callable) -> tuple:
        """The state after `count` steps: in step j = 0, 1, ... the state becomes body(j, *state).

        count: number of steps, as opaque data
        active: mask of the lanes that take part

        The loop is a loop of the kernel. If derivatives are asked for, what a step adds to the state must not depend on
        the state. Dr.Jit 1.5 does not differentiate loops inside loops; wavefront.py has none.
        """
        start = (dr.zeros(self.a.U, max(map(dr.width, state))), *state)
        step = lambda j, *state: (j + 1, *body(j, *state))  # noqa: E731 - the body with its counter
        more = lambda j, *_: (j < count) & active  # noqa: E731 - the condition
        sums_only = -1 if self.attached else None
        return dr.while_loop(start, more, step, label="repeated", max_iterations=sums_only)[1:]


def kernel_scene(
    packed: Packed,
    scene: Scene,
    features: Features,
    a: Arrays,
    atlas: Atlas | None,
    brute_force: bool = False,
    previous: tuple[Packed, KernelScene] | None = None,
    panorama: Panorama | None = None,
) -> KernelScene:
    """The scene as kernels read it, with all arrays evaluated. Derivatives flow through it.

    panorama: pixels of the environment map, or None; those of `previous` if that is given
    previous: packed numbers of a scene with the same structure, and the KernelScene that was made from them. Batches of
        this KernelScene are reused if their columns are unchanged. None: nothing is reused
    """
    settings, occlusion, scatter = scene.settings, scene.settings.occlusion, scene.settings.scatter
    geometry = _geometry(packed, a, settings, previous)
    ranks = _ranks(packed, scene, features, a, previous)
    looks = (with_needed(*pair, features, a, rank) for *pair, rank in zip(geometry.batches, packed.batches, ranks))
    geometry = geometry.with_looks(tuple(looks))
    film = scene.film
    view = packed.camera.view(film.size, reach_of(scene, features), a)
    lights_ambient = ambient_of_lights(packed.lights, a)
    evaluated((view, lights_ambient))
    light_tables = tuple(columns.numbers for columns in packed.lights)
    inputs = geometry.batches, light_tables, view, packed.background, packed.ambient, lights_ambient, packed.occlusion
    attached = dr.grad_enabled(leaves(inputs, shared=True))
    in_waves = attached and _needs_waves(packed, geometry, features)
    lights, looped = prepared_lights(packed, geometry, features, a)
    seen = ()
    if features["visible lights"]:
        seen = visible_lights(packed.lights, [light.seen for light in scene.lights.values()], a)
    parallel = isinstance(view, ParallelView)
    families = shared_by(features, [type(light) for light in scene.lights.values()], bool(looped), parallel)
    if any(geometry.plan(shared).tree for shared in families.values()):
        _ = geometry.tree  # It is built now, because no kernel that is being traced can build it.
    camera_origin, camera_lists = _camera_search(packed.camera, view, geometry, scene, features)
    counts = {"sky": occlusion.sky, "near": occlusion.near, "scatter": max(scatter.rays, 1)}
    return KernelScene(
        a=a,
        features=features,
        settings=settings,
        geometry=geometry,
        view=view,
        origin=camera_origin,
        camera_lists=camera_lists,
        lights=lights,
        looped_lights=looped,
        visible_lights=seen,
        light_steps=light_steps(packed, geometry, a) if in_waves else (),
        most_rows=dr.opaque(a.U, max(map(len, geometry.batches), default=0)),
        sky=_sky(a, features, packed.background, panorama, previous),
        ambient=packed.ambient,
        lights_ambient=lights_ambient,
        occlusion_distance=packed.occlusion.distance,
        zero_material=mapped(lambda x: type(x)(0), needed(rows(packed.materials, a.U(0)), features)),
        bounce_limits=(dr.opaque(a.U, settings.depth), dr.opaque(a.U, scatter.depth if scatter.rays else 0)),
        atlas=atlas,
        sample_sets={name: SampleSet.of(a, n) for name, n in counts.items()},
        coverage=dr.opaque(a.F, float(not film.transparent)),
        transparent=film.transparent,
        filter=film.filter.prepared(a, settings.spp) if features["filter"] else None,
        attached=attached,
        in_waves=in_waves,
        asked=asked_fields(packed.materials, geometry.batches, attached and features["bilinear"]),
        brute_force=brute_force,
    )


def _sky(
    a: Arrays,
    features: Features,
    numbers: Any,
    panorama: Panorama | None,
    previous: tuple[Packed, KernelScene] | None,
) -> SkyGradient | Environment:
    """The background. numbers: its numbers, as arrays. features, panorama, previous: as in kernel_scene.

    An environment map that is left out is white.
    """
    if isinstance(numbers, SkyGradient):
        return numbers
    if not features["environment map"]:
        white = (float(dr.detach(numbers.intensity)[0]),) * 3
        return stacked(a, SkyGradient, [SkyGradient(top=white, bottom=white)])
    return evaluated(environment(a, panorama or previous[1].sky.panorama, numbers))


def reach_of(scene: Scene, features: Features) -> float:
    """How far camera rays go beyond the edges of the picture, in pixels."""
    return scene.film.filter.reach if features["filter"] else 0.0


def with_view(s: KernelScene, camera: Any, scene: Scene, lists: bool = True) -> KernelScene:
    """The kernel scene, seen by another camera of the same type and with the same effects.

    camera: the camera's numbers, as arrays
    scene: the scene with this camera and with the film
    lists: whether camera rays find rows in lists, where the policy puts rows in lists. The lists of a camera take long
        to build, and rays are faster with them. Without lists, rays search the tree. The bits are the same, unless the
        camera lies on a surface.
    """
    view = evaluated(camera.view(scene.film.size, reach_of(scene, s.features), s.a))
    has_lists = bool(s.geometry.plan("direction" if isinstance(view, ParallelView) else "origin").lists)
    if lists or not has_lists:
        # The lists of the camera before are not kept.
        geometry = s.geometry.with_looks(s.geometry.batches) if has_lists else s.geometry
        origin, camera_lists = _camera_search(camera, view, geometry, scene, s.features)
        return replace(s, geometry=geometry, view=view, origin=origin, camera_lists=camera_lists)
    _ = s.geometry.tree  # It is built now, because no kernel that is being traced can build it.
    return replace(s, view=view, origin=None, camera_lists=None)


def _camera_search(
    camera: Any, view: View | ParallelView, geometry: Geometry, scene: Scene, features: Features
) -> tuple[RayOrigin | None, ParallelLists | None]:
    """The fields `origin` and `camera_lists` of a KernelScene. camera: the camera's numbers, as arrays."""
    if isinstance(view, ParallelView):
        return None, parallel_lists_of(geometry, np.array(view.forward, float)[:, 0], against=False)
    sheet = camera_sheet(camera, scene.film.size, reach_of(scene, features))
    return RayOrigin(geometry, view.o, views=(sheet,)), None


def _geometry(packed: Packed, a: Arrays, settings: Settings, previous: tuple[Packed, KernelScene] | None) -> Geometry:
    """All batches placed in the world, and the tree over them. previous: as in kernel_scene."""
    batches: list[Batch] = []
    reusable, same_looks = {}, previous is not None and previous[0].materials is packed.materials
    if previous is not None:
        reusable = {id(columns): batch for columns, batch in zip(previous[0].batches, previous[1].batches)}
    first_row, moved = 0, len(packed.batches) != len(reusable)
    for columns in packed.batches:
        known = reusable.get(id(columns))
        if known is None:
            moved = True
            batches.append(place(columns, first_row, packed.materials))
        else:
            batches.append(known if same_looks else repainted(known, columns, packed.materials))
        first_row += len(columns)
    if previous is not None and not moved and previous[1].geometry.accelerator == settings.accelerator:
        return previous[1].geometry if same_looks else previous[1].geometry.with_looks(tuple(batches))
    return Geometry(a, tuple(batches), settings.accelerator)


def _ranks(
    packed: Packed, scene: Scene, features: Features, a: Arrays, previous: tuple[Packed, KernelScene] | None
) -> list[Any]:
    """For each batch, the ranks of its rows in the order of solids; None in scenes without nested media, and for open
    kinds. previous: as in kernel_scene."""
    if not features["nested media"]:
        return [None] * len(packed.batches)
    same = previous is not None and previous[0].materials is packed.materials
    if same and all(new is old for new, old in zip(packed.batches, previous[0].batches)):
        return [batch.rank for batch in previous[1].batches]
    return nesting.ranks(scene, packed.batches, a)


def _needs_waves(packed: Packed, geometry: Geometry, features: Features) -> bool:
    """Whether a kernel with derivatives would need loops inside its loop over the samples of a pixel."""
    effects = "paths", "area lights", "coloured shadows", "sky occlusion", "near occlusion"
    return any(features[effect] for effect in effects) or loops_lights(packed, geometry)
