"""Makes the frames of an animated scene, one after the other. The scene is prepared once. For each frame, only what
moves is made again, and nothing is compiled unless a frame needs other kernels."""

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from visray import clock
from visray.adaptive.error_floor import Files
from visray.animation.frames import Frame
from visray.animation.moment import assignments, at
from visray.checkpoint import StaleCheckpoint, set_aside
from visray.errors import MomentError, StructureWarning, of_moment
from visray.made_layers import made_layers
from visray.motion_blur import frame_hash, values_while_open
from visray.motion_vectors import has_motion, next_frame
from visray.moving import moving
from visray.output.image import Image
from visray.output.up_to_date import Wanted
from visray.renderer import ANYWHERE, prepare, render
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.track_report import warn_of_tracks
from visray.version import __version__
from visray.warn import warn

# Seconds for the picture that is thrown away, which compiles what frames with a time limit need.
COMPILING_TIME = 1e-3
NUMBER = re.compile(r"[+-]?\d[\d.,]*(e[+-]?\d+)?")


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
