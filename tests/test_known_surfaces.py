"""The known surfaces: their singular points are counted right, their views show them, and the command and the contact
sheet tell and show them."""

import json
import os
import signal
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy
from PIL import Image

import visray as vr
from visray.cli import main
from visray.errors import UserError
from visray.polynomials.catalogue import SURFACES
from visray.surface_picture import sheet
from visray.surface_picture.captions import captioned
from visray.surface_picture.known_report import as_json, degree
from visray.surface_picture.look import BACKGROUND

# Surfaces whose singular points are found fast enough for the quick suite.
FAST = ("cayley-cubic", "ding-dong", "kummer", "piriform", "spindle-torus", "vis-a-vis", "monkey-saddle", "chmutov-4")
# Shown in the quick suite: one that is centred elsewhere, and one with a direction upwards of its own.
SHOWN = ("zitrus", "clebsch-cubic", "distel")


def derivatives(name: str):
    """A function of points that gives f, its gradient and its second derivatives. Shapes: (3, N) to (10, N)."""
    known, variables = SURFACES[name], sympy.symbols("x y z")
    names = dict(zip("xyz", variables)) | {"phi": (1 + sympy.sqrt(5)) / 2, "sqrt": sympy.sqrt, "pi": sympy.pi}
    f = sympy.sympify(known.expression.replace("^", "**"), locals=names | known.parameters)
    first = [sympy.diff(f, v) for v in variables]
    second = [sympy.diff(g, v) for g in first for v in variables]
    compiled = sympy.lambdify(variables, [f, *first, *second], "numpy", cse=True)
    return lambda p: np.stack([np.broadcast_to(np.asarray(v, float), p.shape[1:]) for v in compiled(*p)])


def singular_points(name: str, starts: int) -> np.ndarray:
    """Singular points in the sphere, which Newton's method finds from random points. Shape: (M, 3)."""
    known, of, rng = SURFACES[name], derivatives(name), np.random.default_rng(0)
    centre, r = np.array(known.centre), known.radius
    p = rng.normal(size=(starts, 3))
    p = centre + 1.1 * r * p * (rng.uniform(size=starts) ** (1 / 3) / np.linalg.norm(p, axis=1))[:, None]
    unit = float(np.median(np.abs(of(centre[:, None] + 0.5 * r * rng.normal(size=(3, 1000)))[0])))
    for _ in range(50):
        values = of(p.T)
        gradient, second = values[1:4].T, values[4:].T.reshape(-1, 3, 3)
        square = second.transpose(0, 2, 1) @ second
        square = square + (1e-14 * np.trace(square, axis1=1, axis2=2) + 1e-300)[:, None, None] * np.eye(3)
        step = np.linalg.solve(square, second.transpose(0, 2, 1) @ gradient[..., None])[..., 0]
        length = np.linalg.norm(step, axis=1)
        p = p - step * np.minimum(1, 0.2 * r / np.maximum(length, 1e-300))[:, None]
    values = of(p.T)
    flat = (np.abs(values[0]) < 1e-9 * unit) & (np.linalg.norm(values[1:4], axis=0) < 1e-7 * unit / r)
    found = p[flat & (np.linalg.norm(p - centre, axis=1) <= r)]
    kept = np.zeros((0, 3))
    for q in found:
        if not len(kept) or np.linalg.norm(kept - q, axis=1).min() > 2e-3 * r:
            kept = np.concatenate([kept, q[None]])
        if len(kept) > 400:
            break
    return kept


def count_is_right(name: str, starts: int) -> None:
    known, found = SURFACES[name], singular_points(name, starts)
    if known.singular_count is None:
        assert len(found) > 20 and known.singular_curves
    else:
        assert len(found) == known.singular_count and not known.singular_curves


@pytest.mark.parametrize("name", FAST)
def test_singular_points_are_counted(name):
    count_is_right(name, 1500)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SURFACES if name not in FAST])
def test_singular_points_of_all_are_counted(name):
    count_is_right(name, 40_000)


@pytest.mark.parametrize("name", SURFACES)
def test_what_is_said_of_one_agrees(name):
    known = SURFACES[name]
    assert known.singular_count is None or known.singular_count >= len(known.singular)
    assert bool(known.singular_curves) == (known.singular_count is None)
    view = known.view
    lengths = np.linalg.norm(view.direction) * np.linalg.norm(view.up)
    assert abs(np.dot(view.direction, view.up)) < 0.95 * lengths
    assert view.zoom > 0 and (view.clip is None or view.clip > 0)


