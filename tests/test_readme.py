"""README says what is measured and what works."""

import json
import re
import sys
from pathlib import Path

import OpenEXR

import visray as vr

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()
sys.path.insert(0, str(ROOT / "reference"))
import readme_figures  # noqa: E402 - from the folder that the line above adds


def test_the_figures_are_those_of_the_reports():
    assert readme_figures.filled(README) == README


def test_a_table_has_a_line_a_row_and_escapes_bars():
    lines = readme_figures.table(["kind", "largest |dt|"], [["ball", 3], ["a | b", f"{0.5:.2f}"]])
    assert lines == ["", r"| kind | largest \|dt\| |", "|---|---|", "| ball | 3 |", r"| a \| b | 0.50 |", ""]


def test_the_reports_are_of_every_scene_and_all_passed():
    report = json.loads((ROOT / "reference" / "check_scenes.json").read_text())["scenes"]
    assert set(report) == {p.stem for p in (ROOT / "scenes").glob("*.json")} - {"schema"}
    assert all(r["passed"] for r in report.values())


def test_the_scene_in_the_readme_loads(tmp_path):
    text = re.search(r"```json\n(.*?)```", README, re.DOTALL)[1]
    (tmp_path / "scene.json").write_text(text)
    scene = vr.load(tmp_path / "scene.json")
    assert set(scene.objects) == {"floor", "ball", "post"}


def test_the_links_lead_somewhere():
    headings = {"#" + line.strip("# ").lower().replace(" ", "-") for line in re.findall(r"^#+ .*", README, re.M)}
    for target in re.findall(r"\]\(([^)h][^)]*)\)", README):
        assert target in headings if target.startswith("#") else (ROOT / target).exists(), target


def test_the_exr_has_the_channels_that_the_readme_lists(tmp_path):
    vr.render(str(ROOT / "scenes" / "sphere.json"), size=(8, 8), spp=2).write(tmp_path / "a.exr")
    found = set(OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels())
    assert {
        "R",
        "G",
        "B",
        "A",
        "Z",
        "dist.Z",
        "variance.R",
        "N.X",
        "P.X",
        "UV.U",
        "UV.V",
        "albedo.R",
        "id.object",
    } < found
