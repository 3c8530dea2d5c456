"""README and the pages of docs/: what they show runs, what they say of fields and options is so, and their figures are
those of the reports."""

import inspect
import json
import re
import shlex
import sys
import warnings
from dataclasses import MISSING, fields
from pathlib import Path

import OpenEXR
import pytest
from PIL import Image

import visray as vr
from visray import camera, lights, primitives, textures
from visray.animation import kinds as tracks
from visray.animation.track import TimedTrack
from visray.camera import Viewpoint
from visray.cli import program
from visray.cli.commands import app
from visray.cli.words import written_out
from visray.data import base
from visray.data.base import AnyBase
from visray.data.gizmos import GIZMOS
from visray.lights.light import AreaLight, Light
from visray.output.layers import BY_NAME, names_from
from visray.polynomials.catalogue import SURFACES
from visray.primitives.primitive import Primitive
from visray.scene.check import examined
from visray.scene.legacy.convert import LegacyWarning
from visray.textures import Texture

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = {"README": ROOT / "README.md"} | {
    path.relative_to(DOCS).with_suffix("").as_posix(): path for path in sorted(DOCS.rglob("*.md"))
}
sys.path.insert(0, str(ROOT / "reference"))
import compare_data  # noqa: E402 - from the folder that the line above adds
import docs_figures  # noqa: E402 - likewise

TEXTS = {name: path.read_text() for name, path in PAGES.items()}
page = pytest.mark.parametrize("page", PAGES)


def blocks(language: str) -> list:
    """The code blocks of all pages in a language, as parameters with names such as scenes-3."""
    parts = []
    for name, text in TEXTS.items():
        found = re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
        parts += [pytest.param(name, block, id=f"{name}-{i + 1}") for i, block in enumerate(found)]
    return parts


# Pages, figures, links.


def test_pages_are_short():
    lines = {name: text.count("\n") for name, text in TEXTS.items()}
    assert lines.pop("README") <= 200
    assert {name: count for name, count in lines.items() if count >= 300} == {}


@page
def test_a_page_begins_with_what_it_is_for(page):
    first, empty, second = TEXTS[page].splitlines()[:3]
    assert first.startswith("# ")
    assert empty == ""
    assert second[0].isalpha() or second.startswith("![")


@page
def test_the_figures_are_those_of_the_reports(page):
    assert docs_figures.filled(TEXTS[page]) == TEXTS[page]


def test_each_figure_stands_on_one_page():
    marks = [name for text in TEXTS.values() for name in re.findall("<!-- figures: (.*?) -->", text)]
    assert sorted(marks) == sorted(docs_figures.FIGURES)


def headings(text: str) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    lines = re.findall(r"^#+ (.*)", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).strip().replace(" ", "-") for line in lines}


def links(name: str) -> list[tuple[Path, str]]:
    """The files that a page links to or shows, and the heading in each."""
    targets = re.findall(r"\]\(([^)\s]+)\)|(?:src|href)=\"([^\"]+)\"", TEXTS[name])
    parts = [(a or b).partition("#") for a, b in targets if not (a or b).startswith("http")]
    return [(PAGES[name].parent / file if file else PAGES[name], anchor) for file, _, anchor in parts]


@page
def test_links_lead_somewhere(page):
    for file, anchor in links(page):
        assert file.exists(), file
        assert not anchor or anchor in headings(file.read_text()), f"{file}#{anchor}"


@pytest.mark.parametrize("start", ["README", "index"])
def test_each_page_is_reached_from_the_readme_and_from_the_first_page_of_the_site(start):
    """In one step; those of the reference only from the site."""
    reached = {file.resolve() for file, _ in links(start)}
    for name, path in PAGES.items():
        if name not in ("README", "index") and not (start == "README" and name.startswith("api/")):
            assert path.resolve() in reached, name


def test_each_picture_of_docs_is_shown_and_small():
    shown = {file.resolve() for name in PAGES for file, _ in links(name)}
    for picture in (ROOT / "docs").rglob("*.png"):
        assert picture.resolve() in shown, picture
        with Image.open(picture) as opened:
            assert max(opened.size) <= 2000
    for picture in (ROOT / "docs" / "gallery").glob("*.png"):
        assert picture.stat().st_size < 150_000, picture
        assert (ROOT / "scenes" / f"{picture.stem}.json").exists()


def test_a_table_has_a_line_a_row_and_escapes_bars():
    lines = docs_figures.table(["kind", "largest |dt|"], [["ball", 3], ["a | b", f"{0.5:.2f}"]])
    assert lines == ["", r"| kind | largest \|dt\| |", "|---|---|", "| ball | 3 |", r"| a \| b | 0.50 |", ""]


