"""What a picture to a number of samples says of the light that settings.depth leaves out."""

import warnings
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray import depth_report
from visray.depth_report import _lanes, _least_square, _Stretches, _tested, depth_facts
from visray.errors import CheckpointWarning, DepthWarning
from visray.output.curves import LUMINANCE
from visray.passes import expose
from visray.progress import Interrupts
from visray.setup import prepare

GLOW = vr.Material(kd=(0, 0, 0), ka=(0, 0, 0), emission=(0.2, 0.4, 0.1), kr=(0.5, 0.5, 0.5))
GLASS = vr.Material(kd=(0, 0, 0), ka=(0, 0, 0), kr=(1, 1, 1), kt=(1, 1, 1), ior=1.5, fresnel="dielectric")


def scene(depth: int, spp: int = 4, **more: Any) -> vr.Scene:
    """Two parallel mirrors that glow and reflect half of the light. The camera between them looks straight at one."""
    parts = {
        "camera": vr.OrthographicCamera(origin=(0, 0, 0), target=(0, 0, -1), height=1),
        "lights": {},
        "background": (0.3, 0.3, 0.3),
        "materials": {"glow": GLOW},
        "objects": {
            "before": vr.Plane(point=(0, 0, -1), normal=(0, 0, 1), material="glow"),
            "behind": vr.Plane(point=(0, 0, 1), normal=(0, 0, -1), material="glow"),
        },
        "film": vr.Film(width=40, height=30),
        "settings": vr.Settings(depth=depth, spp=spp),
    }
    return vr.Scene(**(parts | more))


