"""Renders a scene to an Image with layers and metadata.

A lane is one pixel in the arrays of a kernel. The order of lanes is not the order of pixels in a picture
(Prepared.order). A layer is one kind of data of a picture, such as RGB or N (output/layers.py).
"""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray import film as films
from visray.adaptive.error_floor import Files
from visray.adaptive.loop import NotANumber, adaptive_sampler, render_adaptively
from visray.adaptive.stopping import Goal
from visray.arguments import checked_arguments, shown
from visray.certificate import certificate_facts, warn_of_roots
from visray.clip_report import clip_notes
from visray.constant_report import constant_notes
from visray.csg_report import csg_notes
from visray.dark import dark_notes, warn_of_dark
from visray.data.all_objects import address_of
from visray.data_report import data_notes
from visray.errors import GoalWarning, LegendWarning, StoppedWarning, UserError
from visray.features import Features, features
from visray.legend.layer import drawn_legend, has_legend
from visray.material_report import energy_notes, sheet_notes
from visray.mesh_report import mesh_facts
from visray.output.curves import LUMINANCE
from visray.output.image import Image, check_destination
from visray.output.layers import BY_NAME, NAMES, names_from
from visray.overlap_report import overlaps
from visray.pass_timer import LONGEST_PASS, PassTimer
from visray.passes import expose
from visray.progress import Bar, Interrupts
from visray.provenance import provenance
from visray.ray_families import ray_families
from visray.scene.adjusted import adjusted
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.setup import Prepared, refuse_within_kernel
from visray.setup import prepare as prepare_checked

ANYWHERE = Files()
# Seconds per pixel that work after the last sample takes: assembling the layers, writing a PNG file, and writing one
# channel of an EXR file. Measured on one machine. They are only used to keep time for this work if a time is given.
LAYERING, PNG, CHANNEL = 6e-7, 4e-7, 3e-8
# Seconds for a legend: loading matplotlib, and per pixel.
LEGEND, LEGEND_PIXEL = 0.8, 3e-7


@checked_arguments
def render(
    scene: Scene | Prepared | str | Path,
    *,
    setup: str | Path | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    precision: str | None = None,
    threads: int | None = None,
    backend: str = "llvm",
    layers: Sequence[str] = NAMES,
    progress: bool = True,
    error: float | None = None,
    time: float | None = None,
    files: Files = ANYWHERE,
    begun: float | None = None,
    allow_outside: bool = False,
    legend: bool = True,
) -> Image:
    """Renders a scene, a prepared scene (vr.prepare) or a scene file. After Ctrl-C, the picture consists of the samples
    taken so far.

    setup: the setup file of a scene in the format of the original VisRayTrace.
    spp: samples per pixel. Like `size` (width, height), `seed` and `precision`, it replaces the value of the scene.
    threads: number of threads of the LLVM backend.
    backend: "llvm", "cuda" or "metal".
    layers: names of the layers to make. The layers of the first hit need a kernel of their own.
    progress: whether a progress bar is shown.
    error: the error to reach. Samples are taken until the error is no larger, with a confidence of 95 %. The error is
        the root mean square over pixels and channels, in linear light, divided by the picture's mean luminance.
    time: seconds that the render may take, including preparation and compilation. The picture is as good as possible in
        this time. With both `error` and `time`, the render ends when one of them is reached.
    files: files that the picture will be written to. An `error` below the rounding of these files is refused, and a
        part of `time` is kept for writing them.
    begun: the moment from which `time` counts (clock.now); None means the moment of the call.
    allow_outside: whether a scene file may name files outside of its folder.
    legend: whether the picture gets the legend of the scene's data, if there is one, as layer legend.

    With `error` or `time`, pixels with more noise get more samples, without bias (adaptive/). The metadata of the Image
    say how the picture was made.
    """
    now = clock.now()
    refuse_within_kernel()
    goal, layers = Goal.from_arguments(error, time, spp, now if begun is None else begun), checked_layers(layers)
    _check_arguments(goal, layers, files)
    scene = load(scene, setup, allow_outside=allow_outside) if isinstance(scene, (str, Path)) else scene
    given = scene if isinstance(scene, Prepared) else None
    if given and backend not in ("llvm", given.a.backend):
        raise UserError(f"backend = {backend!r}: the scene is prepared for {given.a.backend}; prepare it for the other")
    scene = adjusted(given.scene if given else scene, spp=spp, size=size, seed=seed, precision=precision)
    scene_hash = scene.hash()
    if not (legend and has_legend(scene)):
        layers = tuple(name for name in layers if name not in names_from("overlay"))
    if goal:
        goal = replace(goal, reserve=_seconds_to_finish(scene, layers, files))
        sampler = adaptive_sampler(scene.settings.sampler)
        scene = adjusted(scene, sampler=sampler) if sampler != scene.settings.sampler else scene
    if threads is not None:
        set_threads(threads)
    with Bar("preparing", 1, progress):
        prepared = given.adjusted(scene) if given else prepare_checked(scene, backend)
    with Interrupts(has_results=False) as interrupts:
        if goal:
            values, facts = _layers_for_goal(prepared, goal, files, layers, progress, interrupts)
        else:
            values, facts = _layers_of_spp(prepared, layers, progress, interrupts)
        check_numbers(prepared, values["RGB"])
        overlay = _overlay(prepared, values, layers)
    if goal:
        _warn_of_goal(goal, values["RGB"], facts, interrupts)
    pictures = rasters(prepared, values, layers) | overlay
    certificate = certificate_facts(pictures)
    warn_of_roots(certificate, prepared)
    facts = provenance(prepared, scene_hash, clock.now() - now, pictures.get("id")) | facts | certificate
    if goal:
        del facts["spp_asked"]
    return Image(pictures, facts | {"interrupted": int(interrupts.requested)})