def test_the_reports_are_of_every_scene_and_all_passed():
    report = json.loads((ROOT / "reference" / "check_scenes.json").read_text())["scenes"]
    assert set(report) == {p.stem for p in (ROOT / "scenes").glob("*.json")} - {"schema"}
    assert all(r["passed"] for r in report.values())


def test_the_scripts_that_are_compared_have_the_lines_of_the_report():
    report = json.loads((ROOT / "reference" / "compare_data.json").read_text())["rows"]
    told = {f"{r['program']}_{r['picture']}.py": r["lines"] for r in report if r["program"] in compare_data.PROGRAMS}
    assert told == {
        path.name: compare_data.lines_of_code(path.read_text()) for path in compare_data.SCRIPTS.glob("*.py")
    }
    assert compare_data.lines_of_code('"""Title.\n\nMore."""\n\n# reason\nx = [\n    1\n]  # one\n') == 3


@page
def test_a_page_speaks_of_nothing_that_its_reader_does_not_have(page):
    """Paths of one machine, and words that only people who work on visray know."""
    text = re.sub(r"<!--.*?-->", "", TEXTS[page])
    assert not re.search(r"/work/|/tmp/|/home/|\bshared/|worktree|DESIGN|seed (format|scene)", text)


# What is shown runs.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with the scenes of the repository."""
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    (tmp_path / "textures").symlink_to(ROOT / "scenes" / "textures")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page, block", blocks("json"))
def test_a_scene_on_a_page_loads(page, block, folder):
    (folder / "scene.json").write_text(block)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LegacyWarning)
        scene = vr.load("scene.json", allow_outside=True)  # the folder has links to files of scenes/
    for texture in scene.textures.values():
        assert Path(getattr(texture, "file", ".")).exists()


@pytest.mark.filterwarnings("error")
def test_the_setup_file_on_the_page_of_visraytrace_belongs_to_its_scene(folder):
    for name, language in (("scene", "json"), ("setup", "json setup")):
        block = next(p.values[1] for p in blocks(language) if p.values[0] == "visraytrace")
        (folder / f"{name}.json").write_text(block)
    assert set(vr.load(folder / "scene.json", folder / "setup.json").objects) == {"ball", "floor"}


@pytest.mark.filterwarnings("ignore::visray.EdgeWarning")
@pytest.mark.parametrize("page, block", blocks("python"))
def test_a_script_on_a_page_runs(page, block, folder, monkeypatch):
    """What it prints is not looked at. Libraries that visray does not need may be missing."""
    for library in re.findall(r"^import (torch|jax)$", block, re.MULTILINE):
        pytest.importorskip(library)
    run_small(block, f"{page}.md", monkeypatch)


@pytest.mark.parametrize("script", sorted(compare_data.SCRIPTS.glob("visray_*.py")), ids=lambda path: path.stem)
def test_a_script_that_is_compared_with_other_programs_runs(script, folder, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(script), "picture.png"])
    run_small(script.read_text(), script.name, monkeypatch)
    assert Path("picture.png").exists()


def run_small(text, name, monkeypatch):
    """Runs a script with few samples, on small pictures."""
    render, load, scene = vr.render, vr.load, vr.Scene
    small = vr.Film(width=16, height=12)
    monkeypatch.setattr(vr, "Scene", lambda **parts: scene(**parts | {"film": small}))
    monkeypatch.setattr(vr, "load", lambda *a, **k: vr.replaced(load(*a, **k), "film", small))
    monkeypatch.setattr(vr, "render", lambda made, **k: render(made, **k | {"size": (16, 12), "progress": False}))
    monkeypatch.setattr(vr, "cost", _stub(vr.cost))
    monkeypatch.setattr(vr, "tune", _stub(vr.tune))
    exec(compile(re.sub(r"\bspp=\d+", "spp=2", text), name, "exec"), {"__name__": "__main__"})


class _Record:
    """Stands for a record of a class: has its attributes, all of them None, and its methods, which do nothing."""

    def __init__(self, kind):
        self._kind = kind

    def __getattr__(self, name):
        if name in self._kind.__dataclass_fields__:
            return None
        method = inspect.signature(getattr(self._kind, name))
        return lambda *args, **kwargs: method.bind(self, *args, **kwargs) and None


def _stub(function):
    """A function that takes what another one takes, and does nothing: the studies have tests of their own."""
    signature = inspect.signature(function)

    def stub(*args, **kwargs):
        signature.bind(*args, **kwargs)
        return _Record(signature.return_annotation)

    return stub


