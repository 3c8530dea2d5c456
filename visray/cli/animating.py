"""The command `visray animate`: its options and its help."""

import warnings
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from visray import clock
from visray.cli.frame_report import FrameReport
from visray.cli.keeping import checkpoint_path
from visray.cli.options import (
    INTERRUPTED,
    Cluster,
    Compat,
    Json,
    Outside,
    SceneFile,
    Seconds,
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
    Quiet,
    Region,
    Samples,
    Scale,
    Seed,
    Size,
    film_changes,
    needed_layers,
    parse_gamma,
)
from visray.cli.resuming import missing_frames, refuse_existing, say_how_to_go_on
from visray.cli.standard_output import refuse
from visray.errors import ClusterLost, MomentError, UserError
from visray.progress import Bar, Interrupts
from visray.terminal import kept_notes, write_json, write_line

if TYPE_CHECKING:
    from visray.animation.frames import Frame
    from visray.cluster.crew import Crew
    from visray.frame_maker import FrameMaker
    from visray.output.frame_files import FrameWriter
    from visray.output.image import Image

Destinations = Annotated[
    list[Path],
    Parameter(
        name=("--output", "-o"),
        help="A folder; or a name such as shot.####.exr or shot.####.png, where #### becomes the number of the frame; "
        "or a movie: .mp4, .gif or .webp. May be given more than once. Default: a folder with the name of the scene.",
        show_default=False,
    ),
]


@app.command(name="animate", help_epilogue=EPILOGUE)
def animate_command(
    scene: SceneFile,
    /,
    *,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    output: Destinations = [],  # noqa: B006 - only read
    frames: Annotated[
        str | None, Parameter(help="Frames to render: a:b or a:b:step, without b, or one number. Default: all.")
    ] = None,
    fps: Annotated[float | None, Parameter(help="Frames per second. Default: as the scene says.")] = None,
    spp: Samples = None,
    error: Error = None,
    time: Annotated[
        Seconds | None, Parameter(help="Make the best picture of each frame in this time: 20 or 20s, 2min, 1h.")
    ] = None,
    size: Size = None,
    scale: Scale = None,
    region: Region = None,
    filter: Filter = None,
    precision: Precision = None,
    seed: Seed = None,
    threads: Threads = None,
    cluster: Cluster = None,
    backend: Backend = "llvm",
    set: Settings = [],  # noqa: B006 - the name of the option; only read
    layers: Layers = None,
    gamma: Gamma = "srgb",
    exposure: Exposure = 0.0,
    float32: Float = False,
    no_legend: NoLegend = False,
    checkpoint: flag(
        "Keep the frames of a movie as PNG files in a folder MOVIE.frames, and the samples of a long frame in a file."
    ) = False,
    resume: flag("Render only frames whose files are missing, or are of another scene. Implies --checkpoint.") = False,
    overwrite: flag("Render all frames, and replace the files that exist.") = False,
    quiet: Quiet = False,
    json: Json = False,
    more: Annotated[dict[str, Any] | None, Parameter(parse=False)] = None,
) -> int:
    """Render an animated scene to files of frames and to movies.

    Ctrl-C keeps the finished frames. Frame k has the bits that `visray render --at` gives its time. With another
    --fps, the shutter and the motion vectors follow it. Noise stands still, as all frames have one seed.
    """
    begun = clock.now()
    if quiet:
        warnings.simplefilter("ignore")
    with kept_notes() as notes:
        if resume and overwrite:
            raise UserError("--resume and --overwrite: keep the finished frames or replace them; leave one out")
        refuse(output)
        changes = {"spp": spp, **film_changes(size, scale, region, filter), "seed": seed, "precision": precision}
        check_cluster(cluster)
        with Bar(f"reading {scene.name}", 1, not (quiet or json)):
            loaded = load_scene(scene, setup, compat, set, allow_outside=allow_outside, **changes)
        from visray.adaptive.error_floor import Files
        from visray.adaptive.stopping import Goal
        from visray.animation.frames import chosen_frames
        from visray.frame_checks import check_frames
        from visray.frame_maker import FrameMaker
        from visray.output.frame_files import FrameFiles
        from visray.setup import set_threads

        Goal.from_arguments(error, time, spp, begun)
        if loaded.animation is None:
            raise UserError(f"{scene}: nothing moves in it, as it has no animation; give it one, or use visray render")
        chosen = chosen_frames(loaded.animation, frames, fps)
        files = FrameFiles.of(
            output or [Path(scene.stem)],
            scene.stem,
            checkpoint or resume,
            fps=fps or loaded.animation.fps,
            gamma=parse_gamma(gamma),
            exposure=exposure,
            float32=float32,
        )
        options = {"error": error, "time": time, "legend": not no_legend, "backend": backend}
        options["layers"] = needed_layers(layers, list(files.sequences))
        shown = {"gamma": files.gamma, "exposure": exposure, "float32": float32}
        maker = FrameMaker(loaded, options, fps, lambda frame: Files(files.paths(frame.number), **shown))
        if (checkpoint or resume) and time is None:
            maker.checkpoint = lambda frame: checkpoint_path([*files.paths(frame.number), *files.movies])
        files.check([frame.number for frame in chosen])
        if resume:
            files.check_movies([frame.number for frame in chosen])
        elif not overwrite:
            refuse_existing(files, chosen)
        if threads is not None:
            set_threads(threads)
        check_frames(loaded, chosen, not (quiet or json))
        report = FrameReport(files, len(chosen), begun)
        with ExitStack() as opened:
            writer = opened.enter_context(files.opened([frame.number for frame in chosen]))
            missing = missing_frames(chosen, maker, writer) if resume else chosen
            report.found = len(chosen) - len(missing)
            with _crew(cluster if missing else None, threads, not (quiet or json)) as crew:
                made = partial(_made, crew, missing, maker, not (quiet or json))
                stopped = _write_frames(made, writer, report, crew is None)
            # All frames of a movie would be lost if Ctrl-C ended it while the file is finished, which takes seconds.
            with Interrupts():
                opened.close()
        if (stopped or report.lost) and report.found + len(report.frames) < len(chosen):
            say_how_to_go_on(files)
        if report.lost:
            raise report.lost
    if json:
        all_notes = [*(more or {}).get("notes", ()), *notes]
        write_json((more or {}) | report.facts() | {"stopped": stopped, "notes": all_notes})
    elif not quiet:
        write_line(report.line(stopped))
    if stopped:
        return INTERRUPTED
    return 0 if report.goals_met or time is not None else 1


