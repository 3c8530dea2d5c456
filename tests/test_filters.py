"""Reconstruction filters: the distribution that samples are drawn from is the filter, weights have the mean 1, and
pixels are those of closed forms. The default filter changes no bit, and a number of a filter compiles nothing."""

import re
import warnings
from dataclasses import fields, replace
from math import erf, sqrt
from pathlib import Path

import numpy as np
import pytest
from test_render import compiled

import visray as vr
from visray import filters
from visray.cli.picture_options import FILTERS
from visray.filter_report import FilterWarning
from visray.quantities import Arrays

A = Arrays.of("llvm", "double")
# Each kind as it is, and with other numbers.
SOME = [
    *(kind() for kind in filters.KINDS),
    filters.BoxFilter(radius=1.25),
    filters.TentFilter(radius=0.3),
    filters.GaussianFilter(radius=3.0, sigma=0.4),
    filters.GaussianFilter(radius=16.0, sigma=0.05),
    filters.MitchellFilter(radius=3.0, b=0.0, c=0.5),
    filters.MitchellFilter(b=1.0, c=0.0),
    filters.MitchellFilter(b=0.0, c=1.0),
]
ids = [f"{f.type}-{f.radius:g}-{i}" for i, f in enumerate(SOME)]


def integral(f: filters.ReconstructionFilter, x: np.ndarray) -> np.ndarray:
    """Integral of the function of a filter from its centre to x >= 0, by an antiderivative."""
    if isinstance(f, filters.BoxFilter):
        return x
    if isinstance(f, filters.TentFilter):
        return x - x * x / (2 * f.radius)
    if isinstance(f, filters.GaussianFilter):
        return np.array([sqrt(np.pi / 2) * f.sigma * erf(v / (f.sigma * sqrt(2))) for v in x])
    half, b, c = f.radius / 2, f.b, f.c
    inner = np.poly1d([12 - 9 * b - 6 * c, -18 + 12 * b + 6 * c, 0, 6 - 2 * b]).integ()
    outer = np.poly1d([-b - 6 * c, 6 * b + 30 * c, -12 * b - 48 * c, 8 * b + 24 * c]).integ()
    t = x / half
    return half / 6 * np.where(t < 1, inner(t), inner(1) + outer(t) - outer(1))


def signed_share(f: filters.ReconstructionFilter, x: np.ndarray) -> np.ndarray:
    """Share of the filter's own integral, with its signs, up to x pixels from the centre."""
    total = integral(f, np.array([f.radius]))[0]
    return 0.5 + 0.5 * np.sign(x) * integral(f, np.minimum(np.abs(x), f.radius)) / total


def absolute_share(f: filters.ReconstructionFilter, x: np.ndarray) -> np.ndarray:
    """Share of the integral of the absolute value up to x."""
    zero = f.radius
    if isinstance(f, filters.MitchellFilter):
        zero = f.radius / 2 * min((2 * f.b + 6 * f.c) / (f.b + 6 * f.c), 2)

    def part(v: np.ndarray) -> np.ndarray:
        most = integral(f, np.array([zero]))
        return np.where(v < zero, integral(f, v), 2 * most - integral(f, v))

    near = np.minimum(np.abs(x), f.radius)
    return 0.5 + 0.5 * np.sign(x) * part(near) / part(np.array([f.radius]))


@pytest.mark.parametrize("f", SOME, ids=ids)
def test_the_distribution_of_places_is_that_of_the_filter(f):
    x = np.linspace(-f.radius, f.radius, 40_001)
    off = np.abs(f.share(x + 0.5) - absolute_share(f, x)).max()
    assert off <= 0.5 / filters.PARTS and (off <= 5e-5 or f not in [kind() for kind in filters.KINDS])
    assert (f.share(np.array([-99.0, 0.5 - f.radius, 0.5, 0.5 + f.radius, 99.0])) == [0, 0, 0.5, 1, 1]).all()


@pytest.mark.parametrize("f", SOME, ids=ids)
def test_kernels_invert_the_distribution(f):
    u = np.linspace(0, 1 - 2.0**-24, 20_001)
    made = f.prepared(A)
    x, y = (np.array(p) for p in made.places(A.F(u), A.F(u[::-1].copy()), None))
    assert np.array_equal(x, y[::-1])
    assert (np.diff(x) >= 0).all() and 0.5 - f.radius <= x.min() and x.max() <= 0.5 + f.radius
    assert np.abs(f.share(x) - u).max() < 1e-9


SIGNED = [f for f in SOME if f.may_be_negative]


