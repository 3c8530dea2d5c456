"""Reads image files as linear light: PNG and JPEG with Pillow, EXR and HDR (Radiance) with visray's own readers.

The format is determined by the first bytes of the file, not by its name.
"""

import json
import os
import stat
import warnings
from functools import partial
from pathlib import Path

import numpy as np
from PIL.JpegImagePlugin import JpegImageFile
from PIL.PngImagePlugin import PngImageFile

from visray.errors import UserError
from visray.images.radiance import MAGIC, read_hdr
from visray.images.rows import check_jpeg_rows, check_png_rows, check_size
from visray.output.curves import linear
from visray.output.exr import read_exr
from visray.output.exr_header import read_header
from visray.quantities import BRIGHTEST
from visray.scene.source import neighbour
from visray.terminal import printable

# Suffixes of image files. An error names no other files of a folder.
SUFFIXES = (".png", ".jpg", ".jpeg", ".exr", ".hdr")
# Largest number of bytes that the images in the cache take.
CACHE_BYTES = 2**30
# Pillow reads PNG files of 16-bit colour in one of the raw modes on the left, and keeps only the upper byte of each
# number. In the raw mode on the right it keeps the lower byte. The last number counts the channels that are used.
LOWER_BYTE = {"RGB;16B": ("RGB;16L", 3), "RGBA;16B": ("RGBA;16L", 3), "LA;16B": ("ARGB", 1)}

# Cache of images. Key: path, encoding and `whole`. Value: modification time and size of the file, and its image.
_cache: dict[tuple[str, str, bool], tuple[tuple[int, int], np.ndarray]] = {}


def read_image(file: str, encoding: str, address: str, whole: bool = False) -> np.ndarray:
    """Image of a file, in linear Rec. 709, as a read-only array of float32. Shape: (H, W, 3), the top row first.

    file: path of the file.
    encoding: encoding of the numbers in the file: `srgb`, `linear`, or `auto` (sRGB for PNG and JPEG, linear for EXR
        and HDR).
    address: address of the path in the scene, for error messages.
    whole: whether negative numbers are errors, pixels that are wrong are counted, and an EXR file that has a part of
        its picture is refused. Else negative numbers become 0.

    Grey becomes three equal numbers. Alpha is removed. In EXR files the colour is premultiplied by alpha, so here it is
    divided by alpha. An EXR file without R, G and B is read if it has only one layer. Embedded colour profiles and the
    EXIF orientation are ignored. A file that has not changed is not read again.

    Raises a UserError of one line, which begins with the address.
    """
    try:
        return _cached(file, encoding, whole)
    except UserError as error:
        # The name is shown in full, however long it is.
        shown, text = json.dumps(file, ensure_ascii=False), str(error).removeprefix(f"{file}: ")
        raise UserError(printable(f"{address} = {shown}: {text}")) from None


def _cached(path: str, encoding: str, whole: bool) -> np.ndarray:
    """Image of a file. It comes from the cache if the file has not changed since it was read."""
    status = _status(path)
    key, stamp = (os.path.abspath(path), encoding, whole), (status.st_mtime_ns, status.st_size)
    entry = _cache.pop(key, None)
    if entry is None or entry[0] != stamp:
        entry = stamp, _linear_light(path, encoding, whole)
        entry[1].flags.writeable = False
    # The cache is ordered by last use; the least recently used images are removed first.
    _cache[key] = entry
    while len(_cache) > 1 and sum(pixels.nbytes for _, pixels in _cache.values()) > CACHE_BYTES:
        del _cache[next(iter(_cache))]
    return entry[1]


def _status(path: str) -> os.stat_result:
    """Status of a file: its size and modification time. Raises UserError if it is not a regular file."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise UserError(f"there is no such file{neighbour(Path(path), SUFFIXES) or '; check the path'}") from None
    except (OSError, ValueError) as error:
        raise UserError(f"cannot be read ({_reason(error)}); check the path") from None
    if stat.S_ISDIR(status.st_mode):
        raise UserError("is a folder; give a file in it")
    # A pipe must not be opened: that would wait for a writer.
    if not stat.S_ISREG(status.st_mode):
        raise UserError("is not a regular file; give a PNG, JPEG, EXR or HDR file")
    return status


def _reason(error: Exception) -> str:
    """Text of an exception, or the name of its class if it has no text."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def _linear_light(path: str, encoding: str, whole: bool) -> np.ndarray:
    """Image of a file as linear light. Shape: (H, W, 3)."""
    try:
        with open(path, "rb") as file:
            head = file.read(8)
    except OSError as error:
        raise UserError(f"cannot be read ({_reason(error)}); check its permissions") from None
    if not head:
        raise UserError("is empty; save the picture anew")
    read = next((reader for magic, reader in READERS.items() if head.startswith(magic)), None)
    if read is None:
        raise UserError("is not a PNG, JPEG, EXR or HDR picture; save it as one of them")
    try:
        if whole and read is _exr:
            _check_windows(path)
        return _converted(read(path), encoding, whole)
    except UserError:
        raise
    except MemoryError:
        raise UserError("does not fit into memory; make the picture smaller") from None
    # For damaged files, decoders raise many types of exceptions: OSError, SyntaxError, ValueError, struct.error, ...
    except Exception as error:
        raise UserError(f"is damaged or has no pixels ({_reason(error)}); save it anew") from None


