"""The commands that only examine and report: explain, check, cost, tune, stability, surfaces and doctor."""

from dataclasses import asdict, replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from visray.cli.keeping import kept
from visray.cli.options import (
    INTERRUPTED,
    At,
    Compat,
    Integer,
    Json,
    Outside,
    SceneFile,
    Seconds,
    Settings,
    Setup,
    Share,
    Threads,
    app,
    check_cluster,
    flag,
    load_scene,
    load_still,
    parse_list,
    parse_pixel,
    parse_size,
    write_or_print,
)  # fmt: skip
from visray.cli.picture_options import Size
from visray.errors import UserError
from visray.output.files import check_writable
from visray.terminal import write_json, write_line

if TYPE_CHECKING:
    from visray.features import Features
    from visray.mesh_report import MeshFacts
    from visray.scene.scene import Scene
    from visray.tables import Table

# Number of parts of a mesh whose names `explain` shows.
SHOWN_PARTS = 8
# Number of pairs of overlapping solids that `explain` shows.
SHOWN_OVERLAPS = 20


@app.command(name="explain")
def explain_command(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    set: Settings = [],  # noqa: B006
    size: Size = None,
    cost: flag("Measure what each effect costs, on a small picture.") = False,
    spp: Annotated[Integer | None, Parameter(help="With --cost: samples per pixel of the small picture.")] = None,
    runs: Annotated[
        Integer | None, Parameter(help="With --cost: how often each picture is rendered. Default: 8.")
    ] = None,
    why: Annotated[
        str | None, Parameter(help="X,Y: tell how the colour of this pixel comes about. 0,0 is the top left.")
    ] = None,
    at: At = None,
    json: Json = False,
) -> int:
    """List which effects are simulated for a scene, and why.

    Further tables say how rays find objects, list the meshes, and say which transparent solid counts where two may
    overlap. Notes say which materials do not do what they seem to say. With --cost: what each effect costs in time.
    With --why: only the story of a pixel, what is hit and what becomes of each light there.
    """
    loaded = load_scene(scene, setup, compat, set, allow_outside=allow_outside, size=parse_size(size))
    from visray.animation.moment import still_at

    loaded = loaded if at is None else still_at(loaded, at)
    if why is not None:
        return _tell_pixel(still_at(loaded, None), *parse_pixel(why), json)
    from visray import tables
    from visray.explaining import explain
    from visray.study import ablation

    # This comes first, because its arguments may be wrong, and then nothing else should be printed.
    runs = ablation.RUNS if runs is None else runs
    measured = ablation.cost(still_at(loaded, None), spp, runs, progress=not json) if cost else None
    if measured and json:
        write_json(measured.as_json())
        return 0
    on = explain(loaded)
    if json:
        effects, rays = [asdict(f) for f in on.listed], [asdict(family) for family in on.rays]
        meshes, pairs = ([asdict(x) for x in list_of_records] for list_of_records in (on.meshes, on.overlaps))
        report = {"scene_hash": loaded.hash(), "features": effects, "rays": rays, "meshes": meshes}
        write_json(report | {"overlaps": pairs, "overlap_count": on.overlap_count, "notes": list(on.notes)})
        return 0
    effects = tables.Table("effect", "", "why")
    for f in on.listed:
        effects.add_row(f.name, tables.styled("on", "green") if f.on else tables.styled("off", "dim"), f.reason)
    rays = tables.Table("rays", "objects are found", "why")
    for family in on.rays:
        rays.add_row(family.rays, family.accelerator, family.reason)
    tables.show(effects, rays)
    if on.meshes:
        tables.show(_table_of_meshes(on.meshes))
    if on.overlaps:
        tables.show(_table_of_overlaps(on))
    if on.notes:
        notes = tables.Table("notes")
        for text in on.notes:
            notes.add_row(text)
        tables.show(notes)
    if measured:
        tables.show(measured.table())
    return 0


def _tell_pixel(scene: "Scene", x: int, y: int, json: bool) -> int:
    """Prints the story of a pixel. Returns the exit code."""
    from visray.study.pixel.why import why

    story = why(scene, x, y)
    if json:
        write_json(story.as_json())
    for line in () if json else story.lines():
        write_line(line)
    return 0


def _table_of_meshes(meshes: "tuple[MeshFacts, ...]") -> "Table":
    """A table with facts about meshes."""
    from visray.tables import Table

    table = Table("mesh", "triangles", "vertices", "parts", "kB", "")
    for facts in meshes:
        parts = ", ".join(facts.parts[:SHOWN_PARTS]) + (", ..." if len(facts.parts) > SHOWN_PARTS else "")
        remarks = "; ".join(["closed" if facts.closed else facts.edges, *facts.notes])
        numbers = (f"{number:,}" for number in (facts.triangles, facts.vertices))
        table.add_row(facts.address, *numbers, parts, f"{facts.bytes / 1000:,.0f}", remarks)
    return table