@pytest.mark.parametrize("f", SIGNED, ids=lambda f: f"{f.b:.2g}-{f.c:.2g}")
def test_signs_that_turns_choose_have_no_bias(f):
    """The mean of the weights of places up to x = a and y = b is the filter's integral up to there: the sum over the
    signs of both functions, each with its probability. The weights of 16 even turns add up to 16."""
    made, u = f.prepared(A), (np.arange(2**17) + 0.5) / 2**17
    chance, both = (float(np.array(x)[0]) for x in (made.chance, made.both))
    some = np.array([-1.5, -0.4, 0.0, 0.3, 1.2, 2.0]) * f.radius / 2
    total = np.zeros((len(some), len(some)))
    parts = {chance / 4: chance / 2, 3 * chance / 4: chance / 2, chance + both / 2: both, 1.0: 1 - chance - both}
    for turn, probability in parts.items():
        if probability == 0:
            continue
        turn = A.F(turn)
        x, y = (np.array(p) - 0.5 for p in made.places(A.F(u), A.F(u), turn))
        up_to_a, up_to_b = ((v[:, None] <= some).mean(0) for v in (x, y))
        total += probability * float(np.array(made.weight(None, None, turn))[0]) * np.outer(up_to_a, up_to_b)
    share = signed_share(f, some)
    assert np.abs(total - np.outer(share, share)).max() < 3e-4
    turns = np.array(made.weight(None, None, A.F((np.arange(16) + 0.5) / 16)))
    assert turns.sum() == pytest.approx(16, abs=1e-9)


@pytest.mark.parametrize("f", SIGNED, ids=lambda f: f"{f.b:.2g}-{f.c:.2g}")
@pytest.mark.parametrize("spp", [2, 4, 8, 16])
def test_weights_of_few_samples_add_up_too(f, spp):
    made = f.prepared(A, spp)
    weights = np.array(made.weight(None, None, A.F((np.arange(spp) + 0.5) / spp)))
    assert weights.sum() == pytest.approx(spp, abs=1e-9) and (weights.min() < 0) == (f.c > 0)


def flat(spp: int, sampler: str = "sobol", **film) -> vr.Scene:
    """A background of the brightness 1, and a lane for each of 24 x 24 pixels."""
    return vr.Scene(
        film=vr.Film(24, 24, filter=filters.MitchellFilter(), **film), background=1, camera=vr.Camera(), lights={},
        settings=vr.Settings(spp=spp, sampler=sampler),
    )  # fmt: skip


@pytest.mark.parametrize("sampler", ["sobol", "stratified"])
@pytest.mark.parametrize("spp", [2, 4, 6, 8, 12, 16, 20])
def test_an_even_number_of_samples_leaves_no_dark_dots(spp, sampler):
    with warnings.catch_warnings():
        warnings.simplefilter("error", FilterWarning)
        image = vr.render(flat(spp, sampler), layers="RGB", progress=False)
    assert np.abs(image["RGB"] - 1).max() < 1e-5


@pytest.mark.parametrize("spp, sampler", [(1, "sobol"), (3, "sobol"), (21, "stratified"), (4, "independent")])
def test_samples_that_leave_dark_dots_are_said_with_their_size(spp, sampler):
    scene = flat(spp, sampler)
    with pytest.warns(FilterWarning) as said:
        image = vr.render(scene, layers="RGB", progress=False)
    (text,) = (str(w.message) for w in said if w.category is FilterWarning)
    assert (text,) == vr.explain(scene).notes
    stated = float(re.search(r"by ([\d.]+) %", text)[1]) / 100
    assert image["RGB"].std(axis=(0, 1))[0] == pytest.approx(stated, rel=0.15)


def test_a_render_takes_fields_of_the_film():
    scene = flat(2)
    image = vr.render(scene, filter="tent", region=(2, 3, 6, 9), scale=0.5, spp=1, layers="RGB", progress=False)
    assert image["RGB"].shape == (6, 4, 3)
    film = vr.Film(24, 24, filter=vr.TentFilter(), region=(2, 3, 6, 9), scale=0.5)
    same = vr.render(vr.replaced(scene, "film", film), spp=1, layers="RGB", progress=False)
    assert np.array_equal(image["RGB"], same["RGB"])
    for kind in filters.KINDS:
        assert getattr(vr, kind.__name__) is kind


