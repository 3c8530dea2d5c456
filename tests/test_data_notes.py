"""What visray says of data that are odd: sizes below 0, rows that are not shown, and where wrong rows stand."""

import json
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray.data.gizmos import GIZMOS
from visray.data_report import data_notes
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.scene.check import checked

TABLE = {"lon": [0.0, 20.0, 40.0], "lat": [0.0, 10.0, 20.0], "heat": [5.0, -3.0, 9.0], "rain": [1.0, 20.0, 300.0]}
BASES = {"globe": vr.GlobeBase(), "map": vr.MapBase(), "plane": vr.PlaneBase()}
SOLIDS = [name for name in GIZMOS if name not in ("line", "geometry")]


def scene(base: str = "globe", legend: vr.Legend | None = None, **fields) -> vr.Scene:
    layer = vr.DataLayer(**{"source": TABLE} | fields)
    return checked(vr.Scene(data=vr.Data(base=BASES[base], layers={"caps": layer}, legend=legend)))


def loaded(folder: Path, text: str, layer: dict, base: dict | None = None) -> vr.Scene:
    (folder / "caps.csv").write_text(text)
    data = {"base": base or {"type": "globe"}, "layers": {"caps": {"source": "caps.csv"} | layer}}
    (folder / "scene.json").write_text(json.dumps({"data": data}))
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
    )
    (scale,) = legend_content(checked(made)).sizes
    numbers = [float(text) for text, _ in scale.entries]
    assert numbers[0] < 0.5 and numbers[-1] == 10