def _table_of_overlaps(on: "Features") -> "Table":
    """A table that says which of two transparent solids counts where both overlap."""
    from visray.tables import Table

    table = Table("where both overlap, this counts", "not this", "why")
    for pair in on.overlaps[:SHOWN_OVERLAPS]:
        table.add_row(pair.counts, pair.hidden, pair.reason)
    if on.overlap_count > SHOWN_OVERLAPS:
        table.add_row(f"and {on.overlap_count - SHOWN_OVERLAPS:,} pairs more", "", "see --json")
    return table


@app.command
def check(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    set: Settings = [],  # noqa: B006
    size: Size = None,
    output: Annotated[
        Path | None, Parameter(name=("--output", "-o"), help="Write the difference of both pictures to this .exr file.")
    ] = None,
    at: At = None,
    rays: Annotated[Integer, Parameter(help="Number of random rays through the scene.")] = 100_000,
    seed: Annotated[Integer, Parameter(help="Seed of the random rays.")] = 0,
    threads: Threads = None,
    json: Json = False,
) -> int:
    """Compare a scene with the same scene in Mitsuba.

    Hits, distances, normals, shadows and colours are compared. The same rays go through both. Exit code 1 if they
    differ.
    """
    loaded = load_still(scene, setup, compat, set, at, allow_outside=allow_outside, size=parse_size(size))
    from visray.output.image import check_destination
    from visray.setup import set_threads
    from visray.study.mitsuba import crosscheck
    from visray.tables import show

    if output is not None:
        check_destination(output)
    if threads is not None:
        set_threads(threads)
    report = crosscheck.check(loaded, rays=rays, seed=seed)
    if output is not None:
        report.difference.write(output)
    write_json(report.as_json()) if json else show(report.table())
    return 0 if report.passed else 1


@app.command
def cost(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    set: Settings = [],  # noqa: B006
    size: Size = None,
    output: Annotated[
        Path | None,
        Parameter(name=("--output", "-o"), help="An .html page that opens offline, .json or .csv."),
    ] = None,
    quick: Annotated[bool, Parameter(help="Fewer values of each setting, on smaller pictures.")] = False,
    seeds: Annotated[Integer, Parameter(help="Pictures of each choice of settings, at least 16.")] = 16,
    threads: Threads = None,
    cluster: Annotated[
        str | None,
        Parameter(help="Measure on the workers of a cluster, as in visray render. The times are then the workers'."),
    ] = None,
    csv: Annotated[bool, Parameter(help="Print all records as CSV.")] = False,
    json: Json = False,
) -> int:
    """Measure what accuracy costs, and say what to change.

    The error and the time of every setting that trades accuracy for time, such as the samples per pixel, are
    measured. Ctrl-C keeps the measurements so far, once every setting has had a few pictures.
    """
    if csv and json:
        raise UserError("--csv and --json: print one report; leave one out")
    check_cluster(cluster)
    loaded = load_still(scene, setup, compat, set, None, allow_outside=allow_outside, size=parse_size(size))
    from visray.progress import Interrupts
    from visray.study.cost.advice import options
    from visray.study.cost.report import table
    from visray.study.cost.study import check_report
    from visray.study.cost.study import cost as study
    from visray.tables import show

    if output is not None:
        check_report(output)
        check_writable(output)
    report = study(loaded, quick=quick, seeds=seeds, threads=threads, progress=not (json or csv), cluster=cluster)
    report = replace(report, scene=scene.stem)
    # Ctrl-C must not lose a report that took minutes while it is written.
    with Interrupts():
        written, problems = kept(output, report.write) if output is not None else (None, [])
        # A study that is in no file is printed whole.
        if json or (problems and written is None and not csv):
            write_json(report.as_json())
        elif csv:
            write_or_print(report.as_csv(), None)
        else:
            show(table(report))
            if options(report):
                write_line(f"To use these settings: visray render {quote(str(scene))} {options(report)}")
            _say_written(written)
    if problems:
        raise UserError(*problems)
    return INTERRUPTED if report.stopped else 0


def _say_written(path: Path | None) -> None:
    if path is not None:
        write_line(f"{path}: written")