def _check_arguments(goal: Goal | None, layers: tuple[str, ...], files: Files) -> None:
    """Raises a UserError if a layer needs a goal and there is none, or if a file cannot be written.

    goal: the error or the time to reach, or None.
    """
    adaptive_only = set(layers) & set(names_from("adaptive"))
    if goal is None and adaptive_only and layers != NAMES:
        names = ", ".join(sorted(adaptive_only))
        raise UserError(f"layers = {names}: only a picture to an error or in a time has that")
    for path in files.paths:
        check_destination(path, files.gamma, files.exposure)


def _layers_of_spp(
    prepared: Prepared, layers: tuple[str, ...], progress: bool, interrupts: Interrupts
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Takes the samples that the scene asks for. Returns the layers by name, and facts for the metadata."""
    timer = PassTimer()
    look = partial(_look, prepared, interrupts)
    film, spp = expose(prepared, progress, interrupts, timer=timer, look=look)
    values, facts = developed(prepared, film)
    # Frees the film. If there are many pixels, the layers of the first hit may need its memory.
    del film
    if interrupts.requested and timer.compile_seconds > LONGEST_PASS:
        # Their kernel would take about as long to compile, and Ctrl-C would wait for it.
        text = "stopped before the layers of the first hit were computed, which needs a kernel of its own"
        warnings.warn(text, StoppedWarning, stacklevel=4)
        return values, {"spp": spp} | facts
    return values | _first_hit_layers(prepared, layers), {"spp": spp} | facts


def _layers_for_goal(
    prepared: Prepared, goal: Goal, files: Files, layers: tuple[str, ...], progress: bool, interrupts: Interrupts
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Takes samples until the goal is reached. Returns the layers by name, and facts for the metadata."""
    # The first hit comes before the samples, because it takes a part of the time that the goal allows.
    first_hit = _first_hit_layers(prepared, layers)
    try:
        adaptive = render_adaptively(prepared, goal, files, layers, progress, interrupts)
    except NotANumber as none:
        check_numbers(prepared, none.mean)
        raise
    # A look for light would compile another kernel, which takes a part of the time.
    coverage = np.array(adaptive.layers.get("A", np.ones(len(prepared.order))))
    if not interrupts.requested:
        notes = dark_notes(prepared, adaptive.layers["RGB"], coverage, interrupts, may_look=goal.seconds is None)
        warn_of_dark(notes, stacklevel=4)
    return adaptive.layers | first_hit, adaptive.facts


def _warn_of_goal(goal: Goal, rgb: np.ndarray, facts: dict[str, Any], interrupts: Interrupts) -> None:
    """Warns if the error is not known, or is larger than the error that was asked for.

    rgb: layer RGB. facts: facts for the metadata. interrupts: whether Ctrl-C was pressed.

    The warning shows the line of code that called vr.render.
    """
    if not rgb.any():
        warnings.warn("no sample met any light: nothing is known of the error", GoalWarning, stacklevel=4)
    elif not (goal.seconds or interrupts.requested) and facts["error_high"] > goal.error:
        text = f"the error asked for, {goal.error:g}, is not reached with {facts['spp_most']} samples of a pixel"
        warnings.warn(text, GoalWarning, stacklevel=4)


def checked_layers(layers: Sequence[str]) -> tuple[str, ...]:
    """Names of layers as a tuple. Raises a UserError if one of them is not the name of a layer.

    layers: the names; a single string is one name.
    """
    layers = (layers,) if isinstance(layers, str) else tuple(layers)
    for name in layers:
        if not isinstance(name, str) or name not in BY_NAME:
            raise UserError(f"layers = {shown(name)}: there is no such layer; choose from {', '.join(NAMES)}")
    return layers


def _seconds_to_finish(scene: Scene, layers: tuple[str, ...], files: Files) -> float:
    """Estimated seconds from the last sample until all files are written."""
    pixels = scene.film.width * scene.film.height
    legend = LEGEND + LEGEND_PIXEL * pixels if set(layers) & set(names_from("overlay")) else 0.0
    channels = sum(len(BY_NAME[name].channels) for name in layers)
    writing = [PNG if Path(p).suffix.lower() == ".png" else CHANNEL * channels for p in files.paths]
    return (LAYERING + sum(writing)) * pixels + legend


@checked_arguments
def prepare(scene: Scene | str | Path, backend: str = "llvm", allow_outside: bool = False) -> Prepared:
    """Prepares a scene, or the scene in a file, to be rendered many times. It is validated and turned into the arrays
    of a kernel only once.

    prepared = vr.prepare(scene)
    for x in (0.0, 0.1, 0.2):
        prepared = prepared.updated({"objects.ball.center.0": x})
        image = vr.render(prepared)

    `updated` computes again only what changes.
    allow_outside: whether a scene file may name files outside of its folder.
    """
    scene = load(scene, allow_outside=allow_outside) if isinstance(scene, (str, Path)) else scene
    return prepare_checked(checked(scene), backend)


@checked_arguments
def explain(scene: Scene) -> Features:
    """The effects that a scene needs and those that it does not, each with the reason; how rays find objects; facts
    about meshes; which transparent solids count where they overlap; of what CSG objects are made; and what is odd about
    materials, clips and CSG."""
    scene = checked(scene)
    on = features(scene)
    listed, count = overlaps(scene) if on["nested media"] else ((), 0)
    of_scene = (*csg_notes(scene), *constant_notes(scene), *clip_notes(scene), *data_notes(scene))
    notes = (*sheet_notes(scene, on), *energy_notes(scene), *of_scene)
    more = {"meshes": mesh_facts(scene), "overlaps": listed, "overlap_count": count, "notes": notes}
    return replace(on, rays=ray_families(scene, on), **more)


def set_threads(threads: int) -> None:
    """Sets the number of threads of the LLVM backend."""
    if not isinstance(threads, int) or not 1 <= threads <= 1024:
        raise UserError(f"threads = {threads}: must be a whole number from 1 to 1024")
    dr.set_thread_count(threads)


def check_numbers(prepared: Prepared, mean: np.ndarray) -> None:
    """Raises a UserError if a colour is not finite. The message names the pixel and the object that the pixel shows.

    mean: colours of the pixels, in the order of lanes.

    Shapes: mean (3, N).
    """
    bad = np.flatnonzero(~np.isfinite(mean).all(0))
    if not bad.size:
        return
    names = {i + 1: name for i, name in enumerate(prepared.scene.all_objects)}
    number = np.broadcast_to(np.array(_first_hit(prepared)["id"]), len(prepared.order))[bad[0]]
    y, x = divmod(int(prepared.order[bad[0]]), prepared.scene.film.width)
    what = address_of(names[int(number)]) if number else "nothing"
    more = f", and {bad.size - 1} pixels more" if bad.size > 1 else ""
    raise UserError(f"pixel {x}, {y}, which shows {what}{more}: is not a number; this is an error in visray: report it")


def developed(prepared: Prepared, film: films.Film) -> tuple[dict[str, Any], dict[str, Any]]:
    """The layers of a film by name (colour, coverage, variance), and a dict of facts about the error.

    The fact `error_at_most` is the error that independent samples would have. With other samplers the error is smaller.
    After Ctrl-C, pixels may have no sample; they are transparent.
    """
    present = film.counts > 0
    layers = {"RGB": np.array(film.mean), "A": _coverage(prepared, film)}
    if not present.all():
        text = f"stopped when {present.sum():,} of {present.size:,} pixels had a sample; the others are transparent"
        warnings.warn(text, StoppedWarning, stacklevel=5)
    if film.counts.min() <= 1:
        return layers, {}
    layers["variance"] = np.array(film.squares) / (film.counts - 1)
    luminance = float((LUMINANCE @ layers["RGB"]).mean())
    if luminance <= 0:
        return layers, {}
    square = float((layers["variance"] / film.counts).mean())
    return layers, {"error_at_most": float(np.sqrt(square) / luminance)}


def _coverage(prepared: Prepared, film: films.Film) -> np.ndarray:
    """The coverage (alpha) of the pixels of a film. Pixels without a sample are transparent."""
    if prepared.scene.film.transparent:
        return np.array(film.coverage) / np.maximum(film.counts, 1)
    return (film.counts > 0).astype(float)


def _look(prepared: Prepared, interrupts: Interrupts, film: films.Film) -> None:
    """Warns if the film is black or shows nothing."""
    if not interrupts.requested:
        # The line of code that called vr.render is five calls away.
        warn_of_dark(dark_notes(prepared, film.mean, _coverage(prepared, film), interrupts), stacklevel=6)


def _first_hit_layers(prepared: Prepared, layers: tuple[str, ...]) -> dict[str, Any]:
    """Dict of the layers of the first hit by name, and of the certificate. It is empty if no layer in `layers` is one
    of these."""
    needed = set(layers) & set(names_from("first hit"))
    if set(layers) & set(names_from("certificate")) and any(b.kind.finds_roots for b in prepared.kernel.batches):
        needed.add("certificate")
    return _first_hit(prepared) if needed else {}


def _first_hit(prepared: Prepared) -> dict[str, Any]:
    """Dict of the layers of the first hit along the ray through each pixel's centre. Their arrays are evaluated."""
    layers = integrator.first_hit(prepared.kernel, prepared.x, prepared.y)
    dr.eval(layers)
    return layers


def rasters(prepared: Prepared, values: dict[str, Any], layers: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Dict of layers as pictures, by name.

    values: layers by name, with pixels in the order of lanes.
    layers: names of the layers that are wanted. Those without values are left out.
    """
    return {name: _raster(prepared, name, values[name]) for name in NAMES if name in layers and name in values}


def _overlay(prepared: Prepared, values: dict[str, Any], layers: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Dict of the layer legend as a picture, if it is wanted. Notes about it become warnings.

    values, layers: as in `rasters`.
    """
    if not set(layers) & set(names_from("overlay")):
        return {}
    opaque = {"A": np.ones(len(prepared.order))}
    rgb, alpha = (_raster(prepared, name, (opaque | values)[name]) for name in ("RGB", "A"))
    picture = drawn_legend(prepared.scene, rgb, alpha)
    for note in picture.notes:
        warnings.warn(note, LegendWarning, stacklevel=4)
    return {"legend": picture.pixels}


def _raster(prepared: Prepared, name: str, values: Any) -> np.ndarray:
    """One layer as a picture.

    name: name of the layer.
    values: values of the layer, with pixels in the order of lanes.

    Shapes: values (N,) or (n, N); result (H, W) or (H, W, n).
    """
    width, height = prepared.scene.film.width, prepared.scene.film.height
    if isinstance(values, tuple):
        values = np.stack([np.array(v) for v in values])
    flat = np.array(values)
    flat = flat.T if flat.ndim == 2 else flat
    picture = np.empty(flat.shape, BY_NAME[name].memory_dtype)
    picture[prepared.order] = flat  # if all pixels are equal, `flat` may have a single entry for all of them
    return picture.reshape(height, width, *picture.shape[1:])
