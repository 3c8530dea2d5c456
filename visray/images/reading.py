"""Pictures from files as linear light: PNG and JPEG through Pillow, EXR through visray's own reader.

The first bytes of a file say what it is, not its name.
"""

import json
import os
import stat
import struct
import warnings
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL.JpegImagePlugin import JpegImageFile
from PIL.PngImagePlugin import PngImageFile

from visray.errors import UserError
from visray.output.curves import linear
from visray.output.exr import read_exr
from visray.quantities import BRIGHTEST
from visray.scene.messages import printable
from visray.scene.source import neighbour

# Of all pictures of a scene together: 4 GiB as a kernel holds them. Beyond 2^30 their numbers would leave 32 bits.
MOST_PIXELS = 2**28
# Bytes of pictures that are kept for the next render.
KEPT = 2**30
# Of an attribute in an EXR header.
LONGEST_NAME = 255
# Pillow unpacks coloured PNG files of 16 bits by one of these raw modes, which keep the upper byte of each number. By
# the other mode, the same bytes give the lower one, in as many channels as are said.
LOWER_BYTE = {"RGB;16B": ("RGB;16L", 3), "RGBA;16B": ("RGBA;16L", 3), "LA;16B": ("ARGB", 1)}

_kept: dict[tuple[str, str], tuple[tuple[int, int], np.ndarray]] = {}


def read_image(file: str, encoding: str, address: str) -> np.ndarray:
    """The picture in a file, linear Rec. 709, float32, read-only. Shape: (H, W, 3), the top row first.

    encoding: `srgb`, `linear`, or `auto`, which is sRGB for PNG and JPEG and linear for EXR. Grey becomes three equal
    numbers. Alpha is left out: the colour is that of the pixel were it opaque, so in EXR, whose colour is weighted with
    its alpha, it is divided by it. Of an EXR file without R, G and B its only layer is taken; what is negative becomes
    0. Embedded profiles and the orientation that a camera notes are not applied.

    Raises UserError, one line that begins with `address`. A file that did not change is read once.
    """
    try:
        return _remembered(file, encoding)
    except UserError as error:
        # The file's name in full, however long its path.
        shown, text = json.dumps(file, ensure_ascii=False), str(error).removeprefix(f"{file}: ")
        raise UserError(printable(f"{address} = {shown}: {text}")) from None


def _remembered(path: str, encoding: str) -> np.ndarray:
    facts = _facts(path)
    key, stamp = (os.path.abspath(path), encoding), (facts.st_mtime_ns, facts.st_size)
    found = _kept.pop(key, None)
    if found is None or found[0] != stamp:
        found = stamp, _light(path, encoding)
        found[1].flags.writeable = False
    # The picture used last stands last, and those used longest ago are forgotten first.
    _kept[key] = found
    while len(_kept) > 1 and sum(pixels.nbytes for _, pixels in _kept.values()) > KEPT:
        del _kept[next(iter(_kept))]
    return found[1]


def _facts(path: str) -> os.stat_result:
    """Size and time of a file that can be read."""
    try:
        facts = os.stat(path)
    except FileNotFoundError:
        raise UserError(f"there is no such file{neighbour(Path(path)) or '; check the path'}") from None
    except (OSError, ValueError) as error:
        raise UserError(f"cannot be read ({_reason(error)}); check the path") from None
    if stat.S_ISDIR(facts.st_mode):
        raise UserError("is a folder; give a file in it")
    # Opening a pipe would wait for its other end.
    if not stat.S_ISREG(facts.st_mode):
        raise UserError("is not a regular file; give a PNG, JPEG or EXR file")
    return facts


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def _light(path: str, encoding: str) -> np.ndarray:
    """Linear light. Shape: (H, W, 3)."""
    try:
        with open(path, "rb") as file:
            head = file.read(8)
    except OSError as error:
        raise UserError(f"cannot be read ({_reason(error)}); check its permissions") from None
    if not head:
        raise UserError("is empty; save the picture anew")
    read = next((reader for magic, reader in READERS.items() if head.startswith(magic)), None)
    if read is None:
        raise UserError("is not a PNG, JPEG or EXR picture; save it as one of them")
    try:
        return _converted(read(path), encoding)
    except UserError:
        raise
    except MemoryError:
        raise UserError("does not fit into memory; make the picture smaller") from None
    # A damaged file can lead a decoder anywhere: OSError, SyntaxError, ValueError, struct.error, IndexError and more.
    except Exception as error:
        raise UserError(f"is damaged or has no pixels ({_reason(error)}); save it anew") from None


