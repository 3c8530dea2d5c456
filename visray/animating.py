"""Renders the frames of an animated scene, one after the other. The scene is prepared once. For each frame, only what
moves is made again, and nothing is compiled unless a frame needs other kernels.

A frame has the bits that vr.render(scene, at=t) gives it. Its noise stands still, because all frames have one seed.
"""

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from visray import clock
from visray.adaptive.error_floor import Files
from visray.adaptive.stopping import Goal
from visray.animation.frames import Frame, chosen_frames, frames_at
from visray.animation.moment import assignments, at
from visray.arguments import checked_arguments
from visray.checkpoint import StaleCheckpoint, set_aside
from visray.cluster.address import check_address
from visray.cluster.connecting import connected
from visray.cluster.frames import frames_on
from visray.errors import MomentError, StructureWarning, UserError, of_moment
from visray.frame_checks import check_frames
from visray.made_layers import made_layers
from visray.motion_blur import frame_hash, values_while_open
from visray.motion_vectors import has_motion, next_frame
from visray.moving import moving
from visray.output.image import Image
from visray.output.layers import NAMES
from visray.output.up_to_date import Wanted
from visray.progress import Bar, Interrupts
from visray.renderer import ANYWHERE, checked_layers, prepare, render
from visray.scene.adjusted import adjusted
from visray.scene.load import load
from visray.scene.scene import Scene
from visray.setup import Prepared, set_threads
from visray.track_report import warn_of_tracks
from visray.version import __version__
from visray.warn import warn

# Seconds for the picture that is thrown away, which compiles what frames with a time limit need.
COMPILING_TIME = 1e-3
NUMBER = re.compile(r"[+-]?\d[\d.,]*(e[+-]?\d+)?")


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
    scene = load(scene, allow_outside=allow_outside) if isinstance(scene, (str, Path)) else scene
    scene = adjusted(scene, spp=spp, size=size, seed=seed, precision=precision)
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
    cluster: str, threads: int | None, frames: Sequence[Frame], maker: "FrameMaker", progress: bool
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


