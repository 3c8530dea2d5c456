"""`vr.surface_scene`: where a surface is, from where it is looked at, and how it is shown."""

import warnings
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import visray as vr
from visray import polynomials
from visray.surface_picture.field import Field
from visray.surface_picture.look import COOL, WARM
from visray.surface_picture.picture import Wishes, surface_picture
from visray.surface_picture.points import nodes, special_points, surface_points
from visray.surface_picture.viewing import generator_of
from visray.surface_picture.whereabouts import whereabouts

SMALL = (64, 64)
# Formulas of surfaces that end, each with its ball.
COMPACT = {
    "x^2 + y^2 + z^2 = 1": ((0, 0, 0), 1),
    "(x - 100)^2 + y^2 + z^2 = 1": ((100, 0, 0), 1),
    "(x - 1e4)^2 + (y + 2e4)^2 + z^2 = 0.01": ((1e4, -2e4, 0), 0.1),
    "x^2 + y^2 + z^2 = 1e10": ((0, 0, 0), 1e5),
    "x^2 + y^2 + z^2 - 2(x + y + z) + 2.9999": ((1, 1, 1), 0.01),
    "x^4 + y^4 + z^4 = 1": ((0, 0, 0), 3**0.25),
    "(x² + y² + z² - 1)²": ((0, 0, 0), 1),
    "((x - 5)^2 + y^2 + z^2 - 0.01)((x + 5)^2 + y^2 + z^2 - 0.01)": ((0, 0, 0), 5.1),
    # The lines x = y = 0 and others belong to it, but no ray meets them.
    "x^2 y^2 + x^2 z^2 + y^2 z^2 = 2xyz": ((0, 0, 0), (4 / 3) ** 0.5),
    "x^30 + y^30 + z^30 = 1": ((0, 0, 0), 3 ** (1 / 2 - 1 / 30)),
}
# Formulas of surfaces that go on, each with the special distance in its ball: of a waist, a node or a tip.
ENDLESS = {
    "x^2 + y^2 - z^2 = 1": 1,
    "x^2 + y^2 - z^2 = 1e-6": 1e-3,
    "x^2 + y^2 - z^2 = -4": 2,
    "xyz = 1": 3**0.5,
    "4(x^2 + y^2 + z^2) + 16xyz = 1": 0.75**0.5,
    "x^2 + y^2 = 9": 3,
    "x^2 y^2 + y^2 z^2 + z^2 x^2 = 1": 3**0.25,
}


def scene_of(formula, parameters=None, **options) -> vr.Scene:
    return made(formula) if parameters is None and not options else made_anew(formula, parameters, **options)


@cache
def made(formula) -> vr.Scene:
    return made_anew(formula)


def made_anew(formula, parameters=None, **options) -> vr.Scene:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return vr.surface_scene(formula, parameters, **options)


def field(formula: str, **parameters: float) -> Field:
    return Field(polynomials.build(formula, parameters))


def clip_of(scene: vr.Scene) -> vr.Ball:
    return scene.objects["surface"].clip


@pytest.mark.parametrize("formula", COMPACT)
def test_the_clip_holds_all_of_a_surface_that_ends(formula):
    (center, radius), clip = COMPACT[formula], clip_of(scene_of(formula))
    needed = np.linalg.norm(np.subtract(clip.center, center)) + radius
    assert needed <= clip.radius * (1 + 1e-9) and clip.radius <= 1.25 * needed
    np.testing.assert_allclose(clip.center, center, atol=0.05 * radius)


@pytest.mark.parametrize("formula", ENDLESS)
def test_the_clip_of_a_surface_that_goes_on_holds_its_special_places(formula):
    clip, special = clip_of(scene_of(formula)), ENDLESS[formula]
    assert clip.center == (0, 0, 0) and 1.2 * special < clip.radius < 3 * special


