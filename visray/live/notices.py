"""What is above the tabs beside the state of the picture: what others have changed, and the way back if one is lost."""

from dataclasses import dataclass
from typing import Any

from visray.live.client import Client
from visray.live.engine import Change
from visray.live.frame import Frame
from visray.live.live import Live, escaped
from visray.live.lost import behind_plane, has_edges, void_note
from visray.live.panel import back
from visray.scene.edits import within
from visray.scene.scene import Scene

HOME = "Back to the scene's view"
# At most so many changed values are named.
NAMED = 2


@dataclass(eq=False)
class _Notice:
    """What one browser shows.

    text: where its camera is, if that is no good place
    button: brings it back
    said: the sentence that is shown
    looked: the camera, the size and the change of the picture that was looked at last
    void: what was found out about it
    """

    text: Any
    button: Any
    said: str = ""
    looked: Any = None
    void: str = ""


class NoticesPart:
    """Sentences above the tabs, and a button that brings the camera back."""

    def __init__(self, live: Live):
        self.live, self.file = live, live.engine.scene
        self.notices: dict[int, _Notice] = {}
        self.changes = live.server.gui.add_html("", order=-8, visible=False)
        live.on_client(self.came)
        live.on_leave(lambda client: self.notices.pop(client.number, None))
        live.on_frame(self.frame)
        live.engine.on_scene(live.safely(self.changed))

    def came(self, client: Client) -> None:
        """A browser has come."""
        gui = client.handle.gui
        text = gui.add_html("", order=-7, visible=False)
        button = gui.add_button(HOME, order=-6, icon="home", color="gray", disabled=True)
        button.on_click(self.live.safely(lambda event: client.go_home()))
        self.notices[client.number] = _Notice(text, button)

    def changed(self, change: Change) -> None:
        """The scene or its effects have changed."""
        engine = self.live.engine
        if change.kind == "scene":
            self.file = engine.scene
        if change.kind != "time":
            text = changes_text(engine.left_out, changed_addresses(self.file, engine.scene, tuple(engine.edits)))
            if text != self.changes.content:
                self.changes.content, self.changes.visible = text, bool(text)

    def frame(self, client: Client, frame: Frame) -> None:
        """A browser's picture has a new state. In the thread that renders."""
        notice = self.notices.get(client.number)
        if notice is None:
            return
        if notice.button.disabled != client.at_home:
            notice.button.disabled = client.at_home
        shown = (*(client.viewer.shown or ()), frame.change)
        if shown != notice.looked:
            notice.void = ""
        crossed = "" if client.at_home else behind_plane(self.live.engine.scene, client.camera, client.base)
        if frame.grain == 1 and shown != notice.looked and not crossed:
            notice.looked = shown
            if not has_edges(frame.rgb):
                self.live.engine.ask(void_note, client.viewer).add_done_callback(
                    lambda found: self.found(notice, shown, found)
                )
        self.say(notice, crossed or notice.void)

    def found(self, notice: _Notice, shown: Any, found: Any) -> None:
        """It is known why a picture shows nothing. In the thread that renders."""
        if not found.cancelled() and found.exception() is None and notice.looked == shown:
            notice.void = found.result()
            self.say(notice, notice.void)

    def say(self, notice: _Notice, text: str) -> None:
        """Shows a sentence; "" shows none."""
        if text != notice.said:
            notice.said = text
            notice.text.content, notice.text.visible = _box(escaped(text), "#e8a200") if text else "", bool(text)


def changed_addresses(file: Scene, scene: Scene, edits: tuple[str, ...]) -> list[str]:
    """Addresses at which a scene has other values than its file. edits: all that were assigned"""
    other = [a for a in edits if back(file, a) != back(scene, a)]
    return [a for a in other if not any(a != b and within(a, b) for b in other)]


def changes_text(off: tuple[str, ...], addresses: list[str]) -> str:
    """What is not as in the file, as HTML; "" if all is. off: effects that are switched off"""
    parts = [f"switched off: {', '.join(off)} (tab Price)"] if off else []
    if addresses:
        which = ", ".join(addresses) if len(addresses) <= NAMED else f"{len(addresses)} values"
        parts.append(f"changed: {which} (tab Scene takes it back)")
    return _box("<br>".join(map(escaped, parts)), "#4c6ef5") if parts else ""


def _box(text: str, color: str) -> str:
    """A notice, as HTML. text: HTML"""
    style = f"margin:0.2em 0.8em;padding:0.3em 0.7em;border-left:4px solid {color};font-size:0.85em"
    return f'<div style="{style};overflow-wrap:anywhere">{text}</div>'
