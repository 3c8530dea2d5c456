"""What of a scene is validated, and how often: everything once, and again only what changed."""

import copy
import gc
import json
import pickle
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from test_legacy import MATT
from test_scene_load import FILES, everything
from unchecked import unchecked

import visray as vr
from visray import transforms
from visray.cli.options import load_scene
from visray.primitives import rectangle, triangle
from visray.scene import check, transform_flaws, validated
from visray.scene.address import changed
from visray.scene.check import SECTIONS, checked, examined
from visray.scene.garbage import uncollected
from visray.scene.load import dump, load
from visray.scene.source import parse
from visray.transforms import Matrix, Rotate, Scale, Translate


class Watched:
    """Pydantic's adapter of scenes, which counts how often a thing of a name is validated."""

    def __init__(self, adapter: object):
        self.adapter, self.counts = adapter, Counter()

    def validate_python(self, raw: dict) -> vr.Scene:
        for section in SECTIONS:
            things = raw.get(section, {})
            self.counts.update(f"{section}.{name}" for name in (things if isinstance(things, dict) else ()))
        return self.adapter.validate_python(raw)

    def since(self) -> dict[str, int]:
        """What was validated since this was asked last."""
        found, self.counts = dict(self.counts), Counter()
        return found


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Watched:
    watch = Watched(check.ADAPTER)
    monkeypatch.setattr(check, "ADAPTER", watch)
    return watch


def small(**things: object) -> vr.Scene:
    objects = {"ball": vr.Sphere(radius=2, material="red"), "floor": vr.Plane()} | things
    return vr.Scene(
        film=vr.Film(width=8, height=6),
        materials={"red": vr.Material(kd=(1, 0, 0))},
        lights={"key": vr.PointLight(position=(3, 4, 5))},
        objects=objects,
        settings=vr.Settings(spp=1),
        camera=vr.Camera(),
    )


def rendered(scene: vr.Scene | Path) -> vr.Image:
    return vr.render(scene, layers=["RGB"], progress=False)


ALL = {"materials.red": 1, "lights.key": 1, "objects.ball": 1, "objects.floor": 1}