@pytest.mark.parametrize("f", SIGNED, ids=lambda f: f"{f.b:.2g}-{f.c:.2g}")
def test_signs_that_places_choose_have_no_bias(f):
    """As the test before, along x, with y in the middle, where the function is positive."""
    made, u = f.prepared(A), (np.arange(2**17) + 0.5) / 2**17
    x, _ = made.places(A.F(u), A.F(0.5), None)
    weight = np.array(made.weight(A.F(u), A.F(0.5), None)) / sqrt(np.array(made.size)[0])
    some = np.array([-1.5, -0.4, 0.0, 0.3, 1.2, 2.0]) * f.radius / 2
    found = (weight[:, None] * (np.array(x)[:, None] - 0.5 <= some)).mean(0)
    assert np.abs(found - signed_share(f, some)).max() < 3e-4


EDGE = 0.3


def edge(f: filters.ReconstructionFilter, sampler: str = "sobol", spp: int = 4096, **film) -> vr.Scene:
    """A white half plane, whose edge is EDGE pixels right of the middle column's left side, before black."""
    half = vr.Rectangle(center=(50 + EDGE, 0, 0), width=(100, 0, 0), height=(0, 200, 0), material="white")
    return vr.Scene(
        camera=vr.OrthographicCamera(origin=(0, 0, 5), target=(0, 0, 0), height=2.0),
        film=vr.Film(**({"width": 12, "height": 2, "filter": f} | film)),
        background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), lights={},
        materials={"white": vr.Material(kd=(1.0, 1.0, 1.0), shading="unlit")}, objects={"half": half},
        settings=vr.Settings(spp=spp, sampler=sampler),
    )  # fmt: skip


@pytest.mark.parametrize("f", SOME, ids=ids)
def test_an_edge_is_that_of_the_closed_form(f):
    """Colour, and coverage of a transparent film, which leaves the range from 0 to 1 where the filter is negative."""
    spp = 2**19 if f.may_be_negative else 4096  # signs are noise at edges
    image = vr.render(edge(f, spp=spp, transparent=True), layers=("RGB", "A"), progress=False)
    # The edge is at x = 6 + EDGE of the picture.
    expected = 1 - signed_share(f, 6 + EDGE - (np.arange(12) + 0.5))
    for values in (image["RGB"][..., 0], image["A"]):
        assert np.abs(values - expected).max() < 2e-3
    if f == filters.MitchellFilter():
        assert image["A"].min() < 0 and image["A"].max() > 1
        assert image.display().dtype == np.uint8


@pytest.mark.parametrize("sampler", ["stratified", "sobol", "independent"])
def test_flat_areas_have_no_noise_with_16_samples(sampler):
    """Negative weights do not disturb them, unless samples are independent."""
    for f in SOME:
        picture = vr.render(edge(f, sampler, 16), layers="RGB", progress=False)["RGB"][:, 11]
        if 11.5 - f.radius > 6 + EDGE and not (sampler == "independent" and f.may_be_negative):
            assert np.abs(picture - 1).max() < 1e-5


@pytest.mark.parametrize("kind", filters.KINDS)
def test_the_filter_is_known_to_explain_and_by_its_name(kind):
    scene = vr.replaced(vr.Scene(camera=vr.Camera(), lights={}), "film.filter", kind.type)
    assert scene.film.filter == kind()
    (found,) = (f for f in vr.explain(scene).listed if f.name == "filter")
    assert found.on == (kind() != filters.SQUARE)
    assert found.reason == (
        "needed by film.filter"
        if found.on
        else "film.filter is a box of radius 0.5: a pixel is the light on its square"
    )
    assert vr.value(scene, "film.filter.radius") == kind().radius
    assert vr.replaced(scene, "film.filter.type", "tent").film.filter == filters.TentFilter()


def ball(**film) -> vr.Scene:
    return vr.Scene(
        camera=vr.Camera(),
        film=vr.Film(width=24, height=16, **film),
        lights={"key": vr.PointLight(position=(3, 4, 5))},
        objects={"ball": vr.Sphere(), "floor": vr.Plane(point=(0, -1, 0))},
        settings=vr.Settings(spp=9),
    )


def rgb(scene: vr.Scene, **more) -> np.ndarray:
    return vr.render(scene, layers="RGB", progress=False, **more)["RGB"]


@pytest.mark.slow
def test_the_default_is_the_square_bit_for_bit_with_the_code_of_filters_too():
    plain = vr.prepare(ball())
    forced = vr.setup.prepare(plain.scene, everything=True)
    assert not plain.features["filter"] and forced.features["filter"]
    assert np.array_equal(rgb(plain), rgb(forced))
    assert np.array_equal(rgb(plain), rgb(ball(filter=filters.BoxFilter(radius=0.5))))


