"""Files of maps that visray draws, as textures of scenes."""

import atexit
import os
import shutil
import tempfile
from functools import cache
from hashlib import sha256
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from visray.arguments import shown
from visray.errors import UserError
from visray.leftovers import removed_with_the_process
from visray.output.png import encode, write_png

# Metadata of a drawn map. By them it is told from a picture of the user, which is never replaced.
MARK = {"map": "drawn"}


def write_map(pixels: np.ndarray, path: str) -> None:
    """Writes a drawn map to a PNG file. Shape: pixels uint8 (H, W, 3)."""
    write_png(path, encode(pixels, MARK, True))


def write_own_map(pixels: np.ndarray, path: str) -> None:
    """Writes a drawn map to a file that a user named. Raises a UserError if another file is there, or the name is
    wrong. Shape: pixels uint8 (H, W, 3)."""
    if not path.lower().endswith(".png"):
        raise UserError(f"map_file = {shown(path)}: a map is a PNG file; end the name in .png")
    if Path(path).exists() and not _is_drawn(path):
        other = "there is a file that is no map drawn by visray"
        raise UserError(f"map_file = {shown(path)}: {other}; take another name, or show that picture by map")
    write_map(pixels, path)


def passing_map(pixels: np.ndarray) -> str:
    """Writes a drawn map to a folder that is removed when Python ends. Returns the path of the file; equal maps have
    one file. Shape: pixels uint8 (H, W, 3)."""
    if not _folder().exists():
        # Something has removed it, as systems do with old temporary files.
        _folder.cache_clear()
    path = Path(_folder(), f"map-{sha256(str(pixels.shape).encode() + pixels.tobytes()).hexdigest()[:16]}.png")
    if not path.exists():
        write_map(pixels, str(path))
    return str(path)


@cache
def _folder() -> Path:
    """The folder of this process for maps."""
    folder = tempfile.mkdtemp(prefix="visray-maps-")
    atexit.register(_remove, folder, os.getpid())
    removed_with_the_process(Path(folder))
    return Path(folder)


def _remove(folder: str, process: int) -> None:
    """Removes a folder, unless this process is a copy of the one that made it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


def _is_drawn(path: str) -> bool:
    """Whether a file is a map that visray drew."""
    try:
        with Pillow.open(path) as picture:
            return f"visray/{next(iter(MARK))}" in picture.info
    except (OSError, ValueError, SyntaxError, Pillow.DecompressionBombError):
        return False