@dataclass
class FrameMaker:
    """Renders frames of an animated scene.

    scene: the scene, with its animation.
    options: options of vr.render: backend, layers, error, time, legend.
    fps: frames per second; None: those of the animation.
    files: the files that a frame will be written to.
    checkpoint: the file that keeps the samples of a frame until it is finished; None for none.
    prepared: the scene of the last frame, prepared.
    moved: what made up the last frame: the values of the animation at its time, while the shutter is open, and at the
        next frame, if there are motion vectors.
    image: the last picture.
    said: notes that were shown already, without their numbers.
    blurs: whether frames with the features of the last one were blurred.
    """

    scene: Scene
    options: dict[str, Any]
    fps: float | None = None
    files: Callable[[Frame], Files] = lambda frame: ANYWHERE
    checkpoint: Callable[[Frame], Path] | None = None
    prepared: Prepared | None = None
    moved: tuple | None = None
    image: Image | None = None
    said: set[tuple[type[Warning], str]] = field(default_factory=set)
    blurs: set[bool] = field(default_factory=set)

    def __post_init__(self) -> None:
        warn_of_tracks(self.scene)

    def facts(self, frame: Frame) -> dict[str, Any]:
        """What the metadata of a frame say if it is up to date; None for what they do not have."""
        moment, more = at(self.scene, frame.time), {}
        if has_motion(self.options["layers"]):
            more = {"next_scene_hash": next_frame(self.scene, frame.time, self.fps).hash()}
        return {
            "scene_hash": frame_hash(moment, values_while_open(self.scene, frame.time, self.fps)),
            "visray": __version__,
            "backend": self.options["backend"],
            "error_asked": self.options["error"],
            "time_asked": self.options["time"],
            "interrupted": 0,
            "legend": None if self.options["legend"] else 0,
        } | more

    def wanted(self, frame: Frame) -> Wanted:
        """What the files of a frame must be to be up to date."""
        s = self.scene.settings
        settings = ({} if self.has_goal else {"spp_asked": s.spp}) | {"seed": s.seed, "precision": s.precision}
        return Wanted(self.facts(frame), settings, self.layers)

    @cached_property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers that finished frames have."""
        return made_layers(self.scene, self.options["layers"], self.has_goal, self.options["legend"])

    @property
    def has_goal(self) -> bool:
        """Whether frames are rendered to an error or in a time."""
        return self.options["error"] is not None or self.options["time"] is not None

    def __call__(self, frame: Frame) -> Image:
        """The picture of a frame. If nothing moves since the last one, it is the same picture."""
        begun = clock.now()
        with self._said_once(frame):
            moved = self._moved(frame.time)
            if moved != self.moved:
                try:
                    self.image, self.moved = self._rendered(frame, moved[0]), moved
                except MomentError as error:
                    raise error.of_frame(frame.number) from None
        facts = {"frame": frame.number, "time": frame.time, "render_seconds": clock.now() - begun}
        facts |= {} if self.options["legend"] else {"legend": 0}
        return replace(self.image, metadata=self.image.metadata | facts)

    def received(self, frame: Frame, image: Image, notes: Iterable[tuple[type[Warning], str]]) -> Image:
        """The picture of a frame that another process has rendered, with the hashes of the scene as it is here: there,
        files have other paths. notes: classes and texts of its warnings."""
        with self._said_once(frame):
            for category, text in notes:
                warnings.warn(text.removeprefix(f"frame {frame.number}: "), category, stacklevel=1)
        self.image = image
        hashes = {key: fact for key, fact in self.facts(frame).items() if key.endswith("scene_hash")}
        return replace(image, metadata=image.metadata | hashes)

    def _moved(self, t: float) -> tuple:
        """What makes up the frame at time t: see `moved`."""
        rate = self.fps or self.scene.animation.fps
        after = assignments(self.scene, t + 1 / rate) if has_motion(self.options["layers"]) else None
        return assignments(self.scene, t), values_while_open(self.scene, t, self.fps), after

    def _rendered(self, frame: Frame, values: dict[str, Any]) -> Image:
        """The picture of a frame. values: the values of the animation."""
        options = {key: value for key, value in self.options.items() if key != "backend"} | {"progress": False}
        before = self.prepared
        # For the first frame, the update changes nothing. It compiles what later frames need.
        base = before or prepare(at(self.scene, frame.time), self.options["backend"])
        with of_moment(f"at {frame.time:g} s"):
            updated = base.updated(values)
        self.prepared = moving(updated, self.scene, frame.time, self.fps, self.options["layers"])
        if before is None and options["time"] is not None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                render(self.prepared, **options | {"time": COMPILING_TIME})
        if before is not None and (note := self._change_of_structure(before)):
            warnings.warn(note, StructureWarning, stacklevel=1)
        self.blurs.add(self.prepared.shutter is not None)
        path = self.checkpoint and self.checkpoint(frame)
        options |= {"files": self.files(frame), "checkpoint": path}
        try:
            return render(self.prepared, **options, resume=path is not None and path.exists())
        except StaleCheckpoint as stale:
            set_aside(path, stale)
            return render(self.prepared, **options)

    @contextmanager
    def _said_once(self, frame: Frame) -> Iterator[None]:
        """Shows each warning of a `with` block at its end, unless it was shown for an earlier frame, perhaps with other
        numbers. A warning that does not come with the first frame says its frame."""
        is_first = self.image is None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield
        for note in caught:
            text = str(note.message)
            key = note.category, NUMBER.sub("", text)
            if key not in self.said:
                self.said.add(key)
                warn(text if is_first else f"frame {frame.number}: {text}", note.category)

    def _change_of_structure(self, before: Prepared) -> str | None:
        """Why a frame needs other kernels than those before it, such as `before`; None if it does not."""
        after, old, new = self.prepared, before.features, self.prepared.features
        if old != new:
            self.blurs.clear()
            changes = [f"{x.name} comes ({x.reason})" for x in new.listed if x.on and not old[x.name]]
            changes += [f"{x.name} goes" for x in new.listed if not x.on and old[x.name]]
            return f"other kernels are compiled: {', '.join(changes) or 'a shininess has more digits'}"
        if (is_blurred := after.shutter is not None) not in self.blurs:
            return f"other kernels are compiled: motion blur {'comes' if is_blurred else 'goes'}"
        # Scenes that differ only in numbers share this set.
        if after.looked is not before.looked:
            return "everything is prepared again, as more than numbers changes; perhaps other kernels are compiled"
        return None
