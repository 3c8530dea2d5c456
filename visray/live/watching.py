"""The part of the page of a live picture that follows the scene's file."""

from pathlib import Path

from visray.errors import UserError
from visray.live.engine import Change
from visray.live.file_watch import FileWatch
from visray.live.live import Live

# Seconds between two looks at the files.
PAUSE = 0.3
# Who says errors of the file, in the page.
SOURCE = "file"


class WatchingPart:
    """Follows the scene's file. A scene with errors is told, and the last one without is shown meanwhile.

    When the scene of the file becomes another one, changes that were made in browsers are dropped. Cameras of browsers
    stay, unless the camera of the file has changed.
    """

    def __init__(self, live: Live):
        self.live = live
        self.camera_has_changed = False
        if live.file is None or live.load is None:
            return
        live.engine.on_scene(self.changed)
        others = _setup_files(live.command)
        self.watch = FileWatch(live.file, live.load, live.engine.scene, others, self.told)
        live.begin(self._run, "visray file", live.ended.set)

    def _run(self) -> None:
        """Looks at the files until the live picture ends."""
        while not self.live.ended.wait(PAUSE):
            try:
                self.look()
            except UserError as error:
                self.live.say_errors(SOURCE, error.lines)
            except Exception as error:
                self.live.say_errors(SOURCE, (f"{self.live.file}: internal error: {type(error).__name__}: {error}",))

    def look(self) -> None:
        """Looks at the files once, and shows what they have become."""
        before = self.watch.scene
        scene = self.watch.look()
        self.live.say_errors(SOURCE, self.watch.lines)
        if scene is None:
            return
        self.camera_has_changed = scene.camera != before.camera
        self.live.tell(_text(self.live.file, len(self.live.engine.edits)))
        self.live.engine.show(scene)

    def told(self, text: str) -> None:
        """Says a sentence, and leaves the server the time to send it."""
        self.live.tell(text)
        self.live.ended.wait(PAUSE)

    def changed(self, change: Change) -> None:
        """The scene has changed."""
        if change.kind == "scene" and self.camera_has_changed:
            self.camera_has_changed = False
            for client in list(self.live.clients.values()):
                client.go_home()


def _text(file: Path, edits: int) -> str:
    """What is told when a file has changed. edits: number of values that were changed in browsers."""
    dropped = (
        f"; {edits} value{'s' * (edits != 1)} changed here {'are' if edits != 1 else 'is'} dropped" if edits else ""
    )
    return f"{file.name} has changed and was read again{dropped}"


def _setup_files(command: list[str]) -> list[Path]:
    """The setup file that a command line names; none if it names none."""
    return [Path(command[i + 1]) for i, word in enumerate(command[:-1]) if word == "--setup"]
