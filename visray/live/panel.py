"""The tab with the controls of the scene: what is searched for, or what is changed most, or those of a clicked object.

All browsers share the widgets, so that they agree. A lock guards them: their callbacks run in threads of viser, and the
engine tells of changes in the thread that renders.
"""

import threading
from typing import Any

from visray.live.client import Client
from visray.live.controls import Control
from visray.live.engine import Change
from visray.live.fields import field_at
from visray.live.live import Live, Pick
from visray.live.page_script import enter_presses
from visray.live.panel_text import HELP, folder_title, head_text
from visray.live.playing import Playing
from visray.live.search import Controls, Found, search
from visray.live.tabs import tab
from visray.live.widgets import ControlWidget, short
from visray.scene.address import parse_assignments, value
from visray.scene.animation_values import track_values
from visray.scene.edits import is_below_layer, within
from visray.scene.scene import Scene

# Most controls that are shown at once.
MOST = 30
# Seconds after the last letter until the answer comes.
PAUSE = 0.15
ASSIGN = "Set this value"


class PanelPart:
    """Sliders and pickers for the values of the scene."""

    def __init__(self, live: Live):
        self.live, self.engine, self.gui = live, live.engine, live.server.gui
        self._lock = threading.RLock()
        self.file, self.controls = self.engine.scene, Controls(self.engine.scene)
        self.widgets: list[ControlWidget] = []
        self._focus, self._box, self._last, self._ended = "", None, None, False
        with tab(live.server, "Scene") as self._tab:
            self.text = self.gui.add_text("search", "")
            self.assign = self.gui.add_button(ASSIGN, visible=False)
            self.playing = Playing(live)
            self.head = self.gui.add_html("")
            self._place = self.gui.add_folder(None)
            self.back = self.gui.add_button("All back to the file", icon="restore", color="gray", visible=False)
        self.text.on_update(live.safely(lambda event: self.searched()))
        self.assign.on_click(live.safely(lambda event: self._assign_text()))
        self.back.on_click(live.safely(lambda event: self.engine.show(self.file)))
        enter_presses(live.server, ASSIGN)
        self.list()
        self.engine.on_scene(live.safely(self.changed))
        self.engine.on_error(live.safely(self.refused))
        live.on_client(live.safely(self.came))
        live.on_pick(self.picked)
        live.on_stop(self.ended)

    def focus_on(self, name: str) -> None:
        """Shows the controls of an object first. name: its name or its address; "" shows those of the whole scene."""
        with self._lock:
            self._focus = name
            self.text.value = ""
            self.list()

    def came(self, client: Client) -> None:
        """A browser has come. If it is alone, it does not find what others searched for or clicked on."""
        if len(self.live.clients) == 1 and (self.text.value or self._focus):
            self.focus_on("")

    def ended(self) -> None:
        """The live picture ends: nothing is shown any more."""
        with self._lock:
            self._ended = True

    def picked(self, pick: Pick) -> None:
        """Somebody has clicked on the picture."""
        self.focus_on(pick.address or "")

    def searched(self) -> None:
        """Somebody writes into the search box."""
        asked = self.text.value
        # Whoever writes on has not read the answer.
        if not self.live.ended.wait(PAUSE) and asked == self.text.value:
            self.list()

    def list(self) -> None:
        """Shows the controls that are searched for, those of the object in focus, or those that are changed most."""
        with self._lock:
            text = self.text.value.strip()
            found, title = self._found(text)
            # Names may have such a sign, too.
            self.assign.visible = "=" in text and not found.controls
            if self.assign.visible:
                found, title = self._found(text.partition("=")[0].strip())
            names = self.controls.names() if text and not found.controls else ()
            self.head.content = head_text(title, len(found.controls), found.more, "" if text else HELP, names)
            if [*map(form, found.controls)] != [form(w.control) for w in self.widgets]:
                self._show(found.controls)
            for widget, control in zip(self.widgets, found.controls):
                widget.follow(control)
                self._offer_back(widget)

    def _found(self, text: str) -> tuple[Found, str]:
        """The controls to show, and what they are."""
        if text:
            return search(self.controls, text, MOST), f"with {text}"
        if self._focus:
            found = self.controls.of_object(self._focus, MOST)
            if found.controls:
                return found, f"of {self._focus.removeprefix('objects.')}, which was clicked"
        return self.controls.relevant(MOST), "of the scene"

    def _show(self, controls: tuple[Control, ...]) -> None:
        """Makes widgets for some controls, in a folder for each entry of the scene."""
        if self._box is not None:
            self._box.remove()
        with self._place:
            self._box = self.gui.add_folder(None)
        folders, self.widgets = {}, []
        for i, control in enumerate(controls):
            if control.owner not in folders:
                with self._box:
                    folders[control.owner] = self.gui.add_folder(folder_title(control))
            calls = self.live.safely(self._moved), self.live.safely(self._put_back)
            widget = ControlWidget(self.gui, folders[control.owner], control, i, *calls)
            self.widgets.append(widget)

    def _moved(self, widget: ControlWidget) -> None:
        """Somebody has moved a widget."""
        with self._lock:
            # A widget that is told what to show calls this, too.
            if widget.moved and widget in self.widgets:
                self._last = widget
                self.engine.assign(widget.control.assignments(widget.taken()))

    def _put_back(self, widget: ControlWidget) -> None:
        """Gives a value back what the file says."""
        with self._lock:
            self._last = widget
            self.engine.assign(dict(back(self.file, a) for a in widget.control.assignments(widget.control.value)))

    def _assign_text(self) -> None:
        """Assigns what is written in the search box."""
        assignments = parse_assignments([self.text.value])
        with self._lock:
            self._last = None
            self.engine.assign(assignments)

    def changed(self, change: Change) -> None:
        """The scene has changed: shows its values."""
        with self._lock:
            if self._ended:
                return
            scene = self.engine.scene
            if change.kind == "scene":
                self.file = scene
            if change.kind == "scene" or any(field_changed(self.controls.scene, scene, a) for a in change.addresses):
                self.controls = Controls(scene)
                self.list()
            else:
                self.controls = self.controls.with_scene(scene)
                self._show_values(change.addresses)
            self.playing.changed()
            self.back.visible = any(back(self.file, a) != back(scene, a) for a in self.engine.edits)

    def _show_values(self, addresses: tuple[str, ...]) -> None:
        """Shows the values at some addresses of the scene, unless newer ones are on their way, and those that tracks
        move."""
        wished, moving = self.engine.wished, {}
        if any(w.control.track for w in self.widgets):
            moving = track_values(self.engine.scene, self.engine.time)
        for widget in self.widgets:
            own = widget.control.address
            if own in moving:
                widget.show(moving[own])
                continue
            is_behind = any(related(own, a) for a in addresses) and not any(related(own, a) for a in wished)
            control = self.controls.at(own) if is_behind and not widget.moved else None
            if control is not None:
                widget.follow(control)
                self._offer_back(widget)

    def _offer_back(self, widget: ControlWidget) -> None:
        """Shows the button that puts a value back, if the file says another one."""
        old = Controls(self.file).at(widget.control.address)
        is_same = old is None or old.value == widget.control.value
        widget.offer("" if is_same else f"{widget.control.label}: back to {short(old.value)}")

    def refused(self, lines: tuple[str, ...]) -> None:
        """The scene has refused values, for these reasons: each is shown below the widget that it is about. (): all is
        well."""
        with self._lock:
            said: dict[int, str] = {}
            for line in lines:
                address = line.partition(": ")[0].partition(" = ")[0]
                about = [w for w in self.widgets if related(w.control.address, address)]
                if self._last in about or len(about) == 1:
                    said[id(self._last if self._last in about else about[0])] = line
            for widget in [] if self._ended else self.widgets:
                widget.say(said.get(id(widget), ""))


def form(control: Control) -> tuple:
    """What a widget must be made anew for."""
    return control.address, control.kind, control.has_slider, control.track


def back(file: Scene, address: str) -> tuple[str, Any]:
    """An address, and the value that a scene has there; if it has no such address, those of what contains it."""
    if is_below_layer(file, address):
        return address, value(file, address)
    while (found := field_at(file, address)) is None:
        address = address.rpartition(".")[0]
    return address, found.value


def field_changed(old: Scene, new: Scene, address: str) -> bool:
    """Whether a value has become one of another type, such as another kind of object, so that the scene has other
    controls. Numbers of rows, which are no fields, do not change any."""
    before, after = (field_at(scene, address) for scene in (old, new))
    if before is None or after is None:
        return before is not after
    return type(before.value) is not type(after.value) or isinstance(after.value, (str, dict))


def related(address: str, other: str) -> bool:
    """Whether one of two addresses is a part of the other one."""
    return within(address, other) or within(other, address)