@pytest.mark.parametrize("kind", filters.KINDS)
def test_numbers_of_a_filter_compile_nothing(kind):
    first, second = (kind(radius=r) for r in (1.7, 2.6))
    rgb(ball(filter=first))
    changed = {f.name: 0.7 for f in fields(kind) if f.name in ("sigma", "b", "c")}
    assert compiled(lambda: rgb(ball(filter=second))) == 0
    assert compiled(lambda: rgb(ball(filter=replace(second, **changed)))) == 0


@pytest.mark.parametrize("camera", [vr.Camera(fov=25.0), vr.OrthographicCamera(height=2.5)], ids=lambda c: c.type)
@pytest.mark.parametrize("kind", filters.KINDS)
def test_lists_find_what_lies_beyond_the_pictures_edges(camera, kind):
    """Rays go three pixels beyond the picture: the same bits with lists, with the tree and with neither."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-1.5, 1.5, (60, 3)) * [1.4, 1.0, 0.2]
    scene = vr.Scene(
        camera=camera,
        film=vr.Film(width=20, height=14, filter=kind(radius=3.0)),
        lights={"key": vr.PointLight(position=(3, 4, 5))},
        objects={f"b{i}": vr.Sphere(center=tuple(p), radius=0.12) for i, p in enumerate(places.tolist())},
        settings=vr.Settings(spp=4),
    )
    pictures = [rgb(vr.replaced(scene, "settings.accelerator", way)) for way in ("none", "lists", "tree", "auto")]
    assert all(np.array_equal(pictures[0], other) for other in pictures[1:])
    assert not np.array_equal(pictures[0], rgb(vr.replaced(scene, "film.filter", "box")))


@pytest.mark.filterwarnings("ignore::visray.EdgeWarning")
@pytest.mark.parametrize(
    "light", [vr.PointLight(position=(3, 4, 5)), vr.SphereLight(position=(3, 4, 5), radius=0.5, samples=2)]
)
@pytest.mark.parametrize("kind", filters.KINDS)
def test_derivatives_are_those_of_differences(kind, light):
    """In one loop over samples, and in waves of paths; forward and reverse."""
    scene = replace(
        vr.Scene(
            camera=vr.Camera(),
            film=vr.Film(width=6, height=4, filter=kind(radius=1.4)),
            settings=vr.Settings(spp=5),
            lights={},
        ),
        lights={"key": light},
        materials={"red": vr.Material(kd=(0.8, 0.2, 0.1))},
        objects={"ball": vr.Sphere(radius=3.0, material="red")},
    )
    for address in ("materials.red.kd.0", "objects.ball.radius"):
        found, expected = vr.derivative(scene, address, progress=False), vr.difference(scene, address)
        assert np.abs(found - expected).max() < 1e-6 * max(np.abs(expected).max(), 1)
        assert vr.gradient(scene, address, progress=False)[address] == pytest.approx(found.mean(), rel=1e-9)
    with pytest.raises(vr.UserError, match=r"film\.filter\.radius: is not a number that a picture depends on smoothly"):
        vr.derivative(scene, "film.filter.radius", progress=False)


@pytest.mark.parametrize("sampler", ["stratified", "independent"])
@pytest.mark.parametrize("kind", filters.KINDS)
def test_a_bound_of_the_error_is_stated_where_it_is_near_the_error(kind, sampler):
    scene = vr.replaced(ball(filter=kind()), "settings.sampler", sampler)
    stated = "error_at_most" in vr.render(scene, layers="RGB", progress=False).metadata
    assert stated == (sampler == "independent" or not kind.may_be_negative)


def test_edges_that_only_a_filter_reaches_are_warned_of():
    """The rim of a ball one pixel beyond the picture."""
    scene = vr.Scene(
        camera=vr.OrthographicCamera(origin=(0, 0, 5), target=(0, 0, 0), height=8.0),
        film=vr.Film(width=8, height=8),
        lights={"key": vr.PointLight(position=(0, 0, 50))},
        objects={"ball": vr.Sphere(radius=6.5)},
        settings=vr.Settings(spp=1, shadows=False),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        vr.derivative(scene, "objects.ball.radius", progress=False)
    wide = vr.replaced(scene, "film.filter", {"type": "box", "radius": 3.0})
    with pytest.warns(vr.EdgeWarning, match="silhouettes"):
        vr.derivative(wide, "objects.ball.radius", progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("kind", filters.KINDS)
def test_errors_are_true_with_each_filter(kind):
    """Independent samples: the error that is stated is the error, and the picture is that of all seeds."""
    scene = vr.replaced(ball(filter=kind(radius=1.5)), "settings.sampler", "independent")
    true = np.mean([rgb(scene, spp=1024, seed=s).astype(float) for s in range(100, 104)], 0)
    images = [vr.render(scene, seed=s, spp=16, layers="RGB", progress=False) for s in range(12)]
    off = [sqrt(np.square(i["RGB"] - true).mean()) / (true @ [0.2126, 0.7152, 0.0722]).mean() for i in images]
    stated = [i.metadata["error_at_most"] for i in images]
    assert np.sqrt(np.square(off).mean()) == pytest.approx(np.sqrt(np.square(stated).mean()), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", filters.KINDS)
def test_the_error_asked_for_is_reached_with_each_filter(kind):
    scene = ball(filter=kind(radius=1.5))
    true = rgb(vr.replaced(scene, "settings.sampler", "sobol"), spp=2**15).astype(float)
    scale = (true @ [0.2126, 0.7152, 0.0722]).mean()
    within = 0
    for seed in range(10):
        image = vr.render(scene, seed=seed, error=0.02, layers="RGB", progress=False)
        off = sqrt(np.square(image["RGB"] - true).mean()) / scale
        within += image.metadata["error_low"] <= off <= image.metadata["error_high"] <= 0.02
    assert within >= 8


@pytest.mark.slow
@pytest.mark.parametrize("kind", filters.KINDS)
def test_small_objects_have_cells_in_all_pixels_that_they_reach(kind):
    """A bright ball far smaller than a pixel: each pixel has the ball's area times the filter at its place."""
    f, size, radius, bright = kind(radius=1.5), 9, 0.01, 500.0
    scene = vr.Scene(
        camera=vr.OrthographicCamera(origin=(0, 0, 5), target=(0, 0, 0), height=float(size)),
        film=vr.Film(width=size, height=size, filter=f),
        background=(0.2, 0.2, 0.2), ambient=(0.0, 0.0, 0.0), lights={},
        materials={"hot": vr.Material(kd=(bright, bright, bright), shading="unlit")},
        objects={"spark": vr.Sphere(center=(0.2, -0.1, 0.0), radius=radius, material="hot")},
    )  # fmt: skip
    image = vr.render(scene, error=0.02, layers="RGB", progress=False)
    total = 2 * integral(f, np.array([f.radius]))[0]
    x, y = (np.abs(np.arange(size) + 0.5 - at) for at in (size / 2 + 0.2, size / 2 + 0.1))
    across, down = (np.where(v <= f.radius, f.value(np.minimum(v, f.radius)), 0) / total for v in (x, y))
    expected = 0.2 + np.pi * radius**2 * (bright - 0.2) * np.outer(down, across)
    assert image.metadata["small_object_pixels"] == np.count_nonzero(np.outer(y < f.radius, x < f.radius))
    off = sqrt(np.square(image["RGB"] - expected[..., None]).mean()) / expected.mean()
    assert off <= 1.5 * image.metadata["error_high"]


