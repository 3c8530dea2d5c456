"""Textures: what is read from picture files, what is refused, and what a lookup finds, against the same in NumPy."""

import math
import os
import struct
import warnings
import zlib
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image as Pillow
from samples import NAMES, SAMPLES, Lineup, aimed, array

from visray import memory
from visray.camera import Camera, OrthographicCamera
from visray.errors import UserError
from visray.gradients import derivative
from visray.images import atlas as packing
from visray.images import pack, read_image, reading
from visray.images.lookup import colour
from visray.materials import Material
from visray.output import exr
from visray.output.exr import read_exr
from visray.output.exr_header import read_header
from visray.primitives import Ellipsoid, Rectangle, Sphere
from visray.primitives.instance import Instance
from visray.quantities import Arrays
from visray.renderer import render
from visray.scene.scene import Film, Scene, Settings
from visray.textures import CheckerTexture, ImageTexture, row_number

ADDRESS = "textures.globe.file"
A = Arrays.of("llvm", "single")
DOUBLE = Arrays.of("llvm", "double")
WRAPS = ("repeat", "clamp", "mirror")
PAIRS = (("repeat", "clamp"), ("clamp", "mirror"), ("mirror", "repeat"))
FILTERS = ("nearest", "bilinear")
ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def read(path: Path, encoding: str = "auto") -> np.ndarray:
    found = read_image(str(path), encoding, ADDRESS)
    assert found.dtype == np.float32 and found.ndim == 3 and found.shape[2] == 3
    return found


def refused(path: Any) -> str:
    """What is said of a file, after its address and name."""
    with pytest.raises(UserError) as caught:
        read_image(str(path), "auto", ADDRESS)
    text = str(caught.value)
    assert len(caught.value.lines) == 1 and "\n" not in text
    assert text.startswith(f'{ADDRESS} = "')
    said = text.split('": ', 1)[1]
    assert str(path) not in said
    return said


def some(*shape: int, kind: type = np.uint8) -> np.ndarray:
    return np.random.default_rng(len(shape)).integers(0, np.iinfo(kind).max + 1, shape, kind)


def write_exr(path: Path, compression: Any = OpenEXR.ZIP_COMPRESSION, **channels: np.ndarray) -> Path:
    OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, channels).write(str(path))
    return path


def srgb(c: np.ndarray) -> np.ndarray:
    """Linear light of sRGB fractions, in 80 bits."""
    c = np.asarray(c, np.longdouble)
    return np.where(
        c > np.longdouble("0.04045"), ((c + np.longdouble("0.055")) / np.longdouble("1.055")) ** 2.4, c / 12.92
    )


# PNG and JPEG


def test_all_levels_of_srgb_are_decoded_to_the_nearest_float(tmp_path) -> None:
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    for name, picture in (("grey.png", levels), ("colour.png", np.stack([levels, levels.T, 255 - levels], -1))):
        Pillow.fromarray(picture).save(tmp_path / name)
        fraction = np.atleast_3d(picture) * np.ones(3, np.longdouble) / 255
        lit = fraction > 0
        for encoding, right in (("auto", srgb(fraction)), ("srgb", srgb(fraction)), ("linear", fraction)):
            found = read(tmp_path / name, encoding)
            # Half a unit in the last place of float32, and what double adds before it.
            assert np.abs(found[lit] / right[lit] - 1).max() < 2.0**-23.99
            assert (found[~lit] == 0).all() and (found[fraction == 1] == 1).all()


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def filtered(rows: np.ndarray, pixel: int) -> bytes:
    """The rows of a PNG file, each by another of its five filters. Shapes: (H, bytes)."""
    found, above = b"", np.zeros(rows.shape[1], int)
    for number, row in enumerate(rows.astype(int)):
        left = np.concatenate([np.zeros(pixel, int), row[:-pixel]])
        corner = np.concatenate([np.zeros(pixel, int), above[:-pixel]])
        guess = left + above - corner
        far = np.stack([abs(guess - left), abs(guess - above), abs(guess - corner)])
        paeth = np.stack([left, above, corner])[far.argmin(0), np.arange(len(row))]
        base = (0 * row, left, above, (left + above) // 2, paeth)[number % 5]
        found += bytes([number % 5]) + ((row - base) % 256).astype(np.uint8).tobytes()
        above = row
    return found


def png(values: np.ndarray, interlaced: bool = False) -> bytes:
    """A PNG file of 16 bits: Pillow writes none in colour. Shape: (H, W, C), C: grey, grey + A, RGB, RGBA."""
    h, w, channels = values.shape
    passes = [(0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1)]
    data = b""
    for top, left, down, right in passes if interlaced else [(0, 0, 1, 1)]:
        part = values[top::down, left::right]
        if part.size:
            data += filtered(part.astype(">u2").reshape(len(part), -1).view(np.uint8), 2 * channels)
    header = struct.pack(">IIBBBBB", w, h, 16, {1: 0, 2: 4, 3: 2, 4: 6}[channels], 0, 0, interlaced)
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(data)), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png_files_of_16_bits_keep_all_of_them(tmp_path, channels: int, interlaced: bool) -> None:
    values = some(11, 9, channels, kind=np.uint16)
    (tmp_path / "a.png").write_bytes(png(values, interlaced))
    own = values[..., : 1 if channels < 3 else 3] * np.ones(3)
    assert np.abs(read(tmp_path / "a.png", "linear") * 65535 - own).max() < 0.01
    assert np.abs(read(tmp_path / "a.png") - srgb(own / 65535)).max() < 2.0**-24


def test_alpha_is_left_out_of_png_files_whatever_way_they_hold_it(tmp_path) -> None:
    picture = some(6, 5, 4)
    Pillow.fromarray(picture).save(tmp_path / "rgba.png")
    assert np.abs(read(tmp_path / "rgba.png", "linear") * 255 - picture[..., :3]).max() < 1e-4
    Pillow.fromarray(picture[..., :2].copy()).save(tmp_path / "la.png")
    assert np.abs(read(tmp_path / "la.png", "linear") * 255 - picture[..., :1]).max() < 1e-4
    paletted = Pillow.frombytes("P", (5, 6), (picture[..., 0] % 4).tobytes())
    paletted.putpalette([10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120])
    paletted.save(tmp_path / "p.png", transparency=bytes([0, 128, 255, 7]))
    own = 10 + 30 * (picture[..., :1] % 4) + np.array([0, 10, 20])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.abs(read(tmp_path / "p.png", "linear") * 255 - own).max() < 1e-4
    for name, image, hidden in (
        ("k.png", picture[..., :3], tuple(picture[0, 0, :3].tolist())),
        ("l.png", picture[..., 0], 77),
    ):
        Pillow.fromarray(image.copy()).save(tmp_path / name, transparency=hidden)
        assert np.abs(read(tmp_path / name, "linear") * 255 - np.atleast_3d(image)).max() < 1e-4