def commands() -> list:
    """Every line of the shell blocks that starts with visray, without its comment."""
    found = []
    for param in blocks("sh") + blocks("console"):
        page, block = param.values
        for line in block.replace("\\\n", " ").splitlines():
            for part in line.split("&&"):
                words = shlex.split(part.removeprefix("$ "), comments=True)
                if words and Path(words[0]).name == "visray":
                    found.append(pytest.param(page, words[1:], id=f"{page}: {shlex.join(words)}"))
    return found


@pytest.mark.parametrize("page, words", commands())
def test_a_command_on_a_page_is_one(page, words):
    if not words or words in (["--help"], ["--version"], ["COMMAND", "--help"]):
        return
    command, *_ = app.parse_args(written_out(words), exit_on_error=False, print_error=False)
    assert command is not None
    for word in words[1:]:
        if word.startswith("scenes/"):
            assert (ROOT / word).exists()


def test_each_command_is_on_the_page_of_commands():
    text = TEXTS["command-line"]
    for name in app:
        if not name.startswith("-"):
            assert f"`visray {name}" in text or f"visray {name} " in text, name


# What is said of fields is so.


FOR_TABLES = {
    "Scene": vr.Scene, "Camera": Viewpoint, "Film": vr.Film, "Settings": vr.Settings, "Occlusion": vr.Occlusion,
    "EnvironmentMap": vr.EnvironmentMap,
    "Scatter": vr.Scatter, "Material": vr.Material, "Light": Light, "AreaLight": AreaLight, "Texture": Texture,
    "Object": Primitive, "Polynomial": vr.Polynomial, "Csg": vr.Csg, "Data": vr.Data, "AnyBase": AnyBase,
    "Animation": vr.Animation, "Shutter": vr.Shutter, "DataLayer": vr.DataLayer, "SizeRule": vr.SizeRule,
    "ColorRule": vr.ColorRule, "Legend": vr.Legend,
}  # fmt: skip


def own(kind: type, but: type | None = None) -> dict[str, object]:
    """The fields of a kind and their defaults as JSON; MISSING where there is none. Without those of another kind."""
    rest = {f.name for f in fields(but)} if but else set()
    defaults = {}
    for f in fields(kind):
        default = f.default_factory() if f.default_factory is not MISSING else f.default
        if f.name not in rest and f.name != "type":
            defaults[f.name] = default
    return defaults


def cells(table: str) -> list[list[str]]:
    """The rows of a Markdown table, without its head."""
    rows = [line.strip("|").split(" | ") for line in table.strip().splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows[2:]]


def told(name: str) -> str:
    """The table behind the mark <!-- fields: NAME -->, which stands on one page."""
    tables = [m[1] for text in TEXTS.values() for m in re.finditer(rf"<!-- fields: {name} -->\n+((?:\|.*\n)+)", text)]
    assert len(tables) == 1, name
    return tables[0]


def same(text: str, default: object) -> bool:
    """Whether a default on a page is that of the code."""
    if default is MISSING:
        return text == "required"
    if text == "none":
        return default is None or default in ({}, ())
    value = json.loads(text)
    return value == json.loads(json.dumps(default))


@pytest.mark.parametrize("name", FOR_TABLES)
def test_a_table_of_fields_has_all_of_them_with_their_defaults(name):
    kind = FOR_TABLES[name]
    but = {AreaLight: Light, vr.Polynomial: Primitive, vr.Csg: Primitive}.get(kind)
    expected = own(kind, but)
    rows = {row[0].strip("`"): row[1].strip("`") for row in cells(told(name))}
    assert list(rows) == list(expected)
    for field, text in rows.items():
        if text != "see below":
            assert same(text, expected[field]), f"{name}.{field}: {text}, and not {expected[field]}"


@pytest.mark.parametrize(
    "name, kinds, common",
    [
        ("lights", [k for k in lights.KINDS if not k.has_area], Light),
        ("area lights", [k for k in lights.KINDS if k.has_area], AreaLight),
        ("objects", [k for k in primitives.KINDS if k is not vr.Polynomial], Primitive),
        ("textures", textures.KINDS, Texture),
        ("cameras", camera.KINDS, Viewpoint),
        ("bases", base.KINDS, AnyBase),
        ("tracks", tracks.KINDS, TimedTrack),
    ],
)
def test_a_table_of_kinds_has_all_of_them_with_their_fields(name, kinds, common):
    rows = cells(told(name))
    assert {row[0].strip("`") for row in rows} == {k.type for k in kinds}
    for row in rows:
        kind = next(k for k in kinds if k.type == row[0].strip("`"))
        shown = dict(re.findall(r"`(\w+)` (required|\[.*?\]|\"[^\"]*\"|[-\w.]+)", row[1]))
        assert {k: v for k, v in own(kind, common).items() if not same(shown.get(k, "null"), v)} == {}, kind.type
        assert set(shown) == set(own(kind, common)), kind.type


