"""Movies and names of frames: what is written is read back by the programs of others."""

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.errors import RangeWarning
from visray.output import movie_mp4, sequence
from visray.output.curves import linear
from visray.output.movie import FORMATS, check_movie, movie, seconds_of
from visray.output.movie_gif import MOST_FPS
from visray.output.movie_spool import milliseconds

SIZE = HEIGHT, WIDTH = 36, 64
COUNT = 5
# How far the mean colour of a frame may be off, in levels of 255: the 256 colours of a GIF are the coarsest.
MEAN_ERROR = 2.0
# Seconds in the file may be off by the unit of its format.
TICK = {".mp4": 1e-3, ".gif": 1e-2, ".webp": 1e-3}


def frames(count: int = COUNT, size: tuple[int, int] = SIZE, channels: int = 3) -> list[np.ndarray]:
    """Frames with smooth colours, whose mean differs from frame to frame."""
    y, x = np.mgrid[: size[0], : size[1]] / max(size)
    shades = [x, y, 1 - x, 0 * x + 0.6][:channels]
    return [np.round(255 * np.stack([s * (k + 1) / count for s in shades], -1)).astype(np.uint8) for k in range(count)]


def write(path: Path, pictures: list[np.ndarray], fps: float = 25) -> bytes:
    with movie(path, fps) as writer:
        for picture in pictures:
            writer.add(picture)
    return path.read_bytes()


def read(path: Path) -> tuple[list[np.ndarray], float]:
    """The frames of a movie, and how many seconds it takes."""
    if path.suffix == ".mp4":
        imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
        exact = ["-vf", "scale=flags=accurate_rnd+full_chroma_int"]
        source = imageio_ffmpeg.read_frames(str(path), output_params=exact)
        about = next(source)
        width, height = about["size"]
        shown = [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in source]
        return shown, len(shown) / about["fps"]
    shown, seconds = [], 0.0
    with Pillow.open(path) as picture:
        for number in range(picture.n_frames):
            picture.seek(number)
            picture.load()
            shown.append(np.array(picture if picture.mode == "RGBA" else picture.convert("RGB")))
            seconds += picture.info["duration"] / 1000
    return shown, seconds


@pytest.fixture(params=FORMATS)
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if request.param == ".mp4":
        pytest.importorskip("imageio_ffmpeg")
    return tmp_path / f"movie{request.param}"


def test_a_movie_holds_the_frames_in_their_colours_at_their_speed(path: Path) -> None:
    given = frames()
    write(path, given, 12.5)
    shown, seconds = read(path)
    assert len(shown) == COUNT and seconds == pytest.approx(COUNT / 12.5, abs=TICK[path.suffix])
    for one, other in zip(given, shown):
        assert other.shape == (*SIZE, 3)
        assert np.abs(other.mean((0, 1)) - one.mean((0, 1))).max() < MEAN_ERROR
        # Each frame is nearest to its own, so their order is right.
        assert np.argmin([np.abs(other.astype(float) - x).mean() for x in given]) == [
            i for i, x in enumerate(given) if x is one
        ]


def test_the_same_frames_give_the_same_bytes(path: Path) -> None:
    assert write(path, frames()) == write(path, frames())
    assert write(path, frames()) != write(path, frames()[::-1])


def test_pictures_of_a_loop_become_a_movie(path: Path) -> None:
    """Of Image, as they are shown, and of arrays, from a generator too."""
    pictures = frames()
    expected = write(path, pictures, 5)
    vr.write_movie(path.with_stem("arrays"), (picture for picture in pictures), fps=5)
    vr.write_movie(str(path.with_stem("one array")), np.stack(pictures), fps=np.int64(5))
    images = [vr.Image({"RGB": linear(picture / 255).astype(np.float32)}) for picture in pictures]
    vr.write_movie(path.with_stem("images"), iter(images), 5)
    for name in ("arrays", "one array", "images"):
        assert path.with_stem(name).read_bytes() == expected
    darker = [image.display("srgb", -1) for image in images]
    vr.write_movie(path.with_stem("darker"), images, 5, exposure=-1)
    assert path.with_stem("darker").read_bytes() == write(path.with_stem("as array"), darker, 5) != expected


@pytest.mark.parametrize(
    ("images", "message"),
    [
        ([], "a movie has at least one frame"),
        (5, "images = 5: must be a list or a generator of pictures"),
        (vr.Image({"RGB": np.ones((2, 2, 3), np.float32)}), "images = <Image 2 x 2: RGB>: must be a list or a gener"),
        ([frames()[0], 3], r"images\[1\] = 3: must be an Image, or a uint8 array"),
        ([frames()[0] / 255], r"images\[0\]: is an array of float64 with the shape \(36, 64, 3\); must be"),
        ([frames()[0][..., 0]], r"images\[0\]: is an array of uint8 with the shape \(36, 64\); must be"),
        ([frames()[0], frames()[0][1:]], "its frames have 64 x 36 pixels, and this one has 64 x 35"),
    ],
)
def test_what_is_no_picture_leaves_the_old_movie(tmp_path: Path, images: Any, message: str) -> None:
    path = tmp_path / "a.webp"
    first = write(path, frames())
    with pytest.raises(vr.UserError, match=message):
        vr.write_movie(path, images)
    assert path.read_bytes() == first and [x.name for x in tmp_path.iterdir()] == ["a.webp"]


def test_odd_sizes_are_padded_in_a_movie_that_has_only_even_ones(path: Path) -> None:
    odd = frames(size=(HEIGHT - 1, WIDTH - 1))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        write(path, odd)
    multiple = FORMATS[path.suffix].multiple
    assert [w.category for w in caught] == ([RangeWarning] if multiple == 2 else [])
    shown = read(path)[0][-1]
    assert shown.shape[:2] == (HEIGHT - 1 + (multiple == 2), WIDTH - 1 + (multiple == 2))
    assert np.abs(shown[: HEIGHT - 1, : WIDTH - 1].astype(float) - odd[-1]).mean() < 4 * MEAN_ERROR


