"""The system's viewer: the program that shows a picture when its file is opened on the desktop."""

import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.output.png import write_png

# Commands of Unix that show a file, those of desktops first: they start the program that the user has chosen.
COMMANDS = (("xdg-open",), ("gio", "open"), ("display",), ("gm", "display"), ("eog",), ("feh",))
# Environment variables, of which one is set where a Unix program can open a window.
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME")
# Seconds in which an X server on this machine answers.
ANSWERS_WITHIN = 2.0
# Seconds in which a command that cannot show the file has said so.
FAILS_WITHIN = 0.5


def check_viewer(instead: str = "write a file with -o") -> None:
    """Raises a UserError if no picture can be shown. Call this before a long render.

    instead: what to do then.
    """
    if sys.platform not in ("win32", "darwin"):
        _unix_commands(instead)


def has_windows() -> bool:
    """Whether programs can open windows here."""
    return sys.platform in ("win32", "darwin") or not _no_windows()


def _no_windows() -> str:
    """Why no program of Unix can open a window here; "" if it can."""
    given = {name: text for name in DISPLAYS if (text := os.environ.get(name))}
    if not given:
        return "there is no display to open a window on"
    if set(given) == {"DISPLAY"} and not _is_open(given["DISPLAY"]):
        return f"DISPLAY = {given['DISPLAY']}: no display answers there to open a window on"
    return ""


def show_file(path: str | os.PathLike[str]) -> None:
    """Shows the picture in a file. Returns while it is seen, and leaves the file. Raises a UserError if no program
    shows it."""
    if sys.platform == "win32":
        try:
            os.startfile(path)
        except OSError as error:
            raise UserError(f"show: {error.strerror}; open {os.fspath(path)} yourself") from error
        return
    commands = [("open",)] if sys.platform == "darwin" else _unix_commands()
    if not any(_shows((*command, os.path.abspath(path))) for command in commands):
        names = ", ".join(" ".join(command) for command in commands)
        raise UserError(f"show: {names} failed; open {os.fspath(path)} yourself")


def _unix_commands(instead: str = "write a file") -> list[tuple[str, ...]]:
    """The commands of this machine that show a file. Raises a UserError if there are none, which says what to do
    instead."""
    if problem := _no_windows():
        raise UserError(f"show: {problem}; {instead}, and open it elsewhere")
    found = [command for command in COMMANDS if shutil.which(command[0])]
    if not found:
        raise UserError(f"show: no program that shows pictures was found; install xdg-utils, or {instead}")
    return found


def _is_open(display: str) -> bool:
    """Whether an X server answers at a display of this machine, such as :0. One of another machine counts as open."""
    number = re.fullmatch(r"(?:unix)?:(\d{1,4})(?:\.\d+)?", display)
    if number is None:
        return True
    path, port = f"/tmp/.X11-unix/X{number[1]}", 6000 + int(number[1])
    # Linux also has sockets that are no files, whose names begin with a NUL. Some servers have a port alone.
    places = [(socket.AF_UNIX, path), (socket.AF_UNIX, f"\0{path}"), (socket.AF_INET, ("127.0.0.1", port))]
    return any(_answers(*place) for place in places)


def _answers(family: int, place: Any) -> bool:
    """Whether something answers at the place of a socket."""
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.settimeout(ANSWERS_WITHIN)
        try:
            probe.connect(place)
        except OSError:
            return False
    return True


def _shows(command: tuple[str, ...]) -> bool:
    """Starts a command. Returns False if it fails at once, else True while it runs."""
    # It has no share in the standard streams: a program that reads the report would wait until the picture is closed.
    # It has a session of its own, so that Ctrl-C and the end of the terminal do not close the picture.
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    try:
        process = subprocess.Popen(command, **streams, start_new_session=True)
    except OSError:
        return False
    try:
        return process.wait(FAILS_WITHIN) == 0
    except subprocess.TimeoutExpired:
        # Someone must wait for its end, or it stays in the list of processes.
        threading.Thread(target=process.wait, daemon=True).start()
        return True


def show_png(data: bytes, name: str = "picture.png") -> Path:
    """Shows the bytes of a PNG file, from a file in a new folder among the temporary files, which the system removes.
    Returns the path of this file.

    name: of the file. Viewers write it above the picture.
    """
    path = Path(tempfile.mkdtemp(prefix="visray-"), name)
    write_png(path, data)
    show_file(path)
    return path


def show_in_notebook(data: bytes) -> bool:
    """Shows the bytes of a PNG file below the cell of a notebook. Returns False if no notebook runs this."""
    ipython = sys.modules.get("IPython")
    if ipython is None or not hasattr(ipython.get_ipython(), "kernel"):
        return False
    from IPython.display import Image, display

    display(Image(data, format="png"))
    return True
