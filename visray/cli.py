"""The command line: `visray COMMAND --help` explains each command."""

import json
import os
import sys
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter, Token
from rich.console import Console
from rich.table import Table

from visray.adaptive import Goal
from visray.clock import LOADED
from visray.errors import UserError
from visray.output.files import check_writable, replacing
from visray.output.image import check_destination
from visray.quantities import BACKENDS
from visray.reachable import Files
from visray.render import LAYERS, PROOF, adjusted, render, set_threads
from visray.render import explain as explain_scene
from visray.scene import load as loading
from visray.scene.address import changed, parse_assignment
from visray.scene.scene import Scene
from visray.study import ablation
from visray.study import stability as study
from visray.study.ray_sets import FORMAT
from visray.surfaces import CLASSICS
from visray.version import __version__

app = App(
    name="visray",
    help="A ray tracer that shows what accuracy costs, stays stable in hard cases, and simulates only what is needed.",
    version=__version__,
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative=()),
)


def whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts by itself would round 1.5."""
    return int(tokens[0].value)


Whole = Annotated[int, Parameter(converter=whole)]
Setup = Annotated[Path | None, Parameter(help="The setup file of a scene in the format of the original VisRayTrace.")]
Compat = Annotated[bool, Parameter(help="Light, occlude and weight a scene of the original as the original did.")]
Json = Annotated[bool, Parameter(name="--json", help="Print the report as JSON.")]
Settings = Annotated[
    list[str], Parameter(name="--set", help="ADDRESS=VALUE, such as objects.ball.radius=2 or materials.red.kd=[1,0,0].")
]
Outputs = Annotated[
    list[Path], Parameter(name=("--output", "-o"), help="A .exr or .png file; may be given more than once.")
]
INTERRUPTED = 130
# What a picture says that was made to an error, or in a time.
PURSUED_FACTS = (
    "sampler", "spp_least", "spp_most", "error", "error_low", "error_high", "depth_error", "error_asked", "time_asked",
    "forecast_error", "forecast_spp", "forecast_seconds",
)  # fmt: skip
# What a picture says of its roots, where any were searched for.
PROVEN = ("unresolved", "residual_ulps")


def opened(scene: Path, setup: Path | None, compat: bool, assignments: list[str], **settings: Any) -> Scene:
    """The scene of a file, with the values that the command line sets."""
    made = adjusted(loading.load(scene, setup, compat), **settings)
    return changed(made, dict(map(parse_assignment, assignments))) if assignments else made


def sized(text: str | None) -> tuple[int, int] | None:
    """Width and height from a text such as 640x480."""
    if text is None:
        return None
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.isdecimal() and int(p) > 0 for p in parts):
        raise UserError(f"--size = {text!r}: must be WIDTHxHEIGHT in whole pixels greater than 0, such as 640x480")
    return int(parts[0]), int(parts[1])


def wanted(text: str | None, outputs: list[Path]) -> tuple[str, ...]:
    """The layers that the outputs need: all for an EXR file, colour and coverage for a PNG file, or those named."""
    if text is None or text == "all":
        return LAYERS if any(o.suffix.lower() == ".exr" for o in outputs) else ("RGB", "A", *PROOF)
    named = {l.lower(): l for l in LAYERS}
    asked = [l.strip() for l in text.split(",")]
    if unknown := [l for l in asked if l.lower() not in named]:
        raise UserError(f"--layers = {text!r}: there is no layer {unknown[0]!r}; choose from {', '.join(LAYERS)}")
    return tuple(dict.fromkeys(("RGB", "A", *(named[l.lower()] for l in asked))))


def _samples(facts: dict[str, Any]) -> str:
    """How many samples a picture has, and what is known of its error."""
    stopped = ", stopped" if facts["interrupted"] else ""
    if "error" not in facts:
        known = f", error at most {facts['error_at_most']:.2g}" if "error_at_most" in facts else ""
        return f"{facts['spp']} spp" + (f" of {facts['spp_asked']}" if stopped else "") + stopped + known
    low, high = (f"{facts[f'error_{end}']:.3g}" for end in ("low", "high"))
    depth = f", {facts['depth_error']:.2g} of it by depth" if facts["depth_error"] > 0.01 * facts["error"] else ""
    spp = f"{facts['spp']:.4g} spp ({facts['spp_least']} to {facts['spp_most']}){stopped}"
    return f"{spp}, error {facts['error']:.3g} ({low} to {high}{depth})"


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
    spp: Annotated[Whole | None, Parameter(help="Samples per pixel.")] = None,
    error: Annotated[
        float | None, Parameter(help="Samples until the error is no larger, as a share of the mean luminance.")
    ] = None,
    time: Annotated[float | None, Parameter(help="The best picture in so many seconds.")] = None,
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels.")] = None,
    precision: Annotated[Literal["single", "double"] | None, Parameter(help="Precision of shading.")] = None,
    seed: Annotated[Whole | None, Parameter(help="Another seed is other noise.")] = None,
    threads: Annotated[Whole | None, Parameter(help="Threads of the LLVM backend.")] = None,
    backend: Annotated[Literal[tuple(BACKENDS)], Parameter(help="cuda and metal are untested.")] = "llvm",
    set: Settings = [],  # noqa: B006 - the name of the option; only read
    layers: Annotated[str | None, Parameter(help=f"Of an EXR file, separated by commas: {', '.join(LAYERS)}.")] = None,
    gamma: Annotated[str, Parameter(help="Of a PNG file: srgb, or an exponent such as 2.")] = "srgb",
    exposure: Annotated[float, Parameter(help="Of a PNG file, in stops.")] = 0.0,
    quiet: Annotated[bool, Parameter(help="Print nothing, and show no progress.")] = False,
    json: Json = False,
) -> int:
    """Render a scene to EXR and PNG files. Ctrl-C keeps what is done so far.

    Without -o the picture goes to the current folder, under the scene's name, as EXR and PNG.
    """
    begun = perf_counter()
    if quiet:
        warnings.simplefilter("ignore")
    Goal.asked(error, time, spp, begun)
    made = opened(scene, setup, compat, set, spp=spp, size=sized(size), seed=seed, precision=precision)
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
        begun=LOADED,
    )
    for path in outputs:
        image.write(path, gamma=curve, exposure=exposure)
    facts = image.metadata
    stopped = bool(facts["interrupted"])
    if json:
        keep = ("spp", "seed", "precision", "backend", "features", "scene_hash", "render_seconds", "threads", *PROVEN)
        keep += ("error_at_most", *PURSUED_FACTS)
        report = {"outputs": [str(o) for o in outputs], "width": image.width, "height": image.height}
        seconds = perf_counter() - begun
        put(
            report
            | {k: facts[k] for k in keep if k in facts}
            | {"layers": list(image.layers), "seconds": seconds, "stopped": stopped}
        )
    elif not quiet:
        names = ", ".join(str(o) for o in outputs)
        line = f"{names}: {image.width} x {image.height}, {_samples(facts)}, {facts['render_seconds']:.2f} s"
        if "residual_ulps" in facts:
            seen = f"residual {facts['residual_ulps']:.2g} ulp at most" if facts["residual_ulps"] else "none seen"
            line += f"; roots: {facts['unresolved']} unresolved, {seen}"
        sys.stdout.write(line + "\n")
    return INTERRUPTED if stopped else 0


@app.command
def explain(
    scene: Path,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    set: Settings = [],  # noqa: B006
    cost: Annotated[bool, Parameter(help="Measure what each effect costs, on a small picture.")] = False,
    spp: Annotated[Whole | None, Parameter(help="With --cost: samples per pixel of that picture.")] = None,
    runs: Annotated[Whole, Parameter(help="With --cost: how often each picture is made.")] = ablation.RUNS,
    json: Json = False,
) -> int:
    """List what is simulated for a scene, what is not, and why; and with --cost, at what cost."""
    made = opened(scene, setup, compat, set)
    # Before anything is printed: what is asked of it may be wrong.
    measured = ablation.cost(made, spp, runs, progress=not json) if cost else None
    if measured and json:
        put(measured.as_json())
        return 0
    found = explain_scene(made).listed
    if json:
        put({"scene_hash": made.hash(), "features": [{"name": f.name, "on": f.on, "reason": f.reason} for f in found]})
        return 0
    table = Table("effect", "", "why")
    for f in found:
        table.add_row(f.name, "[green]on[/]" if f.on else "[dim]off[/]", f.reason)
    Console().print(table)
    if measured:
        Console().print(measured.table())
    return 0


@app.command
def check(
    scene: Path,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    set: Settings = [],  # noqa: B006
    output: Annotated[
        Path | None, Parameter(name=("--output", "-o"), help="Write the difference as an EXR file.")
    ] = None,
    rays: Annotated[Whole, Parameter(help="Random rays through the scene's bounds.")] = 100_000,
    seed: Annotated[Whole, Parameter(help="Of the random rays.")] = 0,
    threads: Annotated[Whole | None, Parameter(help="Threads of the LLVM backend.")] = None,
    json: Json = False,
) -> int:
    """Compare a scene with its twin in Mitsuba: the same rays through both. Exit code 1 if they differ."""
    from visray.study import crosscheck  # Mitsuba takes a while to load, and no other command needs it

    if output is not None:
        check_destination(output)
    if threads is not None:
        set_threads(threads)
    report = crosscheck.check(opened(scene, setup, compat, set), rays=rays, seed=seed)
    if output is not None:
        report.difference.write(output)
    put(report.as_json()) if json else Console().print(report.table())
    return 0 if report.passed else 1


@app.command
def stability(
    *,
    surfaces: Annotated[Path | None, Parameter(help=f"A JSON file {FORMAT}; else the known ones.")] = None,
    rays: Annotated[Whole, Parameter(help="Of each set.")] = study.RAYS,
    sets: Annotated[str, Parameter(help="Separated by commas.")] = ",".join(study.SETS),
    only: Annotated[str, Parameter(help="Names of surfaces, separated by commas.")] = "",
    seed: Annotated[Whole, Parameter(help="Of the rays.")] = 0,
    json: Json = False,
) -> int:
    """Compare polynomial surfaces with exact arithmetic: lost, false and wrong roots. Exit code 1 if there are any.

    It needs python-flint: pip install 'visray[test]'.
    """
    report = study.run(surfaces, rays, _listed(sets), _listed(only), seed, progress=not json)
    put(report.as_json()) if json else Console().print(report.table())
    return INTERRUPTED if report.stopped else 0 if report.passed else 1


def _listed(text: str) -> tuple[str, ...]:
    """The words of a text that are separated by commas."""
    return tuple(word for part in text.split(",") if (word := part.strip()))


@app.command
def surfaces(*, json: Json = False) -> int:
    """List the known polynomial surfaces, which a scene has by name: parameters, and the radius of the clip.

    With --json also how each is written, where that is from, and its singular points.
    """
    if json:
        put({name: asdict(c) for name, c in CLASSICS.items()})
        return 0
    table = Table("surface", "", "parameters", "clip")
    for name, c in CLASSICS.items():
        given = ", ".join(f"{k} = {v:.6g}" for k, v in c.parameters.items())
        table.add_row(name, c.title, given, f"{c.radius:g}")
    Console().print(table)
    return 0


@app.command
def doctor(*, json: Json = False) -> int:
    """Say what visray found on this machine, and whether a picture comes out."""
    from visray.study import doctor as examination  # it loads Mitsuba

    report = examination.examine(_probe)
    put(report) if json else Console().print(examination.table(report))
    return 0 if report["verdict"] == examination.GOOD else 1


def _probe() -> Any:
    """A small picture of a small scene, as a NumPy array."""
    from visray.lights import PointLight
    from visray.primitives import Sphere

    probe = Scene(objects={"ball": Sphere(radius=1.5)}, lights={"key": PointLight(position=(3.0, 4.0, 5.0))})
    return render(probe, size=(32, 32), spp=4, layers=("RGB",), progress=False)["RGB"]


@app.command
def schema(*, output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None) -> int:
    """Print the JSON Schema of scene files, or write it to a file."""
    written(json.dumps(loading.schema(), indent=2) + "\n", output)
    return 0


@app.command(name="import")
def import_command(
    scene: Path,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"), help="A .json file; else it is printed.")] = None,
) -> int:
    """Convert a scene of the original VisRayTrace, and its setup, to visray's own format."""
    written(loading.dump(loading.load(scene, setup, compat), output and output.parent), output)
    return 0


