"""Pictures on disk: exact values, names, metadata, and that nothing is ever lost or half-written."""

import contextlib
import errno
import fcntl
import io
import os
import re
import stat
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image as Pillow

from visray.cli.keeping import kept
from visray.errors import RangeWarning, UserError
from visray.output import files
from visray.output.files import check_writable
from visray.output.image import Image, check_destination
from visray.output.layers import LAYERS, Layer
from visray.output.rounding import rounding

H, W = 5, 7
ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def full_picture() -> Image:
    """Every layer, with numbers that need all the bits of their type."""
    rng = np.random.default_rng(7)

    def floats(*shape: int) -> np.ndarray:
        return rng.normal(size=(H, W, *shape)).astype(np.float32)

    def numbers(layer: Layer) -> np.ndarray:
        shape = (len(layer.channels),) if len(layer.channels) > 1 else ()
        if layer.dtype == "uint32":
            return rng.integers(0, 2**32, (H, W, *shape), np.uint32)
        return floats(*shape).astype(layer.dtype).astype(np.float32)

    layers = {layer.name: numbers(layer) for layer in LAYERS}
    layers["A"] = np.abs(layers["A"])
    layers["Z"] = np.where(floats() > 0, np.float32(np.inf), floats())
    layers["distance"] *= np.float32(1e30)
    layers["id"].flat[:3] = 0, 2**32 - 1, 2**24 + 1
    # Layers without a record.
    layers |= {"shadow": floats(), "light.key": floats(3), "rounds": rng.integers(0, 9, (H, W), np.uint32)}
    return Image(layers)


def grey(value: float, **metadata: object) -> Image:
    return Image({"RGB": np.full((H, W, 3), value, np.float32), "A": np.ones((H, W), np.float32)}, dict(metadata))


def channels(path: Path) -> dict[str, np.ndarray]:
    return {name: c.pixels for name, c in OpenEXR.File(str(path), separate_channels=True).channels().items()}


def line_of(caught: pytest.ExceptionInfo[UserError]) -> str:
    line = str(caught.value)
    assert "\n" not in line
    return line


# The picture


def test_a_layer_is_had_by_name_and_a_wrong_name_gets_a_suggestion() -> None:
    picture = full_picture()
    assert picture["N"].shape == (H, W, 3)
    assert (picture.height, picture.width) == (H, W)
    for wrong, right in (("albeddo", "albedo"), ("rgb", "RGB"), ("n", "N"), ("a", "A"), ("Distance", "distance")):
        with pytest.raises(UserError) as caught:
            picture[wrong]
        assert line_of(caught) == f"image: there is no layer '{wrong}'; did you mean '{right}'?"
    with pytest.raises(UserError, match=r"it has RGB, A$"):
        grey(1)["motion"]


def test_repr_is_one_line() -> None:
    assert repr(grey(1)) == "<Image 7 x 5: RGB, A>"


def test_layers_of_different_sizes_are_refused() -> None:
    for shape in ((H, W + 1), (W, H, 3), (H,), (H, W, 3, 1)):
        with pytest.raises(UserError, match="layer 'Z' has the shape"):
            Image({"RGB": np.zeros((H, W, 3)), "Z": np.zeros(shape)})
    with pytest.raises(UserError, match="no layers"):
        Image({})


# EXR


def test_every_layer_comes_back_bit_for_bit(tmp_path) -> None:
    picture = full_picture()
    picture.write(tmp_path / "a.exr")
    back = Image.read(tmp_path / "a.exr")
    assert set(back.layers) == set(picture.layers)
    for name, values in picture.layers.items():
        assert back[name].dtype == values.dtype, name
        assert back[name].tobytes() == values.tobytes(), name