def _converted(values: np.ndarray, encoding: str, whole: bool) -> np.ndarray:
    """Linear light from the numbers of a file.

    values: unsigned integers or floats. whole: as in read_image.

    Shapes: values (H, W, 1) or (H, W, 3); result (H, W, 3).
    """
    is_integer = values.dtype.kind == "u"
    srgb = encoding == "srgb" or (encoding == "auto" and is_integer)
    if is_integer:
        codes = np.arange(np.iinfo(values.dtype).max + 1)
        levels = codes / codes[-1]
        light = (linear(levels) if srgb else levels).astype(np.float32)[values]
    else:
        light = _checked_light(linear(values.astype(np.float64)) if srgb else values, whole)
    return np.ascontiguousarray(np.broadcast_to(light, (*light.shape[:2], 3)))


def _decoded(kind: type, path: str) -> np.ndarray:
    """Numbers of a PNG or JPEG file, as an array of uint8 or uint16. Shape: (H, W, 1) or (H, W, 3).

    kind: Pillow's class for the file format. It is called directly, because `PIL.Image.open` has a limit on pixels that
        can only be changed for the whole process.
    """
    # Pillow's warnings are about lost alpha and invalid animations, not about the colour.
    with warnings.catch_warnings(action="ignore"):
        with kind(path) as image:
            check_size(*image.size)
            if kind is PngImageFile:
                check_png_rows(path)
            else:
                check_jpeg_rows(path, *image.size)
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
    """Numbers of an opened image: 16-bit grey, or 8-bit RGB. Shape: (H, W, 1) or (H, W, 3)."""
    return np.asarray(image)[..., None] if image.mode == "I;16" else np.asarray(image.convert("RGB"))


def _exr(path: str) -> np.ndarray:
    """Colour of an EXR file, as an array of float32. Shape: (H, W, 1) or (H, W, 3)."""
    header = read_header(path)
    if header is None:
        raise UserError("has several parts; save the picture as a file of one")
    check_size(header.width, header.height)
    layers, _ = read_exr(path)
    alpha = layers.pop("A", None)
    values = layers.get("RGB", next(iter(layers.values())) if len(layers) == 1 else None)
    if values is None or [*layers] == ["Z"]:
        raise UserError(f"has no layer RGB but {', '.join(layers) or 'A'}; save the colour as R, G and B")
    values = values[..., None] if values.ndim == 2 else values
    if values.shape[2] == 4:
        values, alpha = values[..., :3], values[..., 3]
    if values.shape[2] not in (1, 3):
        raise UserError(f"has {values.shape[2]} numbers a pixel; save the colour as R, G and B")
    if alpha is not None:
        translucent = (alpha > 0) & (alpha < 1)
        # A quotient may overflow to infinity. Infinite numbers are refused later.
        with np.errstate(over="ignore", invalid="ignore"):
            values = values / np.where(translucent, alpha, 1)[..., None]
    return values.astype(np.float32)


def _check_windows(path: str) -> None:
    """Raises UserError if the pixels of an EXR file are another rectangle than its picture."""
    header = read_header(path)
    if header is not None and header.data != header.display:
        data, display = (f"[{', '.join(map(str, window))}]" for window in (header.data, header.display))
        raise UserError(f"has the data window {data} in the display window {display}; save the whole picture")


def _checked_light(light: np.ndarray, whole: bool) -> np.ndarray:
    """Light as float32, with 0 in place of negative numbers. Raises UserError if a number is not finite or too large.
    Shape: (H, W, C). whole: as in read_image."""
    invalid = ~((light >= 0) & (light <= BRIGHTEST)) if whole else ~(light <= BRIGHTEST) | np.isneginf(light)
    if invalid.any():
        y, x, channel = np.argwhere(invalid)[0]
        others = int(invalid.any(2).sum()) - 1 if whole else 0
        more = f" and wrong at {others} more" if others else ""
        value = f"{light[y, x, channel]:g} at pixel (x {x}, y {y}){more}"
        raise UserError(f"is {value}; a colour is a number from 0 to {BRIGHTEST:g}")
    return np.maximum(light, 0).astype(np.float32)


# For the first bytes of a file, the function that reads its numbers.
READERS = {
    b"\x89PNG\r\n\x1a\n": partial(_decoded, PngImageFile),
    b"\xff\xd8\xff": partial(_decoded, JpegImageFile),
    b"v/1\x01": _exr,
    MAGIC: read_hdr,
}