def _crew(cluster: str | None, threads: int | None, progress: bool) -> AbstractContextManager["Crew | None"]:
    """The workers of a cluster, in a `with` block; None without a cluster. Until they are there, Ctrl-C ends the
    command."""
    from visray.cluster.connecting import connected

    return nullcontext() if cluster is None else connected(cluster, threads, progress)


def _made(
    crew: "Crew | None", frames: list["Frame"], maker: "FrameMaker", progress: bool, interrupts: Interrupts
) -> Generator[tuple["Frame", "Image"]]:
    """Yields frames with their pictures, which this process renders, or workers."""
    from visray.animating import made
    from visray.cluster.frames import frames_on

    yield from made(frames, maker, progress) if crew is None else frames_on(crew, maker, frames, progress, interrupts)


@contextmanager
def _held_back(writer: "FrameWriter", report: FrameReport) -> Iterator[None]:
    """A `with` block that ends early if the cluster is lost in it, or a frame is wrong, and there are finished frames.
    They are kept before the error is raised, in their movies too."""
    try:
        yield
    except (ClusterLost, MomentError) as error:
        if not writer.has_frames:
            raise
        *first, last = error.lines
        kept = (
            error if isinstance(error, ClusterLost) else MomentError(*first, f"{last}; the frames before it are kept")
        )
        report.lost = kept


def _write_frames(
    made: Callable[[Interrupts], Generator[tuple["Frame", "Image"]]],
    writer: "FrameWriter",
    report: FrameReport,
    are_made_here: bool,
) -> bool:
    """Writes frames that `made` yields. Returns whether Ctrl-C was pressed. Then the finished frames are kept.

    are_made_here: whether this process renders them, and compiles for them.
    """
    from visray.pass_timer import Compilations

    with Interrupts(has_results=False) as interrupts, Compilations() as compilations:
        interrupts.has_results = writer.has_frames
        with closing(made(interrupts)) as pairs, _held_back(writer, report):
            for frame, image in pairs:
                if image.metadata["interrupted"]:
                    break
                writer.write(frame.number, image)
                interrupts.has_results = True
                compilations.read()
                report.add(image.metadata, compilations.count if are_made_here else None)
                if interrupts.requested:
                    break
        if interrupts.requested and not writer.has_frames:
            raise KeyboardInterrupt
        return interrupts.requested
