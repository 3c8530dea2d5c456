"""EXR files as compositors expect them: one part, scan lines, ZIP compression, mixed half and float channels.

A channel is one named array of numbers in a file, such as N.X; a layer is one or more channels. The names and types of
the channels are in the records of visray/output/layers.py. Other layers have no record.
"""

import os
import re
import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np
import OpenEXR

from visray.errors import RangeWarning, UserError
from visray.output.exr_header import check_header
from visray.output.files import replacing
from visray.output.layers import BY_NAME, LAYERS
from visray.output.silence import silenced

PREFIX = "visray/"
# Attributes whose names have a meaning in OpenEXR or other renderers. They are written without the prefix.
STANDARD = {"software": str, "capDate": str, "utcOffset": float, "owner": str, "comments": str}
MATRICES = ("worldToCamera", "worldToNDC")
# The colour space: linear light with the primaries and the white of Rec. 709. `chromaticities` is for programs that use
# an OpenEXR older than 3.4.
COLOR = {
    "chromaticities": (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290),
    "colorInteropID": "lin_rec709_scene",
}
# Channel letters of a layer that has no record. Key: how many numbers a pixel has.
LETTERS = {1: "X", 2: "UV", 3: "RGB", 4: "RGBA"}
LARGEST_HALF = 65504.0
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)?")
_RECORDED = {channel for layer in LAYERS for channel in layer.channels}
_ORDER = {letter: place for place, letter in enumerate("RGBAXYZWUV")}


def write_exr(
    path: str | os.PathLike[str], layers: dict[str, np.ndarray], facts: dict[str, Any], float32: bool = False
) -> None:
    """Writes layers and metadata to a file. Values in channels of type half are clamped to the range of half, with a
    RangeWarning.

    layers: arrays by name. facts: metadata by key.
    float32: whether all channels that would be half are float.
    """
    channels: dict[str, np.ndarray] = {}
    for name, values in layers.items():
        dtype = BY_NAME[name].dtype if name in BY_NAME else None
        if dtype == "float16" and not float32:
            _warn_of_clamping(path, name, values, "error" in facts)
        channels |= _channels(name, values, "float32" if dtype == "float16" and float32 else dtype)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | COLOR | _attributes(facts)
    header |= windows_of(facts, next(iter(channels.values())).shape)
    # OpenEXR gets an open file, not a name, because then a full disk raises an OSError with an error number.
    with replacing(path) as temporary, open(temporary, "wb") as file:
        OpenEXR.File(header, channels).write(file)