def test_they_stand_by_degree():
    degrees = [degree(known) for known in SURFACES.values()]
    assert degrees == sorted(degrees) and degrees[-1] == 12
    assert degree(SURFACES["barth-sextic"]) == 6 and degree(SURFACES["labs-septic"]) == 7


def covered(name: str) -> np.ndarray:
    """Where the picture of a known surface shows it. Shape: bool (64, 64)."""
    picture = vr.render(vr.surface_scene(name, size=(64, 64)), spp=4, layers=("RGB",), progress=False)["RGB"]
    return (np.abs(picture - np.array(BACKGROUND, np.float32)) > 1e-4).any(axis=2)


def is_shown_well(name: str) -> None:
    """It fills the picture, and nothing of it is cut by the edges of the picture."""
    seen = covered(name)
    assert 0.12 < seen.mean() < 0.9
    assert not (seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any())
    across, down = np.flatnonzero(seen.any(axis=0)), np.flatnonzero(seen.any(axis=1))
    assert max(np.ptp(across), np.ptp(down)) > 48


@pytest.mark.parametrize("name", SHOWN)
def test_it_is_shown_well(name):
    is_shown_well(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SURFACES if name not in SHOWN])
def test_all_are_shown_well(name):
    is_shown_well(name)


def test_enneper_contains_its_parametrisation():
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-1.5, 1.5, (2, 200))
    p = np.stack([u - u**3 / 3 + u * v**2, v - v**3 / 3 + v * u**2, u**2 - v**2])
    of = derivatives("enneper")
    assert np.abs(of(p)[0]).max() < 1e-9 * np.abs(of(p + 0.5)[0]).max()