def test_a_png_file_of_one_bit_is_black_and_white(tmp_path) -> None:
    bits = some(5, 13, 1) % 2
    Pillow.fromarray(bits[..., 0] * np.uint8(255)).convert("1").save(tmp_path / "a.png")
    assert (read(tmp_path / "a.png") == bits).all()


def test_a_jpeg_file_is_read_within_its_loss(tmp_path) -> None:
    """Of a smooth picture at quality 95, no number is off by more than a few of 255 levels."""
    x, y = np.meshgrid(np.linspace(0, 200, 64), np.linspace(20, 220, 48))
    smooth = np.stack([x, y, 255 - y], -1).round().astype(np.uint8)
    for progressive in (False, True):
        Pillow.fromarray(smooth).save(tmp_path / "a.jpg", quality=95, subsampling=0, progressive=progressive)
        assert np.abs(read(tmp_path / "a.jpg", "linear") * 255 - smooth).max() < 5
    assert np.abs(read(tmp_path / "a.jpg") - srgb(smooth / 255)).max() < 5 / 255 * 2.4
    Pillow.fromarray(smooth[..., 0].copy()).save(tmp_path / "g.jpeg", quality=95)
    assert np.abs(read(tmp_path / "g.jpeg", "linear") * 255 - smooth[..., :1]).max() < 5
    Pillow.fromarray(smooth).convert("CMYK").save(tmp_path / "c.jpg", quality=95, subsampling=0)
    assert np.abs(read(tmp_path / "c.jpg", "linear") * 255 - smooth).max() < 8


def test_what_a_file_is_its_bytes_say_and_not_its_name(tmp_path) -> None:
    picture = some(4, 3, 3)
    Pillow.fromarray(picture).save(tmp_path / "a.exr", "PNG")
    assert np.abs(read(tmp_path / "a.exr", "linear") * 255 - picture).max() < 1e-4
    write_exr(tmp_path / "b.png", **{c: np.full((2, 2), 0.25, np.float32) for c in "RGB"})
    assert (read(tmp_path / "b.png") == 0.25).all()


# EXR


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_an_exr_file_is_exact_and_linear(tmp_path, kind: type) -> None:
    rng = np.random.default_rng(4)
    channels = {c: rng.exponential(10, (7, 5)).astype(kind) for c in "RGB"}
    own = np.stack([channels[c] for c in "RGB"], -1).astype(np.float32)
    path = write_exr(tmp_path / "a.exr", **channels)
    assert np.array_equal(read(path), own)
    assert np.array_equal(read(path, "linear"), own)
    assert np.abs(read(path, "srgb") / srgb(own) - 1).max() < 2.0**-22
    write_exr(path, A=np.ones((7, 5), kind), Z=np.zeros((7, 5), np.float32), **channels)
    assert np.array_equal(read(path), own)


def test_colour_weighted_with_alpha_is_divided_by_it(tmp_path) -> None:
    alpha = np.array([[0.5, 0.25, 1, 0, 2, -1]], np.float32)
    path = write_exr(tmp_path / "a.exr", A=alpha, **{c: np.full((1, 6), 0.5, np.float32) for c in "RGB"})
    assert read(path)[0].tolist() == [[x] * 3 for x in (1, 2, 0.5, 0.5, 0.5, 0.5)]
    four = {f"beauty.{c}": np.full((1, 6), 0.5, np.float32) for c in "RGB"} | {"beauty.A": alpha}
    assert np.array_equal(read(write_exr(tmp_path / "b.exr", **four)), read(path))


def test_an_only_layer_is_taken_for_the_colour(tmp_path) -> None:
    ramp = np.linspace(0, 2, 12, dtype=np.float32).reshape(3, 4)
    assert np.array_equal(read(write_exr(tmp_path / "y.exr", Y=ramp)), ramp[..., None] * np.ones(3, np.float32))
    layer = {f"albedo.{c}": ramp + i for i, c in enumerate("RGB")}
    assert np.array_equal(read(write_exr(tmp_path / "l.exr", **layer)), np.stack(list(layer.values()), -1))


def test_what_is_negative_becomes_0(tmp_path) -> None:
    values = np.array([[-1, -0.0, -1e38, 3]], np.float32)
    for encoding in ("linear", "srgb"):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = read(write_exr(tmp_path / "a.exr", Y=values), encoding)
        assert found[0, :3].tolist() == [[0, 0, 0]] * 3 and (found[0, 3] > 2.9).all()


# Reading once


def test_a_file_is_read_again_only_if_it_changed(tmp_path) -> None:
    path = tmp_path / "a.png"
    Pillow.fromarray(some(4, 4, 3)).save(path)
    first = read(path)
    assert read(path) is first and not first.flags.writeable
    assert read(path, "linear") is not first and read(path, "linear") is read(path, "linear")
    Pillow.fromarray(some(5, 4, 3)).save(path)
    assert read(path).shape == (5, 4, 3)
    again = read(path)
    os.utime(path, ns=(1, 1))
    assert read(path) is not again
    path.unlink()
    assert "no such file" in refused(path)


def test_the_pictures_used_longest_ago_are_forgotten_first(tmp_path, monkeypatch) -> None:
    for name in "abc":
        Pillow.fromarray(some(4, 4, 3)).save(tmp_path / f"{name}.png")
    a, b = read(tmp_path / "a.png"), read(tmp_path / "b.png")
    assert read(tmp_path / "a.png") is a
    monkeypatch.setattr(reading, "CACHE_BYTES", 2 * a.nbytes)
    read(tmp_path / "c.png")
    assert read(tmp_path / "a.png") is a and read(tmp_path / "b.png") is not b
    # One is always kept, however large.
    monkeypatch.setattr(reading, "CACHE_BYTES", 1)
    c = read(tmp_path / "c.png")
    assert read(tmp_path / "c.png") is c


# What is refused


def test_a_file_that_is_not_there_is_named_with_its_neighbour(tmp_path) -> None:
    Pillow.fromarray(some(4, 4, 3)).save(tmp_path / "globe.png")
    with pytest.raises(UserError) as caught:
        read_image(str(tmp_path / "glob.png"), "auto", ADDRESS)
    wrong, right = tmp_path / "glob.png", tmp_path / "globe.png"
    assert str(caught.value) == f"{ADDRESS} = \"{wrong}\": there is no such file; did you mean '{right}'?"
    assert refused(tmp_path / "nowhere" / "x.png").endswith("there is no such file; check the path")


