"""Frames of an animation on the workers of a cluster: each frame is one task."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from visray.adaptive.error_floor import Files
from visray.animation.frames import Frame
from visray.cluster.crew import Crew
from visray.cluster.kept_scenes import kept_scene
from visray.cluster.refusal import versions
from visray.cluster.scene_package import ScenePackage
from visray.cluster.worker import Order, ready, unpacking
from visray.errors import StructureWarning
from visray.output.image import Image
from visray.progress import Bar, Interrupts
from visray.scene.scene import Scene

# Frames that a worker may be ahead of the first one that is not done: pictures wait in memory for those before them.
AHEAD = 4


@dataclass(frozen=True)
class Shot:
    """What a worker must know of all frames, besides the scene.

    maker: FrameMaker (animating.py), which renders frames
    options, fps: its options, and frames per second
    """

    maker: Callable[[Scene, dict[str, Any], float | None], Any]
    options: dict[str, Any]
    fps: float | None


@dataclass(frozen=True)
class MadeFrame:
    """A frame that a worker has rendered.

    image: the picture
    notes: classes and texts of the warnings that came with it
    """

    image: Image
    notes: tuple[tuple[type[Warning], str], ...]


def frames_on(
    crew: Crew, maker: Any, frames: Sequence[Frame], progress: bool, interrupts: Interrupts
) -> Iterator[tuple[Frame, Image]]:
    """Yields frames with their pictures, in their order, until Ctrl-C.

    maker: FrameMaker (animating.py), which says what is to be rendered
    """
    crew.send(ScenePackage.of(maker.scene))
    order, shot = Order(versions(), threads=crew.threads), Shot(type(maker), maker.options, maker.fps)
    done, begun, yielded = {}, 0, 0
    with Bar("frames", len(frames), progress, before="compiling") as bar:
        while yielded < len(frames) and not interrupts.requested:
            while begun < min(len(frames), yielded + AHEAD * len(crew.workers())) and crew.has_room():
                frame = frames[begun]
                crew.submit(begun, f"visray-frame-{frame.number:04d}", frame_of, order, shot, frame, maker.files(frame))
                begun += 1
            done.update(crew.done())
            bar.title = f"frames, {yielded + len(done)} of {len(frames)}"
            bar.update(yielded + len(done))
            while yielded in done:
                frame, found = frames[yielded], done.pop(yielded)
                yielded += 1
                yield frame, maker.received(frame, found.image, found.notes)
    crew.cancel()


def frame_of(package: ScenePackage, order: Order, shot: Shot, frame: Frame, files: Files) -> MadeFrame:
    """A frame. A worker calls this.

    files: the files that the client will write. Their paths matter only in their endings.
    """
    with ready(order):
        with unpacking():
            kept = kept_scene(package)
        maker = kept.made_once(repr(shot), lambda: shot.maker(kept.scene, shot.options, shot.fps))
        here = replace(files, paths=[Path(kept.folder.name, Path(path).name) for path in files.paths])
        maker.files = lambda frame: here
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            image = maker(frame)
        # Which frame needs other kernels than the one before depends on which frames this worker has had.
        notes = [note for note in caught if not issubclass(note.category, StructureWarning)]
        return MadeFrame(image, tuple((note.category, str(note.message)) for note in notes))