def test_the_names_and_types_are_those_that_compositors_expect(tmp_path) -> None:
    full_picture().write(tmp_path / "a.exr")
    half, single, whole = np.float16, np.float32, np.uint32
    expected = dict.fromkeys(["R", "G", "B", "A", "albedo.R", "albedo.G", "albedo.B"], half)
    expected |= dict.fromkeys(["Z", "dist.Z", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "UV.U", "UV.V"], single)
    expected |= dict.fromkeys(["variance.R", "variance.G", "variance.B", "shadow.X"], single)
    expected |= dict.fromkeys(["light.key.R", "light.key.G", "light.key.B"], single)
    expected |= dict.fromkeys(["error.R", "error.G", "error.B", "proof.residual", "forward.U", "forward.V"], single)
    expected |= dict.fromkeys(["legend.R", "legend.G", "legend.B", "legend.A"], half)
    expected |= dict.fromkeys(["id.object", "rounds.X", "samples.count", "proof.unresolved"], whole)
    written = {name: values.dtype.type for name, values in channels(tmp_path / "a.exr").items()}
    # The names and types of these layers are a promise; a new layer has those of its record.
    assert written == {name: layer.dtype for layer in LAYERS for name in layer.channels} | expected
    header = OpenEXR.File(str(tmp_path / "a.exr")).header()
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["type"] == OpenEXR.scanlineimage
    # Blender takes root Z for the depth only if there is no root X and Y; Nuke strips leading digits.
    assert not {"X", "Y"} & set(written)
    assert all(name.count(".") <= 2 and not re.search(r"(^|\.)\d|[^\w.]", name) for name in written)


def test_colour_beyond_half_is_clamped_and_data_is_not(tmp_path) -> None:
    picture = grey(1)
    picture["RGB"][0, :4, 0] = 65504, 65520, 1e30, np.inf
    picture["RGB"][1, 0, 1] = -np.inf
    picture["RGB"][2, 0, 2] = 2.0**-24
    picture.layers["Z"] = np.full((H, W), 1e30, np.float32)
    with pytest.warns(RangeWarning, match="^.*: 4 pixels of RGB are beyond 65504, .*; the largest is inf"):
        picture.write(tmp_path / "a.exr")
    found = channels(tmp_path / "a.exr")
    assert found["R"][0, :5].tolist() == [65504, 65504, 65504, 65504, 1]
    assert found["G"][1, 0] == -65504
    assert found["B"][2, 0] == np.float16(2.0**-24) > 0
    assert (found["Z"] == np.float32(1e30)).all()


def test_an_exr_file_is_linear_whatever_the_screen_gets(tmp_path) -> None:
    grey(0.5).write(tmp_path / "a.exr", gamma=2, exposure=3)
    assert (Image.read(tmp_path / "a.exr")["RGB"] == 0.5).all()


def test_writing_leaves_the_picture_as_it_was(tmp_path) -> None:
    picture, before = full_picture(), full_picture()
    picture.write(tmp_path / "a.exr")
    for name, values in before.layers.items():
        assert isinstance(picture.layers[name], np.ndarray)
        assert picture[name].tobytes() == values.tobytes()


def test_chosen_layers_only(tmp_path) -> None:
    picture = full_picture()
    picture.write(tmp_path / "a.exr", layers=["RGB", "Z"])
    assert set(channels(tmp_path / "a.exr")) == {"R", "G", "B", "Z"}
    assert list(Image.read(tmp_path / "a.exr").layers) == ["RGB", "Z"]
    with pytest.raises(UserError, match="did you mean 'albedo'"):
        picture.write(tmp_path / "b.exr", layers=["RGB", "albdo"])
    with pytest.raises(UserError, match="no layers were chosen"):
        picture.write(tmp_path / "b.exr", layers=[])
    assert os.listdir(tmp_path) == ["a.exr"]


@pytest.mark.parametrize("suffix", [".exr", ".png"])
def test_nan_is_an_error_that_names_the_pixel(suffix: str, tmp_path) -> None:
    picture = grey(1)
    picture["RGB"][3, 4, 1] = np.nan
    picture["RGB"][4, 0] = np.nan
    with pytest.raises(UserError) as caught:
        picture.write(tmp_path / f"a{suffix}")
    assert "layer 'RGB' is not a number (NaN) at pixel (x 4, y 3) and 1 more" in line_of(caught)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["2nd", "a-b", "a b", "a.b.c", "", "ä"])
def test_layer_names_that_compositors_would_change_are_refused(name: str, tmp_path) -> None:
    picture = grey(1)
    picture.layers[name] = np.zeros((H, W), np.float32)
    with pytest.raises(UserError, match="cannot be written as EXR"):
        picture.write(tmp_path / "a.exr")


