"""EXR files as compositors expect them: one part, scan lines, ZIP, mixed half and float.

`R G B A` and the albedo are half; depth, positions, normals, UV and variances are float; ids are uint32. The names
follow what Nuke and Blender make of them: at most two dots, no leading digit, and root `Z` without root X and Y.
"""

import os
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import OpenEXR

from visray.errors import UserError
from visray.output.files import replacing

PREFIX = "visray/"
# Attributes that OpenEXR or other renderers have given a meaning; they stand without the prefix.
STANDARD = {"software": str, "capDate": str, "utcOffset": float, "owner": str, "comments": str}
MATRICES = ("worldToCamera", "worldToNDC")
# Linear light with the primaries and the white of Rec. 709; the numbers are for readers older than OpenEXR 3.4.
COLOR = {
    "chromaticities": (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290),
    "colorInteropID": "lin_rec709_scene",
}
# layer: the channels it becomes. A layer that is not here becomes <layer>.<one of BY_SIZE>.
CHANNELS = {
    "RGB": ("R", "G", "B"),
    "A": ("A",),
    "Z": ("Z",),
    "distance": ("dist.Z",),
    "N": ("N.X", "N.Y", "N.Z"),
    "P": ("P.X", "P.Y", "P.Z"),
    "id": ("id.object",),
    "samples": ("samples.count",),
    "unresolved": ("proof.unresolved",),
    "residual": ("proof.residual",),
}
BY_SIZE = {1: "X", 2: "UV", 3: "RGB", 4: "RGBA"}
HALF = ("RGB", "A", "albedo")
LARGEST_HALF = 65504.0
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)?")
_ORDER = {letter: place for place, letter in enumerate("RGBAXYZWUV")}


def write_exr(path: str | os.PathLike[str], layers: dict[str, np.ndarray], facts: dict[str, Any]) -> None:
    """Writes layers and metadata. Colour beyond the range of half is written as its largest number."""
    channels: dict[str, np.ndarray] = {}
    for name, values in layers.items():
        channels |= _channels(name, values)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | COLOR | _attributes(facts)
    # Through Python's file and not by name: then a full disk is an OSError with its number.
    with replacing(path) as temporary, open(temporary, "wb") as file:
        OpenEXR.File(header, channels).write(file)


