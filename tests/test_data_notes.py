"""What visray says of data that are odd: sizes below 0, rows that are not shown, and where wrong rows stand."""

import json
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray.data.gizmos import GIZMOS
from visray.data.palette import names, palette_of
from visray.data.reading import read_table
from visray.data_report import DataWarning, data_notes, warn_of_data
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.scene.check import checked

TABLE = {"lon": [0.0, 20.0, 40.0], "lat": [0.0, 10.0, 20.0], "heat": [5.0, -3.0, 9.0], "rain": [1.0, 20.0, 300.0]}
BASES = {"globe": vr.GlobeBase(), "map": vr.MapBase(), "plane": vr.PlaneBase()}
SOLIDS = [name for name in GIZMOS if name not in ("line", "geometry")]


def scene(base: str = "globe", legend: vr.Legend | None = None, **fields) -> vr.Scene:
    layer = vr.DataLayer(**{"source": TABLE} | fields)
    return checked(
        vr.Scene(data=vr.Data(base=BASES[base], layers={"caps": layer}, legend=legend), camera=vr.Camera(), lights={})
    )


def loaded(folder: Path, text: str, layer: dict, base: dict | None = None) -> vr.Scene:
    (folder / "caps.csv").write_text(text)
    data = {"base": base or {"type": "globe"}, "layers": {"caps": {"source": "caps.csv"} | layer}}
    (folder / "scene.json").write_text(json.dumps({"data": data, "camera": {}, "lights": {}}))
    return vr.load(folder / "scene.json")


def refused(*arguments, **fields) -> str:
    """The one line of the UserError."""
    with pytest.raises(UserError) as caught:
        (loaded if arguments else scene)(*arguments, **fields)
    (line,) = caught.value.lines
    return line


# Sizes


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("gizmo", SOLIDS)
def test_values_below_zero_have_a_note(gizmo: str, base: str) -> None:
    key = "height" if "height" in GIZMOS[gizmo].sizes else "radius"

    def below(rule: object) -> list[str]:
        return [note for note in data_notes(scene(base, gizmo=gizmo, **{key: rule})) if " are below 0;" in note]

    (note,) = below("heat")
    assert note.startswith(f'data.layers.caps: 1 of 3 values of {key} "heat" are below 0; their gizmos ')
    where = "look like" if GIZMOS[gizmo].flat else "inside the globe" if base == "globe" else "below the map"
    assert where in note
    assert not below(vr.SizeRule(column="heat", domain=(-5, 9))) and not below("rain")


def test_lines_have_no_widths_below_zero() -> None:
    line = {"type": "LineString", "coordinates": [[0, 0], [10, 10]]}
    source = {"type": "FeatureCollection",
              "features": [{"type": "Feature", "properties": {"v": v}, "geometry": line} for v in (1, -2)]}  # fmt: skip
    assert "must not be negative: row 1 (-2)" in refused(source=source, gizmo="line", radius="v")


@pytest.mark.parametrize("key", ["height", "radius"])
@pytest.mark.parametrize("domain", [None, (1.0, 300.0)])
def test_the_smallest_row_of_a_logarithmic_scale_is_seen(key: str, domain) -> None:
    rule = vr.SizeRule(column="rain", scale="log", domain=domain)
    rows = scene("map", **{key: rule}).data.rows["caps"]
    assert len(rows) == 3 and not rows.counts
    sizes = getattr(rows.stand, key)
    assert sizes.min() == pytest.approx(0.1 * sizes.max(), rel=1e-12)


@pytest.mark.parametrize("column", ["heat", "zero"])
def test_a_logarithmic_scale_refuses_what_has_no_logarithm(column: str) -> None:
    rule = vr.SizeRule(column=column, scale="log")
    line = refused(source=TABLE | {"zero": [5.0, 0.0, 9.0]}, height=rule)
    assert line.startswith(f'data.layers.caps.height.scale = "log": values of "{column}" must be above 0 for log, ')


@pytest.mark.parametrize(
    ("field", "rule"), [("color", {"column": "v", "norm": "log"}), ("height", {"column": "v", "scale": "log"})]
)
def test_wrong_values_are_named_by_their_lines(tmp_path, field: str, rule: dict) -> None:
    text = "lon,lat,v\n0,0,1\n1,1,2\n\n2,2,-0.4\n"
    line = refused(tmp_path, text, {field: rule})
    assert 'values of "v" must be above 0 for log, unlike line 5 (-0.4)' in line


def test_keys_of_a_logarithmic_scale_span_it() -> None:
    values = np.geomspace(0.25, 13, 9)
    source = {"lon": np.linspace(-90, 90, 9), "lat": np.zeros(9), "v": values}
    made = vr.Scene(
        camera=vr.Camera(origin=(2.5, 1.5, -0.6), fov=35),
        data=vr.Data(
            layers={"x": vr.DataLayer(source=source, height=vr.SizeRule(column="v", scale="log"))}, legend=vr.Legend()
        ),
        lights={},
    )
    (scale,) = legend_content(checked(made)).sizes
    numbers = [float(text) for text, _ in scale.entries]
    assert numbers[0] < 0.5 and numbers[-1] == 10


# How files were read

GERMAN = "Ort;lon;lat;v;w\nA;1,5;2,5;3,5;1\nB;20,25;1,5;4,5;2\nC;30;2;5;3\n"