def test_what_is_no_file_is_refused(tmp_path) -> None:
    assert refused(tmp_path) == "is a folder; give a file in it"
    (tmp_path / "a.png").write_bytes(b"")
    assert refused(tmp_path / "a.png") == "is empty; save the picture anew"
    with pytest.raises(UserError, match=r"cannot be read \(embedded null byte\); check the path"):
        read_image("a\0b.png", "auto", ADDRESS)


@pytest.mark.skipif(os.name != "posix", reason="pipes and messages of POSIX")
def test_what_posix_calls_no_file_is_refused(tmp_path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    assert refused(tmp_path / "pipe.png") == "is not a regular file; give a PNG, JPEG, EXR or HDR file"
    (tmp_path / "a.png").write_bytes(b"")
    assert refused(tmp_path / "a.png" / "b.png") == "cannot be read (Not a directory); check the path"
    assert refused("x" * 5000) == "cannot be read (File name too long); check the path"


@pytest.mark.skipif(ROOT, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_refused(tmp_path) -> None:
    (tmp_path / "a.png").write_bytes(b"x")
    (tmp_path / "a.png").chmod(0)
    assert refused(tmp_path / "a.png").startswith("cannot be read (Permission denied); ")


@pytest.mark.parametrize("content", [b"no picture", b"GIF89a", b"\x89PNG", b"\xff\xd8", b"v/1", b"II*\0"])
def test_what_is_no_picture_is_refused(tmp_path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    assert refused(tmp_path / "a.png") == "is not a PNG, JPEG, EXR or HDR picture; save it as one of them"


def encoded(kind: str, folder: Path) -> bytes:
    picture = some(40, 30, 3)
    if kind == "EXR":
        return write_exr(
            folder / "whole.exr", **{c: picture[..., i] / np.float32(255) for i, c in enumerate("RGB")}
        ).read_bytes()
    file = BytesIO()
    Pillow.fromarray(picture).save(file, kind)
    return file.getvalue()


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "EXR"])
def test_a_file_cut_off_anywhere_is_refused(tmp_path, kind: str) -> None:
    whole = encoded(kind, tmp_path)
    for length in [9, 12, 20, 25, 30, *np.linspace(40, len(whole) - 60, 20).astype(int)]:
        (tmp_path / f"a{length}").write_bytes(whole[:length])
        text = refused(tmp_path / f"a{length}")
        assert "damaged" in text and "; " in text


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "EXR"])
def test_a_damaged_file_gives_a_picture_or_an_error(tmp_path, kind: str) -> None:
    whole, rng = encoded(kind, tmp_path), np.random.default_rng(8)
    for number in range(100):
        data = bytearray(whole)
        for at in rng.integers(0, min(len(data), 400 if number % 2 else 10**9), 3):
            data[at] = rng.integers(256)
        path = tmp_path / f"a{number}"
        path.write_bytes(data)
        try:
            found = read(path)
        except UserError as error:
            assert len(error.lines) == 1 and "\n" not in str(error)
        else:
            assert np.isfinite(found).all() and (found >= 0).all()


def test_a_picture_without_pixels_is_refused(tmp_path) -> None:
    for size in ((0, 5), (5, 0)):
        header = struct.pack(">IIBBBBB", *size, 8, 2, 0, 0, 0)
        data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")
        (tmp_path / "a.png").write_bytes(data)
        assert refused(tmp_path / "a.png").startswith("is damaged or has no pixels (")


def resized(kind: str, data: bytes, width: int, height: int) -> bytes:
    """A file whose header states another size than its pixels have."""
    if kind == "PNG":
        rest = data[8 + 25 :]
        return data[:8] + chunk(b"IHDR", struct.pack(">II", width, height) + data[24:29]) + rest
    if kind == "JPEG":
        at = data.index(b"\xff\xc0") + 5
        return data[:at] + struct.pack(">HH", height, width) + data[at + 4 :]
    at = data.index(b"dataWindow\0box2i\0") + 21
    return data[:at] + struct.pack("<4i", 3, 4, width + 2, height + 3) + data[at + 16 :]


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "EXR"])
def test_a_picture_too_large_is_refused_by_its_header(tmp_path, kind: str) -> None:
    whole = encoded(kind, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for width, height in ((2**14 + 1, 2**14), (2**14, 2**14 + 1), (65535, 65535)):
            (tmp_path / "a").write_bytes(resized(kind, whole, width, height))
            said = f"has {width} x {height} pixels; visray reads up to 268435456, such as 16384 x 16384"
            assert refused(tmp_path / "a") == said


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "EXR"])
def test_a_picture_without_all_its_rows_is_refused_in_little_memory(tmp_path, monkeypatch, kind: str) -> None:
    """Its header states a size that nothing in the file fills. No decoder is asked: it would take memory for the size,
    and leave what is missing black."""

    def none(*_: Any, **__: Any) -> None:
        raise AssertionError("a decoder was asked")

    whole = encoded(kind, tmp_path)
    monkeypatch.setattr(reading, "_unpacked", none)
    monkeypatch.setattr(exr.OpenEXR, "File", none)
    for width, height in ((2**14, 2**14), (30, 2**14), (2**13, 2**14)):
        if kind == "JPEG" and width == 30:
            continue  # so few pixels could be in the file
        (tmp_path / "a").write_bytes(resized(kind, whole, width, height))
        said = refused(tmp_path / "a")
        assert said.startswith("is damaged: ") and said.endswith("; save it anew")