def written(text: str, path: Path | None) -> None:
    """Puts text into a file, or onto the terminal."""
    if path is None:
        sys.stdout.write(text)
        return
    check_writable(path)
    with replacing(path) as aside:
        Path(aside).write_text(text, encoding="utf-8")


def put(report: Any) -> None:
    """Prints a report as JSON."""
    sys.stdout.write(json.dumps(report, indent=2, ensure_ascii=False) + "\n")


def _note(message: Warning | str, *_: object, **__: object) -> None:
    """A warning as one line."""
    sys.stderr.write(f"visray: note: {message}\n")


def main(tokens: list[str] | None = None) -> int:
    """The exit code of a command: 0 done, 1 a check failed, 2 bad input, 130 stopped by Ctrl-C."""
    warnings.showwarning = _note
    try:
        return app(tokens, exit_on_error=False, print_error=False, result_action="return_value") or 0
    except UserError as error:
        lines = error.lines
    except CycloptsError as error:
        lines = (" ".join(str(error).split()) + " (see visray --help)",)
    except KeyboardInterrupt:
        sys.stderr.write("visray: stopped before anything could be kept\n")
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output has gone; the interpreter would complain once more when it closes it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    sys.stderr.write("".join(f"visray: {line}\n" for line in lines))
    return 2
