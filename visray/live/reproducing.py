"""The picture that a browser shows, for others to make again: as a scene, as a scene file, and as a command line."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from visray.animation.moment import assignments as moment_assignments
from visray.animation.moment import still_at
from visray.errors import UserError
from visray.scene.address import changed, parse_assignments, value
from visray.scene.edits import within
from visray.scene.scene import Scene
from visray.scene.write import value_text

# The program, and the command that renders.
RENDER = ["visray", "render"]


@dataclass(frozen=True)
class Wish:
    """How a picture is to be made.

    size: width and height in pixels; None: as the scene says
    error: the error to reach; None: as many samples as `spp`
    spp: samples per pixel; None: an error is given, or as the scene says
    """

    size: tuple[int, int] | None = None
    error: float | None = None
    spp: int | None = None

    def arguments(self) -> dict[str, Any]:
        """The arguments of vr.render."""
        return {"size": self.size, "error": self.error, "spp": self.spp}

    def words(self) -> list[str]:
        """The options of the command line."""
        size = ["--size", f"{self.size[0]}x{self.size[1]}"] if self.size else []
        error = ["--error", f"{self.error!r}"] if self.error is not None else []
        return size + error + (["--spp", str(self.spp)] if self.spp is not None else [])


@dataclass(frozen=True)
class Seen:
    """What a browser sees.

    scene: the scene with all changes made in browsers; with its animation, if it has one
    edits: addresses of these changes
    time: the moment that is shown, in seconds; None if nothing moves
    camera: camera of the browser
    at_home: whether it looks from where the scene's camera is at this moment
    left_out: names of effects that are not simulated
    """

    scene: Scene
    edits: tuple[str, ...]
    time: float | None
    camera: Any
    at_home: bool
    left_out: tuple[str, ...] = ()

    @property
    def camera_moves(self) -> bool:
        """Whether the animation moves the camera, so that a scene cannot have another camera at this moment."""
        moved = moment_assignments(self.scene, self.time) if self.time is not None else {}
        return any(within(address, "camera") for address in moved)

    def as_file(self) -> Scene:
        """The scene with the camera of the browser, but for one that the animation moves."""
        if self.at_home or self.camera_moves:
            return self.scene
        return replace(self.scene, camera=self.camera)

    def to_render(self) -> tuple[Scene, float | None]:
        """The scene that vr.render makes the picture of, and the moment."""
        if self.at_home or not self.camera_moves:
            return self.as_file(), self.time
        animation, tracks = self.scene.animation, self.scene.animation.tracks.items()
        others = {name: x for name, x in tracks if not any(within(a, "camera") for a in x.addresses())}
        if others:
            # The camera stands still, and what else moves is blurred.
            camera = replace(self.camera, shutter=self.scene.camera.shutter)
            return replace(self.scene, camera=camera, animation=replace(animation, tracks=others)), self.time
        return replace(still_at(self.scene, self.time), camera=replace(self.camera, shutter=None)), None

    def notes(self) -> tuple[str, ...]:
        """What a file or a command line does not say, as sentences."""
        notes = []
        if self.left_out:
            notes.append(f"{', '.join(self.left_out)}: switched off only here; saved files have all effects")
        if not self.at_home and self.camera_moves:
            notes.append("the animation moves the camera, so a scene file has that camera and not the one of this page")
        return tuple(notes)


def assignments(base: Scene, seen: Seen) -> dict[str, Any]:
    """The values by address that make the scene `base` what is seen.

    base: the scene of the file, without changes made in browsers
    """
    scene = seen.as_file()
    edits = [a for a in seen.edits if not within(a, "camera")]
    outer = [a for a in dict.fromkeys(edits) if not any(within(a, other) and a != other for other in edits)]
    values = {address: value(scene, address) for address in outer}
    if type(scene.camera) is not type(base.camera):
        return values | {"camera": scene.camera}
    new = {f.name: getattr(scene.camera, f.name) for f in fields(scene.camera)}
    return values | {f"camera.{name}": x for name, x in new.items() if x != getattr(base.camera, name)}


def command_line(command: Sequence[str], base: Scene, seen: Seen, wish: Wish, outputs: Sequence[str] = ()) -> str:
    """The command line that makes the picture again, for a shell.

    command: words of the command line that shows the scene `base`
    outputs: names of the files to write

    Raises UserError if no command line makes this picture.
    """
    if not seen.at_home and seen.camera_moves:
        raise UserError(
            "the animation moves the camera, and no option moves it elsewhere; save the picture, or go home"
        )
    texts = [f"{address}={value_text(x)}" for address, x in assignments(base, seen).items()]
    again = changed(base, parse_assignments(texts)) if texts else base
    if again.hash() != seen.as_file().hash():
        raise UserError("the scene's file is no longer what is shown here; save the scene")
    words = [*RENDER, *command[len(RENDER) :], *(word for text in texts for word in ("--set", text))]
    if seen.time:
        words += ["--at", f"{seen.time!r}"]
    return shlex.join([*words, *wish.words(), *(word for name in outputs for word in ("-o", name))])


def parse_wish(size: str, quality: str, film: tuple[int, int]) -> Wish:
    """How a picture is to be made, from what a user has typed.

    size: such as 640x480; empty: that of the film. quality: an error such as 1 % or 0.01, or samples such as 64 spp
    film: width and height of the scene's film, in pixels
    """
    return Wish(_size(size, film), *_quality(quality))


def _size(text: str, film: tuple[int, int]) -> tuple[int, int] | None:
    parts = text.lower().split("x")
    if not text.strip():
        return None
    numbers = [p.strip() for p in parts]
    if len(numbers) != 2 or not all(p.isascii() and p.isdecimal() and int(p) > 0 for p in numbers):
        raise UserError(f"size = {text!r}: must be a width and a height in pixels, such as 640x480")
    found = int(numbers[0]), int(numbers[1])
    return None if found == film else found


def _quality(text: str) -> tuple[float | None, int | None]:
    """An error and a number of samples per pixel, of which one is None."""
    words = text.lower().replace("%", " %").split()
    problem = f"quality = {text!r}: must be an error such as 1 %, or samples per pixel such as 64 spp"
    try:
        number = float(words[0])
    except (IndexError, ValueError):
        raise UserError(problem) from None
    unit = words[1] if len(words) == 2 else "" if len(words) == 1 else None
    if unit in ("spp", "samples") and number.is_integer() and number >= 1:
        return None, int(number)
    error = number / 100 if unit == "%" else number
    if unit not in ("", "%") or not 0 < error < 1:
        raise UserError(problem)
    return error, None


def free_name(file: Path) -> Path:
    """A file beside another one, with a name that no file has: NAME-edited.json, NAME-edited-2.json, ..."""
    names = (f"{file.stem}-edited{(n and f'-{n}') or ''}.json" for n in (0, *range(2, 10_000)))
    return next(path for path in map(file.with_name, names) if not path.exists())