def rendered(of: vr.Scene, **more: Any) -> tuple[vr.Image, list[str]]:
    """The picture, and what the report says of its depth."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        image = vr.render(of, progress=False, layers=("RGB",), **more)
    return image, [str(w.message) for w in said if w.category is DepthWarning]


@pytest.mark.parametrize("depth", [1, 2, 4, 9])
def test_two_mirrors(depth):
    """A path of n surfaces brings e (1 + 1/2 + ... + 1/2^n): closed form of what all depths leave out."""
    image, said = rendered(scene(depth))
    left = 0.5 ** (depth + 1) - 0.5 ** (8 * depth + 9)
    luminance = 2 * (1 - 0.5 ** (depth + 1)) * (np.array([0.2126, 0.7152, 0.0722]) @ GLOW.emission)
    error = 2 * left * np.sqrt(np.square(GLOW.emission).mean()) / luminance
    assert image.metadata["depth_error_at_least"] == pytest.approx(error, rel=1e-4)
    assert bool(said) == (error > depth_report.NOTABLE)
    if said:
        assert said[0].startswith(f"settings.depth = {depth}: leaves out light, which is an error of at least ")
        assert f"{100 * error:.2g} %" in said[0]


@pytest.mark.parametrize("light", [1e-6, 1e-170])
def test_dim_light(light):
    """An error is a share of the luminance, so it is the same for much less light. 1e-170 has no square."""
    dim = replace(GLOW, emission=tuple(light * x for x in GLOW.emission))
    settings = vr.Settings(depth=1, spp=1, precision="double")
    bright = rendered(scene(1, settings=settings))[0].metadata["depth_error_at_least"]
    of = scene(1, settings=settings, materials={"glow": dim})
    assert rendered(of)[0].metadata["depth_error_at_least"] == pytest.approx(bright, rel=1e-12)


@pytest.mark.parametrize("spp", [4, 100, 1000, 50_000])
def test_a_small_picture_is_not_rendered_anew(spp):
    """A picture of so few pixels that all of them are chosen would be rendered again, with paths that are longer."""
    prepared = prepare(scene(2, spp))
    lanes = _lanes(_Stretches.of(1200, 0).pairs, 1200)
    tested = _tested(prepared, lanes)
    samples = len(tested.order) * tested.scene.settings.spp
    assert samples <= max(1200 * spp / depth_report.WORK, depth_report.LEAST_SAMPLES)
    assert tested.scene.settings.spp == {4: 4, 100: 16, 1000: 36, 50_000: 1831}[spp]
    assert prepared.scene.settings.spp == spp


def test_errors_above_100_percent_have_no_exponent():
    """Mirrors that reflect all light, of which depth 1 shows two glowing surfaces: all others are left out."""
    all_light = scene(1, materials={"glow": replace(GLOW, kr=(1, 1, 1))})
    image, (text,) = rendered(all_light)
    error = 100 * image.metadata["depth_error_at_least"]
    assert error > 100 and f"at least {error:,.0f} %; with 8 it is about " in text and "e+" not in text


def test_the_frames_of_an_animation_say_it_once():
    """Also where some frames still lack light with the depth that is named, and others lack none."""
    glass = scene(1, objects={"ball": vr.Sphere(center=(0, 0, -3), radius=0.4, material="glass"), "wall": vr.Plane(
        point=(0, 0, -9), normal=(0, 0, 1), material="wall")}, materials={"glass": GLASS, "wall": vr.Material(
        emission=0.3)}, animation=vr.Animation(duration=1, fps=6, tracks={"away": vr.KeysTrack(
        address="objects.ball.center.0", times=(0, 1), values=(0, 0.4))}))  # fmt: skip
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        errors = [x.metadata["depth_error_at_least"] for x in vr.animate(glass, progress=False, layers=("RGB",))]
    assert len({f"{x:.2g}" for x in errors}) > 1
    assert len([w for w in said if w.category is DepthWarning]) == 1


def test_the_depth_that_is_named_is_enough():
    (text,) = rendered(scene(2))[1]
    named, left = text.split("; with ")[1].split(" it is about ")
    image, said = rendered(scene(int(named)))
    assert not said and float(left.split()[0]) / 100 < depth_report.NOTABLE
    # What is said is relative to the luminance of the picture that lacks light, so it is a little larger.
    assert image.metadata["depth_error_at_least"] <= float(left.split()[0]) / 100 * 1.01


@pytest.mark.parametrize(
    "of",
    [
        scene(0),
        scene(1, materials={"glow": vr.Material(color=0.5)}),
        scene(1, materials={"glow": replace(GLOW, emission=(0, 0, 0))}, background=(0, 0, 0)),
        scene(1, film=vr.Film(width=7, height=9)),
    ],
    ids=["mirrors off", "no mirrors", "black", "few pixels"],
)
def test_nothing_is_said_where_nothing_is_known(of):
    image, said = rendered(of)
    assert "depth_error_at_least" not in image.metadata and not said


def test_the_picture_has_the_same_bits_and_no_kernel_is_compiled():
    """Also where a picture is so large that its passes are many, and so small that it is one."""
    glass = scene(3, objects={"ball": vr.Sphere(center=(0, 0, -3), material="glow"), "pane": vr.Box(
        min=(-1, -1, -2), max=(1, 1, -1.5), material="glass")}, materials={"glow": GLOW, "glass": GLASS})  # fmt: skip
    # The last picture has so few pixels that they are rendered again with fewer samples than it has.
    for size, spp in (((64, 48), 4), ((640, 480), 4), ((40, 30), 256)):
        settings = replace(glass.settings, spp=spp)
        prepared = prepare(replace(glass, film=vr.Film(width=size[0], height=size[1]), settings=settings))
        film, _ = expose(prepared)
        before = [np.array(x) for x in film.moments.arrays]
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            facts = depth_facts(prepared, film, False, Interrupts())
            kernels = dr.kernel_history([dr.KernelType.JIT])
        large = [k for k in kernels if k["operation_count"] > 500]
        assert large and not any(not k["cache_hit"] or k["cache_disk"] for k in large)
        assert facts.keys() == {"depth_error_at_least"}
        for one, other in zip(before, film.moments.arrays):
            np.testing.assert_array_equal(one, np.array(other))


def test_after_ctrl_c_nothing_is_looked_at():
    prepared = prepare(scene(1))
    film, _ = expose(prepared)
    stopped = Interrupts()
    stopped.requested = True
    assert depth_facts(prepared, film, False, stopped) == {}


def test_ctrl_c_in_the_look_keeps_the_samples(tmp_path, monkeypatch):
    """The picture counts as stopped then, though it has all of its samples."""
    path, rendering = tmp_path / "a.checkpoint", depth_report._rendered

    def stopping(prepared: Any, depth: int, interrupts: Interrupts) -> np.ndarray:
        interrupts.requested = True
        return rendering(prepared, depth, interrupts)

    with monkeypatch.context() as patched:
        patched.setattr(depth_report, "_rendered", stopping)
        with pytest.warns(CheckpointWarning, match="keeps the samples"):
            image = vr.render(scene(2), progress=False, checkpoint=path)
    assert image.metadata["interrupted"] and image.metadata["spp"] == 4 and path.exists()
    assert "depth_error_at_least" not in image.metadata
    whole, _ = rendered(scene(2), checkpoint=path, resume=True)
    assert whole.metadata["depth_error_at_least"] > 0.1 and not path.exists()
    np.testing.assert_array_equal(whole["RGB"], image["RGB"])


@pytest.mark.parametrize("spp", [1, 2, 16])
@pytest.mark.parametrize("chance", [0.0, 0.001, 0.01, 0.3])
def test_noise_is_taken_for_no_error(chance, spp):
    """Samples with known distributions: the interval holds in more cases than it promises, and where much light is left
    out it is not much too small."""
    rng, pixels, trials = np.random.default_rng(5), 1500, 200
    least = []
    for _ in range(trials):
        cut = rng.random((spp, 1, pixels)) < chance
        least.append(np.sqrt(_least_square((cut * rng.exponential(1.0, (spp, 3, pixels))).mean(0))))
    # Each pixel and channel lacks `chance` in the mean. 2.5 % may be above: of 200, more than 11 once in 100 times.
    assert sum(x > chance for x in least) <= 11
    assert np.median(least) >= (0.8 * chance if chance > 0.1 else 0.0)


def test_neighbours_that_differ_make_the_error_no_larger():
    """The mean product of neighbours is at most the mean square: equal where they are, 0 where one of them lacks no
    light."""
    ones = np.ones((3, 1000))
    assert _least_square(ones) == 1
    assert _least_square(ones * np.tile((0.0, 2.0), 500)) == 0


@pytest.mark.parametrize("n", [200, 2046, 2600, 4095])
def test_all_pixels_are_chosen_equally_often(n):
    """Chosen pixels stand for all others. Stretches of lanes have one pair or more, so their lengths differ."""
    trials = 2000
    counts = np.zeros(n // 2)
    for seed in range(trials):
        counts[_Stretches.of(n, seed).pairs % (n // 2)] += 1
    share = min(depth_report.LEAST_PIXELS, n) / (2 * len(counts))
    # Of 2000 numbers, one is above 5 standard deviations once in 1000 times.
    assert abs(counts / trials - share).max() <= 5 * np.sqrt(share * (1 - share) / trials) + 1e-12


@pytest.mark.parametrize("n", [1, 2, 3, 15, 1024, 1025, 70_000, 10**6])
def test_chosen_pixels(n):
    lanes = _lanes(_Stretches.of(n, 3).pairs, n)
    first, second = lanes[::2], lanes[1::2]
    assert lanes.min() >= 0 and lanes.max() < n and len(set(first)) == len(first)
    assert ((second == first + 1) | (n == 1)).all()
    assert min(n - 1, depth_report.LEAST_PIXELS) <= len(lanes) + 1 <= depth_report.MOST_PIXELS + 1
    # They are spread: no stretch of pixels is left out.
    assert np.diff(np.concatenate([[0], np.sort(first), [n]])).max() <= 4 * -(-n // len(first)) + 2


@pytest.mark.parametrize("n", [2048, 2050, 20_000, 70_001, 10**6])
@pytest.mark.parametrize("lacking", [1, 7, 300])
def test_further_pairs_are_other_ones_of_the_same_stretches(n, lacking):
    stretches = _Stretches.of(n, 1)
    ends = np.append(stretches.begins[1:], stretches.begins[0] + n // 2)
    chosen = np.random.default_rng(2).permutation(len(ends))[:lacking]
    more = stretches.other_pairs(chosen)
    assert len(set(more % (n // 2))) == len(more) <= max(len(ends) / 2, lacking)
    assert not set(more) & set(stretches.pairs)
    # Each stretch has as many of them as the others.
    inside = ((more[:, None] >= stretches.begins[chosen]) & (more[:, None] < ends[chosen])).sum(0)
    assert (inside == inside[0]).all() and inside.sum() == len(more)
    assert inside[0] >= min(stretches.least - 1, 1)


@pytest.mark.parametrize("size", [(160, 120), (640, 480)])
def test_a_small_part_of_the_picture(size):
    """Light is left out in 4 % of the picture, the same in each pixel there: closed form, but for pairs at the edge."""
    glow = {"a": vr.Rectangle(center=(0, 0, -1), width=(0.2, 0, 0), height=(0, 0.2, 0), material="glow")}
    glow["b"] = vr.Rectangle(center=(0, 0, 1), width=(4, 0, 0), height=(0, 4, 0), material="glow")
    width, height = size
    errors = []
    for seed in range(12):
        of = scene(2, 1, objects=glow, film=vr.Film(width=width, height=height),
                   settings=vr.Settings(depth=2, spp=1, seed=seed))  # fmt: skip
        image, said = rendered(of)
        share = (image.rgb != np.float32(0.3)).any(-1).mean()
        left = np.sqrt(share * np.square(GLOW.emission).mean()) * 2 * (0.5**3 - 0.5**25)
        truth = left / (image.rgb @ LUMINANCE).mean()
        errors.append(image.metadata["depth_error_at_least"] / truth)
        assert len(said) == 1
    # 97.5 % of all are at most the truth: two of twelve are not once in 30 times.
    assert sum(x > 1 for x in errors) <= 2 and min(errors) > 0.6 and max(errors) < 1.1
