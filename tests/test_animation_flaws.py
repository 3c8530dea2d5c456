"""Wrong animations are refused, each error in one line with its address."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from track_samples import SCENE, keys, moving

import visray as vr
from visray.scene.animation_flaws import animation_flaws
from visray.scene.check import examined
from visray.scene.edits import parts
from visray.scene.key_checks import MOST_SCENES, spread
from visray.scene.scene import ADAPTER

ADDRESS = "objects.ball.center"


def lines(tracks: Any, scene: dict | None = None, **more: Any) -> list[str]:
    """The errors of a scene with these tracks."""
    raw = parts(SCENE) | (scene or {}) | {"animation": {"duration": 2, "tracks": tracks} | more}
    with pytest.raises(vr.UserError) as refused:
        vr.at(vr.Scene(**raw), 0)
    return refused.value.lines


def key_track(address: str, *values: Any, times: Any = None, **more: Any) -> dict:
    return {"address": address, "times": list(range(len(values))) if times is None else times, "values": values} | more


def at(part: str, text: str) -> str:
    return f"animation.tracks.a.{part}: {text}"


LACKS = "objects has no 'bal'; did you mean \"ball\"? (one of ball, box, still, copy, bite, wave, mesh)"
NUMBERS_ONLY = "and only numbers move; leave the track out"
SHORT = (
    "is the same rotation as that of the key before, and rotations go the short way; for whole turns write a track of "
    "the type spin, or an address that ends with .rotate"
)
MATERIAL = "is the name of a material, and names do not move; move numbers of one"
ONE_TRACK = {
    "an unknown object": (key_track("objects.bal.radius", 1, 2), at('address = "objects.bal.radius"', LACKS)),
    "an unknown field": (
        key_track("camera.fof", 1, 2),
        at('address = "camera.fof"', "camera has no 'fof'; did you mean \"fov\"? (one of origin, target"),
    ),
    "a word": (
        key_track("settings.sampler", "a", "b"),
        at('address = "settings.sampler"', f"is discrete (a word), {NUMBERS_ONLY}"),
    ),
    "the size of frames": (
        key_track("film.scale", 1, 2),
        at('address = "film.scale"', "is the size of the picture, and all frames have one size; leave the track out"),
    ),
    "a name of a colour": (
        key_track("materials.red.kd", [1, 0, 0], "lime"),
        at('values.1 = "lime"', "must be a list of 3 numbers, like the value in the scene; this colour is [0, 1, 0]"),
    ),
    "a material": (
        key_track("objects.ball.material", "a", "b"),
        at('address = "objects.ball.material"', f"{MATERIAL}, such as materials.red.kd"),
    ),
    "a default material": (
        key_track("objects.box.material", "a", "b"),
        at('address = "objects.box.material"', f"{MATERIAL}, such as materials.NAME.kd"),
    ),
    "an address without its section": (
        key_track("ball.radius", 1, 2),
        at('address = "ball.radius"', "is no address; write objects.ball.radius"),
    ),
    "a field without its section": (key_track("fov", 30, 40), at('address = "fov"', "is no address; write camera.fov")),
    "a spin without a section": ({"type": "spin", "of": "box"}, at('of = "box"', "is no address; write objects.box")),
    "a name that is in no section": (
        {"type": "spin", "of": "red"},
        at('of = "red"', "the scene has no 'red'; one of camera, film"),
    ),
    "a spin of the camera": (
        {"type": "spin", "of": "camera"},
        at('of = "camera"', "a camera has no transform; for one that goes about its target, write a track of the type"),
    ),
    "a whole number": (
        key_track("settings.spp", 1, 2),
        at('address = "settings.spp"', f"is discrete (a whole number), {NUMBERS_ONLY}"),
    ),
    "a flag": (
        key_track("settings.shadows", 0, 1),
        at('address = "settings.shadows"', f"is discrete (true or false), {NUMBERS_ONLY}"),
    ),
    "numbers of vertices": (
        key_track("objects.mesh.faces", [], []),
        at('address = "objects.mesh.faces"', f"is discrete (no number), {NUMBERS_ONLY}"),
    ),
    "a whole object": (
        key_track("lights.sun", 0, 1),
        at('address = "lights.sun"', "is no value but has parts; name one: intensity, Ia"),
    ),
    "nothing yet": (
        key_track("objects.ball.cut", 0, 1),
        at('address = "objects.ball.cut"', "is null in the scene, and only numbers move; give it"),
    ),
    "a track": (
        key_track("animation.fps", 1, 2),
        at('address = "animation.fps"', "tracks move what a picture of one moment shows"),
    ),
    "the shutter": (
        key_track("camera.shutter.close", 0.1, 1),
        at('address = "camera.shutter.close"', "tracks move what a picture of one moment shows"),
    ),
    "times out of order": (
        key_track(ADDRESS, *[(0, 0, 0)] * 3, times=[0, 2, 1]),
        at("times.2 = 1.0", "must be after times.1, which is 2 s"),
    ),
    "equal times": (
        key_track(ADDRESS, *[(0, 0, 0)] * 2, times=[1, 1]),
        at("times.1 = 1.0", "must be after times.0, which is 1 s"),
    ),
    "a key far too late": (
        key_track(ADDRESS, *[(0, 0, 0)] * 3, times=[0, 1, 1.7e308], interpolation="smooth"),
        at("times.2 = 1.7e+308", "must be at most 86400"),
    ),
    "a key far too soon": (
        key_track(ADDRESS, *[(0, 0, 0)] * 3, times=[0, 5e-324, 1], interpolation="smooth"),
        at("times.1 = 5e-324", "must be after times.0, which is 0 s, by at least 1e-09 s"),
    ),
    "numbers too far apart": (
        key_track("objects.box.transform.0.rotate", 0, 1.7e308, interpolation="smooth"),
        at("values.1 = 1.7e+308", "is more than 1e+290 away from the key before"),
    ),
    "a step of next to nothing": (
        {"type": "path", "address": ADDRESS, "points": [(0, 0, 0), (1e-170, 0, 0)], "interpolation": "smooth"},
        at("points.1 = [1e-170, 0.0, 0.0]", "must differ from the point before, points.0, in a number by at least 1e"),
    ),
    "an end too soon": (
        {"type": "path", "address": ADDRESS, "points": [(0, 0, 0), (1, 0, 0)], "begin": 1, "end": 1 + 1e-12},
        at("end = 1.000000000001", "must be after begin, which is 1 s, by at least 1e-09 s"),
    ),
    "one key": (key_track(ADDRESS, (0, 0, 0)), at("times = [0.0]", "a track has at least two keys")),
    "no key": (key_track(ADDRESS), at("times = []", "a track has at least two keys")),
    "more values than times": (
        key_track("camera.fov", 30, 40, 50, times=[0, 1]),
        at("values = [30, 40, 50]", "has 3 entries for 2 times"),
    ),
    "a time before 0": (key_track("camera.fov", 30, 40, times=[-1, 1]), at("times.0 = -1", "must be at least 0")),
    "a number for three": (
        key_track(ADDRESS, 1, (0, 0, 0)),
        at("values.0 = 1", "must be a list of 3 numbers, like the value in the scene"),
    ),
    "two numbers for three": (
        key_track(ADDRESS, (0, 0, 0), (0, 0)),
        at("values.1 = [0, 0]", "must be a list of 3 numbers"),
    ),
    "three numbers for one": (
        key_track("camera.fov", 30, (0, 0, 0)),
        at("values.1 = [0, 0, 0]", "must be a number, like the value in"),
    ),
    "a word for a number": (key_track("camera.fov", 30, "wide"), at('values.1 = "wide"', "must be a number")),
    "a flag for a number": (key_track("camera.fov", 30, True), at("values.1 = true", "must be a number")),
    "a value beyond its range": (key_track("camera.fov", 30, 180), at("values.1 = 180", "must be less than 180")),
    "a part beyond its range": (
        key_track("materials.red.kd", (0, 0, 0), (0, 0, -2)),
        at("values.1.2 = -2", "must be at least 0"),
    ),
    "a radius of 0": (key_track("objects.ball.radius", 0, 1), at("values.0 = 0", "must be greater than 0")),
    "a direction of 0": (
        key_track("lights.sun.direction", (0, 0, 0), (1, 0, 0)),
        at("values.0 = [0, 0, 0]", "a direction must not be (0, 0, 0)"),
    ),
    "opposite directions": (
        key_track("lights.sun.direction", (0, 1, 0), (0, -2, 0)),
        at("values.1 = [0, -2, 0]", "is opposite to the key before"),
    ),
    "edges through 0": (
        key_track("objects.sheet.width", (1, 0, 0), (-3, 0, 0)),
        at("values.1 = [-3, 0, 0]", "the way from the key before leads through (0, 0, 0)"),
    ),
    "other steps": (
        key_track("objects.box.transform", [{"rotate": 1}], [{"scale": 1}]),
        at('values.1 = [{"scale": 1}]', "must have the steps of the first key, in its order: rotate"),
    ),
    "fewer steps": (
        key_track("objects.box.transform", [], [{"scale": 1}]),
        at('values.1 = [{"scale": 1}]', "must have the steps of the first key, in its order: none"),
    ),
    "no steps": (key_track("objects.box.transform", 1, [{"scale": 1}]), at("values.0 = 1", "must be a list of steps")),
    "a wrong word for a step": (
        key_track("objects.box.transform", [{"scle": 1}], [{"scale": 1}]),
        at('values.0 = [{"scle": 1}]', "must be a list of steps"),
    ),
    "a wrong step": (
        key_track("objects.box.transform", [{"scale": "x"}], [{"scale": 1}]),
        at('values.0.0.scale = "x"', "must be "),
    ),
    "another step": (
        key_track("objects.box.transform.0", {"rotate": 1}, {"scale": 1}),
        at('values.1 = {"scale": 1}', 'must be a step with the key "rotate"'),
    ),
    "a scale through 0": (
        key_track("objects.box.transform", [{"scale": 1}], [{"scale": (1, -1, 1)}]),
        at('values.1 = [{"scale": [1, -1, 1]}]', "has another sign than the key before"),
    ),
    "a factor through 0": (
        key_track("objects.scaled.transform.0.scale", 1, -1),
        at("values.1 = -1", "has another sign than the key before"),
    ),
    "one of three factors through 0": (
        key_track("objects.scaled.transform.1.scale.2", 1, -1),
        at("values.1 = -1", "has another sign than the key before"),
    ),
    "a scale of 0": (
        key_track("objects.box.transform", [{"scale": 1}], [{"scale": 0}]),
        at("values.1.0.scale = 0", "a scale must not be 0"),
    ),
    "a matrix that mirrors": (
        key_track(
            "objects.box.transform", *([{"matrix": [[x, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}] for x in (1, -1))
        ),
        at('values.1 = [{"matrix": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}]', "mirrors, or the key before does"),
    ),
    "whole turns": (
        key_track("objects.box.transform.0", {"rotate": 10}, {"rotate": 370}),
        at('values.1 = {"rotate": 370}', SHORT),
    ),
    "a wrong interpolation": (
        key_track("camera.fov", 1, 2, interpolation="smoth"),
        at('interpolation = "smoth"', 'unknown value; did you mean "smooth"?'),
    ),
    "a wrong type": (
        {"type": "spinn"},
        at('type = "spinn"', 'unknown type; did you mean "spin"? (one of keys, orbit, spin, path, ellipse)'),
    ),
    "an unknown key": (
        {"type": "spin", "of": "objects.box", "axes": 1},
        at("axes", "unknown key; did you mean 'axis'?"),
    ),
    "no address": (
        {"times": [0, 1], "values": [0, 1]},
        "animation.tracks.a: the key 'address' is missing; it is a string",
    ),
    "a spin of nothing": ({"type": "spin", "of": "objects.bal"}, at('of = "objects.bal"', LACKS)),
    "a spin of a light": (
        {"type": "spin", "of": "lights.sun"},
        at('of = "lights.sun"', "lights.sun has no 'transform'; one of intensity"),
    ),
    "an end before the beginning": (
        {"type": "orbit", "begin": 1, "end": 0.5},
        at("end = 0.5", "must be after begin, which is 1 s"),
    ),
    "a beginning after the end": (
        {"type": "orbit", "begin": 2},
        at("begin = 2.0", "must be before the end of the animation, 2 s"),
    ),
    "a path of a number": (
        {"type": "path", "address": "camera.fov", "points": [(0, 0, 0), (1, 0, 0)]},
        at('address = "camera.fov"', "is not the address of a point"),
    ),
    "a path of one point": (
        {"type": "path", "address": ADDRESS, "points": [(0, 0, 0)]},
        at("points = [[0.0, 0.0, 0.0]]", "a path has at least two points"),
    ),
    "a path that stands still": (
        {"type": "path", "address": ADDRESS, "points": [(0, 0, 0)] * 2},
        at("points.1 = [0.0, 0.0, 0.0]", "must differ from the point before, points.0"),
    ),
    "a closed path that ends where it begins": (
        {"type": "path", "address": ADDRESS, "points": [(0, 0, 0), (1, 0, 0), (0, 0, 0)], "closed": True},
        at("points.0 = [0.0, 0.0, 0.0]", "must differ from the point before, points.2"),
    ),
    "an ellipse of a number": (
        {"type": "ellipse", "address": "camera.fov", "radii": (1, 1), "period": 1},
        at('address = "camera.fov"', "is not the address of a point"),
    ),
    "a period of 0": (
        {"type": "ellipse", "address": ADDRESS, "radii": (1, 1), "period": 0},
        at("period = 0", "must be at least 1e-06, or at most -1e-06"),
    ),
    "a camera in its target": (
        {"type": "path", "address": "camera.target", "points": [(1, 1, 7), (0, 1, 7)]},
        "animation.tracks: at 2 s, camera.target = [0.0, 1.0, 7.0]: must differ from origin",
    ),
}


@pytest.mark.parametrize("what", ONE_TRACK)
def test_a_wrong_track_gets_one_line(what: str) -> None:
    track, expected = ONE_TRACK[what]
    sheet = vr.Rectangle(center=(0, 0, 0), width=(1, 0, 0), height=(0, 1, 0))
    scaled = vr.Sphere(transform=(vr.Scale(scale=2.0), vr.Scale(scale=(1, 1, 2))))
    more = (
        {"objects": SCENE.objects | {"sheet": sheet, "scaled": scaled}, "camera": {}, "lights": {}}
        if "objects.s" in str(track)
        else {}
    )
    found = lines({"a": track}, more)
    assert len(found) == 1 or what == "an unknown key"
    assert found[0].startswith(expected)


SPIN, ORBIT = {"type": "spin", "of": "objects.box"}, {"type": "orbit"}
ELLIPSE = {"type": "ellipse", "address": ADDRESS, "radii": (1, 1), "period": 1}
TWO = {
    "one address": (key_track(ADDRESS, (0, 0, 0), (1, 0, 0)), ELLIPSE, ADDRESS),
    "a part of it": (ELLIPSE, key_track(f"{ADDRESS}.1", 0, 1), f"{ADDRESS}.1"),
    "what it is a part of": (key_track(f"{ADDRESS}.1", 0, 1), ELLIPSE, f"{ADDRESS}.1"),
    "steps and a step": (
        key_track("objects.box.transform", [], []),
        key_track("objects.box.transform.0.rotate", 0, 1),
        "objects.box.transform.0.rotate",
    ),
    "two spins": (SPIN, SPIN, "objects.box.transform"),
    "orbit and origin": (key_track("camera.origin.0", 0, 1), ORBIT, "camera.origin.0"),
    "two orbits": (ORBIT, ORBIT, "camera.origin"),
    "orbit and up": (ORBIT | {"axis": (1, 1, 0)}, key_track("camera.up", (0, 1, 0), (0, 1, 1)), "camera.up"),
}  # fmt: skip


@pytest.mark.parametrize("what", TWO)
def test_two_tracks_of_one_value_are_refused(what: str) -> None:
    first, second, shared = TWO[what]
    [found] = lines({"a": first, "b": second})
    assert found.startswith("animation.tracks.b.")
    assert found.endswith(f": animation.tracks.a writes {shared} too; leave one of the two tracks out")


def test_a_name_in_two_sections_is_a_choice() -> None:
    ball = {"ball": {"type": "point", "position": (0, 5, 0)}}
    [found] = lines({"a": key_track("ball.intensity", 0, 1)}, {"lights": ball})
    assert found == at('address = "ball.intensity"', "is no address; write lights.ball.intensity")
    geometries = {"drop": {"type": "sphere"}, "ball": {"type": "sphere"}}
    copies = {name: {"type": "instance", "geometry": name} for name in geometries} | {"ball": {"type": "sphere"}}
    copies |= {"other": {"type": "instance", "geometry": "ball"}}
    [found] = lines(
        {"a": key_track("ball.radius", 1, 2)}, {"objects": copies, "geometries": geometries, "camera": {}, "lights": {}}
    )
    assert found.endswith("is no address; write geometries.ball.radius or objects.ball.radius")


def test_a_date_without_its_section_is_that_of_the_data() -> None:
    table = {"lon": [0.0, 0.0], "lat": [0.0, 0.0], "x": [1.0, 2.0], "day": ["2001-01", "2001-02"]}
    data = {"layers": {"rain": {"source": table, "time": "day", "height": {"column": "x"}}}}
    [found] = lines({"a": key_track("date", 2001, 2001.05)}, {"data": data})
    assert found == at('address = "date"', "is no address; write data.date")


def test_tracks_of_neighbours_are_accepted() -> None:
    scene = moving(
        keys("objects.ball.center.0", 0, 1),
        keys("objects.ball.center.1", 0, 1),
        keys("camera.up", (0, 1, 0), (0, 1, 1)),
        vr.OrbitTrack(),
    )
    assert vr.at(scene, 1).objects["ball"].center == (0.5, 0.5, 0)


def test_tracks_that_go_wrong_only_together_are_named_with_the_time() -> None:
    origin = key_track("camera.origin", (0, 0, 7), (0, 0, 5), times=[0, 2])
    target = key_track("camera.target", (0, 0, 0), (0, 0, 5), times=[0, 2])
    [found] = lines({"a": origin, "b": target})
    assert found == "animation.tracks: at 2 s, camera.target = [0.0, 0.0, 5.0]: must differ from origin"


def many(kind: str, count: int = 2000) -> dict:
    """A track of many keys, or points."""
    numbers = np.random.default_rng(1).uniform(1, 2, (count, 3))
    if kind == "path":
        return {"type": "path", "address": ADDRESS, "points": numbers.tolist()}
    times = np.linspace(0, 2, count).tolist()
    if kind == "transform":
        steps = [[{"rotate": 30 * x}] for x in numbers[:, 0].tolist()]
        return {"address": "objects.box.transform", "times": times, "values": steps}
    return {"address": ADDRESS, "times": times, "values": numbers.tolist()}


@pytest.mark.parametrize("kind", ["path", "transform", "keys"])
def test_many_keys_are_checked_in_few_scenes(kind: str) -> None:
    raw = parts(SCENE) | {"animation": {"duration": 2, "tracks": {"a": many(kind)}}}
    scene, seen = ADAPTER.validate_python(raw), []

    def examine(one: dict) -> tuple:
        seen.append(one)
        return examined(one)

    assert list(animation_flaws(scene, examine)) == []
    assert 64 <= len(seen) <= 2 * MOST_SCENES


@pytest.mark.parametrize(
    ("address", "what"), [(ADDRESS, "values.1234.1 = 1e+20"), ("camera.fov", "values.1234 = 1e+20")]
)
def test_each_of_many_keys_is_checked(address: str, what: str) -> None:
    track = many("keys") | {"address": address}
    column = track["values"] if address == ADDRESS else [30 + x for x, _, _ in track["values"]]
    column[1234] = [1, 1e20, 1] if address == ADDRESS else 1e20
    [found] = lines({"a": track | {"values": column}})
    assert found.startswith(f"animation.tracks.a.{what}") and "must be" in found


@pytest.mark.parametrize("part", ["objects.box.transform.0", "objects.ball.center.1", "objects.bite.of.1.center"])
def test_a_part_of_many_keys_is_checked(part: str) -> None:
    good = {"objects.box.transform.0": {"rotate": 1.0}, "objects.ball.center.1": 0.5}.get(part, (0.5, 1.7, 0.5))
    bad = {"objects.box.transform.0": {"rotate": math.inf}, "objects.ball.center.1": 1e10}.get(part, (1e10, 1, 1))
    values = [good] * 777 + [bad] + [good] * 222
    [found] = lines({"a": key_track(part, *values, times=np.linspace(0, 2, 1000).tolist())})
    assert "values.777" in found and "must be" in found


def test_some_are_spread_evenly() -> None:
    assert spread(range(5), 5) == [0, 1, 2, 3, 4] and spread(range(9), 3) == [0, 4, 8]
    assert spread(range(1000))[:: MOST_SCENES - 1] == [0, 999] and len(spread(range(1000))) == MOST_SCENES


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ({"fps": 0}, "animation.fps = 0: must be greater than 0"),
        ({"fps": "x"}, 'animation.fps = "x": must be a number'),
        ({"duration": 0}, "animation.duration = 0: must be greater than 0"),
        ({"duration": 1e9}, "animation.duration = 1000000000.0: must be at most 86400"),
        ({"frames": 20}, "animation.frames: unknown key; one of duration, fps, tracks"),
        ({"tracks": []}, "animation.tracks = []: must be an object {...} that holds entries by name"),
        ({"tracks": {"a.b": SPIN}}, 'animation.tracks: "a.b" is not a valid name'),
    ],
)
def test_wrong_lengths_and_rates_are_refused(more: dict, text: str) -> None:
    found = lines(**{"tracks": {}} | more)
    assert found[0].startswith(text)


def test_all_errors_are_reported_at_once() -> None:
    found = lines({"a": key_track("objects.bal.radius", 1, 2), "b": key_track("camera.fov", 1, 200), "c": SPIN})
    assert [x.split(" = ")[0] for x in found] == ["animation.tracks.a.address", "animation.tracks.b.values.1"]


def test_a_wrong_scene_gets_no_errors_of_its_tracks() -> None:
    """The track's object may be the one that is wrong."""
    objects = {"ball": {"type": "sphere", "radius": -1}}
    [found] = lines(
        {"a": key_track("objects.ball.radius", 1, 2)},
        {"objects": objects, "geometries": {}, "camera": {}, "lights": {}},
    )
    assert found == "objects.ball.radius = -1: must be greater than 0"


def test_a_file_with_wrong_tracks_is_refused_with_its_name(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({"animation": {"duration": 1, "tracks": {"a": key_track("camera.fov", 1)}}}))
    with pytest.raises(vr.UserError, match=r"scene.json: animation.tracks.a.times = \[0.0\]: a track has at least two"):
        vr.load(file)


def test_an_assignment_is_checked_with_the_tracks() -> None:
    scene = moving(keys("objects.ball.radius", 1, 2))
    with pytest.raises(vr.UserError, match=r"^animation.tracks.track0.values.1 = -2: must be greater than 0$"):
        vr.replaced(scene, "animation.tracks.track0.values", (1, -2))
    shorter = vr.replaced(scene, "animation.duration", 1)
    assert vr.at(shorter, 1).objects["ball"].radius == 1.5
