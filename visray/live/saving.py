"""The part of the page of a live picture that saves: the scene, a picture at full quality, and the command line."""

import re
import threading
from functools import partial
from pathlib import Path
from typing import Any

from visray import clock, terminal
from visray.errors import UserError
from visray.live.client import Client
from visray.live.guard import is_local
from visray.live.live import Live, escaped
from visray.live.picture_file import picture_file
from visray.live.reproducing import Seen, Wish, command_line, free_name, parse_wish
from visray.live.surface_line import surface_line
from visray.live.tabs import tab
from visray.output.files import write_text
from visray.progress import Follower
from visray.scene.load import dump
from visray.surface_picture.recipe import recipe_of

# Seconds between two reports of how far a picture is.
PAUSE = 0.2
FORMATS = ("PNG", "EXR")


class SavingPart:
    """Buttons that save what a browser sees: each saves what the browser sees in which it is pressed.

    One picture is made at a time, in a thread of its own. It shares the processors with the live picture.
    """

    def __init__(self, live: Live):
        self.live = live
        self._lock, self.follower, self.told_at = threading.Lock(), None, 0.0
        gui, film = live.server.gui, live.engine.scene.film
        writes_beside = live.file is not None and is_local(live.server.get_host())
        has_command = live.file is not None or live.recipe is not None or recipe_of(live.engine.scene) is not None
        with tab(live.server, "Save"):
            with gui.add_folder("Scene"):
                self.download = gui.add_button("Download the scene", hint="The scene with all changes and this camera")
                self.beside = gui.add_button("Write it beside the file", visible=writes_beside)
                self.line = gui.add_button(
                    "Command line", hint="The command that makes this picture again", visible=has_command
                )
            with gui.add_folder("Picture"):
                self.size = gui.add_text("size", "{}x{}".format(*film.size), hint="Width and height in pixels")
                self.quality = gui.add_text("quality", "1 %", hint="An error, such as 1 %, or samples, such as 64 spp")
                self.format = gui.add_dropdown("format", FORMATS, hint="EXR has all layers, in linear light")
                self.picture = gui.add_button("Make the picture")
                self.bar = gui.add_progress_bar(0.0, visible=False)
                self.state = gui.add_html("", visible=False)
                self.stop = gui.add_button("Cancel", visible=False)
        self.download.on_click(live.safely(self.save_scene))
        self.beside.on_click(live.safely(self.write_beside))
        self.line.on_click(live.safely(self.show_line))
        self.picture.on_click(live.safely(self.make_picture))
        self.stop.on_click(live.safely(lambda event: self.cancel()))
        live.on_stop(self.cancel)

    # The scene.

    def save_scene(self, event: Any) -> None:
        """Sends the scene file to the browser."""
        client, seen = self._client(event), self._seen(event)
        text = self._text(seen, self.live.file.parent if self.live.file else None)
        client.handle.send_file_download(f"{self._name()}.json", text.encode(), save_immediately=True)
        self._tell(client, f"{self._name()}.json: downloaded", seen)

    def write_beside(self, event: Any) -> None:
        """Writes the scene beside its file, under a name that no file has."""
        seen, path = self._seen(event), free_name(self.live.file)
        write_text(path, self._text(seen, path.parent))
        self._tell(self._client(event), f"{path}: written", seen)

    def _text(self, seen: Seen, folder: Path | None) -> str:
        """The text of the scene file. folder: that of the file"""
        like = self.live.file if self.live.file is not None and self.live.file.exists() else None
        return dump(seen.as_file(), folder, like)

    # The command line.

    def show_line(self, event: Any) -> None:
        """Shows the command line in the browser, with a button that copies it."""
        client, seen = self._client(event), self._seen(event)
        gui = client.handle.gui
        outputs = [f"{self._name()}{self._suffix()}"]
        if self.live.file is not None and self.live.load is not None:
            line = command_line(self.live.command, self.live.load(), seen, self._wish(), outputs)
        elif (recipe := self.live.recipe or recipe_of(seen.scene)) is not None:
            line = surface_line(recipe, seen, self._wish(), outputs)
        else:
            raise UserError("this scene has no file that a command could name; download it, and render that file")
        modal = gui.add_modal("Command line")
        with modal:
            gui.add_html(line_html(line, seen.notes()))
            close = gui.add_button("Close")
        close.on_click(lambda _: modal.close())

    # The picture.

    def make_picture(self, event: Any) -> None:
        """Makes a picture, and sends its file to the browser."""
        client, seen, wish, suffix = self._client(event), self._seen(event), self._wish(), self._suffix()
        with self._lock:
            if self.follower is not None:
                raise UserError("a picture is being made already; wait for it, or cancel it")
            follower = self.follower = Follower(self._report)
        made = partial(self.live.safely(self._made), event, client, seen, wish, suffix, follower)
        self.live.begin(made, "visray picture", partial(setattr, follower, "stopped", True))

    def _made(self, event: Any, client: Client, seen: Seen, wish: Wish, suffix: str, follower: Follower) -> None:
        """Makes a picture, in a thread of its own."""
        self._show(True)
        try:
            with terminal.kept_notes() as notes:
                made = picture_file(seen, wish, suffix, follower)
        finally:
            self.follower = None
            self._show(False)
        if made is None:
            self.live.tell("the picture was cancelled", client)
            return
        name = f"{self._name()}{suffix}"
        if client.number in self.live.clients:
            client.handle.send_file_download(name, made[0], save_immediately=True)
            self._tell(client, ". ".join([f"{name}: {made[1]}", *notes]), seen)

    def cancel(self) -> None:
        """Ends the picture that is being made."""
        if self.follower is not None:
            self.follower.stopped = True
            self.state.content = _small("stopping at the end of this pass")

    def _report(self, doing: str, share: float) -> None:
        """Shows how far a picture is."""
        now = clock.now()
        if now - self.told_at > PAUSE or share == 0:
            self.told_at = now
            self.bar.value = 100 * share
            if self.follower is not None and not self.follower.stopped:
                self.state.content = _small(f"{doing} {100 * share:.0f} %")

    def _show(self, is_running: bool) -> None:
        """Shows the widgets of a picture that is being made, or hides them."""
        self.bar.value, self.bar.animated = 0.0, is_running
        self.bar.visible = self.state.visible = self.stop.visible = is_running
        self.picture.disabled = is_running

    # What all of them need.

    def _client(self, event: Any) -> Client:
        """The browser in which a button was pressed."""
        client = self.live.client_of(event)
        if client is None:
            raise UserError("the browser has left")
        return client

    def _seen(self, event: Any) -> Seen:
        """What that browser sees."""
        client, engine = self._client(event), self.live.engine
        time = engine.time if engine.scene.animation is not None else None
        return Seen(engine.scene, tuple(engine.edits), time, client.camera, client.at_home, engine.left_out)

    def _wish(self) -> Wish:
        return parse_wish(self.size.value, self.quality.value, self.live.engine.scene.film.size)

    def _suffix(self) -> str:
        return f".{self.format.value.lower()}"

    def _name(self) -> str:
        """Name of a file without its ending: that of the scene."""
        return re.sub(r"[^\w.-]+", "-", self.live.name).strip("-.") or "scene"

    def _tell(self, client: Client, text: str, seen: Seen) -> None:
        """Tells what was saved, and what it does not have."""
        self.live.tell(". ".join([text, *seen.notes()]), client)


def line_html(line: str, notes: tuple[str, ...] = ()) -> str:
    """A command line in a box, with a button that copies it, as HTML. notes: sentences about it"""
    box = "width:100%;height:9em;font-family:monospace;font-size:0.85em;box-sizing:border-box"
    copy = "const t=this.previousElementSibling;t.select();navigator.clipboard?navigator.clipboard.writeText(t.value):0"
    said = "".join(_small(note) for note in notes)
    button = "padding:0.3em 1em;margin:0.5em 0;cursor:pointer"
    return (
        f'<textarea readonly style="{box}">{escaped(line)}</textarea>'
        f'<button style="{button}" onclick="{copy}">Copy</button>{said}'
    )


def _small(text: str) -> str:
    """Small text, as HTML."""
    return f'<div style="padding:0 1em 0.4em;font-size:0.8em;opacity:0.75">{escaped(text)}</div>'
