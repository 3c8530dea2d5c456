"""The command `visray render`: its options, its help, and its reports.

Facts are the metadata of a rendered Image: how it was made, and how large its error is.
"""

import warnings
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from visray import clock
from visray.cli.keeping import checkpoint_path, kept
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
    Share,
    Threads,
    app,
    flag,
    load_scene,
    parse_size,
)
from visray.errors import UserError
from visray.modes import MODES, Mode
from visray.output.layers import LAYERS, NAMES, Layer, names_from
from visray.progress import Bar, Interrupts
from visray.terminal import kept_notes, write_json, write_line

if TYPE_CHECKING:
    from visray.output.image import Image
    from visray.scene.scene import Scene

# The facts that --json reports: for every picture, for pictures with --error or --time, and for pictures of polynomial
# surfaces or tori.
FACTS = ("spp", "seed", "precision", "backend", "features", "scene_hash", "render_seconds", "threads", "error_at_most")
ADAPTIVE_FACTS = (
    "sampler", "spp_least", "spp_most", "error", "error_low", "error_high", "depth_error", "file_error", "error_asked",
    "time_asked", "time_missed", "unseen_error", "unseen", "small_object_pixels", "forecast_error", "forecast_spp",
    "forecast_seconds",
)  # fmt: skip
CERTIFICATE_FACTS = ("unresolved", "residual_ulps")


def _list(title: str, records: Iterable[Layer | Mode]) -> str:
    """A list for the help text, in Markdown, with the name and the meaning of each record.

    title: text above the list. records: the layers or the shading modes.
    """
    return "\n".join([title, "", *(f"- **{record.name}**: {record.meaning}" for record in records)])


EPILOGUE = "\n\n".join(
    [
        _list("Layers of an EXR file, for `--layers`:", LAYERS),
        _list("Shading modes, for `--set settings.shading=MODE`:", MODES),
    ]
)


def needed_layers(text: str | None, outputs: list[Path]) -> tuple[str, ...]:
    """Names of the layers to render, as a tuple.

    text: value of the option --layers, names separated by commas, to which RGB, A and the legend of a data scene are
        added. If it is None or "all":
        all layers if there is an EXR file, else only colour, coverage, the certificate and the legend.
    outputs: paths of the files to write.
    """
    has_exr = any(o.suffix.lower() == ".exr" for o in outputs)
    if text is None or text == "all":
        return NAMES if has_exr else ("RGB", "A", *names_from("certificate", "overlay"))
    by_lower = {name.lower(): name for name in NAMES}
    asked = [word.strip() for word in text.split(",")]
    if unknown := [word for word in asked if word.lower() not in by_lower]:
        raise UserError(f"--layers = {text!r}: there is no layer {unknown[0]!r}; choose from {', '.join(NAMES)}")
    always = ("RGB", "A", *names_from("overlay"))
    names = tuple(dict.fromkeys((*always, *(by_lower[word.lower()] for word in asked))))
    if len(names) > len(always) and not has_exr:
        warnings.warn("--layers: only an EXR file has layers, and none is written", stacklevel=1)
    return names


def _summary_of_samples(facts: dict[str, Any]) -> str:
    """Samples per pixel and the error of a picture, as a part of a sentence."""
    stopped = ", stopped" if facts["interrupted"] else ""
    if "error" not in facts:
        # The bound is the error of independent samples. Other samplers have a smaller error; how much is not known.
        bound = "" if facts["sampler"] == "independent" else "below "
        error = f", error {bound}{facts['error_at_most']:.2g}" if "error_at_most" in facts else ""
        return f"{facts['spp']} spp" + (f" of {facts['spp_asked']}" if stopped else "") + stopped + error
    low, high = (f"{facts[f'error_{end}']:.3g}" for end in ("low", "high"))
    parts = {"depth": facts["depth_error"], "the file's rounding": facts["file_error"]}
    # The squares of errors add up. So a part below a fifth of the whole error changes it by about 2 % and is not shown.
    largest = "".join(f", {x:.2g} of it by {name}" for name, x in parts.items() if x > 0.2 * facts["error"])
    # The upper end of the interval is the root of a sum of squares, too.
    if facts.get("unseen_error", 0.0) > 0.2 * facts["error_high"]:
        largest += f", {facts['unseen_error']:.2g} in case that no sample met {facts['unseen']}"
    above = "" if _goal_met(facts) else f", above the {facts['error_asked']:g} asked"
    mean = f"{facts['spp']:,.0f}" if facts["spp"] >= 100 else f"{facts['spp']:.3g}"
    spp = f"{mean} spp ({facts['spp_least']:,} to {facts['spp_most']:,} in a pixel){stopped}"
    return f"{spp}, error {facts['error']:.3g} (95 %: {low} to {high}{largest}){above}"


def _goal_met(facts: dict[str, Any]) -> bool:
    """Whether the error is as small as the user asked for. True if no error was asked for."""
    return facts.get("error_high", 0.0) <= facts.get("error_asked", inf)


def parse_gamma(text: str) -> Any:
    """Display curve from a text: a number if the text is one, else the text itself, such as "srgb". It is checked
    later, together with the output files."""
    try:
        return float(text)
    except ValueError:
        return text


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
    return replace(image, layers={name: values for name, values in image.layers.items() if name not in left_out})


