"""A picture that is rendered until a goal is reached, and the facts about it."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from visray import terminal
from visray.adaptive.error_floor import Files
from visray.adaptive.journal import Journal
from visray.adaptive.loop import AdaptiveRun
from visray.adaptive.planning import Forecast
from visray.adaptive.stopping import Goal
from visray.checkpoint import Checkpoint
from visray.progress import Bar, Interrupts
from visray.setup import Prepared


@dataclass(frozen=True)
class AdaptiveResult:
    """Result of an adaptive render.

    layers: dict of the picture's layers by name, with pixels in the order of lanes. Shapes: (3, N) or (N) each.
    facts: metadata of the picture: samples, error and forecast.
    """

    layers: dict[str, np.ndarray]
    facts: dict[str, Any]


def adaptive_sampler(sampler: str) -> str:
    """The sampler of an adaptive render, for the sampler that a scene asks for: Sobol points in place of stratified
    samples, which need their number beforehand."""
    return "sobol" if sampler == "stratified" else sampler


def render_adaptively(
    prepared: Prepared,
    goal: Goal,
    files: Files,
    layers: Collection[str],
    progress: bool,
    interrupts: Interrupts,
    checkpoint: Checkpoint | None = None,
) -> AdaptiveResult:
    """Renders a picture until a goal is reached.

    files: files that the picture will be written to.
    layers: names of the layers to make.
    progress: whether the forecast and a progress bar are shown.
    interrupts: after Ctrl-C, the picture consists of the samples so far.
    checkpoint: keeps the samples; the picture in it is continued.
    """
    journal = Journal.of(checkpoint, prepared, _asked(goal, files), interrupts)
    forecasts: list[Forecast] = []

    def report(forecast: Forecast) -> None:
        forecasts.append(forecast)
        if progress:
            terminal.say(forecast.text())

    with Bar("rendering", 1, progress, before="compiling") as bar:
        run = AdaptiveRun(prepared, goal, interrupts, bar, report, journal)
        run.run(files)
        if not interrupts.requested:
            bar.update(bar.total)
    journal.end(finished=not interrupts.requested)
    return AdaptiveResult(run.evidence.buffer.layers(layers), _facts(run, forecasts[-1]))


def _asked(goal: Goal, files: Files) -> dict[str, Any]:
    """What an adaptive render decides by, besides the picture: the error asked for, and how its files round."""
    suffixes = sorted({str(path).lower().rpartition(".")[2] for path in files.paths})
    kind = f"{' '.join(suffixes)}, gamma {files.gamma}, exposure {files.exposure:g}" + ", float" * files.float32
    return {"goal": f"error {goal.error}", "files": kind if suffixes else "none"}


def _facts(run: AdaptiveRun, forecast: Forecast) -> dict[str, Any]:
    """Metadata of a finished render, as a dict."""
    buffer, estimate, hidden = run.evidence.buffer, run.evidence.estimate, run.evidence.hidden
    floor, goal = run.planner.floor, run.goal
    scale = 1 / estimate.luminance if estimate.luminance > 0 else 1.0
    # The error floor is part of the error and of both ends of its interval.
    noise, squares = (estimate.error, estimate.low, estimate.high), (floor.square, floor.low, floor.high)
    errors = [float(np.hypot(x, scale * np.sqrt(square))) for x, square in zip(noise, squares)]
    floor_parts = {"depth_error": max(floor.depth.square, 0.0), "file_error": floor.rounding}
    spp = buffer.samples()
    facts = {
        "sampler": buffer.prepared.scene.settings.sampler,
        "spp": round(float(spp.mean()), 2),
        "spp_least": int(spp.min()),
        "spp_most": int(spp.max()),
        **dict(zip(("error", "error_low", "error_high"), errors)),
        **{name: float(scale * np.sqrt(square)) for name, square in floor_parts.items()},
        "forecast_error": forecast.error,
        "forecast_spp": round(forecast.spp, 2),
        "forecast_seconds": round(forecast.seconds, 2),
    }
    if buffer.hidden:
        facts |= {"unseen_error": float(scale * np.sqrt(estimate.unseen)), "unseen": hidden[1]}
    if buffer.cells is not None:
        facts |= {"small_object_pixels": len(buffer.cells.lanes)}
    facts |= {} if goal.error is None else {"error_asked": float(goal.error)}
    facts |= {} if goal.seconds is None else {"time_asked": float(goal.seconds)}
    facts |= {} if run.time_missed is None else {"time_missed": run.time_missed}
    return facts