def test_layers_of_a_wrong_kind_are_refused(tmp_path) -> None:
    for name, values, part in (
        ("N", np.zeros((H, W, 2)), "2 numbers a pixel; an EXR file takes 3"),
        ("many", np.zeros((H, W, 5)), "5 numbers a pixel; an EXR file takes 1 to 4"),
        ("id", np.full((H, W), -1), "whole numbers"),
        ("id", np.full((H, W), 2**32), "whole numbers"),
        ("id", np.zeros((H, W)), "whole numbers"),
    ):
        picture = grey(1)
        picture.layers[name] = values
        with pytest.raises(UserError, match=part):
            picture.write(tmp_path / "a.exr")


METADATA = {
    "scene_hash": "0f" * 32,
    "spp": 64,
    "seed": 2**32 - 1,
    "huge": 10**30,
    "negative": -(2**31),
    "third": 1 / 3,
    "tenth": 0.1,
    "half": 0.5,
    "tiny": 1e-300,
    "infinite": float("inf"),
    "text": "Kugel ä 球, two\nlines",
    "number_as_text": "12",
    "empty": "",
    "camera/fov": 40.0,
    "features": ["shadows", "ambient"],
    "owner": "1234567890123",
    "comments": "a test",
}


def test_metadata_comes_back_exactly(tmp_path) -> None:
    matrix = np.arange(16.0).reshape(4, 4).tolist()
    given = METADATA | {"worldToCamera": matrix, "worldToNDC": matrix, "numpy": np.float32(0.25), "count": np.int64(3)}
    grey(1, **given).write(tmp_path / "a.exr")
    back = Image.read(tmp_path / "a.exr").metadata
    assert {key: back[key] for key in given} == given
    assert {key: type(back[key]) for key in METADATA} == {key: type(value) for key, value in METADATA.items()}
    assert set(back) - set(given) == {"software", "capDate", "utcOffset"}


def test_metadata_survive_a_second_writing(tmp_path) -> None:
    grey(1, **METADATA).write(tmp_path / "a.exr")
    first = Image.read(tmp_path / "a.exr")
    first.metadata["capDate"] = "2020:01:02 03:04:05"
    first.write(tmp_path / "b.exr")
    assert Image.read(tmp_path / "b.exr").metadata == first.metadata


def test_the_standard_attributes(tmp_path) -> None:
    matrix = np.arange(16.0).reshape(4, 4)
    grey(1, owner="me", worldToCamera=matrix.tolist(), render_seconds=1.5, features=[]).write(tmp_path / "a.exr")
    header = OpenEXR.File(str(tmp_path / "a.exr")).header()
    assert header["owner"] == "me"
    assert header["software"].startswith("visray")
    assert header["renderTime"] == 1.5
    assert header["visray/render_seconds"] == 1.5
    assert "visray/features" not in header
    assert header["worldToCamera"].dtype == np.float32
    assert (header["worldToCamera"] == matrix).all()
    assert header["colorInteropID"] == "lin_rec709_scene"
    assert np.allclose(header["chromaticities"], (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), atol=1e-7)
    assert OpenEXR.checkColorMetadata(header) == 0
    stated = datetime.strptime(header["capDate"], "%Y:%m:%d %H:%M:%S") + timedelta(seconds=header["utcOffset"])
    assert abs(stated.replace(tzinfo=UTC) - datetime.now(UTC)) < timedelta(minutes=1)


