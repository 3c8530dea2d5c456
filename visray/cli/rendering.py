"""visray render."""

import sys
import warnings
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from visray import clock
from visray.adaptive.error_floor import Files
from visray.adaptive.stopping import Goal
from visray.cli.options import (
    INTERRUPTED,
    Compat,
    Integer,
    Json,
    Outputs,
    Settings,
    Setup,
    app,
    load_scene,
    parse_size,
    print_json,
)
from visray.errors import UserError
from visray.output.image import check_destination
from visray.output.layers import NAMES, names_from
from visray.progress import Interrupts
from visray.quantities import BACKENDS
from visray.render import render

# What a picture says that was made to an error, or in a time.
PURSUED_FACTS = (
    "sampler", "spp_least", "spp_most", "error", "error_low", "error_high", "depth_error", "file_error", "error_asked",
    "time_asked", "forecast_error", "forecast_spp", "forecast_seconds",
)  # fmt: skip
# What a picture says of its roots, where any were searched for.
PROVEN = ("unresolved", "residual_ulps")


def wanted(text: str | None, outputs: list[Path]) -> tuple[str, ...]:
    """The layers that the outputs need: all for an EXR file, colour and coverage for a PNG file, or those named."""
    if text is None or text == "all":
        return NAMES if any(o.suffix.lower() == ".exr" for o in outputs) else ("RGB", "A", *names_from("certificate"))
    named = {l.lower(): l for l in NAMES}
    asked = [l.strip() for l in text.split(",")]
    if unknown := [l for l in asked if l.lower() not in named]:
        raise UserError(f"--layers = {text!r}: there is no layer {unknown[0]!r}; choose from {', '.join(NAMES)}")
    return tuple(dict.fromkeys(("RGB", "A", *(named[l.lower()] for l in asked))))


def _samples(facts: dict[str, Any]) -> str:
    """How many samples a picture has, and what is known of its error."""
    stopped = ", stopped" if facts["interrupted"] else ""
    if "error" not in facts:
        # How much better others are than independent samples, one picture does not tell.
        bound = "" if facts["sampler"] == "independent" else "below "
        known = f", error {bound}{facts['error_at_most']:.2g}" if "error_at_most" in facts else ""
        return f"{facts['spp']} spp" + (f" of {facts['spp_asked']}" if stopped else "") + stopped + known
    low, high = (f"{facts[f'error_{end}']:.3g}" for end in ("low", "high"))
    parts = {name: facts[f"{name}_error"] for name in ("depth", "file")}
    told = {"depth": "depth", "file": "the file's rounding"}
    # What is squared away tells nobody anything.
    rest = "".join(f", {x:.2g} of it by {told[k]}" for k, x in parts.items() if x > 0.2 * facts["error"])
    above = "" if _met(facts) else f", above the {facts['error_asked']:g} asked"
    mean = f"{facts['spp']:,.0f}" if facts["spp"] >= 100 else f"{facts['spp']:.3g}"
    spp = f"{mean} spp ({facts['spp_least']:,} to {facts['spp_most']:,} in a pixel){stopped}"
    return f"{spp}, error {facts['error']:.3g} (95 %: {low} to {high}{rest}){above}"


def _met(facts: dict[str, Any]) -> bool:
    """Whether a picture has no more error than was asked for, if anything was."""
    return facts.get("error_high", 0.0) <= facts.get("error_asked", inf)


def gamma_of(text: str) -> Any:
    """A display curve: a number where the text is one; whether it can be used is judged with the output."""
    try:
        return float(text)
    except ValueError:
        return text


@app.command(name="render")
def render_command(
    scene: Path,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    output: Outputs = [],  # noqa: B006 - only read
    spp: Annotated[Integer | None, Parameter(help="Samples per pixel.")] = None,
    error: Annotated[
        float | None, Parameter(help="Samples until the error is no larger, as a share of the mean luminance.")
    ] = None,
    time: Annotated[float | None, Parameter(help="The best picture in so many seconds.")] = None,
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels.")] = None,
    precision: Annotated[Literal["single", "double"] | None, Parameter(help="Precision of shading.")] = None,
    seed: Annotated[Integer | None, Parameter(help="Another seed is other noise.")] = None,
    threads: Annotated[Integer | None, Parameter(help="Threads of the LLVM backend.")] = None,
    backend: Annotated[Literal[tuple(BACKENDS)], Parameter(help="cuda and metal are untested.")] = "llvm",
    set: Settings = [],  # noqa: B006 - the name of the option; only read
    layers: Annotated[str | None, Parameter(help=f"Of an EXR file, separated by commas: {', '.join(NAMES)}.")] = None,
    gamma: Annotated[str, Parameter(help="Of a PNG file: srgb, or an exponent such as 2.")] = "srgb",
    exposure: Annotated[float, Parameter(help="Of a PNG file, in stops.")] = 0.0,
    quiet: Annotated[bool, Parameter(help="Print nothing, and show no progress.")] = False,
    json: Json = False,
) -> int:
    """Render a scene to EXR and PNG files. Ctrl-C keeps what is done so far.

    Without -o the picture goes to the current folder, under the scene's name, as EXR and PNG.
    """
    begun = clock.now()
    if quiet:
        warnings.simplefilter("ignore")
    Goal.from_arguments(error, time, spp, begun)
    made = load_scene(scene, setup, compat, set, spp=spp, size=parse_size(size), seed=seed, precision=precision)
    if not made.lights and not any(made.ambient):
        warnings.warn("the scene has no light and no ambient: every object is black", stacklevel=1)
    outputs = output or [Path(scene.stem + suffix) for suffix in (".exr", ".png")]
    chosen, curve = wanted(layers, outputs), gamma_of(gamma)
    for path in outputs:
        check_destination(path, curve, exposure)
    image = render(
        made,
        threads=threads,
        backend=backend,
        layers=chosen,
        progress=not (quiet or json),
        error=error,
        time=time,
        files=Files(outputs, curve, exposure),
        begun=clock.LOADED,
    )
    # A picture that is there is written, whatever is pressed.
    with Interrupts():
        for path in outputs:
            image.write(path, gamma=curve, exposure=exposure)
    facts = image.metadata
    # To an error, or in a time, all counts, from the start of the program on, as in the forecast.
    seconds = clock.now() - (clock.LOADED if "forecast_seconds" in facts else begun)
    stopped = bool(facts["interrupted"])
    if json:
        keep = ("spp", "seed", "precision", "backend", "features", "scene_hash", "render_seconds", "threads", *PROVEN)
        keep += ("error_at_most", *PURSUED_FACTS)
        report = {"outputs": [str(o) for o in outputs], "width": image.width, "height": image.height}
        print_json(
            report
            | {k: facts[k] for k in keep if k in facts}
            | {"layers": list(image.layers), "seconds": seconds, "stopped": stopped}
        )
    elif not quiet:
        names = ", ".join(str(o) for o in outputs)
        line = f"{names}: {image.width} x {image.height}, {_samples(facts)}, {seconds:.2f} s"
        if "residual_ulps" in facts:
            seen = f"residual {facts['residual_ulps']:.2g} ulp at most" if facts["residual_ulps"] else "none seen"
            line += f"; roots: {facts['unresolved']} unresolved, {seen}"
        sys.stdout.write(line + "\n")
    return INTERRUPTED if stopped else 0 if _met(facts) or time is not None else 1