@pytest.mark.parametrize("interlaced", [False, True])
def test_a_png_file_whose_rows_end_early_is_refused(tmp_path, interlaced: bool) -> None:
    """Its compressed stream ends as a stream should, after some of the rows."""
    whole = png(some(20, 9, 3, kind=np.uint16), interlaced)
    at = whole.index(b"IDAT")
    size = struct.unpack(">I", whole[at - 4 : at])[0]
    rows = zlib.decompress(whole[at + 4 : at + 4 + size])
    for share in (0, 0.5, 0.99):
        part = zlib.compress(rows[: int(share * len(rows))])
        (tmp_path / "a.png").write_bytes(whole[: at - 4] + chunk(b"IDAT", part) + chunk(b"IEND", b""))
        assert refused(tmp_path / "a.png").startswith("is damaged: it lacks rows, only ")
    pieces = [chunk(b"IDAT", part) for part in (whole[at + 4 : at + 9], b"", whole[at + 9 : at + 4 + size])]
    (tmp_path / "b.png").write_bytes(whole[: at - 4] + b"".join(pieces) + chunk(b"IEND", b""))
    assert read(tmp_path / "b.png").shape == (20, 9, 3)


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"])
def test_an_exr_file_without_some_rows_is_refused(tmp_path, compression: str) -> None:
    """The table of its blocks says that some of them are not there, or the file ends before them."""
    planes = {c: np.random.default_rng(1).random((70, 30)).astype(np.float16) for c in "RGB"}
    path = write_exr(tmp_path / "a.exr", getattr(OpenEXR, f"{compression}_COMPRESSION"), **planes)
    header = read_header(path)
    assert (header.width, header.height, header.channels, header.missing) == (30, 70, 3, 0)
    read(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 40])
    assert "is damaged: " in refused(path)
    first = struct.pack("<Q", min(struct.unpack("<Q", whole[i : i + 8])[0] for i in [_table(whole)]))
    path.write_bytes(whole.replace(first, bytes(8), 1))
    assert refused(path) == "is damaged: 1 of its blocks of rows are missing; save it anew"
    with pytest.raises(UserError, match=f"^{path}: is damaged: 1 of its blocks"):
        read_exr(path)


def _table(whole: bytes) -> int:
    """Where the table of an EXR file's blocks begins: after the attribute of its type, and a zero byte."""
    at = whole.index(b"type\0string\0") + 12
    return at + 4 + struct.unpack("<I", whole[at : at + 4])[0] + 1


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "EXR"])
def test_a_picture_that_does_not_fit_into_memory_is_refused(tmp_path, monkeypatch, kind: str) -> None:
    (tmp_path / "a").write_bytes(encoded(kind, tmp_path))
    monkeypatch.setattr(memory, "free", lambda: memory.Free(40 * 30 * 48 - 1, "are left of the container's limit"))
    said = "has 30 x 40 pixels, which take about 0.0 GiB; 0.0 GiB are left of the container's limit; "
    assert refused(tmp_path / "a") == said + "make the picture smaller"
    monkeypatch.setattr(memory, "free", lambda: memory.Free(40 * 30 * 48, "are free"))
    read(tmp_path / "a")


def test_pillows_own_limit_on_pixels_does_not_count(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(Pillow, "MAX_IMAGE_PIXELS", 1)
    for name in ("a.png", "a.jpg"):
        Pillow.fromarray(some(9, 9, 3)).save(tmp_path / name)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert read(tmp_path / name).shape == (9, 9, 3)


def test_a_limit_on_memory_is_no_traceback(tmp_path, monkeypatch) -> None:
    def none(_: str) -> None:
        raise MemoryError

    monkeypatch.setattr(reading, "READERS", {b"\x89PNG": none})
    Pillow.fromarray(some(4, 4, 3)).save(tmp_path / "a.png")
    assert refused(tmp_path / "a.png") == "does not fit into memory; make the picture smaller"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1.001e9, 1e38])
def test_an_exr_file_with_what_is_no_colour_is_refused(tmp_path, value: float) -> None:
    values = np.ones((3, 4), np.float32)
    values[2, 1] = value
    path = write_exr(tmp_path / "a.exr", Y=values)
    assert refused(path) == f"is {np.float32(value):g} at pixel (x 1, y 2); a colour is a number from 0 to 1e+09"


def test_an_exr_file_without_a_colour_is_refused(tmp_path) -> None:
    plane = np.ones((3, 4), np.float32)
    cases = [
        ({"P.X": plane, "P.Y": plane, "P.Z": plane, "Z": plane}, "has no layer RGB but Z, P; "),
        ({"UV.U": plane, "UV.V": plane}, "has 2 numbers a pixel; "),
        ({"A": plane}, "has no layer RGB but A; "),
    ]
    for number, (channels, said) in enumerate(cases):
        assert refused(write_exr(tmp_path / f"a{number}.exr", **channels)).startswith(said)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [OpenEXR.Part(dict(header, name=n), {"Y": plane}) for n in "ab"]
    OpenEXR.File(parts).write(str(tmp_path / "two.exr"))
    assert refused(tmp_path / "two.exr") == "has several parts; save the picture as a file of one"


# Packing