@pytest.mark.parametrize("formula", ["z = x^2 - y^2", "z = x^2 + y^2", "z = x^3 - 3xy^2", "x^2 + y^2 = z^2", "x = 0"])
def test_a_surface_without_special_places_has_a_clip_of_its_size(formula):
    assert clip_of(scene_of(formula)).center == (0, 0, 0) and 0.9 <= clip_of(scene_of(formula)).radius <= 4


@pytest.mark.parametrize(
    ("formula", "ends"),
    [
        ("((x + 2y)(y - 3z))^2 + (x - y + z)^2 = 1", False),
        ("(xy)^2 + z^2 = 1", False),
        ("(x + 2y)^2 (y - 3z)^2 + (x - y + z)^2 + (x^2 + y^2 + z^2)/100 = 1", True),
    ],
)
def test_thin_arms_are_found(formula, ends):
    whole = "which holds the whole surface" in surface_picture(formula, {}, Wishes()).choices["clip"]
    assert whole == ends


def test_degenerate_points_and_far_places_do_not_mislead():
    # Its only singular point is so flat that searches end all around it. Its farthest turning point is at 199.4.
    assert 199.4 < clip_of(scene_of("x^3 z + 10x^2 y + xy^2 + yz^2 = z^3")).radius < 400
    # It goes to infinity along its axes, where searches end anywhere.
    assert 1 < clip_of(scene_of("x^4 y z = 10")).radius < 10


def test_a_surface_is_shown_alike_in_all_sizes():
    clips = [clip_of(scene_of(f"z = {k}(x^2 - y^2)")).radius * k for k in (0.01, 100)]
    np.testing.assert_allclose(clips, clip_of(scene_of("z = x^2 - y^2")).radius, rtol=0.3)


def test_clips_are_numbers_as_people_write_them():
    assert clip_of(scene_of("x^2 + y^2 + z^2 = 1")) == vr.Ball(radius=1.1)
    assert clip_of(scene_of("x^2 + y^2 - z^2 = 1")).radius == 2.3
    assert clip_of(scene_of("x^2 + y^2 - z^2 = 1", clip=4)) == vr.Ball(radius=4.0)


def seen_in(scene: vr.Scene, points: np.ndarray) -> np.ndarray:
    """Places of points in the picture, from -1 to 1 along its half sides. Shape: (N, 2)."""
    camera = scene.camera
    forward = np.subtract(camera.target, camera.origin)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right = right / np.linalg.norm(right)
    offset = points - np.array(camera.origin)
    depth = offset @ forward
    assert (depth > 0).all()
    slope = np.tan(np.radians(camera.fov / 2))
    x, y = offset @ right / depth, offset @ np.cross(right, forward) / depth
    return np.stack([x / (slope * scene.film.width / scene.film.height), y / slope], axis=1)