# The command


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Exit code, output and error stream of a command."""
    code = main([*words])
    return code, *capsys.readouterr()


def test_the_list_has_all_names_whole(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = said(capsys, "surfaces")
    rows = [line for line in out.splitlines() if line.startswith("│")]
    first = [row.split("│")[1].strip() for row in rows]
    assert code == 0 and [name for name in first if name] == list(SURFACES)
    titles = [row.split("│")[2].strip() for row in rows]
    assert [title for title in titles if title] == [known.title for known in SURFACES.values()]
    assert [cell.strip() for cell in out.splitlines()[2].split("┃")[1:3]] == ["name", "surface"]
    assert "…" not in out
    assert max(map(len, out.splitlines()[:-1])) <= 80
    (kummer,) = (row for row in rows if " kummer " in row)
    assert [cell.strip() for cell in kummer.split("│")[3:6]] == ["4", "16", "mu = 1.3"]
    (boy,) = (row for row in rows if " boy " in row)
    assert [cell.strip() for cell in boy.split("│")[3:6]] == ["6", "curves", ""]
    chair = next(i for i, row in enumerate(rows) if " chair " in row)
    assert [row.split("│")[5].strip() for row in rows[chair : chair + 3]] == ["a = 0.95", "b = 0.8", "k = 5"]


def test_one_surface_is_told_whole(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = said(capsys, "surfaces", "labs-septic")
    formula = "".join(row.split("│")[2].strip() for row in out.splitlines() if row.count("│") == 3)
    assert code == 0 and SURFACES["labs-septic"].expression.replace(" ", "") in formula.replace(" ", "")
    for text in ("Labs septic", "71", "alpha = -0.140107", "Labs 2006", "visray surface labs-septic"):
        assert text in out


def test_reports_as_json(capsys):
    everything = json.loads(said(capsys, "surfaces", "--json")[1])
    assert list(everything) == list(SURFACES)
    one = json.loads(said(capsys, "surfaces", "kummer", "--json")[1])["kummer"]
    assert one["degree"] == 4 and one["singular_count"] == 16 and one["parameters"] == {"mu": 1.3}
    assert one["view"]["up"] == [0, 0, 1] and everything["kummer"] == one
    two = json.loads(said(capsys, "surfaces", "--only", "torus,heart", "--json")[1])
    assert list(two) == ["torus", "heart"] == list(as_json(["torus", "heart"]))


WRONG = {
    ("klein",): "surfaces: there is no surface 'klein'; did you mean \"klein-bottle\"?",
    ("barth",): 'surfaces: there is no surface \'barth\'; did you mean "barth-decic" or "barth-sextic"?',
    ("kumer",): "surfaces: there is no surface 'kumer'; did you mean \"kummer\"?",
    ("--only", "heart,tors"): "surfaces: there is no surface 'tors'; did you mean \"torus\"?",
    ("--only", ","): "--only: names no surface; write names",
    ("heart", "--only", "torus"): "--only: names surfaces, and so does the word before it",
    ("--columns", "3"): "--columns: is for the pictures of --sheet",
    ("--size", "9x9"): "--size: is for the pictures of --sheet",
    ("--sheet", "a.jpg"): "a.jpg: a contact sheet is a .png file; end the name so",
    ("--sheet", "nowhere/a.png"): "nowhere/a.png: the folder 'nowhere' does not exist",
    ("--sheet", "a.png", "--columns", "0"): "columns = 0: must be a whole number greater than 0",
    ("--sheet", "a.png", "--size", "9"): "--size = '9': must be WIDTHxHEIGHT",
    ("--sheet", "a.png", "--size", "9000x9000"): "size: the sheet would be",
}


@pytest.mark.parametrize("words", WRONG, ids=" ".join)
def test_what_is_wrong_gets_one_line(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = said(capsys, "surfaces", *words)
    assert code == 2 and out == "" and len(err.splitlines()) == 1
    assert WRONG[words] in err
    assert not list(Path().iterdir())


# The contact sheet


def test_a_sheet_has_a_picture_and_a_caption_of_each(capsys, tmp_path):
    path = tmp_path / "a.png"
    names = "torus,double-cone,monkey-saddle"
    words = ("surfaces", "--sheet", str(path), "--only", names, "--size", "60x40", "--columns", "2", "--json")
    code, out, _ = said(capsys, *words)
    report = json.loads(out)
    with Image.open(path) as picture:
        pixels = np.array(picture)
    caption = sheet.LEAST_CAPTION
    assert code == 0 and report["surfaces"] == names.split(",") and not report["stopped"]
    assert pixels.shape == (2 + 2 * (40 + caption + 2), 2 + 2 * 62, 3)
    assert (report["width"], report["height"]) == (pixels.shape[1], pixels.shape[0])
    for i in range(3):
        y, x = 2 + i // 2 * (42 + caption), 2 + i % 2 * 62
        tile, below = pixels[y : y + 40, x : x + 60], pixels[y + 40 : y + 40 + caption, x : x + 60]
        assert len(np.unique(tile.reshape(-1, 3), axis=0)) > 100
        assert below.max() == 255 and below.min() < 120
    assert (pixels[44 + caption :, 64:] == 255).all()


def test_ctrl_c_keeps_the_pictures_that_are_finished(capsys, tmp_path, monkeypatch):
    made = []

    def picture(name, size, spp):
        made.append(name)
        if len(made) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return np.zeros((size[1], size[0], 3), np.uint8)

    monkeypatch.setattr(sheet, "_picture", picture)
    path = tmp_path / "a.png"
    code, out, _ = said(capsys, "surfaces", "--sheet", str(path), "--size", "40x40")
    assert code == 130 and "with 2 of 40 surfaces" in out and len(made) == 3
    with Image.open(path) as drawn:
        assert drawn.size[1] == 2 + 40 + sheet.LEAST_CAPTION + 2
        assert json.loads(drawn.info["visray/surfaces"]) == list(SURFACES)[:2]


def test_a_sheet_of_nothing_is_not_written(tmp_path, monkeypatch):
    def picture(name, size, spp):
        os.kill(os.getpid(), signal.SIGINT)
        return np.zeros((size[1], size[0], 3), np.uint8)

    monkeypatch.setattr(sheet, "_picture", picture)
    path = tmp_path / "a.png"
    assert main(["surfaces", "--sheet", str(path)]) == 2 and not path.exists()
    assert sheet.contact_sheet(("torus",), progress=False).names == ()


def test_long_captions_become_smaller():
    for width in (60, 100, 240):
        strip = captioned(np.zeros((9, width, 3), np.uint8), "Quartic of the report on VisRayTrace", "x" * 60, 30)[9:]
        dark = np.flatnonzero((strip < 200).any(axis=(0, 2)))
        assert strip.shape == (30, width, 3) and dark[0] >= 0 and dark[-1] < width
        assert (strip[:, 0] > 150).all() and (strip[:, -1] > 150).all()


def test_columns_make_a_sheet_that_is_a_little_wider_than_high():
    for count in (1, 2, 9, 40):
        assert 1 <= sheet._columns(count, (240, 240)) <= count
    assert sheet._columns(40, (240, 240)) == 8
    assert all(a <= b for a, b in pairwise(sheet._columns(n, (240, 240)) for n in range(1, 60)))


def test_too_large_a_sheet_is_refused():
    with pytest.raises(UserError, match="size: the sheet would be 31,575 pixels long; at most 30,000"):
        sheet.contact_sheet(("torus", "heart"), (15_000, 10), 2, progress=False)
