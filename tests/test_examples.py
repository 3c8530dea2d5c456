"""Each example runs in a folder of its own, and prints what it promises: the numbers are read and judged."""

import itertools
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))
# Libraries that an example may need and that visray does not.
LIBRARIES = ("torch", "jax")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|inf"


def numbers(text: str) -> list[float]:
    return [float(x) for x in re.findall(NUMBER, text)]


def csg_in_python(text: str) -> None:
    """A level leaves 8 of 9 squares: no pixel of the pictures is wrong. Both materials are in the large picture."""
    rows = [numbers(line) for line in text.splitlines()]
    assert [row[0] for row in rows] == [1, 2, 3]
    assert [row[1] for row in rows] == [round((8 / 9) ** level, 6) for level in (1, 2, 3)]
    red, green, blue = np.moveaxis(np.asarray(Pillow.open("sponge.png")).astype(int), -1, 0)
    clay, sand = (green < 1.25 * blue) & (red > 1.6 * blue), (green > 1.27 * blue) & (red > 1.4 * blue)
    assert clay.mean() > 0.1 and sand.mean() > 0.05


def data_on_a_globe(text: str) -> None:
    """The numbers are those of the table; Istanbul is seen north-west of Delhi."""
    table = (Path(__file__).resolve().parents[1] / "scenes" / "data" / "cities.csv").read_text().splitlines()[1:]
    found = {line.split(":")[0]: numbers(line.replace(",", "")) for line in text.splitlines()}
    for city, (row, people, *_) in found.items():
        cells = table[int(row)].split(",")
        assert cells[0] == city and float(cells[4]) == people
    (_, _, seen, x, y), (_, _, others, east, south) = found["Istanbul"], found["Delhi"]
    assert x < east and y < south and min(seen, others) > 50
    assert Path("data_on_a_globe.png").read_bytes()[16:24] == (640).to_bytes(4) + (360).to_bytes(4)


def fit_colour(text: str) -> None:
    """The colour that is fitted is the one that the picture was made with, to the last digit printed."""
    fitted, secret = (numbers(part) for part in text.removeprefix("found ").split("made with"))
    assert len(fitted) == 3 and np.abs(np.subtract(fitted, secret)).max() <= 1e-4


def fit_glass(text: str) -> None:
    """Newton's steps: six of them, ever smaller errors, and at last the index that the picture was made with."""
    steps = [numbers(line) for line in text.splitlines()]
    assert [step[0] for step in steps] == [1, 2, 3, 4, 5, 6]
    assert steps[-1][1] == 1.5 and steps[-1][2] < 1e-3 * steps[0][2]


def fit_with_torch(text: str) -> None:
    """Losses fall, and what is fitted is what the picture was made with, as printed."""
    *steps, last = text.splitlines()
    losses = [numbers(line)[1] for line in steps]
    assert losses == sorted(losses, reverse=True) and losses[-1] < 1e-4 * losses[0]
    fitted, secret = (numbers(part) for part in last.removeprefix("found ").split("made with"))
    assert len(fitted) == 6 and np.abs(np.subtract(fitted, secret)).max() <= 0.011


def fit_with_jax(text: str) -> None:
    """Losses fall to the square of a rounding in single, and the index is that of the picture."""
    steps = [numbers(line) for line in text.splitlines()]
    losses = [step[2] for step in steps]
    assert losses == sorted(losses, reverse=True) and losses[-1] < 1e-12
    assert steps[-1][:2] == [7, 1.45]


def hello(text: str) -> None:
    """The picture has the size that was asked for, on the screen and in the file."""
    assert numbers(text)[:2] == [480, 320] and "RGB" in text
    assert Path("hello.png").read_bytes()[16:24] == (480).to_bytes(4) + (320).to_bytes(4)


def layers(text: str) -> None:
    """All pixels are counted once; the depths are those of the file; nothing is seen at no finite depth."""
    *objects, last = text.splitlines()
    counts = {line.split()[0]: numbers(line.split(maxsplit=1)[1]) for line in objects}
    assert sum(count for count, _ in counts.values()) == 320 * 200
    assert counts.pop("nothing")[1] == np.inf and set(counts) == {"floor", "large", "middle", "small"}
    again = vr.Image.read("layers.exr")
    for number, (count, depth) in enumerate(counts.values(), 1):
        pixels = again["id"] == number
        assert pixels.sum() == count and abs(again["Z"][pixels].min() - depth) <= 0.00051
    # All of the floor faces straight up, and at most a hundredth of the balls; the percentage is printed rounded.
    floor = 100 * counts["floor"][0] / (320 * 200)
    assert floor - 0.5 <= numbers(last)[0] <= floor + 1 + 0.5