@pytest.mark.parametrize("size", [(64, 64), (120, 60), (60, 120)])
@pytest.mark.parametrize("formula", ["(x - 100)^2 + y^2 + z^2 = 1", "x^2 + 4y^2 + 9z^2 = 1", "heart", "torus"])
def test_all_of_the_surface_is_in_the_picture_and_fills_it(formula, size):
    scene = scene_of(formula, size=size)
    shape = scene.objects["surface"]
    rng = np.random.default_rng(1)
    clip = clip_of(scene)
    d = rng.normal(size=(4000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    points = Field(polynomials.build(shape.source(), shape.parameters)).all_crossings(
        np.tile(clip.center, (len(d), 1)), d, np.tile(np.linspace(0, clip.radius, 400), (len(d), 1))
    )
    seen = np.abs(seen_in(scene, points))
    assert len(points) >= 2000 and 0.9 < seen.max() < 0.96


def test_the_camera_is_outside_of_the_clip():
    for formula in [*list(COMPACT)[:4], *list(ENDLESS)[:4], "barth-sextic", "x = 100"]:
        scene = scene_of(formula)
        clip = clip_of(scene)
        assert np.linalg.norm(np.subtract(scene.camera.origin, clip.center)) > 1.5 * clip.radius


def test_z_is_upwards_and_the_view_is_that_asked_for():
    scene = scene_of("x^2 + y^2 - z^2 = 1", view=(1, 2, 0.5))
    towards = np.subtract(scene.camera.origin, scene.camera.target)
    assert scene.camera.up == (0, 0, 1)
    np.testing.assert_allclose(towards / np.linalg.norm(towards), np.array([1, 2, 0.5]) / 5.25**0.5, atol=2e-3)
    # From above, something else has to be upwards.
    above = scene_of("x^2 + y^2 - z^2 = 1", view=(0, 0, 1))
    np.testing.assert_allclose(above.camera.up, (0, 1, 0), atol=1e-9)
    assert np.abs(seen_in(above, surface_points(field("x^2 + y^2 - z^2 - 1"), np.zeros(3), 2.3))).max() < 0.96


def test_known_surfaces_are_seen_from_where_they_look_best():
    for name in ("heart", "barth-sextic", "kummer"):
        view, scene = vr.SURFACES[name].view, scene_of(name)
        towards = np.subtract(scene.camera.origin, clip_of(scene).center)
        assert towards @ view.direction > 0.97 * np.linalg.norm(towards) * np.linalg.norm(view.direction)
        assert clip_of(scene).radius == view.clip or vr.SURFACES[name].radius
        assert scene.objects["surface"].surface == name
    assert scene_of("Barth sextic") == scene_of("barth-sextic")


def colors(scene: vr.Scene) -> set:
    """The colours of materials that are seen, as layers of albedo show them."""
    image = vr.render(scene, spp=1, size=SMALL, layers=("RGB", "albedo"))
    seen = image["albedo"].any(-1)
    return {tuple(np.round(c, 2)) for c in image["albedo"][seen].astype(float)}


def test_both_sides_are_seen_and_have_their_colours():
    expected = {tuple(np.round(c, 2)) for c in (WARM, COOL)}
    assert colors(scene_of("x^2 + y^2 - z^2 = 1")) == expected
    # The outside is warm, whatever the sign of f.
    for formula in ("x^2 + y^2 + z^2 - 1", "1 - x^2 - y^2 - z^2", "1 = x^2 + y^2 + z^2"):
        assert colors(scene_of(formula)) == {tuple(np.round(WARM, 2))}
    given = scene_of("x^2 + y^2 - z^2 = 1", color=(0.1, 0.6, 0.1), inside=(0.5, 0.5, 0.5))
    assert colors(given) == {(0.1, 0.6, 0.1), (0.5, 0.5, 0.5)}


def test_the_sign_of_f_does_not_matter():
    one, other = (
        vr.render(scene_of(f, size=SMALL), spp=4)["RGB"] for f in ("x^2 + y^2 - z^2 - 1", "z^2 + 1 - x^2 - y^2")
    )
    np.testing.assert_allclose(one, other, atol=1e-4)


def test_a_saved_scene_is_the_same_picture(tmp_path):
    for formula, parameters in (
        ("x^2 + y^2 - z^2 - a", {"a": 0.5}),
        ("kummer", {"mu": 1.4}),
        ("(x - 1/3)^2 + y^2 + z^2 = 2", {}),
    ):
        scene = scene_of(formula, parameters, size=(48, 32))
        (tmp_path / "s.json").write_text(vr.dump(scene, tmp_path))
        loaded = vr.load(tmp_path / "s.json")
        assert loaded == scene and loaded.hash() == scene_of(formula, parameters, size=(48, 32)).hash()
        np.testing.assert_array_equal(vr.render(loaded, spp=2)["RGB"], vr.render(scene, spp=2)["RGB"])


def test_parameters_can_be_changed_in_the_scene():
    scene = scene_of("x^2 + y^2 - z^2 - a", {"a": 0.5})
    assert made_anew("x^2 + y^2 - z^2 - a", {"a": 0.5}) == scene
    assert vr.value(scene, "objects.surface.parameters.a") == 0.5
    assert vr.replaced(scene, "objects.surface.parameters.a", 0.25).objects["surface"].parameters == {"a": 0.25}


@pytest.mark.parametrize(("name", "count"), [("cayley-cubic", 4), ("kummer", 16), ("barth-sextic", 50)])
def test_all_nodes_are_found(name, count):
    known = vr.SURFACES[name]
    f = field(known.expression, **known.parameters)
    found = special_points(f, np.zeros(3), surface_points(f, np.zeros(3), 1.2 * known.radius, 24)).singular
    assert len(found) == count
    for point in known.singular:
        place = [float(polynomials.exact_terms(f"({c})*x", known.parameters).get((1, 0, 0), 0)) for c in point]
        assert np.linalg.norm(found - place, axis=1).min() < 1e-6


@given(st.lists(st.integers(-3, 3), min_size=4, max_size=4), st.tuples(*3 * [st.integers(-4, 4)]))
@settings(max_examples=30)
def test_derivatives_are_those_of_the_terms(c, at):
    text = f"(x + {c[0]}*y*z - {c[1]})^3 - (2*z - x*y)*(y + {c[2]}) + {c[3]}*x + 1/2"
    try:
        f = field(text)
    except polynomials.PolynomialError:
        return
    terms = polynomials.exact_terms(text)
    sign = float(np.sign(f.values(np.array([[0.3, 0.7, 0.2]]))[0])) * np.sign(_value(terms, (0.3, 0.7, 0.2)))
    jet = f.jet(np.array([at], float))
    value, gradient = f.slope(np.array([at], float))
    for i in range(3):
        first = _derivative(terms, i)
        assert jet.gradient[i, 0] == pytest.approx(sign * float(_value(first, at)), abs=1e-6)
        assert gradient[i, 0] == pytest.approx(sign * float(_value(first, at)), abs=1e-6)
        for j in range(3):
            assert jet.hessian[i, j, 0] == pytest.approx(sign * float(_value(_derivative(first, j), at)), abs=1e-6)
    assert jet.value[0] == value[0] == pytest.approx(sign * float(_value(terms, at)), abs=1e-6)


def _value(terms, at):
    return sum(c * at[0] ** e[0] * at[1] ** e[1] * at[2] ** e[2] for e, c in terms.items())


def _derivative(terms, axis):
    steps = [int(k == axis) for k in range(3)]
    return {tuple(n - s for n, s in zip(e, steps)): c * e[axis] for e, c in terms.items() if e[axis]}


@pytest.mark.parametrize("formula", ["x^2 + y^2 + z^2 + 1", "x^2 + y^2", "x^2 + y^2 + z^2", "x^4 + (y - z)^2 + 1/2"])
def test_a_surface_without_points_is_nowhere(formula):
    assert whereabouts(field(formula)) is None
    with pytest.raises(vr.UserError, match=r"shows nothing: .*; change a sign or a number"):
        vr.surface_scene(formula)


WRONG = {
    "barth-sextc": 'no surface has this name; did you mean "barth-sextic"',
    "banana": "unknown name banana .* visray surfaces lists the known names",
    "": "the formula: it is empty",
    "sin(x) + y": "sin of x, y or z at column 1",
    "x^2 = 1 = y": "a second = at column 9",
    "7": "no x, y or z",
    "1e200 x^2 + y - 1e200": "too large for doubles",
}


@pytest.mark.parametrize("formula", WRONG)
def test_a_wrong_formula_is_one_line(formula):
    with pytest.raises(vr.UserError, match=WRONG[formula]) as error:
        vr.surface_scene(formula)
    assert len(error.value.lines) == 1


WRONG_ARGUMENTS = {
    "radius": ({"clip": 0}, r"clip = 0: must be greater than 0"),
    "no number": ({"clip": float("nan")}, r"clip = nan: must be greater than 0"),
    "too small": (
        {"clip": 0.5},
        r"x.* with a = 1: no point of the surface is in the clip, .*; clip 2.3 shows it",
    ),
    "direction": ({"view": (0, 0, 0)}, r"view: has no length"),
    "two numbers": ({"view": (0, 1)}, r"view = \(0, 1\): must be three numbers"),
    "dark": ({"color": (-1, 0, 0)}, r"color = -1,0,0: must be red, green and blue, each from 0 to 1"),
    "name": ({"parameters": {"b": 1}}, r"b: is no parameter of the formula; one of a"),
    "inf": ({"parameters": {"a": float("inf")}}, r"a = inf: must be a finite number"),
    "text": ({"parameters": {"a": "1"}}, r"a = '1': must be a finite number"),
}


@pytest.mark.parametrize("case", WRONG_ARGUMENTS)
def test_wrong_arguments_are_one_line(case):
    arguments, message = WRONG_ARGUMENTS[case]
    with pytest.raises(vr.UserError, match=f"^{message}") as error:
        scene_of("x^2 + y^2 - z^2 - a", **arguments)
    assert len(error.value.lines) == 1


def test_near_names_of_parameters_are_offered():
    with pytest.raises(vr.UserError, match="aa: is no parameter of the surface kummer; one of mu"):
        vr.surface_scene("kummer", {"aa": 1})
    with pytest.raises(vr.UserError, match="heart; it has none"):
        vr.surface_scene("heart", {"a": 1})


def notes(formula, parameters=None) -> str:
    return "; ".join(surface_picture(formula, parameters or {}, Wishes()).notes)


def test_what_may_not_be_expected_is_told():
    assert notes("x^2 + y^2 - z^2 - a") == "a = 1, as no value was given; --param a=2 gives another"
    assert notes("x^2 + y^2 - z^2 - a", {"a": 1}) == notes("heart") == ""
    assert "occurs 2 times in f; it is drawn once" in notes("(x^2 + y^2 + z^2 - 1)^2")
    assert "f is a product" in notes("(x^2 + y^2 + z^2 - 1)(x - y)")
    assert "with a = 0 the degree is 2, not 3" in notes("a x^3 + x^2 + y^2 - z^2 - 1", {"a": 0})
    with pytest.warns(UserWarning, match='a = 1, as no value was given; parameters={"a": 2} gives another'):
        vr.surface_scene("x + a")


def test_the_choices_are_told():
    made = surface_picture("x^2 + y^2 - z^2 - a", {"a": 1.0}, Wishes())
    assert made.choices == made.choices | {"degree": "2", "parameters": "a = 1"}
    assert made.choices["clip"] == "a ball of radius 2.3, which cuts the surface"
    whole = surface_picture("(x - 9)^2 + y^2 + z^2 - 1", {}, Wishes()).choices
    assert whole["clip"] == "a ball of radius 1.1 about 9, 0, 0, which holds the whole surface"


def test_the_surface_is_seen_as_it_is_placed():
    """The picture of a surface that is moved is the same picture."""
    here, there = (
        scene_of(f, size=SMALL) for f in ("x^2 + 2y^2 + 3z^2 = 1", "(x - 8)^2 + 2(y + 16)^2 + 3(z - 4)^2 = 1")
    )
    moved = replace(
        there.camera,
        origin=tuple(np.subtract(there.camera.origin, (8, -16, 4)).tolist()),
        target=tuple(np.subtract(there.camera.target, (8, -16, 4)).tolist()),
    )
    np.testing.assert_allclose(moved.origin, here.camera.origin, atol=0.03)
    np.testing.assert_allclose(moved.target, here.camera.target, atol=0.03)


def test_signs_and_crossings():
    f = field("(x - 1/2)*(y^2 + z^2 - 4)")
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    np.testing.assert_array_equal(f.signs(corners), np.where(corners[:, 0] > 0.5, -1, 1))
    at, lines = f.first_crossings(
        np.zeros((2, 3)), np.array([[1.0, 0, 0], [0, 1.0, 0]]), np.tile(np.linspace(0, 5, 20), (2, 1))
    )
    np.testing.assert_allclose(at, [0.5, 2.0], atol=1e-7)
    np.testing.assert_array_equal(lines, [0, 1])


def test_formulas_of_known_surfaces_are_seen_as_these():
    heart = scene_of("heart", size=SMALL)
    for formula in (
        "(x^2 + 9/4 y^2 + z^2 - 1)^3 = x^2 z^3 + 9/80 y^2 z^3",
        "3x^2 z^3 + 27/80 y^2 z^3 - 3(x^2 + 2.25y^2 + z^2 - 1)^3",
    ):
        made = scene_of(formula, size=SMALL)
        assert (made.camera, clip_of(made)) == (heart.camera, clip_of(heart)) and made.lights == heart.lights
        assert "this is the known surface heart" in notes(formula)
    other = scene_of("(x^2 + 9/4 y^2 + z^2 - 1)^3 = x^2 z^3 + 10/80 y^2 z^3", size=SMALL)
    assert other.camera != heart.camera and "known surface" not in notes("x^2 + y^2 - z^2 = 1")


def along(scene: vr.Scene, axis: tuple[float, float, float]) -> float:
    """The angle in degrees under which the camera looks along an axis."""
    towards = np.subtract(scene.camera.origin, clip_of(scene).center)
    return float(np.degrees(np.arccos(abs(towards @ axis) / np.linalg.norm(towards))))


@pytest.mark.parametrize(
    ("formula", "generator"),
    [
        ("y = x^2", (0, 0, 1)),
        ("xy = 1", (0, 0, 1)),
        ("y^2 = x^3 - x", (0, 0, 1)),
        ("z = x^2", (0, 1, 0)),
        ("yz = 1", (1, 0, 0)),
        ("(x + y + z)^2 = x - y", np.array((1, 1, -2)) / 6**0.5),
    ],
)
def test_cylinders_are_looked_into(formula, generator):
    scene = scene_of(formula)
    shape = scene.objects["surface"]
    f = Field(polynomials.build(shape.source(), shape.parameters))
    found = generator_of(f, surface_points(f, np.zeros(3), clip_of(scene).radius))
    assert abs(found @ generator) > 1 - 1e-9 and 12 < along(scene, generator) < 40


def test_only_cylinders_have_generators():
    for formula in ("z - x*y", "x^2 + y^2 - z^2", "x + y", "z - x^3 + 3*x*y^2"):
        assert generator_of(field(formula), surface_points(field(formula), np.zeros(3), 1.0)) is None


@pytest.mark.parametrize("formula", ["x^3 + y^2 = z^2", "z^2 = x^2 (x + 1) - y^2", "x^2 + y^2 = z^2"])
def test_nodes_are_not_hidden(formula):
    scene = scene_of(formula)
    shape = scene.objects["surface"]
    f = Field(polynomials.build(shape.source(), shape.parameters))
    found = nodes(f, np.zeros(3), clip_of(scene).radius, surface_points(f, np.zeros(3), clip_of(scene).radius, 16))
    np.testing.assert_allclose(found, [[0, 0, 0]], atol=1e-3)
    t = np.linspace(0.03, 1, 400)[:, None] * clip_of(scene).radius
    values = f.values(t * np.array(scene.camera.origin) / np.linalg.norm(scene.camera.origin))
    assert (values > 0).all() or (values < 0).all()


def test_points_of_singular_curves_are_no_nodes():
    for formula in ("y^2 - x^3", "y^2 - x^3 - x^2", "(x^2 + y^2 - 1)*(z - x^2)"):
        starts = surface_points(field(formula), np.zeros(3), 1.2, 16)
        assert len(nodes(field(formula), np.zeros(3), 1.2, starts)) == 0


def test_the_clip_of_a_known_surface_grows_with_its_parameters():
    assert clip_of(scene_of("kummer")).radius == clip_of(scene_of("kummer", {"mu": 1.3})).radius == 2.3
    assert 3.5 < clip_of(scene_of("kummer", {"mu": 1.9})).radius < 4.5