def read_exr(path: str | os.PathLike[str]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Reads layers and metadata, two dicts, from a file of one part. It may be written by visray or another program.

    Numbers of type half become float32. Colours are not converted, whatever colour space the file states.
    """
    path = os.fspath(path)
    if not os.path.isfile(path):
        raise UserError(f"{path}: there is no such file; check the path")
    if not OpenEXR.isOpenExrFile(path):
        raise UserError(f"{path}: this is not an EXR file; give one")
    try:
        check_header(path)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    try:
        # By default OpenEXR joins R, G and B into one array, but not the channels of other layers.
        with silenced():
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


def read_facts(path: str | os.PathLike[str]) -> tuple[dict[str, Any], set[str]]:
    """The metadata of an EXR file, and the names of its channels. No pixels are read. Raises UserError if the file is
    damaged or is none."""
    path = os.fspath(path)
    try:
        check_header(path)
        header = OpenEXR.File(path, header_only=True).header()
    except (UserError, RuntimeError, ValueError) as error:
        raise UserError(f"{path}: the EXR file cannot be read ({error}); write it anew") from error
    return _metadata(header), {channel.name for channel in header["channels"]}


def _warn_of_clamping(path: str | os.PathLike[str], name: str, values: np.ndarray, error_stated: bool) -> None:
    """Warns if numbers of a layer are beyond the range of half. Shapes: values (H, W) or (H, W, n).

    error_stated: whether the error of the picture is in the file; it does not count what is clamped
    """
    sizes = np.abs(values).reshape(*values.shape[:2], -1).max(2)
    count = int((sizes > LARGEST_HALF).sum())
    if count:
        pixels = f"{count} pixel{'s' * (count > 1)} of {name} {'are' if count > 1 else 'is'}"
        problem = f"{pixels} beyond {LARGEST_HALF:g}, the largest half float, and clamped to it; the largest is"
        advice = "write float colours: --float, or write(..., float32=True)"
        beside = "; the error that is stated leaves this out" if error_stated else ""
        text = f"{os.fspath(path)}: {problem} {float(sizes.max()):.6g}{beside}; {advice}"
        warnings.warn(text, RangeWarning, stacklevel=5)


def _channels(name: str, values: np.ndarray, dtype: str | None) -> dict[str, np.ndarray]:
    """Dict of the channels of one layer by name, in the types in which they are written.

    name: name of the layer.
    dtype: type of its numbers in the file; None: uint32 or float, as the values are.

    Shapes: values (H, W) or (H, W, n).
    """
    if not _NAME.fullmatch(name):
        raise UserError(f"image: layer '{name}' cannot be written as EXR; use letters, digits and _, a letter first")
    flat = values[..., None] if values.ndim == 2 else values
    by_size = tuple(f"{name}.{letter}" for letter in LETTERS.get(flat.shape[2], ""))
    names = BY_NAME[name].channels if name in BY_NAME else by_size
    if len(names) != flat.shape[2]:
        right = f"{len(names)}" if names else "1 to 4"
        raise UserError(f"image: layer '{name}' has {flat.shape[2]} numbers a pixel; an EXR file takes {right}")
    return {channel: _typed(name, flat[..., i], dtype) for i, channel in enumerate(names)}


def _typed(name: str, values: np.ndarray, dtype: str | None) -> np.ndarray:
    """The values in the type in which they are written. name, dtype: as in _channels."""
    if dtype == "uint32" or values.dtype == np.uint32:
        if not np.issubdtype(values.dtype, np.integer) or (values.astype(np.uint32) != values).any():
            raise UserError(f"image: layer '{name}' must hold whole numbers from 0 to {2**32 - 1}")
        return np.ascontiguousarray(values, np.uint32)
    if dtype == "float16":
        return np.clip(values, -LARGEST_HALF, LARGEST_HALF).astype(np.float16)
    # A double beyond the range of float becomes inf, because in data a wrong finite number would be worse.
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values, np.float32)


def windows_of(facts: dict[str, Any], shape: tuple[int, ...]) -> dict[str, Any]:
    """The windows of a part of a picture, as a dict of attributes; empty for a whole picture. The display window is
    the whole picture, and the data window the part that the file has.

    facts: metadata, with `region` and `whole` if the picture is a part. shape: height and width of the part
    """
    try:
        left, top, right, bottom = map(int, facts["region"].split())
        width, height = map(int, facts["whole"].split())
    except (KeyError, AttributeError, ValueError):
        return {}
    if (bottom - top, right - left) != tuple(shape):
        return {}
    data, whole = ((left, top), (right - 1, bottom - 1)), ((0, 0), (width - 1, height - 1))
    return {
        name: tuple(np.array(corner, np.int32) for corner in window)
        for name, window in (("dataWindow", data), ("displayWindow", whole))
    }


def _part(header: dict[str, Any]) -> dict[str, str]:
    """The facts `region` and `whole` of a file whose data window is not its display window: the inverse of windows_of.
    Empty for other files."""
    (data_low, data_high), (low, high) = (
        [np.array(corner, int) for corner in header[name]] for name in ("dataWindow", "displayWindow")
    )
    if (data_low == low).all() and (data_high == high).all():
        return {}
    edges, size = (*(data_low - low), *(data_high - low + 1)), high - low + 1
    return {"region": " ".join(map(str, edges)), "whole": " ".join(map(str, size))}


def _attributes(facts: dict[str, Any]) -> dict[str, Any]:
    """Metadata as EXR attributes. Empty lists are left out, because OpenEXR cannot write them."""
    attributes: dict[str, Any] = {}
    if "render_seconds" in facts:
        attributes["renderTime"] = float(facts["render_seconds"])
    for key, value in facts.items():
        if key in MATRICES:
            attributes[key] = np.array(value, np.float32)
            if attributes[key].shape != (4, 4):
                raise UserError(f"image: metadata '{key}' must be a 4 x 4 matrix, not {attributes[key].shape}")
        elif value not in ([], ()):
            attributes[key if key in STANDARD else PREFIX + key] = STANDARD.get(key, _attribute)(value)
    return attributes


def _attribute(value: Any) -> Any:
    """The value in a form that OpenEXR stores exactly. A number that its 32-bit types would change becomes text."""
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
    """Whether a float that is written as float32 is the same when `_value` reads it. This is so if the float is the
    shortest decimal number of its float32, or is not finite."""
    with np.errstate(over="ignore"):
        return not np.isfinite(value) or float(str(np.float32(value))) == value


def _metadata(header: dict[str, Any]) -> dict[str, Any]:
    """Metadata from the header of a file: the inverse of `_attributes`. Matrices become lists. Attributes of other
    programs are left out."""
    facts = {}
    for key, value in header.items():
        if key in MATRICES and isinstance(value, np.ndarray):
            facts[key] = value.tolist()
        elif key in STANDARD:
            facts[key] = value
        elif key.startswith(PREFIX):
            facts[key.removeprefix(PREFIX)] = _value(value)
    return facts | _part(header)


def _value(attribute: Any) -> Any:
    """The value that an attribute stores: the inverse of `_attribute`. A float becomes the shortest decimal number of
    its float32."""
    if isinstance(attribute, float):
        return float(str(np.float32(attribute)))
    return _number(attribute) if isinstance(attribute, str) else attribute


def _number(text: str) -> Any:
    """The number that `_attribute` wrote as a text. If `_attribute` writes no number as this text, the text itself."""
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        if repr(number) == text and _attribute(number) == text:
            return number
    return text


def _layers(pixels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Dict of the layers that a file's channels make up. First come the layers with a record, in the order of the
    records. The remaining channels are grouped by prefix (_prefix), one layer for each.

    If a file has more channels of a prefix than the record, such as albedo.A, they all make up another layer, and the
    record is not used.

    pixels: channels by name.
    """
    rest = dict(pixels)
    foreign = {_prefix(name) for name in set(pixels) - _RECORDED if "." in name}
    layers = {}
    for layer in LAYERS:
        if all(name in rest and _prefix(name) not in foreign for name in layer.channels):
            layers[layer.name] = _stack(rest.pop(name) for name in layer.channels)
    groups: dict[str, list[str]] = {}
    for name in rest:
        groups.setdefault(_prefix(name), []).append(name)
    for prefix, names in groups.items():
        names.sort(key=lambda name: (_ORDER.get(name.rpartition(".")[2], len(_ORDER)), name))
        layers[prefix] = _stack(rest[name] for name in names)
    return layers


def _prefix(channel: str) -> str:
    """The part of a channel's name before the last dot, or the whole name if it has no dot."""
    return channel.rpartition(".")[0] or channel


def _stack(channels: Iterable[np.ndarray]) -> np.ndarray:
    """The array of a layer of n channels. Numbers of type half become float32.

    Shapes: channels (H, W) each; result (H, W) for one channel, else (H, W, n).
    """
    arrays = [values.astype(np.float32) if values.dtype == np.float16 else values for values in channels]
    return arrays[0] if len(arrays) == 1 else np.stack(arrays, axis=-1)
