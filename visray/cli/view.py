"""The command `visray view`: a live picture in the browser."""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from visray import terminal
from visray.cli import options
from visray.cli.options import At, Compat, Integer, Outside, SceneFile, Settings, Setup, Share, app, flag, load_scene
from visray.cli.stuck import last_signal
from visray.errors import UserError

if TYPE_CHECKING:
    from visray.scene.scene import Scene
    from visray.surface_picture.recipe import Recipe

Host = Annotated[
    str,
    Parameter(help="Where the server listens. Default: this machine alone. 0.0.0.0: all that can reach this machine."),
]
Port = Annotated[Integer | None, Parameter(help="Port of the server. Default: 8080, or the next free one.")]
NoBrowser = flag("Open no browser; only print the address.")
Target = Annotated[Share, Parameter(help="The picture gets better until its error is no larger: 0.01 or 1%.")]


@app.command(name="view")
def view_command(
    scene: SceneFile,
    /,
    *,
    host: Host = "127.0.0.1",
    port: Port = None,
    no_browser: NoBrowser = False,
    error: Target = 0.01,
    at: At = None,
    setup: Setup = None,
    compat: Compat = False,
    allow_outside: Outside = False,
    set: Settings = [],  # noqa: B006
) -> int:
    """Show a scene live in the browser.

    Turn it with the mouse, change it with sliders, click on it to see why a pixel has its colour. The picture is
    coarse while something moves, and gets better while nothing does; its error is shown. Changes of the file are
    followed. Ctrl-C ends it. Needs viser: pip install 'visray[view]'.
    """

    def load() -> "Scene":
        return load_scene(scene, setup, compat, set, allow_outside=allow_outside)

    words = ["visray", "view", str(scene), *(["--setup", str(setup)] if setup else []), *(["--compat"] * compat)]
    words += ["--allow-outside"] * allow_outside + [word for text in set for word in ("--set", text)]
    return show_live(
        load, name=scene.stem, file=scene, command=words, host=host, port=port, error=error, at=at,
        browser=not no_browser,
    )  # fmt: skip


def show_live(
    load: Callable[[], "Scene"],
    *,
    name: str,
    host: str = "127.0.0.1",
    port: int | None = None,
    error: float = 0.01,
    at: float | None = None,
    browser: bool = True,
    file: Path | None = None,
    command: Sequence[str] = (),
    recipe: "Recipe | None" = None,
) -> int:
    """Shows a live picture until Ctrl-C. Returns the exit code: 0 after Ctrl-C, options.INTERRUPTED after SIGTERM.
    A thread that compiles may go on.

    load: reads or makes the scene
    name: its name in the page
    port: the port; None: any free one
    browser: whether to open a browser, if this machine shows windows
    file: the scene's file, which is watched; None if it has none
    command: words of the command line that shows the file
    recipe: of a surface without a file
    """
    from visray.live.guard import is_local

    if not 0 < error < 1:
        raise UserError(f"--error = {error:g}: must be between 0 and 1, such as 0.01 or 1%")
    if file is None or file.exists():
        check_live(host, port)
    scene = load()
    from visray.live.view import started

    reload: Any = load if file is not None else None
    more = {"file": file, "command": command, "load": reload, "recipe": recipe}
    shown = started(scene, name=name, host=host, port=port, error=error, **more)
    try:
        if at is not None:
            shown.live.engine.seek(at)
        if not is_local(host):
            terminal.note(
                f"--host {host}: anybody who reaches this machine can change the scene, and can have files beside it "
                "read as textures"
            )
        terminal.write_line(f"{name}: {shown.url} (Ctrl-C ends)")
        if browser and _has_windows() and not shown.open():
            terminal.note("no browser opens here; open the address in one yourself")
        shown.wait()
    except KeyboardInterrupt:
        pass  # as in `wait`
    finally:
        shown.stop()
    # SIGTERM is no way to end it that a user would choose.
    return options.INTERRUPTED if last_signal() == signal.SIGTERM else 0


def check_live(host: str, port: int | None) -> None:
    """Raises a UserError if there is no viser, or if the port is taken. Call this before long work."""
    from visray.live.guard import check_installed, chosen_port

    check_installed()
    chosen_port(host, port)


def _has_windows() -> bool:
    """Whether programs can show windows here. Without windows, a browser for terminals would take the terminal."""
    return sys.platform in ("win32", "darwin") or any(os.environ.get(x) for x in ("DISPLAY", "WAYLAND_DISPLAY"))