@app.command
def tune(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    set: Settings = [],  # noqa: B006
    size: Size = None,
    error: Annotated[Share | None, Parameter(help="The error to reach, as a share of the mean luminance.")] = None,
    time: Annotated[
        Seconds | None, Parameter(help="The time that a render may take, compilation apart: 20 or 20s, 2min.")
    ] = None,
    full: Annotated[bool, Parameter(help="Measure more values of each setting, on larger pictures.")] = False,
    threads: Threads = None,
    output: Annotated[
        Path | None, Parameter(name=("--output", "-o"), help="Write the scene with these settings to a .json file.")
    ] = None,
    json: Json = False,
) -> int:
    """Choose the settings of a scene for an error or a time.

    Only settings that trade accuracy for time are changed. Samples per pixel are left to the adaptive sampler: render
    the scene with the same --error or --time. Ctrl-C keeps the better of the settings that were rendered.
    """
    if error is None and time is None:
        raise UserError("visray tune: needs an error or a time to choose for; write --error 1% or --time 10")
    if output is not None and output.suffix.lower() != ".json":
        raise UserError(f"{output}: a scene is a .json file; end the name so")
    if output is not None:
        check_writable(output)
    loaded = load_scene(scene, setup, compat, set, allow_outside=allow_outside, size=parse_size(size))
    from visray.progress import Interrupts
    from visray.study.cost.tuned import as_scene
    from visray.study.cost.tuning import tune as study
    from visray.tables import show

    tuned = study(
        loaded,
        error=error,
        time=time,
        quick=not full,
        threads=threads,
        progress=not json,
    )
    # Ctrl-C must not lose the result while it is written.
    with Interrupts():
        if output is not None:
            write_or_print(as_scene(tuned, output.parent, scene), output)
        if json:
            write_json(tuned.as_json() | ({} if output is None else {"output": str(output)}))
        else:
            show(tuned.table())
            _say_written(output)
    return INTERRUPTED if tuned.stopped else 0 if tuned.met else 1


@app.command
def stability(
    *,
    kind: Annotated[
        Literal["polynomial", "mesh"], Parameter(help="What is tested: polynomial surfaces, or meshes.")
    ] = "polynomial",
    surfaces: Annotated[Path | None, Parameter(help="A .json file of surfaces. Default: the known ones.")] = None,
    rays: Annotated[Integer | None, Parameter(help="Number of rays in each set.")] = None,
    sets: Annotated[str, Parameter(help="Sets of rays, separated by commas. Default: all.", show_default=False)] = "",
    only: Annotated[
        str, Parameter(help="Names of surfaces, separated by commas. Default: all.", show_default=False)
    ] = "",
    seed: Annotated[Integer, Parameter(help="Seed of the rays.")] = 0,
    json: Json = False,
) -> int:
    """Compare surfaces or meshes with exact arithmetic.

    Lost, false and wrong hits are counted. Exit code 1 if there are any. Polynomial surfaces need python-flint: pip
    install 'visray[test]'.
    """
    from visray.study.stability import mesh_study, study
    from visray.tables import show

    if kind == "mesh" and surfaces is not None:
        raise UserError("surfaces: is a file of polynomial surfaces; leave it out, or leave out --kind mesh")
    of_kind = mesh_study if kind == "mesh" else study
    count, chosen = of_kind.RAYS if rays is None else rays, parse_list(sets) or of_kind.SETS
    if kind == "mesh":
        report = mesh_study.run(count, chosen, parse_list(only), seed, progress=not json)
    else:
        report = study.run(surfaces, count, chosen, parse_list(only), seed, progress=not json)
    write_json(report.as_json()) if json else show(report.table())
    return INTERRUPTED if report.stopped else 0 if report.passed else 1


@app.command
def doctor(*, json: Json = False) -> int:
    """Test whether visray works on this machine.

    It reports Python, Dr.Jit, LLVM, threads and folders, and renders a small picture.
    """
    from visray.study import doctor as examination
    from visray.tables import show

    report = examination.examine(_probe)
    write_json(report) if json else show(examination.table(report))
    return 0 if report["verdict"] == examination.GOOD else 1


def _probe() -> Any:
    """Colours of a small picture of a small scene, to see whether rendering works. Shape: (32, 32, 3)."""
    from visray.camera import Camera
    from visray.lights import PointLight
    from visray.primitives import Sphere
    from visray.renderer import render
    from visray.scene.scene import Scene

    lights = {"key": PointLight(position=(3.0, 4.0, 5.0))}
    probe = Scene(camera=Camera(), objects={"ball": Sphere(radius=1.5)}, lights=lights)
    return render(probe, size=(32, 32), spp=4, layers=("RGB",), progress=False)["RGB"]
