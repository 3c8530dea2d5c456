"""Renders the frames of an animated scene, one after the other. The scene is prepared once. For each frame, only what
moves is made again, and nothing is compiled unless a frame needs other kernels.

A frame has the bits that vr.render(scene, at=t) gives it. Its noise stands still, because all frames have one seed.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from visray import clock
from visray.adaptive.stopping import Goal
from visray.animation.frames import Frame, chosen_frames, frames_at
from visray.arguments import checked_arguments
from visray.cluster.address import check_address
from visray.cluster.connecting import connected
from visray.cluster.frames import frames_on
from visray.errors import UserError
from visray.frame_checks import check_frames
from visray.frame_maker import FrameMaker
from visray.output.image import Image
from visray.output.layers import NAMES
from visray.progress import Bar, Interrupts
from visray.renderer import checked_layers
from visray.scene.adjusted import adjusted
from visray.scene.load import load_as_written
from visray.scene.scene import Scene
from visray.setup import set_threads


@checked_arguments
def animate(
    scene: Scene | str | Path,
    times: Any = None,
    *,
    frames: str | slice | int | Sequence[int] | None = None,
    fps: float | None = None,
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
    allow_outside: bool = False,
    legend: bool = True,
    cluster: str | None = None,
    filter: Any = None,
    region: Sequence[int] | None = None,
    scale: float | None = None,
) -> Iterator[Image]:
    """Renders frames of an animated scene, or of a scene file. Each picture is rendered when it is asked for:

    for image in vr.animate(scene, frames="0:50"):
        image.write(f"ball.{image.metadata['frame']:04d}.png")

    times: times in seconds; None: the times of `frames`.
    frames: which frames of the animation: a range a:b:step, as Python's slices, a number, or a list; None: all of them.
    fps: frames per second; None: those of the animation.
    time: seconds that each frame may take.
    cluster: address of a Dask scheduler, or local:N, as in vr.render. Its workers render whole frames, with `error` or
        `time` too. After Ctrl-C no picture follows.

    All others are as in vr.render. The metadata of the pictures have `frame`, its number, and `time`. The scene is
    prepared once; then only what moves is made again, and nothing is compiled. If a frame does need other kernels, a
    StructureWarning says why. After Ctrl-C, the last picture consists of the samples taken so far.
    """
    Goal.from_arguments(error, time, spp, clock.now())
    options = {"layers": checked_layers(layers), "error": error, "time": time, "legend": legend, "backend": backend}
    scene = load_as_written(scene, allow_outside=allow_outside) if isinstance(scene, (str, Path)) else scene
    film = {"size": size, "filter": filter, "region": region, "scale": scale}
    scene = adjusted(scene, **film, spp=spp, seed=seed, precision=precision)
    if times is None:
        chosen = chosen_frames(scene.animation, frames, fps)
    elif frames is None and fps is None:
        chosen = frames_at(scene.animation, times)
    else:
        raise UserError("times: goes with neither frames nor fps, which choose times; leave one of them out")
    if threads is not None:
        set_threads(threads)
    maker = FrameMaker(scene, options, fps)
    check_frames(scene, chosen, progress)
    if cluster is None:
        return (image for _, image in made(chosen, maker, progress))
    check_address(cluster)
    return _made_on_cluster(cluster, threads, chosen, maker, progress)


def _made_on_cluster(
    cluster: str, threads: int | None, frames: Sequence[Frame], maker: FrameMaker, progress: bool
) -> Iterator[Image]:
    """Yields the pictures of frames, rendered by workers. cluster, threads: as in `animate`."""
    with connected(cluster, threads, progress) as crew:
        yield from (image for _, image in frames_on(crew, maker, frames, progress, Interrupts()))


def made(
    frames: Sequence[Frame], make: Callable[[Frame], Image], progress: bool = True
) -> Iterator[tuple[Frame, Image]]:
    """Yields frames with their pictures, in their order. After Ctrl-C, the last picture is incomplete.

    make: makes the picture of a frame. progress: whether a progress bar is shown.
    """
    with Bar("frames", len(frames), progress, before="compiling") as bar:
        for done, frame in enumerate(frames):
            image = make(frame)
            bar.title = f"frame {frame.number}, {done + 1} of {len(frames)}"
            bar.update(done + 1)
            yield frame, image
            if image.metadata["interrupted"]:
                return