def said(made: vr.Scene) -> list[str]:
    """The texts of the warnings of a render."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_of_data(made)
    assert {w.category for w in caught} <= {DataWarning} and {w.filename for w in caught} <= {__file__}
    return [str(w.message) for w in caught]


def test_how_a_file_was_read_is_one_short_line_and_explain_has_all(tmp_path) -> None:
    made = loaded(tmp_path, GERMAN, {"height": "v", "radius": "w", "name": "Ort"})
    notes = read_table(tmp_path / "caps.csv").notes
    assert len(notes) > 1
    (line,) = said(made)
    assert line == f"{tmp_path / 'caps.csv'}: the comma is decimal; visray explain has all {len(notes)} notes"
    assert set(data_notes(made)) == {f"{tmp_path / 'caps.csv'}: {note}" for note in notes}
    assert set(data_notes(made)) <= set(vr.explain(made).notes)
    (line,) = said(loaded(tmp_path, GERMAN.replace(";w", ";v"), {"height": "v (1)"}))
    assert line.startswith(f'{tmp_path / "caps.csv"}: the column "v" is there 2 times: v (1), v (2); visray explain ')


def test_files_below_the_current_folder_have_short_names(tmp_path, monkeypatch) -> None:
    made = loaded(tmp_path, GERMAN, {"source": "../" + tmp_path.name + "/caps.csv", "height": "v"})
    monkeypatch.chdir(tmp_path)
    assert said(made)[0].startswith("caps.csv: ")
    monkeypatch.chdir(tmp_path.parent)
    assert said(made)[0].startswith(f"{tmp_path.name}/caps.csv: ")


def test_layers_of_one_source_have_each_note_once(tmp_path) -> None:
    (tmp_path / "caps.csv").write_text(GERMAN + "D;x;1;2;3\n".replace("x", "") + "E;150;80;1;1\n")
    layer = {"source": "caps.csv", "height": "v", "gizmo": "cone"}
    base = {"type": "map", "extent": [-10, 40, -10, 40]}
    data = {"base": base, "layers": {"a": layer, "b": layer | {"gizmo": "box"}}}
    (tmp_path / "scene.json").write_text(json.dumps({"data": data, "camera": {}, "lights": {}}))
    of_file, outside, left_out = said(vr.load(tmp_path / "scene.json"))
    assert of_file.startswith(f"{tmp_path / 'caps.csv'}: ")
    assert outside == "data.layers.a and b: 1 row lies outside of the map and is not shown: line 6 (150, 80)"
    assert left_out == "data.layers.a and b: 3 rows are shown, and not: 1 without a position"


@pytest.mark.parametrize("missing", [1, 2])
def test_rows_in_the_colour_of_missing_values_are_shown(missing: int) -> None:
    heat = [None] * missing + [3.0] + [5.0] * (2 - missing)
    notes = [n for n in data_notes(scene(source=TABLE | {"heat": heat}, color="heat")) if "missing" in n]
    have = "has" if missing == 1 else "have"
    assert notes == [f"data.layers.caps: {missing} of the rows that are shown {have} the colour of missing values"]


def test_each_text_is_shown_once_at_the_line_of_the_program(tmp_path) -> None:
    (tmp_path / "once.py").write_text(
        "import warnings\n"
        "import visray as vr\n"
        "layer = vr.DataLayer(source={'lon': [1.0, 2.0], 'lat': [1.0, 2.0], 'v': [1.0, -1.0]}, height='v')\n"
        "scene = vr.Scene(film=vr.Film(width=8, height=8), data=vr.Data(layers={'caps': layer}))\n"
        "for _ in range(2):\n"
        "    vr.explain(scene)\n"
        "    vr.prepare(scene)\n"
        "vr.prepare(vr.replaced(scene, 'film.width', 9))\n"
    )
    done = subprocess.run([sys.executable, "once.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.count("DataWarning") == done.stderr.count("are below 0") == 1
    assert "once.py:7: DataWarning" in done.stderr


# Palettes with a middle, and glass

# As matplotlib lists them; newer ones are added below.
DIVERGING = ["PiYG", "PRGn", "BrBG", "PuOr", "RdGy", "RdBu", "RdYlBu", "RdYlGn", "Spectral", "coolwarm", "bwr"]
DIVERGING += ["seismic"]


def test_palettes_with_a_middle_are_those_that_matplotlib_calls_diverging() -> None:
    found = {name for name in names() if palette_of(name).diverging}
    assert found - {"berlin", "managua", "vanimo"} == set(DIVERGING)
    assert palette_of(["navy", "white", "tomato"]).diverging and not palette_of(["white", "navy"]).diverging


@pytest.mark.parametrize("name", [*DIVERGING, "RdBu_r"])
def test_a_middle_that_is_not_zero_has_a_note(name: str) -> None:
    values = np.array([-21.6, 3.0, 24.9])

    def middles(**fields) -> list[str]:
        return [n for n in vr.ColorRule(**{"column": "v", "palette": name} | fields).notes(values) if "middle" in n]

    (note,) = middles()
    assert f'The palette {name} has its middle at {1.65:.2g}, and not at 0; to have it there, write "norm": ' in note
    assert not middles(norm="symmetric") and not middles(domain=(-30, 20)) and not middles(palette="viridis")
    assert not vr.ColorRule(column="v", palette=name).notes(abs(values))[1:]


def test_glass_that_hides_colours_has_a_note() -> None:
    def of(**fields) -> list[str]:
        made = vr.Scene(
            materials={"glass": vr.Material(**{"kt": (0.9, 0.9, 0.9)} | fields)},
            data=vr.Data(layers={"caps": vr.DataLayer(source=TABLE, color="rain", material="glass")}),
            camera=vr.Camera(),
            lights={},
        )
        return [note for note in data_notes(checked(made)) if "glass" in note]

    (note,) = of()
    assert note.startswith("data.layers.caps.color: is hardly seen, as materials.glass lets 90% of the light through")
    right = json.loads(note.partition('"colored": ')[2].removesuffix(" there"))
    assert not of(colored=tuple(right)) and not of(kt=(0.3, 0.3, 0.3))