def test_what_is_loaded_is_validated_once(watched: Watched, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(dump(small()))
    watched.since()
    scene = load(path)
    vr.explain(scene)
    rendered(scene)
    vr.render(scene, size=(4, 4), spp=2, seed=3, layers=["RGB"], progress=False)
    dump(scene)
    checked(checked(scene))
    assert watched.since() == ALL
    rendered(path)
    assert watched.since() == ALL


def test_what_is_written_in_python_is_validated_once(watched: Watched) -> None:
    scene = small()
    first = rendered(scene)
    assert watched.since() == ALL
    second = rendered(scene)
    assert watched.since() == {}
    assert np.array_equal(first["RGB"], second["RGB"])
    assert first.metadata["scene_hash"] == second.metadata["scene_hash"] == scene.hash()
    scene.objects["ball"] = replace(scene.objects["ball"], radius=1.5)
    rendered(scene)
    rendered(replace(scene, camera=vr.Camera(fov=30.0)))
    assert watched.since() == {"objects.ball": 1}


@pytest.mark.parametrize(
    ("assignments", "expected"),
    [
        ({"objects.ball.center.1": 7}, {"objects.ball"}),
        ({"objects.ball.radius": 0.5, "settings.spp": 3, "objects.ball.material": "default"}, {"objects.ball"}),
        ({"materials.red.kd": (0.5, 0, 0), "lights.key.intensity": 2}, {"materials.red", "lights.key"}),
        ({"camera.fov": 30, "film.width": 4, "background": (0, 0, 0), "ambient.1": 0.5}, set()),
    ],
)
def test_only_what_changed_is_validated(watched: Watched, assignments: dict, expected: set) -> None:
    scene = checked(small())
    watched.since()
    new = changed(scene, assignments)
    assert watched.since() == dict.fromkeys(expected, 1)
    for section in SECTIONS:
        for name, thing in getattr(scene, section).items():
            assert (getattr(new, section)[name] is thing) == (f"{section}.{name}" not in expected)
    rendered(new)
    assert watched.since() == {}


def test_the_command_line_validates_once(watched: Watched, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(dump(small()))
    watched.since()
    scene = load_scene(path, None, False, ["objects.ball.radius=3", "settings.spp=2"], size=(4, 4), allow_outside=False)
    rendered(scene)
    assert watched.since() == ALL | {"objects.ball": 2}


def test_an_original_scene_is_validated_once(watched: Watched, tmp_path: Path) -> None:
    ball = {"name": "a", "type": "sphere", "center": [0, 0, 0], "radius": 1, "material": MATT}
    path = tmp_path / "old.json"
    path.write_text(json.dumps({"scene": "x", "typeScene": "VIRTUALWORLD", "objects": [ball]}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = load(path)
    rendered(replace(scene, film=vr.Film(width=4, height=4), settings=vr.Settings(spp=1)))
    assert set(watched.since().values()) == {1}


WRONG = {
    "value": ("objects", "late", unchecked(vr.Sphere, radius=-1.0), "objects.late.radius = -1.0: must be greater than "
              "0"),
    "flaw": ("objects", "late", vr.Box(max=(0.0, 0.0, -1.0)), "objects.late.max = [0.0, 0.0, -1.0]: must be greater "
             "than min in z"),
    "light": ("lights", "late", vr.DirectionalLight(direction=(0.0, -1.0, 0.0), b=1.0), "lights.late.b = 1.0: must be "
              "0: a directional light is infinitely far away, so it would not be seen"),
    "material": ("objects", "ball", vr.Sphere(material="rod"), 'objects.ball.material = "rod": unknown material; '
                 'did you mean "red"? (one of red, default)'),
    "texture": ("materials", "red", vr.Material(texture="x"), 'materials.red.texture = "x": unknown texture; '
                "there is none"),
    "number": ("objects", 7, vr.Plane(), "objects.7: is no text; a key is a text"),
    "dot": ("objects", "a.b", vr.Plane(), 'objects: "a.b" is not a valid name; a name is not empty, has no dot, and '
            "has no space at either end"),
    "transform": ("objects", "late", vr.Plane(transform=(Scale(scale=1e-6),) * 3), None),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("known", [False, True])
def test_what_is_put_into_a_dict_later_is_refused(case: str, known: bool) -> None:
    section, name, thing, expected = WRONG[case]
    scene = small()
    rendered(scene)
    if known and case in ("number", "dot"):
        rendered(small(known=thing))  # the thing is fine, its name is not
    getattr(scene, section)[name] = thing
    with pytest.raises(vr.UserError) as caught:
        rendered(scene)
    assert len(caught.value.lines) == 1
    if expected:
        assert caught.value.lines == (expected,)


def test_what_is_taken_from_a_dict_is_missed() -> None:
    scene = small()
    rendered(scene)
    del scene.materials["red"]
    with pytest.raises(vr.UserError, match=r'objects\.ball\.material = "red": unknown material'):
        rendered(scene)


def test_what_is_right_in_one_section_is_wrong_in_another() -> None:
    scene = checked(everything())
    for section in SECTIONS:
        for other in SECTIONS:
            for thing in getattr(scene, other).values():
                # A geometry is right among the objects too.
                if type(thing) not in SECTIONS[section]:
                    with pytest.raises(vr.UserError):
                        checked(vr.Scene(**{section: {"it": thing}}))


def test_what_can_change_is_validated_every_time(watched: Watched) -> None:
    centre, parameters = [0.0, 0.0, 0.0], {"k": 0.5}
    surface = unchecked(vr.Polynomial, expression="x^2 + y^2 - k", parameters=parameters)
    scene = small(ball=unchecked(vr.Sphere, center=centre), surface=surface)
    checked(scene)
    watched.since()
    checked(scene)
    assert watched.since() == {"objects.ball": 1, "objects.surface": 1}
    centre[1] = float("nan")
    parameters["k"] = float("inf")
    with pytest.raises(vr.UserError) as caught:
        checked(scene)
    assert caught.value.lines == (
        "objects.ball.center.1 = NaN: must be finite",
        "objects.surface.parameters.k = Infinity: must be finite",
    )


def test_every_kind_but_those_that_hold_dicts_is_remembered() -> None:
    scene = everything()
    for _ in range(2):
        for section in SECTIONS:
            for thing in getattr(scene, section).values():
                checked(scene)
                kept = validated.validated(thing)
                assert (kept == thing) if not isinstance(thing, vr.Polynomial) else kept is None
        scene = checked(scene)


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, replace, lambda x: pickle.loads(pickle.dumps(x))],
    ids=["copy", "deepcopy", "replace", "pickle"],
)  # fmt: skip
def test_a_copy_is_validated_by_itself(again: Callable, watched: Watched) -> None:
    scene = checked(small())
    twin = again(scene.objects["ball"])
    assert twin == scene.objects["ball"] and vars(twin) == vars(scene.objects["ball"])
    watched.since()
    assert checked(replace(scene, objects={"twin": twin})).objects == {"twin": twin}
    assert watched.since() == {"objects.twin": 1}
    assert checked(again(scene)) == scene


def test_a_replaced_copy_is_judged_anew() -> None:
    scene = checked(small())
    with pytest.raises(vr.UserError, match=r"Sphere: radius = 0: must be greater than 0"):
        replace(scene.objects["ball"], radius=0)
    with pytest.raises(vr.UserError, match=r"objects\.ball\.radius = 0: must be greater than 0"):
        checked(replace(scene, objects={"ball": unchecked(vr.Sphere, radius=0)}))


def test_what_is_gone_is_forgotten() -> None:
    gc.collect()
    before = len(validated._entries)
    scene = small()
    mine = checked(scene)
    assert len(validated._entries) > before
    del scene, mine
    gc.collect()
    assert len(validated._entries) == before


def test_a_checked_scene_does_not_change_with_the_one_it_was_made_of() -> None:
    scene = small()
    for _ in range(2):
        mine = checked(scene)
        scene.objects["late"] = vr.Sphere()
        assert "late" not in mine.objects
        del scene.objects["late"]


def text(scene: vr.Scene) -> str:
    """All values of a scene, so that numbers are compared with their signs."""
    return repr([getattr(scene, f.name) for f in fields(scene)])


def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has every scene validated as a whole."""
    monkeypatch.setattr(check, "_accepted", lambda raw: None)


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_what_is_kept_is_what_validation_gives(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load(path)
    quick = [scene, checked(scene), changed(scene, {"camera.target.0": 33})]
    slow(monkeypatch)
    whole = load(path)
    for one, other in zip(quick, [whole, checked(whole), changed(whole, {"camera.target.0": 33})]):
        assert text(one) == text(other) and one.hash() == other.hash()


@given(data=st.data())
def test_errors_read_the_same_whatever_is_known(data: st.DataObject) -> None:
    scene = checked(everything())
    raw = check.parts(scene)
    for _ in range(data.draw(st.integers(1, 3))):
        section = data.draw(st.sampled_from(list(SECTIONS)))
        names = list(raw[section])
        thing = validated.plain(raw[section][data.draw(st.sampled_from(names))])
        key = data.draw(st.sampled_from(list(thing)))
        value = data.draw(st.sampled_from([-1, 0.0, None, "x", [], {}, (1, 2, 3), float("nan"), vr.Sphere(), True]))
        raw[section] = raw[section] | {data.draw(st.sampled_from([*names, "new", " ", "a.b"])): thing | {key: value}}
    quick, errors = examined(raw)
    with pytest.MonkeyPatch.context() as patch:
        slow(patch)
        whole, same = examined(raw)
        assert errors == same and (quick and text(quick)) == (whole and text(whole))


def test_equal_scenes_have_equal_hashes(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(dump(small()))
    assert small().hash() == checked(small()).hash() == load(path).hash()
    assert small().hash() != small(ball=vr.Sphere(radius=2.0)).hash()


TRANSFORMS = st.lists(
    st.builds(Translate, translate=st.tuples(*[st.floats(-1e9, 1e9)] * 3))
    | st.builds(Scale, scale=st.floats(1e-9, 1e9) | st.tuples(*[st.floats(-1e3, 1e3).filter(bool)] * 3))
    | st.builds(Rotate, rotate=st.floats(-360, 360), axis=st.tuples(*[st.floats(0.5, 2)] * 3))
    | st.builds(partial(unchecked, Matrix), matrix=st.tuples(*[st.tuples(*[st.floats(-10, 10)] * 4)] * 3)),
    min_size=1, max_size=4,
)  # fmt: skip


# Invertible, but not clearly so.
FLAT = Matrix(matrix=((0.0, 0.0, 3.1e-14, 0.0), (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 1.0, 0.0)))


@given(steps=TRANSFORMS)
@example(steps=[FLAT])
def test_bounds_judge_a_transform_as_arrays_do(steps: list) -> None:
    with np.errstate(all="ignore"):
        quick = transform_flaws.transform_flaw(tuple(steps))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(transform_flaws, "_clearly_invertible", lambda steps: False)
            assert quick == transform_flaws.transform_flaw(tuple(steps))
        if quick is None:
            least, most, far = transforms.bounds(tuple(steps))
            whole = transforms.compose(tuple(steps))
            factors = np.linalg.svd(whole[:, :3], compute_uv=False)
            assert least <= factors[-1] * (1 + 1e-9) + 1e-15 * most and factors[0] <= most * (1 + 1e-9)
            assert np.linalg.norm(whole[:, 3]) <= far * (1 + 1e-9)


MATRICES = st.tuples(*[st.tuples(*[st.floats(-4, 4) | st.floats()] * 4)] * 3)
VECTORS = st.tuples(*[st.floats(-1e9, 1e9) | st.integers(-2, 2).map(float)] * 3)


@given(rows=MATRICES, scale=st.floats(-2, 2), share=st.floats(0, 1e-12))
def test_a_short_look_judges_a_matrix_as_its_condition_does(rows: tuple, scale: float, share: float) -> None:
    near = tuple(scale * x + share * y for x, y in zip(rows[0], rows[2]))
    for matrix in (rows, (rows[0], rows[1], near)):
        if np.isfinite(matrix).all() and transforms._clearly_invertible(matrix):
            assert np.linalg.cond(np.array(matrix)[:, :3]) < 1e12


@given(v=VECTORS, w=VECTORS, scale=st.floats(-2, 2), share=st.floats(0, 1e-12))
def test_a_short_look_judges_corners_and_sides_as_arrays_do(v: tuple, w: tuple, scale: float, share: float) -> None:
    near = tuple(scale * x + share * y for x, y in zip(v, w))
    with np.errstate(all="ignore"):
        for other in (w, near):
            things = [unchecked(vr.Triangle, a=(0.5, 0.25, 1.0), b=v, c=other)]
            things += [unchecked(vr.Rectangle, width=v, height=other)] if any(v) and any(other) else []
            quick = [thing.flaws() for thing in things]
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(triangle, "clearly_not_parallel", lambda v, w: False)
                patch.setattr(rectangle, "clearly_not_parallel", lambda v, w: False)
                assert quick == [thing.flaws() for thing in things]


def test_the_search_for_cycles_goes_on_afterwards() -> None:
    assert gc.isenabled()
    with pytest.raises(KeyError), uncollected():
        assert not gc.isenabled()
        raise KeyError
    assert gc.isenabled()
    gc.disable()
    try:
        with uncollected():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_deep_files_are_refused_or_judged() -> None:
    raw = parse('{"camera": ' + "[" * 209 + "]" * 209 + "}", "x").raw
    assert examined(raw)[1][0].startswith("camera = [[[[")
    for depth in (210, 600, 900, 5000):
        with pytest.raises(vr.UserError, match="x: is nested deeper than 210"):
            parse('{"camera": ' + "[" * depth + "]" * depth + "}", "x")


def test_keys_that_are_written_twice_are_found_at_any_depth() -> None:
    text = '{"a": [{"b": 1, "c": {"d": 1, "d": 2}, "b": 3}], "a": [{"b": 1, "b": 2}]}'
    assert parse(text, "x").repeated == ("a", "a.0.b")
    assert parse(text, "x").raw == json.loads(text)
