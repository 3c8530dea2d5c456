"""Renders a scene to an Image with layers and metadata.

A lane is one pixel in the arrays of a kernel. The order of lanes is not the order of pixels in a picture
(Prepared.order). A layer is one kind of data of a picture, such as RGB or N (output/layers.py).
"""

import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from visray import clock
from visray.adaptive.error_floor import Files
from visray.adaptive.result import adaptive_sampler
from visray.adaptive.stopping import Goal
from visray.animation.moment import still_at
from visray.arguments import ONE_MOMENT, checked_arguments, shown
from visray.certificate import certificate_facts, warn_of_roots
from visray.checkpoint import Checkpoint, held
from visray.cluster.address import check_address
from visray.cluster.connecting import connected
from visray.cluster.picture import Job
from visray.errors import GoalWarning, UserError
from visray.filter_report import warn_of_filter
from visray.legend.layer import has_legend
from visray.motion_vectors import check_motion
from visray.moving import moving
from visray.output.image import Image, check_destination
from visray.output.layers import BY_NAME, NAMES, names_from
from visray.picture_layers import check_numbers, overlay, rasters
from visray.progress import Bar, Interrupts
from visray.provenance import provenance
from visray.sampled_layers import layers_for_goal, layers_of_spp
from visray.scene.adjusted import adjusted
from visray.scene.load import checked, load, load_as_written
from visray.scene.scene import Scene
from visray.setup import Prepared, refuse_within_kernel, set_threads
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
    at: float | None = None,
    checkpoint: str | Path | Checkpoint | None = None,
    resume: bool = False,
    cluster: str | None = None,
    filter: Any = None,
    region: Sequence[int] | None = None,
    scale: float | None = None,
) -> Image:
    """Renders a scene, a prepared scene (vr.prepare) or a scene file. After Ctrl-C, the picture consists of the samples
    taken so far.

    setup: the setup file of a scene in the format of the original VisRayTrace.
    spp: samples per pixel. Like `size` (width, height), `seed`, `precision`, and the film's `filter`, `region` and
        `scale` (vr.Film), it replaces the value of the scene.
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
    at: the moment of an animated scene that is shown, in seconds; None means its beginning. Only here is there motion
        blur: vr.at gives a scene without it.
    checkpoint: a file that keeps the samples until the picture is finished (checkpoint.py), at least each half minute;
        or a Checkpoint, which the caller holds.
    resume: whether the picture in the file `checkpoint` is continued. It has the same bits as if it had not stopped.
    cluster: address of a Dask scheduler whose workers take the samples, such as tcp://host:8786, or local:N for N
        workers on this machine. The bits are the same. `threads` is then the number of threads of each worker.

    With `error` or `time`, pixels with more noise get more samples, without bias (adaptive/). The metadata of the Image
    say how the picture was made.
    """
    now = clock.now()
    refuse_within_kernel()
    goal, layers = Goal.from_arguments(error, time, spp, now if begun is None else begun), checked_layers(layers)
    _check_arguments(goal, layers, files, cluster)
    _check_checkpoint(goal, checkpoint, resume)
    scene = load_as_written(scene, setup, allow_outside=allow_outside) if isinstance(scene, (str, Path)) else scene
    given = scene if isinstance(scene, Prepared) else None
    if given and backend not in ("llvm", given.a.backend):
        raise UserError(f"backend = {backend!r}: the scene is prepared for {given.a.backend}; prepare it for the other")
    if cluster and given and given.shutter:
        raise UserError(f"cluster = {cluster!r}: takes no prepared frame with motion blur; give its scene, and `at`")
    if given and at is not None:
        raise UserError(f"at = {at:g}: {ONE_MOMENT}")
    film = {"size": size, "filter": filter, "region": region, "scale": scale}
    with Bar("preparing", 1, progress):
        animated = adjusted(given.scene if given else scene, **film, spp=spp, seed=seed, precision=precision)
    check_motion(layers, given.after if given else animated.animation)
    asked = scene = still_at(animated, at)
    if not (legend and has_legend(scene)):
        layers = tuple(name for name in layers if name not in names_from("overlay"))
    if goal:
        goal = replace(goal, reserve=_seconds_to_finish(scene, layers, files))
        sampler = adaptive_sampler(scene.settings.sampler)
        scene = adjusted(scene, sampler=sampler) if sampler != scene.settings.sampler else scene
    else:
        warn_of_filter(scene)
    if threads is not None:
        set_threads(threads)
    with ExitStack() as stack:
        crew = stack.enter_context(connected(cluster, threads, progress)) if cluster else None
        job = Job.begun(crew, animated, at) if crew else None
        with Bar("preparing", 1, progress):
            prepared = given.adjusted(scene) if given else prepare_checked(scene, backend)
            if animated.animation is not None:
                prepared = moving(prepared, animated, at or 0.0, layers=layers)
        kept, interrupts = map(stack.enter_context, (held(checkpoint, resume), Interrupts(has_results=False)))
        if kept is not None and animated.animation is not None:
            kept.moment = float(at or 0.0)
        if goal:
            values, facts = layers_for_goal(prepared, goal, files, layers, progress, interrupts, kept)
        else:
            values, facts = layers_of_spp(prepared, layers, progress, interrupts, kept, job)
        check_numbers(prepared, values["RGB"])
        drawn = overlay(prepared, values, layers)
    if goal:
        _warn_of_goal(goal, values["RGB"], facts, interrupts)
    pictures = rasters(prepared, values, layers) | drawn
    certificate = certificate_facts(pictures)
    warn_of_roots(certificate, prepared)
    scene_hash = prepared.shutter.hash(asked) if prepared.shutter else asked.hash()
    facts = provenance(prepared, scene_hash, clock.now() - now, pictures.get("id")) | facts | certificate
    if goal:
        del facts["spp_asked"]
    if animated.animation is not None:
        facts["time"] = float(at or 0.0)
    if "forward" in pictures:
        facts["next_scene_hash"] = prepared.after.hash()
    return Image(pictures, facts | {"interrupted": int(interrupts.requested)})


def _check_arguments(goal: Goal | None, layers: tuple[str, ...], files: Files, cluster: str | None) -> None:
    """Raises a UserError if a layer needs a goal and there is none, if a file cannot be written, or if there is no such
    cluster.

    goal: the error or the time to reach, or None.
    """
    adaptive_only = set(layers) & set(names_from("adaptive"))
    if goal is None and adaptive_only and layers != NAMES:
        names = ", ".join(sorted(adaptive_only))
        raise UserError(f"layers = {names}: only a picture to an error or in a time has that")
    for path in files.paths:
        check_destination(path, files.gamma, files.exposure)
    if cluster is not None:
        check_address(cluster)
        if goal is not None:
            reason = "each of its passes depends on all samples before, so one picture to an error or in a time is"
            raise UserError(f"cluster = {cluster!r}: {reason} rendered on one machine; give spp, or leave cluster out")


def _check_checkpoint(goal: Goal | None, checkpoint: str | Path | Checkpoint | None, resume: bool) -> None:
    """Raises a UserError if a render to this goal has no checkpoint, or if there is none to go on with."""
    if resume and checkpoint is None:
        raise UserError("resume = True: needs the checkpoint to go on with; give its file as checkpoint")
    if goal and goal.seconds is not None and checkpoint is not None:
        reason = "how far a picture comes in a time depends on the machine, so it cannot go on to the same bits"
        raise UserError(f"time = {goal.seconds:g}: goes with no checkpoint: {reason}; give an error, or samples")


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
    pixels = prod(scene.film.raster)
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
