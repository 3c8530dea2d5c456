"""What the tab with the controls says."""

from visray.live.controls import Control
from visray.live.live import escaped

HELP = "Search for words such as ball radius, or write a value: camera.fov = 40"


def folder_title(control: Control) -> str:
    """Title of the folder of an entry, such as "material red", "layer rain" or "data rain.12, Zurich"."""
    name = control.owner.partition(".")[2]
    if not name:
        return control.owner
    if name.startswith("layers."):
        return f"layer {name.removeprefix('layers.')}"
    return f"{control.group} {name}, {control.title}" if control.title else f"{control.group} {name}"


def head_text(title: str, count: int, more: int, help: str = "", names: tuple[str, ...] = ()) -> str:
    """What the widgets are, as HTML.

    help: a sentence about what else can be done
    names: what there is, if nothing was found
    """
    number = "nothing" if not count else "1 value" if count == 1 else f"{count} values"
    text = f"{number} {title}" + (f", and {more:,} more" if more else "") + (f". {help}" if help else "")
    if names:
        text += f". There are: {', '.join(names)}"
    style = "padding:0.2em 0.9em 0.4em;font-size:0.85em;opacity:0.75;overflow-wrap:anywhere"
    return f'<div style="{style}">{escaped(text)}</div>'