def image_file(folder: Path, name: str, image: np.ndarray) -> str:
    """The name of an EXR file with an image, so that its numbers are exact. Shape: (H, W, 3)."""
    path = folder / f"{name}.exr"
    write_exr(path, **{c: np.ascontiguousarray(image[..., i], np.float32) for i, c in enumerate("RGB")})
    return str(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("textures")


def test_no_textures_no_atlas() -> None:
    assert pack(A, {}) is None
    only = pack(A, {"c": CheckerTexture(), "d": CheckerTexture()})
    assert only.texels is None and dr.width(only.rows.a) == 2


def test_texels_lie_row_by_row_from_the_bottom_and_an_image_is_held_once(folder) -> None:
    rng = np.random.default_rng(0)
    one, two = rng.random((2, 3, 3)).astype(np.float32), rng.random((4, 1, 3)).astype(np.float32)
    first, second = ImageTexture(file=image_file(folder, "one", one)), ImageTexture(file=image_file(folder, "two", two))
    found = pack(A, {"a": first, "b": second, "c": replace(first, wrap="mirror", scale=(2.0, 3.0))})
    texels = np.array(found.texels).reshape(-1, 4)
    assert np.array_equal(texels[:, :3], np.concatenate([one[::-1].reshape(-1, 3), two[::-1].reshape(-1, 3)]))
    assert (texels[:, 3] == 0).all()
    assert np.array(found.rows.start).tolist() == [0, 6, 0]
    assert np.array(found.rows.wrap_u).tolist() == np.array(found.rows.wrap_v).tolist() == [0, 0, 1]
    assert np.array(found.rows.scale_v).tolist() == [1, 1, 3]
    assert found.rows.a is None


def test_every_file_that_cannot_be_read_has_its_line(folder) -> None:
    textures = {name: ImageTexture(file=str(folder / f"{name}.png")) for name in ("x", "y")}
    with pytest.raises(UserError) as caught:
        pack(A, textures | {"c": CheckerTexture()})
    starts = [text.split(" = ")[0] for text in caught.value.lines]
    assert starts == ["textures.x.file", "textures.y.file"]


def test_too_many_pixels_together_are_refused(folder, monkeypatch) -> None:
    image = np.ones((4, 4, 3), np.float32)
    textures = {name: ImageTexture(file=image_file(folder, name, image)) for name in "pqr"}
    monkeypatch.setattr(packing, "MOST_PIXELS", 31)
    with pytest.raises(UserError, match=r"^textures: up to 'q' they have 32 pixels; shrink some, visray holds 31$"):
        pack(A, textures)
    # Those of one file count once.
    pack(A, dict.fromkeys("abc", textures["p"]))


# Looking up


def seen(
    a: Arrays, textures: dict, index: Any, u: Any, v: Any, bilinear: bool = True, v_ends: bool = False
) -> np.ndarray:
    """What the kernel finds. Shapes: u, v (N), index (N) or one number; (N, 3)."""
    u, v = np.broadcast_arrays(np.atleast_1d(np.asarray(u, float)), np.asarray(v, float))
    index = a.put(a.U, np.broadcast_to(np.asarray(index, np.uint32), u.shape))
    return np.array(colour(a, pack(a, textures, v_ends), index, a.put(a.F, u), a.put(a.F, v), bilinear)).T


def wrapped(i: np.ndarray, n: int, wrap: str) -> np.ndarray:
    """Numbers of pixels along an axis, in whole numbers."""
    if wrap == "repeat":
        return i % n
    if wrap == "clamp":
        return np.clip(i, 0, n - 1)
    return np.where(i % (2 * n) < n, i % (2 * n), 2 * n - 1 - i % (2 * n))


def between_poles(j: np.ndarray, t: ImageTexture, h: int) -> np.ndarray:
    """The nearest rows of those that the poles v = 0 and v = 1 leave something of, in exact arithmetic."""
    offset, scale = (Fraction(repr(float(x))) for x in (t.offset[1], t.scale[1]))
    low, high = sorted((offset * h, (offset + scale) * h))
    return np.clip(j, math.floor(low), max(math.floor(low), math.ceil(high) - 1))


def twin(image: np.ndarray, t: ImageTexture, u: np.ndarray, v: np.ndarray, v_ends: bool = False) -> np.ndarray:
    """The same in 80 bits: a plane tiled without end, whose pixels are numbered in whole numbers.

    v_ends: whether the plane is a globe, whose rows end at the poles.
    """
    h, w, _ = image.shape
    x = (np.longdouble(t.scale[0]) * u + np.longdouble(t.offset[0])) * w
    y = (np.longdouble(t.scale[1]) * v + np.longdouble(t.offset[1])) * h

    def at(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        j = j.astype(np.int64)
        rows = h - 1 - wrapped(between_poles(j, t, h) if v_ends else j, h, t.wraps[1])
        return image[rows, wrapped(i.astype(np.int64), w, t.wraps[0])].astype(np.longdouble)

    if t.filter == "nearest":
        return at(np.floor(x), np.floor(y))
    i, j = np.floor(x - 0.5), np.floor(y - 0.5)
    total = np.zeros((len(u), 3), np.longdouble)
    for k in (i, i + 1):
        for l in (j, j + 1):
            weight = np.maximum(1 - abs(x - 0.5 - k), 0) * np.maximum(1 - abs(y - 0.5 - l), 0)
            total += weight[:, None] * at(k, l)
    return total


def clear(t: ImageTexture, u: np.ndarray, v: np.ndarray, w: int, h: int) -> np.ndarray:
    """Whether rounding of the place cannot reach another pixel, where the nearest one is asked for."""
    ok = np.ones(len(u), bool)
    if t.filter == "nearest":
        for p, k, size in ((u, 0, w), (v, 1, h)):
            x = np.longdouble(t.scale[k]) * p + np.longdouble(t.offset[k])
            ok &= abs(x * size - np.round(x * size)) > 2.0**-50 * size * (1 + abs(t.scale[k] * p) + abs(t.offset[k]))
    return ok


@pytest.mark.parametrize("arrays", [A, DOUBLE], ids=["single", "double"])
@pytest.mark.parametrize("wrap", [*WRAPS, *PAIRS])
@pytest.mark.parametrize("filter", FILTERS)
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_a_lookup_is_what_its_twin_finds(folder, arrays: Arrays, wrap: Any, filter: str, data: st.DataObject) -> None:
    h, w = data.draw(st.tuples(st.integers(1, 9), st.integers(1, 9)))
    near, wide = st.floats(-3, 3), st.floats(-1e6, 1e6)
    scale = data.draw(st.tuples(near | wide, near | wide))
    offset = data.draw(st.tuples(near | wide, near | wide))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    image = rng.random((h, w, 3)).astype(np.float32)
    t = ImageTexture(file=image_file(folder, "twin", image), scale=scale, offset=offset, wrap=wrap, filter=filter)
    reach = data.draw(st.sampled_from([1.0, 10.0, 1e3, 1e6]))
    u, v = rng.uniform(-reach, reach, (2, 300)).astype(np.dtype("f4" if arrays is A else "f8")).astype(float)
    bilinear = filter == "bilinear" or data.draw(st.booleans())
    error = np.abs(seen(arrays, {"t": t}, 0, u, v, bilinear) - twin(image, t, u, v)).max(1)
    # The place is off by 2^-52 of what its formula adds up, in pixels; a blend of numbers up to 1 by three roundings.
    off = 2.0**-51 * (w * (abs(scale[0] * u) + abs(offset[0]) + 1) + h * (abs(scale[1] * v) + abs(offset[1]) + 1))
    allowed = 3 * (2.0**-23 if arrays is A else 2.0**-52) + off if filter == "bilinear" else 0
    ok = clear(t, u, v, w, h)
    assert (error <= allowed)[ok].all()


@pytest.mark.parametrize("wrap", [*WRAPS, *PAIRS])
@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize(
    ("scale", "offset"), [(1, 0), (-1, 1), (2, 0), (0.7, 0.3), (0.2, 0.1), (-0.35, 0.95), (0, 0.4), (0.01, 0.005)]
)
def test_no_pixel_from_beyond_a_pole_is_blended_in(folder, wrap: Any, filter: str, scale: float, offset: float) -> None:
    """At the poles of a globe themselves, and everywhere else; wherever on the image they are."""
    image = np.random.default_rng(4).random((10, 4, 3)).astype(np.float32)
    file = image_file(folder, "globe", image)
    t = ImageTexture(file=file, wrap=wrap, filter=filter, scale=(1, scale), offset=(0, offset))
    v = np.concatenate([np.linspace(0, 1, 200), [0, 1, 2.0**-40, 1 - 2.0**-40]])
    u = np.random.default_rng(5).random(len(v))
    index = row_number(0, 1, v_ends=True, keeps_ka=False)
    found, expected = seen(DOUBLE, {"t": t}, index, u, v, True, True), twin(image, t, u, v, True)
    ok = clear(t, u, v, 4, 10) | np.isin(v, (0, 1))
    assert np.abs(found - expected)[ok].max(initial=0) < 2.0**-20
    # The same texture on another kind goes on beyond v = 0 and v = 1.
    plain, expected = seen(DOUBLE, {"t": t}, 0, u, v, True, True), twin(image, t, u, v)
    assert np.abs(plain - expected)[clear(t, u, v, 4, 10)].max(initial=0) < 2.0**-20


def test_squares_end_at_a_pole() -> None:
    index = row_number(0, 1, v_ends=True, keeps_ka=False)
    textures = {"c": CheckerTexture(scale=(1, 2))}
    found = seen(DOUBLE, textures, index, 0.25, [0, 0.2, 0.3, 0.99, 1], v_ends=True)
    assert found[:, 0].tolist() == [0.8, 0.8, 0.2, 0.2, 0.2]


@pytest.mark.parametrize("name", NAMES)
def test_kinds_with_poles_say_so(name: str) -> None:
    """A pole: v goes from 0 to 1, and the points within 1/20 of an end are close together and have every u."""
    thing = SAMPLES[name].posed
    o, d = aimed(np.random.default_rng(1), thing, 150_000)
    line = Lineup([thing], len(o))
    ray = line.ray(o, d)
    crossing = line.crossing(ray)
    surface, u, v = line.surface(ray, crossing.t, crossing.part)
    hit = np.isfinite(np.array(crossing.t))
    part = np.broadcast_to(np.array(crossing.part), hit.shape)[hit]
    p, u, v = array(surface.p)[hit], np.array(u)[hit], np.array(v)[hit]
    size, poles = np.ptp(p, axis=0).max(), 0
    for number in set(part):
        for near_end in (v < 0.05, v > 0.95):
            points, turn = p[near_end & (part == number)], u[near_end & (part == number)]
            if len(points) > 9 and not ((v < -0.05) | (v > 1.05)).any():
                near = np.linalg.norm(points - np.median(points, axis=0), axis=1) < 0.1 * size
                poles += len(set(np.floor(turn * 4).astype(int) % 4)) == 4 and near.mean() > 0.5
    assert line.kind.v_ends == bool(poles)


@pytest.mark.parametrize("arrays", [A, DOUBLE], ids=["single", "double"])
def test_textures_of_all_kinds_side_by_side(folder, arrays: Arrays) -> None:
    """Each lane has its own texture; one blends, so the kernel can, and the others are not blended."""
    rng = np.random.default_rng(5)
    images = [rng.random(shape).astype(np.float32) for shape in ((3, 5, 3), (1, 1, 3), (8, 2, 3), (4, 4, 3))]
    textures: dict[str, Any] = {
        f"t{i}": ImageTexture(
            file=image_file(folder, f"side{i}", image),
            wrap=WRAPS[i % 3],
            filter=FILTERS[i % 2],
            scale=(1.0 + i, -0.5 * i),
            offset=(0.3 * i, 0.1),
        )
        for i, image in enumerate(images)
    }
    textures["c"] = CheckerTexture(a=(1.0, 2.0, 3.0), b=(4.0, 5.0, 6.0), scale=(0.7, 3.0), offset=(0.1, -0.4))
    index = rng.integers(0, 5, 4000)
    u, v = rng.uniform(-4, 4, (2, 4000)).astype(np.float32).astype(float)
    found = seen(arrays, textures, index, u, v)
    for i, image in enumerate(images):
        t, mine = textures[f"t{i}"], index == i
        ok = clear(t, u[mine], v[mine], image.shape[1], image.shape[0])
        assert np.abs(found[mine] - twin(image, t, u[mine], v[mine]))[ok].max() < 4e-7
    mine = index == 4
    even = (np.floor(2 * (0.7 * u + 0.1)) + np.floor(2 * (3 * v - 0.4))) % 2 == 0
    assert np.array_equal(found[mine], np.where(even[mine][:, None], [1, 2, 3], [4, 5, 6]))


def test_colours_of_a_checker_keep_the_shading_precision() -> None:
    textures = {"c": CheckerTexture(a=(0.1, 0.2, 0.3), b=(0.7, 0.8, 0.9))}
    found = seen(DOUBLE, textures, 0, [0.25, 0.75, 0.75, 0.25, -0.25, -0.25], [0.25, 0.75, 0.25, 0.75, 0.25, -0.25])
    a, b = [0.1, 0.2, 0.3], [0.7, 0.8, 0.9]
    assert found.tolist() == [a, a, b, b, b, a]


@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize("wrap", WRAPS)
def test_the_first_row_is_at_v_1_and_edges_belong_to_a_pixel(folder, wrap: str, filter: str) -> None:
    image = np.array([[[1, 0, 0], [2, 0, 0]], [[3, 0, 0], [4, 0, 0]]], np.float32)
    t = ImageTexture(file=image_file(folder, "corners", image), wrap=wrap, filter=filter)
    # Where it repeats, its corners are one place: in the pixel that begins there, or amid all four.
    corner = 3 if filter == "nearest" else 2.5
    corners = [corner] * 4 if wrap == "repeat" else [3, 4, 1, 2]
    for bilinear in {True, filter == "bilinear"}:
        found = seen(A, {"t": t}, 0, [0.25, 0.75, 0.25, 0.75], [0.75, 0.75, 0.25, 0.25], bilinear)
        assert found[:, 0].tolist() == [1, 2, 3, 4]
        assert seen(A, {"t": t}, 0, [0, 1, 0, 1], [0, 0, 1, 1], bilinear)[:, 0].tolist() == corners


@pytest.mark.parametrize("filter", FILTERS)
@pytest.mark.parametrize("wrap", WRAPS)
def test_an_image_of_one_pixel_has_one_colour(folder, wrap: str, filter: str) -> None:
    image = np.array([[[0.1, 0.7, 3.3]]], np.float32)
    t = ImageTexture(file=image_file(folder, "pixel", image), wrap=wrap, filter=filter)
    u, v = np.random.default_rng(2).normal(0, 5, (2, 1000))
    u[:6], v[:6] = [0, 1, -1, 0.5, -0.0, 1e6], [1, 0, -1, 0.5, -1e-30, -1e6]
    # Exactly, as a blend of equals must be.
    assert (seen(A, {"t": t}, 0, u, v) == image[0]).all()


@pytest.mark.parametrize("wrap", WRAPS)
def test_blends_run_on_over_all_seams(folder, wrap: str) -> None:
    """A step to either side of a tile's edge or a pixel's changes the colour by no more than the step times the
    slope."""
    image = np.random.default_rng(3).random((3, 4, 3)).astype(np.float32)
    t = ImageTexture(file=image_file(folder, "seams", image), wrap=wrap)
    seams, step = np.arange(-24, 25) / 8, 1e-9
    for along in (0, 1):
        line = [np.full(len(seams), 0.37)] * 2
        sides = []
        for sign in (-1, 0, 1):
            line[along] = seams + sign * step
            sides.append(seen(DOUBLE, {"t": t}, 0, *line))
        # The slope is at most the size in pixels, as no two numbers differ by more than 1.
        assert np.abs(sides[0] - sides[1]).max() < 4.1 * step
        assert np.abs(sides[2] - sides[1]).max() < 4.1 * step


@pytest.mark.parametrize("arrays", [A, DOUBLE], ids=["single", "double"])
@pytest.mark.parametrize("bilinear", [False, True])
@pytest.mark.parametrize("wrap", WRAPS)
def test_no_place_reads_outside_the_image(folder, arrays: Arrays, wrap: str, bilinear: bool) -> None:
    """Not even one that is no number: the colour is one of the image's own, whose neighbours in memory are others."""
    far = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e6, -1e6, 1 - 2.0**-24, -(2.0**-149), 1, 0, 0.3])
    u, v = (x.ravel() for x in np.meshgrid(far, far))
    own, other = np.full((3, 5, 3), 7, np.float32), np.full((9, 9, 3), -np.float32(0), np.float32)
    filter = FILTERS[bilinear]
    around = ImageTexture(file=image_file(folder, "around", other + 99))
    t = ImageTexture(file=image_file(folder, "within", own), wrap=wrap, filter=filter, scale=(1e6, -1e6))
    second = ImageTexture(file=image_file(folder, "behind", other + 98))
    found = seen(arrays, {"a": around, "t": t, "z": second, "c": CheckerTexture()}, 1, u, v, bilinear)
    assert (found == 7).all()
    squares = seen(arrays, {"c": CheckerTexture()}, 0, u, v)
    assert np.isin(squares, np.array([0.2, 0.8], np.float32 if arrays is A else float)).all()