def mesh_from_numpy(text: str) -> None:
    """The number of pixels that show the wave, and the nearest depth, are those of the picture; pictures differ."""
    rows = [numbers(line) for line in text.splitlines()]
    assert [row[0] for row in rows] == [0, 1, 2, 3]
    assert all(0.2 * 480 * 320 < count < 0.6 * 480 * 320 and 3 < depth < 5 for _, count, depth in rows)
    pictures = [np.asarray(Pillow.open(f"wave{k}.png")) for k in range(4)]
    assert all((a != b).any() for a, b in itertools.combinations(pictures, 2))


def moving_light(text: str) -> None:
    """The warning says what is left out; the picture shows pixels that brighten, and pixels that darken."""
    assert "the derivative leaves them out" in text
    picture = np.asarray(Pillow.open("moving_light.png"))
    assert (picture[..., 0] > 0).mean() > 0.01 and (picture[..., 2] > 0).mean() > 0.01
    assert not (picture[..., 0].astype(bool) & picture[..., 2].astype(bool)).any()


def noise(text: str) -> None:
    """Errors fall with samples; stratified ones faster than independent ones, whose slope is -1/2."""
    *rows, last = text.splitlines()
    counts, errors = zip(*(numbers(line) for line in rows))
    assert counts == (4, 16, 64) and errors[0] > errors[1] > errors[2] > 0
    slope = float(re.search(r"samples\^(-[\d.]+)", last)[1])
    exact = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # Each error is printed to half of its fifth decimal.
    assert abs(slope - exact) <= 0.005 + 5e-6 / errors[2] and slope < -0.5


def penumbra(text: str) -> None:
    """The noise falls with the samples of the light, for every sampler. For independent ones it falls by the root of
    their number, 8, or by less, as edges within a pixel add their own; for the others it is less from 4 samples on."""
    table = {line.split()[0]: numbers(line)[1::2] for line in text.splitlines()}
    assert set(table) == {"independent", "stratified", "sobol"}
    assert all(row == sorted(row, reverse=True) and len(row) == 4 for row in table.values())
    independent = np.array(table.pop("independent"))
    assert 6 < independent[0] / independent[3] <= 8.5
    assert all((row[1:] < 0.8 * independent[1:]).all() for row in map(np.array, table.values()))


def slices(text: str) -> None:
    """The radius of the core in each picture is the true one, to half the diagonal of a pixel; both are rounded."""
    rows = [numbers(line) for line in text.splitlines()]
    assert [z for z, *_ in rows] == [0.6, 0.3, 0]
    for z, seen, true in rows:
        exact = max(0.45**2 - z * z, 0) ** 0.5
        assert abs(true - exact) <= 0.0005 and abs(seen - exact) <= 0.5**0.5 * 2.4 / 240 + 0.0005
    assert rows[0][1] == 0 < rows[1][1] < rows[2][1]


def to_an_error(text: str) -> None:
    """Each picture's error is at most the one asked for, and within its own limits; finer ones take more samples."""
    *rows, last = text.splitlines()
    asked, got, low, high, samples, least, most = zip(*(numbers(line) for line in rows))
    assert asked == (0.02, 0.005, 0.002)
    assert all(g <= a and l <= g <= h for a, g, l, h in zip(asked, got, low, high))
    assert samples[0] < samples[1] < samples[2] and all(l <= s <= m for l, s, m in zip(least, samples, most))
    # The last picture is the truth to 0.002; the first one is promised to 0.02.
    assert numbers(last)[0] <= 0.02 + 0.002


def what_is_simulated(text: str) -> None:
    """What is taken out of the scene is what is missing from the list, and nothing else."""
    effects = {line.split(": ")[0]: set(line.split(": ")[1].split(", ")) for line in text.splitlines()}
    whole = effects["as it is"]
    assert whole - effects["without shadows"] == {"shadows"} and effects["without shadows"] < whole
    assert whole - effects["without highlights"] == {"specular"} and effects["without highlights"] < whole


JUDGES = (
    csg_in_python, data_on_a_globe, fit_colour, fit_glass, fit_with_jax, fit_with_torch, hello, layers,
    mesh_from_numpy, moving_light, noise, penumbra, slices, to_an_error, what_is_simulated,
)  # fmt: skip
JUDGES = {judge.__name__: judge for judge in JUDGES}


def test_every_example_is_judged():
    assert {path.stem for path in EXAMPLES} == set(JUDGES), "an example needs a function of its name in this file"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path, monkeypatch, capsys):
    for library in set(LIBRARIES) & set(re.findall(r"^import (\w+)", path.read_text(), re.MULTILINE)):
        pytest.importorskip(library)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [path.name])
    runpy.run_path(str(path), run_name="__main__")
    JUDGES[path.stem](capsys.readouterr().out)


def test_examples_are_short():
    long = {p.stem: n for p in EXAMPLES if not 10 <= (n := len(p.read_text().splitlines())) <= 40}
    assert not long
