"""Lines of data: one object, one name and one number for each row of the source, whatever segments it has."""

import json

import numpy as np
import pytest

import visray as vr
from visray.columns import Names
from visray.data_picture import Wishes, data_picture
from visray.errors import UserError
from visray.scene.check import checked
from visray.written_out import written_out

# A row of two lines, one of a single segment, a point, and a line outside of the map.
FEATURES = (
    ("MultiLineString", [[[-9, 0], [-3, 4], [-1, -2]], [[-8, -6], [-2, -6]]], 1.0),
    ("LineString", [[2, -5], [8, 5]], 4.0),
    ("Point", [1, 1], 70.0),
    ("LineString", [[20, 5], [30, 5]], 900.0),
)
SEGMENTS = {0: 3, 1: 1}


def collection(features=FEATURES) -> dict:
    return {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": {"v": v}, "geometry": {"type": kind, "coordinates": at}}
            for kind, at, v in features
        ],
    }


@pytest.fixture
def source(tmp_path) -> str:
    path = tmp_path / "roads.geojson"
    path.write_text(json.dumps(collection()))
    return str(path)


def scene(source: str, gizmo: str = "line", kt: float = 0.0, **fields) -> vr.Scene:
    layer = vr.DataLayer(
        **{"source": source, "gizmo": gizmo, "color": "v", "material": "paint", "radius": 0.2} | fields
    )
    made = vr.Scene(
        camera=vr.Camera(origin=(0, 9, 6), fov=45),
        film=vr.Film(width=48, height=36),
        lights={"key": vr.PointLight(position=(4, 6, 5))},
        materials={"paint": vr.Material(kt=(kt,) * 3, colored=("kd",))},
        data=vr.Data(base=vr.MapBase(extent=(-10, 10, -10, 10), width=8.0), layers={"roads": layer}),
        settings=vr.Settings(spp=4),
    )
    return checked(made)


def test_a_line_is_one_object(source):
    made = scene(source)
    rows, objects = made.data.rows["roads"], made.all_objects
    assert np.unique(rows.number, return_counts=True)[1].tolist() == list(SEGMENTS.values())
    names = ["data.base", *(f"data.roads.{n}" for n in SEGMENTS)]
    assert list(objects) == names and len(objects) == len(names) == len(made.materials_of_objects())
    assert [name for name, _ in objects.items()] == names
    parts = [name for name, _ in objects.parts()]
    assert parts == ["data.base", "data.roads.0:0", "data.roads.0:1", "data.roads.0:2", "data.roads.1"]
    assert list(made.objects_of({"paint"})) == parts[1:]
    image = vr.render(made, progress=False)
    numbers = json.loads(image.metadata["objects"])
    assert numbers == {name: i for i, name in enumerate(names, 1)}
    assert set(np.unique(image["id"])) == {0, *numbers.values()}
    assert vr.value(made, "data.roads.1.color") == 4.0


@pytest.mark.parametrize("kt", [0.0, 0.6])
def test_lines_have_the_bits_of_objects_that_are_written_out(source, kt):
    """Also those of glass, whose segments overlap."""
    made = scene(source, kt=kt)
    twin = written_out(made)
    assert len(twin.objects) == 1 + sum(SEGMENTS.values())
    a, b = (vr.render(x, progress=False) for x in (made, twin))
    for name in set(a.layers) - {"id"}:
        assert np.array_equal(a[name], b[name], equal_nan=True), name
    # The segments of a line have its number.
    of_part = np.array([0, *(1 + list(made.all_objects).index(n.split(":")[0]) for n, _ in made.all_objects.parts())])
    assert np.array_equal(a["id"], of_part[b["id"]])


