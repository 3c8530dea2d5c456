"""The samples of a picture, as layers by name: to a number of samples, or to a goal."""

import warnings
from functools import partial
from typing import Any

import numpy as np

from visray.adaptive.error_floor import Files
from visray.adaptive.evidence import NotANumber
from visray.adaptive.result import render_adaptively
from visray.adaptive.stopping import Goal
from visray.checkpoint import Checkpoint
from visray.cluster.picture import Job, expose_on
from visray.dark import dark_notes, warn_of_dark
from visray.depth_report import depth_facts
from visray.errors import StoppedWarning
from visray.film import Film
from visray.pass_timer import LONGEST_PASS, PassTimer
from visray.passes import expose, identity_of
from visray.picture_layers import alpha_of, check_numbers, developed, first_hit_layers
from visray.progress import Interrupts
from visray.setup import Prepared


def layers_of_spp(
    prepared: Prepared,
    layers: tuple[str, ...],
    progress: bool,
    interrupts: Interrupts,
    checkpoint: Checkpoint | None,
    job: Job | None,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Takes the samples that the scene asks for. Returns the layers by name, and facts for the metadata.

    job: the workers that take the samples; None: this process does.
    """
    # With an open shutter a pass is many launches, whose seconds say nothing about others.
    timer = PassTimer() if prepared.shutter else prepared.pace
    compiled_before = timer.compile_seconds
    look, keep, film = partial(_look, prepared, interrupts), None, None
    if checkpoint is not None:
        film = checkpoint.film(prepared.a, identity_of(prepared), prepared.scene.settings.spp)
        keep = checkpoint.keep
    if job is None:
        film, spp = expose(prepared, progress, interrupts, film, timer, look, keep)
    else:
        keep_lost = partial(checkpoint.end, finished=False) if checkpoint else lambda film: None
        film, spp = expose_on(job, prepared, progress, interrupts, film, look, keep, keep_lost)
    values, facts = developed(prepared, film)
    if job is None:  # workers have the kernel, which would have to be compiled here
        facts |= depth_facts(prepared, film, progress, interrupts)
    # After Ctrl-C in that look the picture counts as stopped, so its samples are kept too.
    stopped = interrupts.requested
    if checkpoint is not None:
        checkpoint.end(film, finished=not stopped)
    # Frees the film. If there are many pixels, the layers of the first hit may need its memory.
    del film
    if stopped and timer.compile_seconds - compiled_before > LONGEST_PASS:
        # Their kernel would take about as long to compile, and Ctrl-C would wait for it.
        text = "stopped before the layers of the first hit were computed, which needs a kernel of its own"
        warnings.warn(text, StoppedWarning, stacklevel=4)
        return values, {"spp": spp} | facts
    return values | first_hit_layers(prepared, layers), {"spp": spp} | facts


def layers_for_goal(
    prepared: Prepared,
    goal: Goal,
    files: Files,
    layers: tuple[str, ...],
    progress: bool,
    interrupts: Interrupts,
    checkpoint: Checkpoint | None,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Takes samples until the goal is reached. Returns the layers by name, and facts for the metadata."""
    # The first hit comes before the samples, because it takes a part of the time that the goal allows.
    first_hit = first_hit_layers(prepared, layers)
    try:
        adaptive = render_adaptively(prepared, goal, files, layers, progress, interrupts, checkpoint)
    except NotANumber as none:
        check_numbers(prepared, none.mean)
        raise
    # A look for light would compile another kernel, which takes a part of the time.
    coverage = np.array(adaptive.layers.get("A", np.ones(len(prepared.order))))
    if not interrupts.requested:
        notes = dark_notes(prepared, adaptive.layers["RGB"], coverage, interrupts, may_look=goal.seconds is None)
        warn_of_dark(notes, stacklevel=4)
    return adaptive.layers | first_hit, adaptive.facts


def _look(prepared: Prepared, interrupts: Interrupts, film: Film) -> None:
    """Warns if the film is black or shows nothing."""
    if not interrupts.requested:
        # The line of code that called vr.render is five calls away.
        warn_of_dark(dark_notes(prepared, film.mean, alpha_of(prepared, film), interrupts), stacklevel=6)