# In pictures


def picture(scene: Scene, **changes: Any) -> np.ndarray:
    """The colours of a scene with a flat light. Shape: (H, W, 3)."""
    scene = replace(scene, **changes)
    return render(scene, layers=("RGB",), progress=False)["RGB"]


@pytest.mark.parametrize("wrap", [*WRAPS, *PAIRS])
@pytest.mark.parametrize("pole", [1, -1])
def test_a_globe_seen_from_above_its_pole_has_one_colour(folder, wrap: Any, pole: int) -> None:
    """Bilinear filtering blended the south into the north pole, on instances and ellipsoids too."""
    image = np.zeros((8, 4, 3), np.float32)
    image[:2], image[-2:] = (1, 0.5, 0.25), (0.25, 0.5, 1)
    globe = ImageTexture(file=image_file(folder, "poles", image), wrap=wrap)
    squashed = Ellipsoid(radii=(1, 0.6, 1), material="globe")
    objects = [Sphere(material="globe"), Instance(geometry="ball", material="globe"), squashed]
    for thing in objects:
        found = picture(
            Scene(
                camera=Camera(origin=(0, 6 * pole, 0), up=(0, 0, 1), fov=3),
                film=Film(width=9, height=9),
                textures={"globe": globe},
                materials={"globe": Material(texture="globe")},
                geometries={"ball": Sphere()} if isinstance(thing, Instance) else {},
                objects={"globe": thing},
                settings=Settings(shading="albedo", spp=16),
                lights={},
            )
        )
        expected = np.float32(image[0 if pole > 0 else -1, 0])
        assert np.abs(found - expected).max() < 4 * 2.0**-23