ALL = f"(one of {', '.join(filters.BY_TYPE)})"


@pytest.mark.parametrize("raw, text", [
    ("gausian", f'film.filter = "gausian": unknown filter; did you mean "gaussian"? {ALL}'),
    ({"type": "tnt"}, f'film.filter.type = "tnt": unknown type; did you mean "tent"? {ALL}'),
    ({"type": "tent", "radius": 0}, "film.filter.radius = 0: must be at least 0.1"),
    ({"type": "tent", "radius": 100}, "film.filter.radius = 100: must be at most 16"),
    ({"type": "gaussian", "sigma": 0}, "film.filter.sigma = 0: must be at least 0.05"),
    ({"type": "box", "sigma": 1}, "film.filter.sigma: unknown key; one of type, radius"),
    (3, "film.filter = 3: must be an object {...} with a type: one of box, tent, gaussian, mitchell"),
])  # fmt: skip
def test_wrong_filters_are_refused(raw, text):
    with pytest.raises(vr.UserError) as error:
        vr.replaced(vr.Scene(camera=vr.Camera(), lights={}), "film.filter", raw)
    assert error.value.lines == (text,)


def test_the_options_and_the_page_know_all_filters():
    assert tuple(filters.BY_TYPE) == FILTERS
    page = (Path(__file__).parents[1] / "docs" / "film.md").read_text()
    table = page.split("<!-- fields: filters -->")[1].split("\n\n")[0].splitlines()[3:]
    shown = {re.match(r"\| `(\w+)`", row)[1]: re.findall(r"`(\w+)` ([\d./]+)", row.split("|")[2]) for row in table}
    assert set(shown) == set(filters.BY_TYPE)
    for name, listed in shown.items():
        defaults = {f.name: f.default for f in fields(filters.BY_TYPE[name]) if f.name != "type"}
        assert {key: eval(text) for key, text in listed} == defaults
