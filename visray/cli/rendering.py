"""The command `visray render`: its options and its help."""

import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from visray import clock
from visray.cli.keeping import checkpoint_path, kept
from visray.cli.moment import files_at, moment
from visray.cli.options import (
    INTERRUPTED,
    At,
    Cluster,
    Compat,
    Integer,
    Json,
    Outputs,
    Outside,
    SceneFile,
    Settings,
    Setup,
    Threads,
    app,
    check_cluster,
    flag,
    load_scene,
)
from visray.cli.picture_options import (
    EPILOGUE,
    Backend,
    Error,
    Exposure,
    Filter,
    Float,
    Gamma,
    Layers,
    NoLegend,
    Precision,
    Preview,
    Quiet,
    Region,
    Samples,
    Scale,
    Seed,
    Show,
    Size,
    Time,
    film_changes,
    needed_layers,
    parse_gamma,
)
from visray.cli.picture_report import goal_met, line, report
from visray.cli.showing import Showing
from visray.cli.standard_output import files_for, is_aside, reserve
from visray.errors import CheckpointWarning, UserError
from visray.output.layers import names_from
from visray.progress import Bar, Interrupts
from visray.terminal import kept_notes, say, write_json, write_line
from visray.warn import warn

if TYPE_CHECKING:
    from visray.output.image import Image
    from visray.scene.scene import Scene


def check_legend(scene: "Scene", path: Path | None) -> None:
    """Raises a UserError if the legend cannot be written to a file of its own. path: value of the option --legend."""
    from visray.legend.layer import has_legend
    from visray.output.image import check_destination

    if path is None:
        return
    if path.suffix.lower() != ".png":
        raise UserError(f"--legend = {str(path)!r}: must be a .png file; an EXR file has the legend as a layer")
    if not has_legend(scene):
        raise UserError(f"--legend = {str(path)!r}: the scene has no legend; give it data.legend")
    check_destination(path)


def without_legend(image: "Image") -> "Image":
    """The picture without the layer of the legend."""
    left_out = names_from("overlay")
    layers = {name: values for name, values in image.layers.items() if name not in left_out}
    return replace(image, layers=layers, metadata=image.metadata | {"legend": 0})


@app.command(name="render", help_epilogue=EPILOGUE)
def render_command(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    output: Outputs = [],  # noqa: B006 - only read
    spp: Samples = None,
    error: Error = None,
    time: Time = None,
    at: At = None,
    frame: Annotated[
        Integer | None, Parameter(help="The moment as the number of a frame. In -o shot.####.exr, it replaces ####.")
    ] = None,
    size: Size = None,
    scale: Scale = None,
    region: Region = None,
    filter: Filter = None,
    precision: Precision = None,
    seed: Seed = None,
    threads: Threads = None,
    backend: Backend = "llvm",
    cluster: Cluster = None,
    set: Settings = [],  # noqa: B006 - the name of the option; only read
    layers: Layers = None,
    gamma: Gamma = "srgb",
    exposure: Exposure = 0.0,
    float32: Float = False,
    legend: Annotated[
        Path | None, Parameter(help="A .png file for the legend alone, with a transparent background.")
    ] = None,
    no_legend: NoLegend = False,
    checkpoint: flag(
        "Keep the samples in a file beside the first output, OUTPUT.checkpoint, until all is written."
    ) = False,
    resume: flag("Go on with the checkpoint of a render that has not ended, to the same bits.") = False,
    show: Show = False,
    preview: Preview = False,
    quiet: Quiet = False,
    json: Json = False,
    showing: Annotated[Showing | None, Parameter(parse=False)] = None,
    more: Annotated[dict[str, Any] | None, Parameter(parse=False)] = None,
) -> int:
    """Render a scene to EXR and PNG files.

    Without -o the picture goes to the current folder, under the scene's name, as EXR and PNG. With --show or
    --preview it is shown instead. Ctrl-C keeps what is done so far.
    """
    begun = clock.now()
    if quiet:
        warnings.simplefilter("ignore")
    with kept_notes() as notes:
        changes = {"spp": spp, **film_changes(size, scale, region, filter), "seed": seed, "precision": precision}
        check_cluster(cluster)
        showing = showing or Showing.of(show, preview, json, output)
        asked = showing.outputs(output, [Path(scene.stem + suffix) for suffix in (".exr", ".png")])
        reserve(asked, json=json, preview=showing.screen is not None)
        if (not asked or is_aside(asked[0])) and (checkpoint or resume):
            raise UserError("--checkpoint and --resume: the samples are kept beside the picture; give its file with -o")
        with Bar(f"reading {scene.name}", 1, not (quiet or json)):
            loaded = load_scene(scene, setup, compat, set, allow_outside=allow_outside, **changes)
        from visray.adaptive.error_floor import Files
        from visray.adaptive.stopping import Goal
        from visray.checkpoint import held
        from visray.output.image import check_destination
        from visray.output.sequence import check_unused
        from visray.renderer import render

        Goal.from_arguments(error, time, spp, begun)
        at = moment(loaded, at, frame)
        asked = files_at(loaded, asked, at)
        with files_for(asked) as outputs:
            names, curve = needed_layers(layers, outputs), parse_gamma(gamma)
            for path in outputs:
                check_destination(path, curve, exposure)
                check_unused(path)
            check_legend(loaded, legend)
            with held(checkpoint_path(outputs) if checkpoint or resume else None, resume) as kept_samples:
                image = render(
                    loaded,
                    threads=threads,
                    backend=backend,
                    layers=names,
                    progress=not (quiet or json),
                    error=error,
                    time=time,
                    files=Files(outputs, curve, exposure, float32),
                    begun=clock.LOADED,
                    legend=legend is not None or not no_legend,
                    checkpoint=kept_samples,
                    at=at,
                    cluster=cluster,
                )
                if image.metadata["interrupted"] and kept_samples is None and time is None:
                    text = "its samples are not kept; with --checkpoint, --resume would go on"
                    warn(f"{[*asked, scene][0]}: {text}", CheckpointWarning)
                # While the files are written, Ctrl-C does not stop the program.
                with Interrupts():
                    results = [kept(legend, partial(image.legend().write, gamma=curve))] if legend else []
                    image = without_legend(image) if no_legend else image
                    write = partial(image.write, gamma=curve, exposure=exposure, float32=float32)
                    results += [kept(path, write) for path in outputs]
                if problems := [line for _, lines in results for line in lines]:
                    raise UserError(*problems)
    facts, outputs = image.metadata, [*asked, *([legend] if legend else [])]
    found = kept_samples.found if kept_samples else None
    # With --error or --time, the seconds count from the start of the program, as in the forecast.
    seconds = clock.now() - (clock.LOADED if "forecast_seconds" in facts else begun)
    if json:
        all_notes = [*(more or {}).get("notes", ()), *notes]
        write_json((more or {}) | report(image, outputs, seconds) | {"found_spp": found, "notes": all_notes})
    else:
        showing.in_terminal(image, curve, exposure)
        if not quiet:
            not_saved = "" if asked else f"; not saved: -o {scene.stem}.png writes it"
            write_line(line(image, outputs or [Path(scene.stem)], seconds, found) + not_saved)
    shown = showing.in_window(image, [path for path in asked if not is_aside(path)], scene.stem, curve, exposure)
    if shown and not (quiet or json):
        say(f"shown from {shown}; if no window comes, open this file")
    if facts["interrupted"]:
        return INTERRUPTED
    return 0 if goal_met(facts) or time is not None else 1