AMBIENT = Scene(
    camera=OrthographicCamera(origin=(0, 0, 5), target=(0, 0, 0), height=2),
    film=Film(width=2, height=2),
    background=(0, 0, 0),
    ambient=(0.5, 1.0, 2.0),
    textures={"squares": CheckerTexture(a=(0.8, 0.4, 0.2), b=(0.1, 0.3, 0.5))},
    materials={"m": Material(texture="squares", ka=(0.5, 0.25, 0.75))},
    objects={"card": Rectangle(center=(0, 0, 0), width=(2, 0, 0), height=(0, 2, 0), material="m")},
    settings=Settings(spp=1, sampler="independent"),
    lights={},
)
SQUARES = np.array([[AMBIENT.textures["squares"].b, AMBIENT.textures["squares"].a]] * 2)
SQUARES[1] = SQUARES[1, ::-1]


def test_a_texture_colours_what_only_ambient_light_reaches() -> None:
    """I = Ig ka times the colour of the texture, or Ig ka where the material keeps it."""
    glow, ka = np.array(AMBIENT.ambient), np.array(AMBIENT.materials["m"].ka)
    assert np.allclose(picture(AMBIENT), glow * ka * SQUARES, rtol=4 * 2.0**-23)
    kept = {"m": replace(AMBIENT.materials["m"], textured="kd")}
    assert np.allclose(picture(AMBIENT, materials=kept), np.broadcast_to(glow * ka, (2, 2, 3)), rtol=4 * 2.0**-23)
    # Without a ka, the texture is the ambient colour.
    left_out, written = ({"m": Material(texture="squares", **ka)} for ka in ({}, {"ka": (1.0, 1.0, 1.0)}))
    assert np.array_equal(picture(AMBIENT, materials=left_out), picture(AMBIENT, materials=written))


def test_materials_side_by_side_each_keep_to_their_own_rule() -> None:
    """One scales ka, one keeps it and one has no texture, on a sphere, whose v ends at poles, and on rectangles."""
    left, right, ball = (-1, 0, 0), (1, 0, 0), Sphere(center=(0, 3, 0), radius=1, material="kept")
    card = Rectangle(width=(1, 0, 0), height=(0, 1, 0))
    objects = {"a": replace(card, center=left, material="scaled"), "b": replace(card, center=right, material="kept")}
    objects |= {"c": replace(card, center=(0, -2, 0), material="plain"), "ball": ball}
    m = AMBIENT.materials["m"]
    materials = {"scaled": m, "kept": replace(m, textured="kd"), "plain": replace(m, texture=None)}
    camera = OrthographicCamera(origin=(0, 0, 5), target=(0, 0, 0), height=10)
    found = picture(AMBIENT, objects=objects, materials=materials, camera=camera, film=Film(width=40, height=40))
    light = np.array(AMBIENT.ambient) * m.ka
    colours = {tuple(np.round(c, 4)) for c in found.reshape(-1, 3).astype(float)} - {(0, 0, 0)}
    expected = [light, *(light * SQUARES[0])]
    assert colours == {tuple(np.round(c, 4)) for c in expected}