@app.command(name="render", help_epilogue=EPILOGUE)
def render_command(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    output: Outputs = [],  # noqa: B006 - only read
    spp: Annotated[Integer | None, Parameter(help="Samples per pixel. Default: as the scene says.")] = None,
    error: Annotated[
        Share | None,
        Parameter(help="Take samples until the error is no larger: 0.01 or 1% is 1 % of the mean luminance."),
    ] = None,
    time: Annotated[float | None, Parameter(help="Make the best picture in this many seconds.")] = None,
    at: At = None,
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels, such as 640x480.")] = None,
    precision: Annotated[Literal["single", "double"] | None, Parameter(help="Precision of shading.")] = None,
    seed: Annotated[Integer | None, Parameter(help="Seed of the random numbers. Another gives other noise.")] = None,
    threads: Threads = None,
    backend: Annotated[Literal["llvm", "cuda", "metal"], Parameter(help="cuda and metal are untested.")] = "llvm",
    cluster: Cluster = None,
    set: Settings = [],  # noqa: B006 - the name of the option; only read
    layers: Annotated[
        str | None, Parameter(help="Layers of the EXR file, separated by commas: see below. Default: all.")
    ] = None,
    gamma: Annotated[str, Parameter(help="Display curve of the PNG file: srgb, or an exponent such as 2.2.")] = "srgb",
    exposure: Annotated[float, Parameter(help="Exposure of the PNG file, in stops: 1 is twice as bright.")] = 0.0,
    float32: flag(
        "Write colours of EXR files as 32-bit floats, not halves, which end at 65504.", name="--float"
    ) = False,
    legend: Annotated[
        Path | None, Parameter(help="A .png file for the legend alone, with a transparent background.")
    ] = None,
    no_legend: flag("Draw no legend into the picture of a data scene, and put none into its EXR file.") = False,
    checkpoint: flag(
        "Keep the samples in a file beside the first output, OUTPUT.checkpoint, until all is written."
    ) = False,
    resume: flag("Go on with the checkpoint of a render that has not ended, to the same bits.") = False,
    quiet: flag("Print nothing, and show no progress.") = False,
    json: Json = False,
    more: Annotated[dict[str, Any] | None, Parameter(parse=False)] = None,
) -> int:
    """Render a scene to EXR and PNG files. Ctrl-C keeps what is done so far.

    Without -o the picture goes to the current folder, under the scene's name, as EXR and PNG.
    """
    begun = clock.now()
    if quiet:
        warnings.simplefilter("ignore")
    with kept_notes() as notes:
        changes = {"spp": spp, "size": parse_size(size), "seed": seed, "precision": precision}
        with Bar(f"reading {scene.name}", 1, not (quiet or json)):
            loaded = load_scene(scene, setup, compat, set, allow_outside=allow_outside, **changes)
        from visray.adaptive.error_floor import Files
        from visray.adaptive.stopping import Goal
        from visray.checkpoint import held
        from visray.output.image import check_destination
        from visray.renderer import render

        Goal.from_arguments(error, time, spp, begun)
        outputs = output or [Path(scene.stem + suffix) for suffix in (".exr", ".png")]
        names, curve = needed_layers(layers, outputs), parse_gamma(gamma)
        for path in outputs:
            check_destination(path, curve, exposure)
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
            # While the files are written, Ctrl-C does not stop the program.
            with Interrupts():
                results = [kept(legend, partial(image.legend().write, gamma=curve))] if legend else []
                image = without_legend(image) if no_legend else image
                write = partial(image.write, gamma=curve, exposure=exposure, float32=float32)
                results += [kept(path, write) for path in outputs]
            if problems := [line for _, lines in results for line in lines]:
                raise UserError(*problems)
    facts, outputs = image.metadata, [*outputs, *([legend] if legend else [])]
    # With --error or --time, the seconds count from the start of the program, as in the forecast.
    seconds = clock.now() - (clock.LOADED if "forecast_seconds" in facts else begun)
    if json:
        all_notes = [*(more or {}).get("notes", ()), *notes]
        write_json((more or {}) | _report(image, outputs, seconds) | {"notes": all_notes})
    elif not quiet:
        write_line(_line(image, outputs, seconds))
    if facts["interrupted"]:
        return INTERRUPTED
    return 0 if _goal_met(facts) or time is not None else 1


def _report(image: "Image", outputs: list[Path], seconds: float) -> dict[str, Any]:
    """The report of a render for --json, as a dict.

    outputs: paths of the files written. seconds: duration of the render.
    """
    facts = image.metadata
    return (
        {"outputs": [str(path) for path in outputs], "width": image.width, "height": image.height}
        | {key: facts[key] for key in (*FACTS, *CERTIFICATE_FACTS, *ADAPTIVE_FACTS) if key in facts}
        | {"layers": list(image.layers), "seconds": seconds, "stopped": bool(facts["interrupted"])}
    )


def _line(image: "Image", outputs: list[Path], seconds: float) -> str:
    """The report of a render, as one line of text.

    outputs: paths of the files written. seconds: duration of the render.
    """
    facts = image.metadata
    names = ", ".join(str(path) for path in outputs)
    line = f"{names}: {image.width} x {image.height}, {_summary_of_samples(facts)}, {seconds:.2f} s"
    if "residual_ulps" in facts:
        residual = f"residual {facts['residual_ulps']:.2g} ulp at most" if facts["residual_ulps"] else "none seen"
        line += f"; roots: {facts['unresolved']} unresolved, {residual}"
    return line
