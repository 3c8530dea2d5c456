"""README and the pages of docs/ say what is measured and what works."""

import json
import re
import sys
from pathlib import Path

import OpenEXR
import pytest

import visray as vr
from visray.output.layers import BY_NAME, names_from

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
sys.path.insert(0, str(ROOT / "reference"))
import docs_figures  # noqa: E402 - from the folder that the line above adds


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_the_figures_are_those_of_the_reports(page):
    text = page.read_text()
    assert docs_figures.filled(text) == text


def test_each_figure_stands_on_one_page():
    marks = [name for page in PAGES for name in re.findall("<!-- figures: (.*?) -->", page.read_text())]
    assert sorted(marks) == sorted(docs_figures.FIGURES)


def test_a_table_has_a_line_a_row_and_escapes_bars():
    lines = docs_figures.table(["kind", "largest |dt|"], [["ball", 3], ["a | b", f"{0.5:.2f}"]])
    assert lines == ["", r"| kind | largest \|dt\| |", "|---|---|", "| ball | 3 |", r"| a \| b | 0.50 |", ""]


def test_the_reports_are_of_every_scene_and_all_passed():
    report = json.loads((ROOT / "reference" / "check_scenes.json").read_text())["scenes"]
    assert set(report) == {p.stem for p in (ROOT / "scenes").glob("*.json")} - {"schema"}
    assert all(r["passed"] for r in report.values())


def headings(text: str) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    lines = re.findall(r"^#+ (.*)", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).strip().replace(" ", "-") for line in lines}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_the_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if target.startswith("http"):
            continue
        file, _, anchor = target.partition("#")
        place = page if not file else page.parent / file
        assert place.exists(), target
        assert not anchor or anchor in headings(place.read_text()), target


def test_the_exr_has_the_channels_that_the_page_lists(tmp_path):
    vr.render(str(ROOT / "scenes" / "sphere.json"), size=(8, 8), spp=2).write(tmp_path / "a.exr")
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    types = {name: channel.pixels.dtype.type for name, channel in channels.items()}
    layers = [BY_NAME[name] for name in names_from("film", "first hit")]
    assert types == {name: layer.dtype for layer in layers for name in layer.channels}