def test_derivatives_by_ka_are_scaled_by_the_texture() -> None:
    m = AMBIENT.materials["m"]
    for textured, expected in (("ka and kd", SQUARES[..., 0]), ("kd", np.ones((2, 2)))):
        scene = replace(AMBIENT, materials={"m": replace(m, textured=textured)})
        slope = derivative(scene, "materials.m.ka.0")
        assert np.allclose(slope[..., 0], AMBIENT.ambient[0] * expected, rtol=1e-12) and not slope[..., 1:].any()


# Derivatives


def slopes(t: Any, u: np.ndarray, v: np.ndarray, bilinear: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the sum of the three colours by u and by v, in reverse mode."""
    p, q = DOUBLE.put(DOUBLE.F, u), DOUBLE.put(DOUBLE.F, v)
    dr.enable_grad(p, q)
    found = colour(DOUBLE, pack(DOUBLE, {"t": t}), DOUBLE.U(0), p, q, bilinear)
    total = found.x + found.y + found.z
    if not dr.grad_enabled(total):
        return np.zeros(len(u)), np.zeros(len(u))
    dr.backward(total)
    return np.array(dr.grad(p)), np.array(dr.grad(q))


@pytest.mark.parametrize("wrap", WRAPS)
def test_blends_have_the_derivatives_of_finite_differences(folder, wrap: str) -> None:
    image = np.random.default_rng(6).random((4, 5, 3)).astype(np.float32)
    t = ImageTexture(file=image_file(folder, "slopes", image), wrap=wrap, scale=(1.5, -0.8), offset=(0.2, 0.6))
    u, v = np.random.default_rng(7).uniform(-3, 3, (2, 2000))
    # Between two centres of pixels a blend is a polynomial of degree 1 in u, so only rounding is left of the error.
    step = 1e-6
    x, y = (1.5 * u + 0.2) * 5 - 0.5, (-0.8 * v + 0.6) * 4 - 0.5
    smooth = (abs(x - np.round(x)) > 1e-4) & (abs(y - np.round(y)) > 1e-4)
    if wrap == "clamp":
        # And the edges themselves, where the slope ends.
        for edge in (x + 0.5, x - 4.5, y + 0.5, y - 3.5):
            smooth &= abs(edge) > 1e-4
        assert (slopes(t, np.array([-1.0, 9.0]), np.array([0.0, 0.0]))[0] == 0).all()
    by_u, by_v = slopes(t, u, v)
    textures = {"t": t}
    for found, du, dv in ((by_u, step, 0), (by_v, 0, step)):
        sides = [seen(DOUBLE, textures, 0, u + sign * du, v + sign * dv).sum(1) for sign in (1, -1)]
        expected = (sides[0] - sides[1]) / (2 * step)
        assert np.abs(found - expected)[smooth].max() < 1e-7
        assert np.abs(expected).max() > 1


def test_nearest_pixels_and_checkers_have_no_derivatives(folder) -> None:
    image = np.random.default_rng(6).random((4, 5, 3)).astype(np.float32)
    nearest = ImageTexture(file=image_file(folder, "flat", image), filter="nearest")
    u, v = np.random.default_rng(7).uniform(-3, 3, (2, 500))
    for t, bilinear in ((nearest, True), (nearest, False), (CheckerTexture(), True)):
        assert not np.any(slopes(t, u, v, bilinear))


def test_a_colour_has_a_derivative_by_those_of_its_checker() -> None:
    found = pack(DOUBLE, {"c": CheckerTexture()})
    dr.enable_grad(found.rows.a, found.rows.b)
    u, v = (DOUBLE.put(DOUBLE.F, np.array(x)) for x in ([0.2, 0.7, 0.7], [0.2, 0.7, 0.2]))
    dr.backward(dr.sum(colour(DOUBLE, found, DOUBLE.U(0), u, v, False).x))
    assert np.array(found.rows.a.x.grad).sum() == 2 and np.array(found.rows.b.x.grad).sum() == 1


# Kernels


def kernels(draw: Callable[[], None]) -> list[dict]:
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        draw()
        return dr.kernel_history([dr.KernelType.JIT])


@pytest.mark.parametrize("count", [1, 2])
def test_a_texture_is_data_not_code(folder, count: int) -> None:
    """Another image of another size, scale, offset, wrap and filter: the kernel is the same."""
    place = [A.put(A.F, np.random.default_rng(1).random(100)) for _ in range(2)]
    index = A.put(A.U, np.arange(100, dtype=np.uint32) % count)

    def draw(h: int, w: int, **more: Any) -> None:
        image = np.full((h, w, 3), 0.5, np.float32)
        file = image_file(folder, f"data{h}x{w}", image)
        found = pack(A, {f"t{i}": ImageTexture(file=file, **more) for i in range(count)})
        dr.eval(colour(A, found, index, *place, True))

    draw(3, 4)
    history = kernels(lambda: draw(3, 4))
    for size, more in (
        ((1, 1), {"wrap": "clamp", "filter": "nearest"}),
        ((33, 70), {"wrap": "mirror", "scale": (7.0, -1e6)}),
        ((2, 5), {"offset": (0.5, 0.0), "scale": (0.0, 1.0)}),
    ):
        again = kernels(lambda size=size, more=more: draw(*size, **more))
        assert [k["hash"] for k in again] == [k["hash"] for k in history] and all(k["cache_hit"] for k in again)


def test_a_kernel_holds_only_what_its_textures_need(folder) -> None:
    image = ImageTexture(file=image_file(folder, "cost", np.ones((4, 4, 3), np.float32)))
    place = [A.put(A.F, np.random.default_rng(1).random(100)) for _ in range(2)]

    def operations(textures: dict, bilinear: bool) -> int:
        found = pack(A, textures)
        return kernels(lambda: dr.eval(colour(A, found, A.U(0), *place, bilinear)))[-1]["operation_count"]

    checker, nearest = {"t": CheckerTexture()}, {"t": replace(image, filter="nearest")}
    order = [operations(checker, False), operations(nearest, False), operations(nearest, True)]
    assert order == sorted(set(order))