def _converted(values: np.ndarray, encoding: str) -> np.ndarray:
    """Linear light of the numbers of a file, whole ones or real. Shapes: (H, W, 1) or (H, W, 3); (H, W, 3)."""
    whole = values.dtype.kind == "u"
    srgb = encoding == "srgb" or (encoding == "auto" and whole)
    if whole:
        steps = np.arange(np.iinfo(values.dtype).max + 1)
        levels = steps / steps[-1]
        light = (linear(levels) if srgb else levels).astype(np.float32)[values]
    else:
        light = _sound(linear(values.astype(np.float64)) if srgb else values)
    return np.ascontiguousarray(np.broadcast_to(light, (*light.shape[:2], 3)))


def _check_size(width: int, height: int) -> None:
    if width * height > MOST_PIXELS:
        raise UserError(f"has {width} x {height} pixels; visray reads up to {MOST_PIXELS}, such as 16384 x 16384")


def _decoded(kind: type, path: str) -> np.ndarray:
    """The numbers of a PNG or JPEG file, uint8 or uint16. Shape: (H, W, 1) or (H, W, 3).

    kind: Pillow's class of the format; `PIL.Image.open` has a limit on pixels of its own, for the whole process.
    """
    # Pillow warns of what does not change the colour: alpha that is lost, or an animation that is none.
    with warnings.catch_warnings(action="ignore"):
        with kind(path) as image:
            _check_size(*image.size)
            mode = image.tile[0].args
            upper = _unpacked(image)
        if mode not in LOWER_BYTE:
            return upper
        mode, channels = LOWER_BYTE[mode]
        with kind(path) as image:
            image.tile = [tile._replace(args=mode) for tile in image.tile]
            lower = _unpacked(image)
    return upper[..., :channels] * np.uint16(256) + lower[..., :channels]


def _unpacked(image: PngImageFile | JpegImageFile) -> np.ndarray:
    return np.asarray(image)[..., None] if image.mode == "I;16" else np.asarray(image.convert("RGB"))


def _exr(path: str) -> np.ndarray:
    """The colour in an EXR file, float32. Shape: (H, W, 1) or (H, W, 3)."""
    _check_header(path)
    layers, _ = read_exr(path)
    alpha = layers.pop("A", None)
    values = layers.get("RGB", next(iter(layers.values())) if len(layers) == 1 else None)
    if values is None:
        raise UserError(f"has no layer RGB but {', '.join(layers) or 'A'}; save the colour as R, G and B")
    values = values[..., None] if values.ndim == 2 else values
    if values.shape[2] == 4:
        values, alpha = values[..., :3], values[..., 3]
    if values.shape[2] not in (1, 3):
        raise UserError(f"has {values.shape[2]} numbers a pixel; save the colour as R, G and B")
    if alpha is not None:
        partly = (alpha > 0) & (alpha < 1)
        # What this makes infinite is refused with what was so in the file.
        with np.errstate(over="ignore", invalid="ignore"):
            values = values / np.where(partly, alpha, 1)[..., None]
    return values.astype(np.float32)


def _check_header(path: str) -> None:
    """Returns if an EXR file states one part and a size within bounds; no pixel is decoded.

    What else the header holds is for the reader to judge, which opens the file next.
    """
    with open(path, "rb") as file:
        # Bit 12 of the version says that there are several parts.
        if file.read(8)[5] & 0x10:
            raise UserError("has several parts; save the picture as a file of one")
        # An attribute: its name and its type, each with a 0 behind, the size of its value, and the value.
        while name := _word(file):
            _word(file)
            size = int.from_bytes(file.read(4), "little")
            if name == b"dataWindow":
                left, top, right, bottom = struct.unpack("<4i", file.read(16))
                return _check_size(right - left + 1, bottom - top + 1)
            file.seek(size, os.SEEK_CUR)
    raise UserError("is damaged: its header states no size; save it anew")


def _word(file: BinaryIO) -> bytes:
    """The bytes up to the next 0 or the end of the file, or more than a name may have."""
    found = b""
    while len(found) <= LONGEST_NAME and (byte := file.read(1)) not in (b"\0", b""):
        found += byte
    return found


def _sound(light: np.ndarray) -> np.ndarray:
    """Light as float32, without what is negative; refused where it is not finite or too bright. Shape: (H, W, C)."""
    bad = ~(light <= BRIGHTEST) | np.isneginf(light)
    if bad.any():
        y, x, channel = np.argwhere(bad)[0]
        value = f"{light[y, x, channel]:g}"
        raise UserError(f"is {value} at pixel (x {x}, y {y}); a colour is a number from 0 to {BRIGHTEST:g}")
    return np.maximum(light, 0).astype(np.float32)


# By the first bytes of a file.
READERS = {
    b"\x89PNG\r\n\x1a\n": partial(_decoded, PngImageFile),
    b"\xff\xd8\xff": partial(_decoded, JpegImageFile),
    b"v/1\x01": _exr,
}
