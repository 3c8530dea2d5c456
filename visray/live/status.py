"""What is above the tabs: how good the picture is, and what is wrong."""

from dataclasses import dataclass
from typing import Any

from visray import clock, terminal
from visray.live.client import Client
from visray.live.frame import Frame
from visray.live.live import Live, escaped

# Seconds between two states of the line, while the picture changes.
PAUSE = 0.15
GREY = "opacity:0.65"
# Most errors that are shown, and most characters of one: a file may have thousands.
MOST_ERRORS, LONGEST_ERROR = 8, 600


@dataclass(eq=False)
class _Line:
    """The line of one browser.

    text: what it says of the picture, as HTML
    label: what stands in the title of the panel
    errors: shows the errors that only this browser has
    """

    client: Client
    widget: Any
    errors: Any
    text: str = ""
    label: str = ""
    grain: int = 0
    shown_at: float = -PAUSE


class StatusPart:
    """A line for each browser about its picture, and the errors of the scene for all of them."""

    def __init__(self, live: Live):
        self.live = live
        self.lines: dict[int, _Line] = {}
        self.errors = live.server.gui.add_html("", order=-20, visible=False)
        live.on_client(self.came)
        live.on_leave(lambda client: self.lines.pop(client.number, None))
        live.on_frame(self.frame)
        live.on_errors(self.told)
        live.on_fail(self.failed)
        live.engine.on_busy(self.busy)

    def came(self, client: Client) -> None:
        """A browser has come."""
        gui = client.handle.gui
        errors = gui.add_html("", order=-19, visible=False)
        self.lines[client.number] = _Line(client, gui.add_html(waiting("preparing the scene"), order=-10), errors)

    def frame(self, client: Client, frame: Frame) -> None:
        """A browser's picture has a new state."""
        line, now = self.lines.get(client.number), clock.now()
        if line is None:
            return
        if now - line.shown_at < PAUSE and line.grain == frame.grain and not frame.finished:
            return
        line.shown_at, line.grain, line.text = now, frame.grain, text_of(frame)
        line.widget.content = line.text
        self.name(line, brief(frame))

    def name(self, line: "_Line", state: str) -> None:
        """Shows the state beside the name of the scene, where it is seen although the panel is closed."""
        label = f"{self.live.name}{state}"
        if label != line.label:
            line.label = label
            line.client.handle.gui.set_panel_label(terminal.printable(label))

    def busy(self, text: str | None) -> None:
        """The engine does something that takes long, such as compiling. None: it is done."""
        for line in list(self.lines.values()):
            line.widget.content = waiting(text) if text else line.text

    def failed(self, client: Client, lines: tuple[str, ...]) -> None:
        """A browser sees nothing because of an error; (): it sees a picture again."""
        if (line := self.lines.get(client.number)) is not None:
            line.errors.content = errors_text(list(lines), "This view has no picture")
            line.errors.visible = bool(lines)

    def told(self, errors: dict[str, tuple[str, ...]]) -> None:
        """The errors have changed."""
        lines = [line for source in errors.values() for line in source]
        self.errors.content = errors_text(lines)
        self.errors.visible = bool(lines)


def text_of(frame: Frame) -> str:
    """The line about a state, as HTML."""
    more = [
        f"{frame.size[0]} x {frame.size[1]}",
        f"{frame.seconds:.2g} s",
        *([frame.note] if frame.note else []),
    ]
    if frame.grain > 1:
        return _line(f"coarse: squares of {frame.grain} x {frame.grain} pixels", ", ".join(more))
    samples = f"{frame.samples:.3g} sample{'' if frame.samples == 1 else 's'} a pixel"
    error = "error not known yet" if frame.error is None else f"error {percent(frame.error)}"
    return _line(("✓ " if frame.finished else "") + error, ", ".join([samples, *more]))


def brief(frame: Frame) -> str:
    """A state in a few letters; "" while it is coarse."""
    return "" if frame.error is None else f" · {'✓ ' if frame.finished else ''}{percent(frame.error)}"


def percent(share: float) -> str:
    """A share as text, such as 1.3 %."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def waiting(text: str) -> str:
    """The line while there is no picture yet, as HTML."""
    return _line("…", text)


def errors_text(lines: list[str], title: str = "The scene has errors") -> str:
    """Errors as HTML; "" if there are none. title: what they are about."""
    style = "margin:0.4em 0.8em;padding:0.5em 0.7em;border-left:4px solid #c92a2a;background:#fff0f0;color:#7a1010;"
    shown = [line if len(line) <= LONGEST_ERROR else f"{line[:LONGEST_ERROR]}…" for line in lines[:MOST_ERRORS]]
    shown += [f"and {len(lines) - MOST_ERRORS} more"] if len(lines) > MOST_ERRORS else []
    items = "".join(f'<div style="margin:0.2em 0;overflow-wrap:anywhere">{escaped(line)}</div>' for line in shown)
    return f'<div style="{style}font-size:0.85em"><b>{title}</b>{items}</div>' if lines else ""


def _line(main: str, more: str) -> str:
    style = "padding:0.5em 0.9em 0.4em;line-height:1.35;font-size:0.9em;font-variant-numeric:tabular-nums"
    small = f'<div style="{GREY};font-size:0.88em">{escaped(more)}</div>'
    return f'<div style="{style}"><b>{escaped(main)}</b>{small}</div>'