def test_alpha_is_kept_or_lies_over_black(path: Path) -> None:
    given = frames(channels=4)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        write(path, given)
    has_alpha = FORMATS[path.suffix].has_alpha
    assert [w.category for w in caught] == ([] if has_alpha else [RangeWarning])
    shown = read(path)[0][-1]
    if has_alpha:
        assert shown.shape[2] == 4 and np.array_equal(shown[..., 3], given[-1][..., 3])
    else:
        black = given[-1][..., :3] * (given[-1][..., 3:] / 255)
        assert np.abs(shown.mean((0, 1)) - black.mean((0, 1))).max() < MEAN_ERROR


def test_a_movie_that_fails_leaves_the_old_one(path: Path) -> None:
    before = write(path, frames())
    with pytest.raises(KeyboardInterrupt), movie(path, 25) as writer:
        writer.add(frames()[0])
        raise KeyboardInterrupt
    with pytest.raises(vr.UserError, match="has at least one frame"), movie(path, 25):
        pass
    with pytest.raises(vr.UserError, match="its frames have 64 x 36 pixels, and this one has 36 x 64"):
        write(path, [*frames(), frames()[0].transpose(1, 0, 2)])
    assert path.read_bytes() == before and list(path.parent.iterdir()) == [path]


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes")
def test_a_file_that_grows_too_large_is_one_line(path: Path) -> None:
    """As on a full disk: what the system refuses in the middle."""
    program = f"""
import resource, numpy as np
from pathlib import Path
from visray.errors import UserError
from visray.output.movie import movie
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
noise = np.random.default_rng(0)
try:
    with movie(Path({str(path)!r}), 25) as writer:
        for k in range(60):
            writer.add(noise.integers(0, 256, (120, 160, 3), dtype=np.uint8))
except UserError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.count("\n") == 1 and done.stdout.startswith(f"{path}: cannot be written, the file would be")
    assert done.stderr == "" and list(path.parent.iterdir()) == []


@pytest.mark.parametrize("fps", [0, -1, float("nan"), float("inf"), True])
def test_no_movie_has_such_a_speed(path: Path, fps: float) -> None:
    with pytest.raises(vr.UserError, match=r"^fps = .*: must be a number of frames per second greater than 0"):
        write(path, frames(), fps)


def test_a_frame_that_lasts_too_long_is_refused_at_once(path: Path) -> None:
    longest = FORMATS[path.suffix].longest
    for fps in (0.99 / longest, 1e-300):
        with pytest.raises(vr.UserError, match=r"a frame would last .* s, and at most .* s fit into such a file; give"):
            check_movie(path, fps)
    with pytest.raises(vr.UserError, match="must be at most 1e"):
        check_movie(path, 10**400)
    check_movie(path, 1.001 / longest)


def test_a_frame_may_last_long(path: Path) -> None:
    fps = 1.001 / FORMATS[path.suffix].longest
    write(path, frames(), fps)
    assert seconds_of(path) == pytest.approx(len(frames()) / fps, rel=1e-4)


@pytest.mark.parametrize("name", ["a.mov", "a.avi", "a", "a.exr"])
def test_other_kinds_of_movies_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(vr.UserError, match=r"end it in \.mp4, \.gif or \.webp$"):
        write(tmp_path / name, frames())


def test_without_ffmpeg_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    movie_mp4._ffmpeg.cache_clear()
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(vr.UserError, match=r"^.*a\.mp4: .*pip install 'visray\[movie\]'"):
        write(tmp_path / "a.mp4", frames())


def test_a_gif_is_no_faster_than_programs_show_it(tmp_path: Path) -> None:
    with pytest.warns(RangeWarning, match="programs show a GIF slower"):
        write(tmp_path / "a.gif", frames(), 2 * MOST_FPS)


@pytest.mark.parametrize("unit", [1, 10])
def test_times_of_frames_add_up(unit: int) -> None:
    for fps in (24, 25, 30, 23.976):
        shown = milliseconds(240, fps, unit)
        assert all(t % unit == 0 for t in shown) and abs(sum(shown) - 240_000 / fps) <= unit / 2
        assert max(shown) - min(shown) <= unit


def test_names_of_frames() -> None:
    name = Path("out/shot.####.exr")
    assert sequence.is_pattern(name) and not sequence.is_pattern(Path("a#/shot.exr"))
    assert sequence.frame_file(name, 12) == Path("out/shot.0012.exr")
    assert sequence.frame_file(name, 123456) == Path("out/shot.123456.exr")
    assert sequence.frame_file(Path("#1.#.png"), 7) == Path("#1.7.png")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("shot.exr", r"is one file, and each frame needs its own; write .*shot\.####\.exr$"),
        ("shot.jpg", r"is no place for frames; right would be a folder"),
        ("shot.##.tif", r"is no place for frames; right would be a folder"),
    ],
)
def test_an_output_that_names_no_sequence(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(vr.UserError, match=message):
        sequence.patterns(tmp_path / name, "scene")


def test_a_folder_gets_the_name_of_the_scene(tmp_path: Path) -> None:
    assert sequence.patterns(tmp_path, "ball") == [tmp_path / "ball.####.exr", tmp_path / "ball.####.png"]
    assert sequence.patterns(Path("new"), "ball")[0] == Path("new/ball.####.exr")
    (tmp_path / "ball.0003.png").touch()
    assert sequence.existing(sequence.patterns(tmp_path, "ball"), range(5)) == [tmp_path / "ball.0003.png"]