def read_exr(path: str | os.PathLike[str]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Layers and metadata of a file with one part, of visray or of another program: half becomes float32.

    The colour is taken as it is, whatever colour space the file states.
    """
    path = os.fspath(path)
    if not os.path.isfile(path):
        raise UserError(f"{path}: there is no such file; check the path")
    if not OpenEXR.isOpenExrFile(path):
        raise UserError(f"{path}: this is not an EXR file; give one")
    try:
        # Without this, OpenEXR would group R, G and B, but leave all other layers apart.
        file = OpenEXR.File(path, separate_channels=True)
    except (RuntimeError, ValueError) as error:
        raise UserError(f"{path}: the EXR file cannot be read ({error}); write it anew") from error
    if len(file.parts) != 1:
        count = len(file.parts)
        raise UserError(f"{path}: the EXR file is damaged or has {count} parts; visray reads whole files of one part")
    pixels = {name: channel.pixels for name, channel in file.channels().items()}
    if any(values is None or values.ndim != 2 or values.dtype == object for values in pixels.values()):
        raise UserError(f"{path}: the EXR file holds deep samples; visray reads flat ones")
    return _layers(pixels), _metadata(file.header())


def _channels(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """The channels of one layer, in the type in which they are written."""
    if not _NAME.fullmatch(name):
        raise UserError(f"image: layer '{name}' cannot be written as EXR; use letters, digits and _, a letter first")
    flat = values[..., None] if values.ndim == 2 else values
    names = CHANNELS.get(name) or tuple(f"{name}.{letter}" for letter in BY_SIZE.get(flat.shape[2], ""))
    if len(names) != flat.shape[2]:
        right = f"{len(names)}" if names else "1 to 4"
        raise UserError(f"image: layer '{name}' has {flat.shape[2]} numbers a pixel; an EXR file takes {right}")
    return {channel: _typed(name, flat[..., i]) for i, channel in enumerate(names)}


def _typed(name: str, values: np.ndarray) -> np.ndarray:
    if name in ("id", "unresolved") or values.dtype == np.uint32:
        if not np.issubdtype(values.dtype, np.integer) or (values.astype(np.uint32) != values).any():
            raise UserError(f"image: layer '{name}' must hold whole numbers from 0 to {2**32 - 1}")
        return np.ascontiguousarray(values, np.uint32)
    if name in HALF:
        return np.clip(values, -LARGEST_HALF, LARGEST_HALF).astype(np.float16)
    # A double beyond the range of float is written as infinite: for data, a wrong finite number would be worse.
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values, np.float32)


def _attributes(facts: dict[str, Any]) -> dict[str, Any]:
    """The metadata as attributes; an empty list of texts is left out, as OpenEXR has none."""
    found: dict[str, Any] = {}
    if "render_seconds" in facts:
        found["renderTime"] = float(facts["render_seconds"])
    for key, value in facts.items():
        if key in MATRICES:
            found[key] = np.array(value, np.float32)
            if found[key].shape != (4, 4):
                raise UserError(f"image: metadata '{key}' must be a 4 x 4 matrix, not {found[key].shape}")
        elif value not in ([], ()):
            found[key if key in STANDARD else PREFIX + key] = STANDARD.get(key, _attribute)(value)
    return found


def _attribute(value: Any) -> Any:
    """A value that OpenEXR keeps exactly: a number that its 32-bit types would change is written as text."""
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, int):
        return value if -(2**31) <= value < 2**31 else str(value)
    if isinstance(value, float):
        return value if _survives(value) else repr(value)
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple) and all(isinstance(item, str) for item in value):
        return list(value)
    raise UserError(f"image: metadata {value!r} cannot be written; give str, int, float or list of str")


def _survives(value: float) -> bool:
    """Whether `value` is the shortest decimal of its float32, or not finite: then it is read back as it was."""
    with np.errstate(over="ignore"):
        return not np.isfinite(value) or float(str(np.float32(value))) == value


def _metadata(header: dict[str, Any]) -> dict[str, Any]:
    """What `_attributes` wrote, undone; matrices come back as lists, and other programs' attributes are left out."""
    found = {}
    for key, value in header.items():
        if key in MATRICES and isinstance(value, np.ndarray):
            found[key] = value.tolist()
        elif key in STANDARD:
            found[key] = value
        elif key.startswith(PREFIX):
            found[key.removeprefix(PREFIX)] = _undone(value)
    return found


def _undone(value: Any) -> Any:
    """An attribute as `_attribute` got it: floats in the shortest decimals of their float32, texts of numbers read."""
    if isinstance(value, float):
        return float(str(np.float32(value)))
    return _number(value) if isinstance(value, str) else value


def _number(text: str) -> Any:
    """The number that `_attribute` had to write as text, or the text itself."""
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        if repr(number) == text and _attribute(number) == text:
            return number
    return text


def _layers(pixels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The layers of the channels, in the order in which visray has them."""
    left = dict(pixels)
    found = {}
    for layer, names in CHANNELS.items():
        if all(name in left for name in names):
            found[layer] = _stack(left.pop(name) for name in names)
    groups: dict[str, list[str]] = {}
    for name in left:
        groups.setdefault(name.rpartition(".")[0] or name, []).append(name)
    for layer, names in groups.items():
        names.sort(key=lambda name: (_ORDER.get(name.rpartition(".")[2], len(_ORDER)), name))
        found[layer] = _stack(left[name] for name in names)
    return found


def _stack(channels: Iterable[np.ndarray]) -> np.ndarray:
    wide = [values.astype(np.float32) if values.dtype == np.float16 else values for values in channels]
    return wide[0] if len(wide) == 1 else np.stack(wide, axis=-1)