def test_the_derivative_by_a_line_is_that_of_all_its_segments(source):
    color = vr.ColorRule(column="v", domain=(0, 10))
    made = scene(source, color=color)
    found = vr.derivative(made, "data.roads.0.color", spp=4, progress=False)
    step = 1e-3
    sides = []
    for sign in (1, -1):
        features = [(kind, at, v + sign * step * (i == 0)) for i, (kind, at, v) in enumerate(FEATURES)]
        with open(source, "w") as file:
            json.dump(collection(features), file)
        sides.append(vr.render(scene(source, color=color), spp=4, progress=False)["RGB"].astype(float))
    expected = (sides[0] - sides[1]) / (2 * step)
    assert np.abs(expected).max() > 0
    assert found == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_names_with_repeats():
    names = Names(prefix="t", numbers=np.array([2, 2, 2, 5, 7, 7]))
    assert [names[i] for i in range(len(names))] == ["t2", "t2", "t2", "t5", "t7", "t7"]
    assert [names.row(f"t{n}") for n in range(8)] == [None, None, 0, None, None, 3, None, 4]
    assert [names.repeats(names.row(f"t{n}")) for n in (2, 5, 7)] == [3, 1, 2]


def test_points_among_lines_are_counted_and_shown_as_points(source):
    """What the other gizmo shows is counted, and does not widen the domain of the colours."""
    rows = scene(source).data.rows["roads"]
    assert rows.counts == {"without a line": 1, "segments outside of the map": 1}
    assert (rows.rules["color"].lo, rows.rules["color"].hi) == (1.0, 4.0)
    points = scene(source, "sphere").data.rows["roads"]
    assert points.number.tolist() == [2] and points.counts == {"without a position": 3}
    with pytest.raises(UserError, match="3 rows of lines and outlines, and no points; take the gizmo line"):
        with open(source, "w") as file:
            json.dump(collection([f for f in FEATURES if f[0] != "Point"]), file)
        scene(source, "sphere")


def test_only_segments_between_opposite_edges_are_left_out(source):
    """A long straight road is no such segment, and a short one across the date line is one on a map that ends there."""
    with open(source, "w") as file:
        json.dump(
            collection([("LineString", [[-9, -9], [9, 9]], 1.0), ("LineString", [[179, 0], [-179, 0]], 2.0)]), file
        )
    assert scene(source).data.rows["roads"].number.tolist() == [0]
    layer = vr.DataLayer(source=source, gizmo="line", radius=0.01)
    for extent, lines, counts in (
        ((-180, 180, -60, 60), [0], {"segments across the edge of the map": 1}),
        ((-20, 340, -60, 60), [0, 1], {}),
    ):
        made = checked(
            vr.Scene(
                data=vr.Data(base=vr.MapBase(extent=extent), layers={"roads": layer}), camera=vr.Camera(), lights={}
            )
        )
        rows = made.data.rows["roads"]
        assert (rows.number.tolist(), rows.counts) == (lines, counts)


@pytest.mark.parametrize(
    ("gizmo", "shown", "says"),
    [(None, "2 of 4", "1 row is a point, and not shown; --gizmo sphere"), ("sphere", "1 of 4", None)],
)
def test_the_command_shows_lines_or_points(source, gizmo, shown, says):
    made = data_picture(source, Wishes(gizmo=gizmo, extent=(-10.0, 10.0, -10.0, 10.0)), "map.png")
    assert made.choices["rows"] == shown and made.choices["gizmo"] == (gizmo or "line")
    assert says is None or any(note.startswith(says) for note in made.notes)


@pytest.mark.parametrize("size", [(480, 300), (960, 540)])
def test_lines_of_the_command_are_two_pixels_wide(source, size):
    made = data_picture(source, Wishes(size=size), "map.png").scene
    rows = made.data.rows["roads"]
    ends = [vr.projected(made, rows.fields[name].T) for name in "ab"]
    depth = np.median(np.concatenate([end.depth for end in ends]))
    pixels = size[1] / (2 * np.tan(np.radians(made.camera.fov) / 2) * depth)
    assert np.unique(2 * rows.fields["radius"] * pixels) == pytest.approx(2, abs=0.6)


def test_lines_of_a_small_picture_are_two_pixels_wide(source):
    """A map that fills a picture of 480 pixels has visible lines."""
    rows = scene(source, radius=None).data.rows["roads"]
    assert (2 * rows.fields["radius"] >= 2 / 480 * 8.0).all()


def test_a_globe_is_seen_from_above_the_lines(source):
    made = data_picture(source, Wishes(base="globe"), "map.png").scene
    view = np.array(made.camera.origin) / np.linalg.norm(made.camera.origin)
    ups = made.data.rows["roads"].ground.up
    # A camera far away would be at most 60 degrees off.
    assert (ups @ view > 0.5).all()