def test_the_table_of_gizmos_has_all_of_them_with_their_sizes():
    rows = {row[0].strip("`"): tuple(re.findall(r"`(\w+)`", row[1])) for row in cells(told("gizmos"))}
    assert rows == {name: gizmo.sizes for name, gizmo in GIZMOS.items()}


@pytest.mark.parametrize("page", ["data", "legends"])
def test_every_choice_of_a_field_of_data_is_on_its_page(page):
    """The choices of fields that have a table on the page."""
    schema = json.loads((ROOT / "scenes" / "schema.json").read_text())["$defs"]
    kinds = [name for name in FOR_TABLES if f"<!-- fields: {name} -->" in TEXTS[page] and name in schema]
    assert kinds
    for name in (*kinds, *(("MapBase",) if page == "data" else ())):
        for field, described in schema[name]["properties"].items():
            for part in (described, *described.get("anyOf", ())):
                for choice in part.get("enum", ()):
                    assert f"`{choice}`" in TEXTS[page], f"{name}.{field}: {choice}"


def test_every_choice_of_a_setting_is_on_the_page_of_scenes():
    rows = {row[0].strip("`"): row for row in cells(told("Settings"))}
    schema = json.loads((ROOT / "scenes" / "schema.json").read_text())["$defs"]
    for field, described in schema["Settings"]["properties"].items():
        for choice in described.get("enum", ()):
            # The modes of shading have a table of their own, which is made from their records.
            text = TEXTS["scenes"] if field == "shading" else rows[field][2]
            assert f"`{choice}`" in text, f"settings.{field}: {choice}"


def test_the_table_of_exit_codes_has_all_of_them():
    """That a live picture ends with 0 at Ctrl-C is shown by test_endings.py."""
    rows = re.findall(r"^\| (\d+) \| (.*) \|$", TEXTS["command-line"], re.MULTILINE)
    codes = {program.BAD_INPUT, program.INTERNAL_ERROR, program.INTERRUPTED, program.TERMINATED}
    meanings = {int(code): text for code, text in rows}
    assert meanings.keys() == {0, 1, *codes}
    assert "visray view" in meanings[0] and "with 0" in meanings[program.INTERRUPTED]


def test_the_known_surfaces_are_counted_right():
    numbers = {int(n) for n in re.findall(r"(\d+) known surfaces", TEXTS["polynomial-surfaces"])}
    assert numbers == {len(SURFACES)}


def test_the_exr_has_the_channels_that_the_page_lists(folder):
    vr.render("scenes/sphere.json", size=(8, 8), spp=2).write("a.exr")
    channels = OpenEXR.File("a.exr", separate_channels=True).channels()
    types = {name: channel.pixels.dtype.name for name, channel in channels.items()}
    layers = [BY_NAME[name] for name in names_from("film", "first hit")]
    assert types == {name: layer.dtype for layer in layers for name in layer.channels}


# For pages with error messages: a scene that gets them.
BALL, HEART = {"type": "sphere"}, {"type": "polynomial", "surface": "heart"}
GLASS, RED = ({**BALL, "material": material} for material in ("glass", "red"))
WRONG = {
    "scenes": {"objects": {"ball": {"type": "sphere", "radius": -1, "colour": "red"}}, "camera": {}, "lights": {}},
    "csg": {
        "materials": {"glass": {"kt": [0.9, 0.9, 0.9]}, "red": {}},
        "objects": {
            "a": {"type": "csg", "op": "difference", "of": [BALL]},
            "b": {"type": "csg", "op": "difference", "of": [BALL, {"type": "disk"}]},
            "c": {"type": "csg", "op": "union", "of": {"ball": BALL, "heart": HEART}},
            "d": {"type": "csg", "op": "difference", "of": [GLASS, RED]},
        }, "camera": {}, "lights": {},
    },
}  # fmt: skip


@pytest.mark.parametrize("page", WRONG)
def test_an_error_message_on_a_page_is_what_visray_says(page):
    """Each line is all that visray says of the object that it names. visray does not say all of them at once, because
    some mistakes are only looked for where there are no others."""
    wrong = re.search(r"```text\n(.*?)```", TEXTS[page], re.DOTALL)[1]
    raw, said = WRONG[page], []
    for name, obj in raw["objects"].items():
        said += examined(raw | {"objects": {name: obj}})[1]
    assert wrong.splitlines() == said