def test_the_offset_from_utc_has_openexrs_sign(tmp_path) -> None:
    code = (
        "from visray.output.image import Image; import numpy as np;"
        "print(Image({'A': np.ones((1, 1))}).provenance()['utcOffset'])"
    )
    environment = os.environ | {"TZ": "XXX-5"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    # Five hours east of Greenwich: UTC = local time - 5 h.
    assert float(done.stdout) == -18000


@pytest.mark.parametrize(
    "metadata", [{"x": None}, {"x": [1, 2]}, {"x": {}}, {"a b": 1}, {"x" * 73: 1}, {"worldToNDC": [[1]]}]
)
def test_metadata_that_cannot_be_kept_are_refused(metadata: dict, tmp_path) -> None:
    with pytest.raises(UserError) as caught:
        grey(1, **metadata).write(tmp_path / "a.exr")
    line_of(caught)
    assert os.listdir(tmp_path) == []


def test_a_file_of_another_program_is_read(tmp_path) -> None:
    rng = np.random.default_rng(3)
    names = [
        "View.Combined.R",
        "View.Combined.G",
        "View.Combined.B",
        "View.Combined.A",
        "View.Depth.Z",
        "Y",
        "V.X",
        "V.Z",
        "V.Y",
    ]
    given = {name: rng.random((H, W)).astype(np.float32) for name in names}
    OpenEXR.File({"compression": OpenEXR.PIZ_COMPRESSION}, dict(given)).write(str(tmp_path / "a.exr"))
    found = Image.read(tmp_path / "a.exr")
    assert {name: values.shape for name, values in found.layers.items()} == {
        "View.Combined": (H, W, 4),
        "View.Depth": (H, W),
        "Y": (H, W),
        "V": (H, W, 3),
    }
    assert (found["View.Combined"][..., 3] == given["View.Combined.A"]).all()
    assert (found["V"][..., 1] == given["V.Y"]).all()
    assert found.metadata == {}


def test_channels_beside_those_of_a_record_are_another_layer(tmp_path) -> None:
    """A file of another program with an alpha in albedo: four channels, not visray's albedo."""
    given = {f"albedo.{letter}": np.full((H, W), i, np.float32) for i, letter in enumerate("RGBA")}
    OpenEXR.File({}, dict(given)).write(str(tmp_path / "a.exr"))
    assert Image.read(tmp_path / "a.exr")["albedo"][0, 0].tolist() == [0, 1, 2, 3]


def test_files_that_cannot_be_read_are_one_line(tmp_path) -> None:
    text, cut, many = tmp_path / "text.exr", tmp_path / "cut.exr", tmp_path / "many.exr"
    text.write_text("not a picture")
    full_picture().write(cut)
    cut.write_bytes(cut.read_bytes()[:-100])
    part = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = {"R": np.zeros((H, W), np.float32)}
    OpenEXR.File([OpenEXR.Part(dict(part), dict(pixels), name) for name in "ab"]).write(str(many))
    head = tmp_path / "head.exr"
    head.write_bytes(cut.read_bytes()[:60])
    for path in (text, cut, many, head, tmp_path / "none.exr", tmp_path):
        with pytest.raises(UserError) as caught:
            Image.read(path)
        assert line_of(caught).startswith(f"{path}: ")


# PNG


def pixels(data: bytes) -> np.ndarray:
    return np.array(Pillow.open(io.BytesIO(data)))


@pytest.mark.parametrize(
    ("gamma", "light", "seen"),
    [
        # sRGB: 255 * (1.055 * x^(1/2.4) - 0.055), and 255 * 12.92 * x up to 0.0031308.
        ("srgb", 0.0, 0),
        ("srgb", 0.001, 3),
        ("srgb", 0.0031308, 10),
        ("srgb", 0.18, 118),
        ("srgb", 0.2158605, 128),
        ("srgb", 0.5, 188),
        ("srgb", 1.0, 255),
        ("srgb", 7.0, 255),
        ("srgb", np.inf, 255),
        ("srgb", -1.0, 0),
        (2, 0.25, 128),  # 127.5 rounds up
        (2, 0.04, 51),
        (2, 0.5, 180),
        (1, 0.2, 51),
        (2.2, 0.5, 186),
    ],
)
def test_png_values_by_hand(gamma, light: float, seen: int, tmp_path) -> None:
    grey(light).write(tmp_path / "a.png", gamma=gamma)
    found = np.array(Pillow.open(tmp_path / "a.png"))
    assert found.shape == (H, W, 3)
    assert (found == seen).all()


def test_the_exposure_is_in_stops() -> None:
    assert (grey(0.25).display(2, 2) == 255).all()
    assert (grey(1.0).display(2, -2) == 128).all()
    assert (grey(np.inf).display(2, -100) == 255).all()


def test_coverage_becomes_straight_alpha() -> None:
    picture = grey(0.125)
    picture["A"][0, 0] = 0.5
    picture["A"][0, 1] = 0
    picture["A"][0, 2] = 1 / 3
    found = picture.display(gamma=1)
    assert found.shape == (H, W, 4)
    assert found.dtype == np.uint8
    assert found[0, 0].tolist() == [64, 64, 64, 128]
    assert found[0, 1].tolist() == [0, 0, 0, 0]
    assert found[0, 2].tolist() == [96, 96, 96, 85]
    assert found[1, 0].tolist() == [32, 32, 32, 255]
    assert (pixels(picture.png(gamma=1)) == found).all()


def test_a_notebook_gets_a_png() -> None:
    assert (pixels(grey(0.5)._repr_png_()) == 188).all()
    assert Image({"Z": np.zeros((H, W))})._repr_png_() is None


def test_png_carries_the_provenance(tmp_path) -> None:
    grey(1, **METADATA).write(tmp_path / "a.png", exposure=1)
    with Pillow.open(tmp_path / "a.png") as found:
        found.load()
        text = found.text
        assert "srgb" in found.info
    assert text["Software"].startswith("visray")
    assert text["Author"] == "1234567890123"
    assert text["Comment"] == "a test"
    assert re.fullmatch(r"\d{4}:\d\d:\d\d \d\d:\d\d:\d\d", text["Creation Time"])
    assert text["visray/seed"] == "4294967295"
    assert text["visray/tenth"] == "0.1"
    assert text["visray/text"] == METADATA["text"]
    assert text["visray/features"] == '["shadows", "ambient"]'
    assert text["visray/gamma"] == "srgb"
    assert text["visray/exposure"] == "1"
    assert "srgb" not in Pillow.open(io.BytesIO(grey(1).png(2))).info


# Where to, and how


def test_other_suffixes_are_refused_with_the_two(tmp_path) -> None:
    for name in ("a.jpg", "a", "a.exr.bak", ".png"):
        with pytest.raises(UserError) as caught:
            grey(1).write(tmp_path / name)
        assert "end it in .exr or .png" in line_of(caught)
    grey(1).write(tmp_path / "A.EXR")
    grey(1).write(tmp_path / "A.PNG")


@pytest.mark.parametrize(
    ("name", "wishes", "part"),
    [
        ("a.png", {"gamma": 0}, "gamma: 0"),
        ("a.png", {"gamma": -2.2}, "gamma: -2.2"),
        ("a.png", {"gamma": "sRGB"}, "gamma: 'sRGB'"),
        ("a.png", {"gamma": float("nan")}, "gamma: nan"),
        ("a.png", {"gamma": True}, "gamma: True"),
        ("a.png", {"exposure": float("inf")}, "exposure: inf"),
        ("a.png", {"exposure": 2000}, "exposure: 2000"),
        ("a.png", {"layers": ["RGB"]}, "layers do not apply"),
        ("a.exr", {"gamma": 0}, "gamma: 0"),
    ],
)
def test_wishes_that_cannot_be_met_are_refused_before_and_at_the_writing(
    name: str, wishes: dict, part: str, tmp_path
) -> None:
    for attempt in (check_destination, grey(1).write):
        with pytest.raises(UserError) as caught:
            attempt(tmp_path / name, **wishes)
        assert part in line_of(caught)
    assert os.listdir(tmp_path) == []


def test_places_that_cannot_be_written_are_one_line(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    (tmp_path / "folder.exr").mkdir()
    os.symlink("/dev/null", "null.exr")
    for path, line in (
        ("out/x.exr", "out/x.exr: the folder 'out' does not exist; create it first"),
        ("folder.exr", "folder.exr: this is a folder; give the name of a file in it"),
        ("file/x.exr", "file/x.exr: 'file' is a file, not a folder; write to another folder"),
        ("null.exr", "null.exr: this is not a regular file; choose another name"),
        ("n" * 300 + ".exr", "n" * 300 + ".exr: cannot be written, the name is too long; choose a shorter one"),
    ):
        for attempt in (files.check_writable, grey(1).write):
            with pytest.raises(UserError) as caught:
                attempt(path)
            assert line_of(caught) == line
    files.check_writable("x.exr")
    assert sorted(os.listdir()) == ["file", "folder.exr", "null.exr"]
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


@pytest.mark.skipif(ROOT, reason="root may write everywhere")
def test_permissions_are_one_line(tmp_path) -> None:
    folder, old = tmp_path / "folder", tmp_path / "old.exr"
    folder.mkdir(0o500)
    old.touch(0o400)
    with pytest.raises(UserError, match="no permission"):
        files.check_writable(folder / "x.exr")
    with pytest.raises(UserError, match="write-protected"):
        files.check_writable(old)


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.ENOSPC, errno.EIO])
def test_refusals_of_the_system_are_one_line_before_the_render(number: int, tmp_path, monkeypatch) -> None:
    def refuse(*_: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(UserError) as caught:
        files.check_writable(tmp_path / "x.exr")
    assert line_of(caught).startswith(f"{tmp_path / 'x.exr'}: cannot be written, ")


class Boom(BaseException):
    """What no `except Exception` catches."""


@pytest.mark.parametrize("error", [KeyboardInterrupt(), Boom(), ValueError(), UserError("x")])
def test_the_old_file_survives_any_failure_and_nothing_is_left(error: BaseException, tmp_path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(b"old")
    with pytest.raises(type(error)), files.replacing(path) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".exr"
        temporary.write_bytes(b"half")
        raise error
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.exr"]


@pytest.mark.parametrize("suffix", [".exr", ".png"])
@pytest.mark.parametrize("when", ["fsync", "replace"])
def test_a_disk_that_fills_up_is_one_line_and_costs_nothing(suffix: str, when: str, tmp_path, monkeypatch) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, when, full)
    with pytest.raises(UserError) as caught:
        grey(1).write(path)
    assert line_of(caught) == f"{path}: cannot be written, the disk is full; free some space or write to another disk"
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("suffix", [".exr", ".png"])
def test_a_device_that_is_really_full(suffix: str, tmp_path, monkeypatch) -> None:
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full")
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")
    reserved = files._reserved

    @contextlib.contextmanager
    def reserved_full(target: Path) -> Iterator[Path]:
        with reserved(target) as temporary:
            temporary.unlink()
            temporary.symlink_to("/dev/full")
            yield temporary

    monkeypatch.setattr(files, "_reserved", reserved_full)
    picture = Image({"RGB": np.random.default_rng(1).random((300, 400, 3), np.float32)})
    with pytest.raises(UserError, match="the disk is full"):
        picture.write(path)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == [path.name]
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.parametrize("suffix", [".exr", ".png"])
def test_a_file_system_that_is_really_full(suffix: str, tmp_path) -> None:
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(tmp_path)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no file system can be mounted here")
    try:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(b"old")
        picture = Image({"RGB": np.random.default_rng(1).random((300, 400, 3), np.float32)})
        with pytest.raises(UserError, match="the disk is full"):
            picture.write(path)
        assert path.read_bytes() == b"old"
        assert os.listdir(tmp_path) == [path.name]
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


def test_a_new_file_has_the_usual_permissions_and_an_old_one_keeps_its_own(tmp_path) -> None:
    usual, path = tmp_path / "usual", tmp_path / "a.exr"
    usual.touch()
    grey(1).write(path)
    assert path.stat().st_mode == usual.stat().st_mode
    path.chmod(0o640)
    grey(1).write(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_link_stays_and_its_target_is_replaced(tmp_path) -> None:
    (tmp_path / "far").mkdir()
    target, link = tmp_path / "far" / "real.exr", tmp_path / "a.exr"
    link.symlink_to(target)
    grey(1).write(link)
    grey(0.5).write(link)
    assert link.is_symlink()
    assert (Image.read(target)["RGB"] == 0.5).all()
    assert os.listdir(tmp_path / "far") == ["real.exr"]


def test_clamped_colours_are_noted_and_float_keeps_them(tmp_path) -> None:
    rgb = np.full((3, 4, 3), 0.5, np.float32)
    rgb[0, 1, 2], rgb[2, 3] = 784588, (-70000, 1, 2)
    picture = Image({"RGB": rgb, "albedo": np.ones_like(rgb), "Z": np.full((3, 4), 1e9, np.float32)})
    with pytest.warns(RangeWarning) as noted:
        picture.write(tmp_path / "half.exr")
    (note,) = noted
    assert str(note.message) == (
        f"{tmp_path / 'half.exr'}: 2 pixels of RGB are beyond 65504, the largest half float, and clamped to it; "
        "the largest is 784588; write float colours: --float, or write(..., float32=True)"
    )
    assert note.filename == __file__
    with pytest.warns(RangeWarning, match="784588; the error that is stated leaves this out; write float colours"):
        Image(picture.layers, {"error": 0.01}).write(tmp_path / "stated.exr")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture.write(tmp_path / "float.exr", float32=True)
        Image({"RGB": np.full((1, 1, 3), 65504, np.float32)}).write(tmp_path / "least.exr")
    found = {name: Image.read(tmp_path / f"{name}.exr")["RGB"] for name in ("half", "float")}
    assert np.array_equal(found["float"], rgb)
    assert np.array_equal(found["half"], np.clip(rgb, -65504, 65504))
    file = OpenEXR.File(str(tmp_path / "float.exr"), separate_channels=True)
    assert {str(c.pixels.dtype) for c in file.channels().values()} == {"float32"}


def test_float_colours_are_rounded_less() -> None:
    rgb = np.random.default_rng(0).uniform(0.5, 2, (9, 9, 3))
    assert rounding(rgb, "a.exr", float32=True) < 2.0**-24
    assert 2.0**-14 < rounding(rgb, "a.exr") < 2.0**-11


@pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")
def test_files_of_processes_that_were_killed_are_removed(tmp_path) -> None:
    """And no others: not those of living processes, not those that are locked, and nothing of another name."""
    code = "from visray.output.files import replacing\nimport sys, time\n"
    code += f"with replacing({str(tmp_path / 'a.exr')!r}):\n    print('in', flush=True)\n    time.sleep(60)"
    writer = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert writer.stdout.readline() == "in\n"
    (temporary,) = tmp_path.iterdir()
    others = [f".visray-{'0' * 16}.exr", ".visray-99.exr", f"visray-999999999-{'0' * 16}.exr", ".visray"]
    for name in others:
        (tmp_path / name).touch()
    check_writable(tmp_path / "b.exr")
    assert temporary.exists()
    writer.kill()
    writer.wait()
    assert temporary.exists()
    locked = temporary.with_name(temporary.name.replace(".exr", ".png"))
    with open(locked, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        check_writable(tmp_path / "b.exr")
        assert not temporary.exists() and locked.exists()
    check_writable(tmp_path / "b.exr")
    assert sorted(x.name for x in tmp_path.iterdir()) == sorted(others)


def test_openexr_prints_nothing_itself(tmp_path, capfd) -> None:
    full_picture().write(tmp_path / "a.exr")
    whole = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "b.exr").write_bytes(whole[:-9] + bytes(9))
    (tmp_path / "c.exr").write_bytes(whole[: len(whole) - 5])
    for name in ("b.exr", "c.exr"):
        with contextlib.suppress(UserError):
            Image.read(tmp_path / name)
    os.system("echo shown")
    assert capfd.readouterr() == ("shown\n", "")


def test_what_cannot_be_written_is_kept_elsewhere(tmp_path, monkeypatch) -> None:
    """A full disk at the end of a long study or render: the file is in the folder for temporary files, or is told to
    be nowhere."""
    full, spare = tmp_path / "full", tmp_path / "spare"
    spare.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(spare))

    def write(path: Path, broken: tuple[Path, ...]) -> None:
        if path.parent in broken:
            raise UserError(f"{path}: cannot be written, the disk is full")
        path.write_text("study")

    written, problems = kept(full / "a.html", lambda path: write(path, (full,)))
    assert written.parent == spare and written.suffix == ".html" and written.read_text() == "study"
    assert problems == [f"{full / 'a.html'}: cannot be written, the disk is full; it is kept as {written}"]
    written, problems = kept(full / "a.html", lambda path: write(path, (full, spare)))
    assert written is None and [line.split(": ")[1] for line in problems] == ["cannot be written, the disk is full"] * 2
    assert kept(spare / "b.html", lambda path: write(path, ())) == (spare / "b.html", [])
