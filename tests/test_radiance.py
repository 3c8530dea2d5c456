"""Radiance files: flat and with run lengths of both kinds, their headers, and what is refused,
against a writer in Python."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from visray.errors import UserError
from visray.images.radiance import read_hdr
from visray.images.reading import read_image

HEADER = b"#?RADIANCE\n# made by a test\nFORMAT=32-bit_rle_rgbe\n"


def written(path: Path, data: bytes, size: str, header: bytes = HEADER) -> str:
    path.write_bytes(header + b"\n" + size.encode() + b"\n" + data)
    return str(path)


def light(rgbe: np.ndarray) -> np.ndarray:
    """The colours of pixels (r, g, b, e), one after the other."""
    flat = [[float(c) * 2.0 ** (int(e) - 136) if e else 0.0 for c in rgb] for *rgb, e in rgbe.reshape(-1, 4)]
    return np.array(flat, np.float32).reshape(*rgbe.shape[:2], 3)


def some(height: int, width: int, levels: int = 200) -> np.ndarray:
    """Pixels with runs: few levels make many of equal bytes."""
    rng = np.random.default_rng(height + width)
    pixels = np.repeat(rng.integers(2, 2 + levels, (height, -(-width // 3), 4)), 3, 1)[:, :width]
    pixels[..., 3] = np.where(pixels[..., 3] < 10, 0, 100 + pixels[..., 3] % 50)
    return pixels.astype(np.uint8)


def new_runs(pixels: np.ndarray) -> bytes:
    """Rows with run lengths of the new kind: runs where three bytes or more are equal, the rest as it is."""
    out, width = bytearray(), pixels.shape[1]
    for row in pixels:
        out += bytes((2, 2, width >> 8, width & 255))
        for plane in row.T.tolist():
            at, plain = 0, []
            while at < width:
                end = at
                while end < width and plane[end] == plane[at] and end - at < 127:
                    end += 1
                if end - at >= 3 or len(plain) == 128:
                    out += bytes((len(plain), *plain)) if plain else b""
                    plain = []
                if end - at >= 3:
                    out += bytes((128 + end - at, plane[at]))
                    at = end
                else:
                    plain.append(plane[at])
                    at += 1
            out += bytes((len(plain), *plain)) if plain else b""
    return bytes(out)


def old_runs(pixels: np.ndarray) -> bytes:
    """Pixels with run lengths of the old kind, which go on from row to row."""
    flat, out, at = [bytes(p) for p in pixels.reshape(-1, 4)], bytearray(), 0
    while at < len(flat):
        end = at
        while end < len(flat) and flat[end] == flat[at]:
            end += 1
        out += flat[at]
        count, at = end - at - 1, end
        while count:
            out += bytes((1, 1, 1, count & 255))
            count >>= 8
    return bytes(out)


@pytest.mark.parametrize("shape", [(1, 2), (4, 8), (5, 9), (3, 700)])
@pytest.mark.parametrize("coded", [lambda p: p.tobytes(), old_runs, new_runs])
def test_pixels_are_read_bit_for_bit(coded, shape, tmp_path) -> None:
    if coded is new_runs and shape[1] < 8:
        pytest.skip("rows this narrow have no run lengths of the new kind")
    pixels = some(*shape, levels=4) if coded is old_runs else some(*shape)
    path = written(tmp_path / "a.hdr", coded(pixels), f"-Y {shape[0]} +X {shape[1]}")
    found = read_hdr(path)
    assert found.dtype == np.float32
    assert found.tobytes() == light(pixels).tobytes()
    assert read_image(path, "auto", "background.file", whole=True).tobytes() == found.tobytes()


def test_long_runs_of_the_old_kind(tmp_path) -> None:
    pixels = np.tile(np.uint8([10, 20, 30, 140]), (300, 300, 1))
    assert (read_hdr(written(tmp_path / "a.hdr", old_runs(pixels), "-Y 300 +X 300")) == light(pixels)).all()


@pytest.mark.parametrize("signs, turn", [("-+", np.s_[:, :]), ("++", np.s_[::-1, :]), ("--", np.s_[:, ::-1])])
def test_the_line_of_the_size_says_where_rows_and_columns_begin(signs, turn, tmp_path) -> None:
    pixels = some(4, 8)
    path = written(tmp_path / "a.hdr", new_runs(pixels), f"{signs[0]}Y 4 {signs[1]}X 8")
    assert (read_hdr(path) == light(pixels)[turn]).all()


def test_light_is_divided_by_exposures(tmp_path) -> None:
    pixels = some(4, 8)
    header = HEADER + b"EXPOSURE=2.0\nEXPOSURE= 4\nCOLORCORR=1 2 0.5\n"
    found = read_hdr(written(tmp_path / "a.hdr", pixels.tobytes(), "-Y 4 +X 8", header))
    assert found == pytest.approx(light(pixels) / (8 * np.array([1, 2, 0.5])), rel=1e-7)


@pytest.mark.parametrize(
    "size, header, data, said",
    [
        ("-Y 4 +X 8", HEADER, b"\x09" * 100, "is damaged: it lacks rows, only 78 % of its pixels are there"),
        ("-Y 4 +X 8", HEADER, b"\2\2\0\x08\x8a\5", "is damaged: it has wrong run lengths, only 0 %"),
        ("-Y 4 +X 8", HEADER, b"\1\1\1\5" * 9, "is damaged: it repeats a pixel before the first one; save it anew"),
        ("+X 8 -Y 4", HEADER, b"", "has the size '+X 8 -Y 4'; it must be a line such as '-Y 512 +X 1024'"),
        ("-Y 0 +X 8", HEADER, b"", "has 8 x 0 pixels; give a picture that has some"),
        ("-Y 900000 +X 900000", HEADER, b"", "has 900000 x 900000 pixels; visray reads up to"),
        ("-Y 4 +X 8", b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n", b"", "has the FORMAT '32-bit_rle_xyze'; save it as"),
        ("-Y 4 +X 8", HEADER + b"EXPOSURE=0\n", b"", "has the line 'EXPOSURE=0'; it must be a number > 0"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(size, header, data, said, tmp_path) -> None:
    path = written(tmp_path / "a.hdr", data, size, header)
    with pytest.raises(UserError) as caught:
        read_image(path, "auto", "background.file")
    assert len(caught.value.lines) == 1
    assert str(caught.value).split('": ', 1)[1].startswith(said)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_files_are_read_or_refused(data) -> None:
    """Any bytes changed, cut or added: a picture of the stated size, or one line."""
    pixels = some(4, 8, levels=3)
    body = data.draw(st.sampled_from([pixels.tobytes(), old_runs(pixels), new_runs(pixels)]))
    whole = bytearray(HEADER + b"\n-Y 4 +X 8\n" + body)
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    del whole[data.draw(st.integers(0, len(whole))) :]
    path = Path("damaged.hdr")
    path.write_bytes(whole)
    try:
        found = read_image(str(path), "auto", "background.file", whole=True)
    except UserError as error:
        assert len(error.lines) == 1 and "\n" not in str(error)
    else:
        assert found.ndim == 3 and found.shape[2] == 3 and np.isfinite(found).all()


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
