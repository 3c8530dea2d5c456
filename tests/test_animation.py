"""Tracks: interpolation against closed forms and invariants, moments of a scene, and frames."""

import json
import math
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from track_samples import ADDRESSES, DURATION, SCENE, TRACK_SAMPLES, keys, moving

import visray as vr
from visray.animation import interpolation, paths, rotations
from visray.animation.frames import chosen_frames, frame_times
from visray.animation.kinds import KINDS
from visray.animation.moment import assignments
from visray.quantities import Direction, Quantity, quantities
from visray.scene.check import checked
from visray.transforms import compose

EPS = np.finfo(float).eps
NUMBERS = st.floats(-1e3, 1e3, allow_subnormal=False)


@st.composite
def curves(draw: Any) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of keys."""
    gaps = draw(st.lists(st.floats(0.01, 10), min_size=1, max_size=8))
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    return times, np.array(draw(st.lists(NUMBERS, min_size=len(times), max_size=len(times))))


def moved(track: vr.KeysTrack, t: float) -> Any:
    """The value that a track of keys gives its address at time t."""
    return vr.value(vr.at(moving(track), t), track.address)


# Numbers.


def cubic(times: np.ndarray, values: np.ndarray, t: float) -> float:
    return interpolation.cubic(times, values, interpolation.slopes(times, values), t)


@pytest.mark.parametrize("values", [[0, 1, 4, 9, 16], [0, 0, 1, 1], [3, 1, 2, 2, 5], [1, 2], [0, 5, 4], [0, 0.1, 9]])
def test_smooth_curves_are_those_of_another_program(values: list[float]) -> None:
    scipy = pytest.importorskip("scipy.interpolate")
    times, values = np.array([0, 1, 1.5, 4, 4.2][: len(values)], float), np.array(values, float)
    other = scipy.PchipInterpolator(times, values)
    for t in np.linspace(0, times[-1], 101):
        # A cubic of a few terms: tens of roundings.
        assert cubic(times, values, t) == pytest.approx(float(other(t)), rel=0, abs=50 * EPS * np.abs(values).max())


def test_smooth_curves_have_the_slopes_of_their_authors() -> None:
    """Fritsch and Butland: at an inner key the weighted harmonic mean of the slopes beside it; here (2 h2 + h1) and (h2
    + 2 h1) are 5 and 4."""
    slopes = interpolation.slopes(np.array([0.0, 1, 3]), np.array([0.0, 1, 2]))
    assert slopes[1] == pytest.approx(9 / (5 / 1 + 4 / 0.5), rel=4 * EPS)
    flat = interpolation.slopes(np.array([0.0, 1, 2]), np.array([0.0, 1, 0]))
    assert flat[1] == 0


@given(curves())
def test_interpolation_meets_the_keys_and_never_leaves_their_values(curve: tuple[np.ndarray, np.ndarray]) -> None:
    times, values = curve
    slopes = interpolation.slopes(times, values)
    for i, (time, value) in enumerate(zip(times, values)):
        assert interpolation.linear(times, values, time) == value == interpolation.cubic(times, values, slopes, time)
        if i + 1 == len(times):
            continue
        low, high = sorted(values[i : i + 2])
        inner = [cubic(times, values, t) for t in np.linspace(time, times[i + 1], 20)]
        assert low <= min(inner) and max(inner) <= high
        # Between two keys it goes one way only, up to rounding of the values.
        steps = np.diff(inner) * (1 if values[i + 1] >= values[i] else -1)
        assert steps.min() >= -50 * EPS * np.abs(values).max()


@given(curves(), NUMBERS)
def test_outside_of_the_keys_a_track_holds_still(curve: tuple[np.ndarray, np.ndarray], beyond: float) -> None:
    times, values = curve
    for how in (interpolation.linear, cubic):
        assert how(times, values, times[0] - abs(beyond)) == values[0]
        assert how(times, values, times[-1] + abs(beyond)) == values[-1]


def test_held_values_are_those_of_the_key_before() -> None:
    track = keys("objects.ball.radius", 1.0, 2.0, 3.0, interpolation="step")
    assert [moved(track, t) for t in (0, 0.999, 1, 1.999, 2)] == [1, 1, 2, 2, 3]


def test_linear_values_are_on_a_line() -> None:
    assert moved(keys("materials.red.kd", (0, 0, 0), (0.5, 1, 0)), 0.5) == (0.125, 0.25, 0)
    assert moved(keys("objects.wave.parameters.a", 1, 2), 0.5) == 1.25


# Directions and rotations.


def test_directions_go_at_constant_speed_on_a_great_circle() -> None:
    track = keys("lights.sun.direction", (1, 0, 0), (0, 2, 0))
    for share in np.linspace(0, 1, 9):
        angle = share * math.pi / 2
        direction = np.array(moved(track, share * DURATION))
        assert direction / np.linalg.norm(direction) == pytest.approx(
            [math.cos(angle), math.sin(angle), 0], abs=8 * EPS
        )
        assert np.linalg.norm(direction) == pytest.approx(1 + share, rel=8 * EPS)


def rotation(step: dict) -> np.ndarray:
    return compose((vr.Rotate(**step),))[:, :3]


@pytest.mark.parametrize(("a", "b", "middle"), [(350, 10, 0), (0, 180, 90), (0, 270, -45), (10, 200, -75)])
def test_rotations_go_the_short_way(a: float, b: float, middle: float) -> None:
    track = keys("objects.box.transform.0", vr.Rotate(rotate=a), vr.Rotate(rotate=b))
    [found] = assignments(checked(moving(track)), 1.0).values()
    assert rotation(found) == pytest.approx(rotation({"rotate": middle}), abs=20 * EPS)


AXES = st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
TURNS = st.builds(lambda d, axis: {"rotate": d, "axis": axis}, st.floats(-720, 720, allow_subnormal=False), AXES)


@given(TURNS, TURNS, st.floats(0, 1))
def test_rotations_turn_evenly_about_one_axis(a: dict, b: dict, share: float) -> None:
    p, q = (rotations.quaternion(x["rotate"], np.array(x["axis"])) for x in (a, b))
    q = rotations.nearer(q, p)
    degrees, axis = rotations.angle_and_axis(rotations.slerp(p, q, share), np.array(a["axis"]))
    found = rotation({"rotate": degrees, "axis": tuple(axis)})
    assert rotation(a) == pytest.approx(rotations.matrix(p), abs=64 * EPS)

    def angle(m: np.ndarray, n: np.ndarray) -> float:
        """Angle of the rotation from m to n, by the distance of matrices: |m - n| = 2 sqrt(2) sin(angle / 2)."""
        return 2 * math.asin(min(np.linalg.norm(m - n) / math.sqrt(8), 1.0))

    whole = angle(rotation(a), rotation(b))
    # The arc sine loses half of the digits near half a turn.
    assert angle(rotation(a), found) == pytest.approx(share * whole, abs=1e-6)
    assert angle(found, rotation(b)) == pytest.approx((1 - share) * whole, abs=1e-6)


@given(TURNS)
def test_a_matrix_has_the_quaternion_of_its_rotation(turn: dict) -> None:
    q = rotations.of_matrix(rotation(turn))
    assert rotations.matrix(q) == pytest.approx(rotation(turn), abs=64 * EPS)


@given(st.lists(st.floats(-2, 2, allow_subnormal=False), min_size=9, max_size=9).map(lambda x: np.reshape(x, (3, 3))))
def test_a_matrix_is_a_rotation_of_a_stretch(m: np.ndarray) -> None:
    if abs(np.linalg.det(m)) < 1e-3:
        return
    turn, stretch = rotations.polar(m)
    # The singular values and vectors have errors of some tens of roundings of the largest one.
    error = 64 * EPS * np.linalg.norm(m)
    assert turn @ stretch == pytest.approx(m, abs=error)
    assert turn.T @ turn == pytest.approx(np.eye(3), abs=64 * EPS) and np.linalg.det(turn) > 0
    assert stretch == pytest.approx(stretch.T, abs=error)
    assert np.all(np.linalg.eigvalsh(stretch) * np.linalg.det(m) > 0)


def test_matrices_between_two_turn_and_stretch_at_the_same_time() -> None:
    """From the identity to a quarter turn of a stretch by 2 in x: half way, an eighth turn of a stretch by 1.5."""
    [found] = vr.at(moving(ADDRESSES["matrices"]), 1.0).objects["still"].transform
    c = math.sqrt(0.5)
    assert np.array(found.matrix) == pytest.approx(
        np.array([[1.5 * c, -c, 0, 0.25], [1.5 * c, c, 0, 0], [0, 0, 1, 0]]), abs=20 * EPS
    )


@pytest.mark.parametrize(("how", "jumps"), [("smooth", False), ("linear", True)])
def test_smooth_directions_change_their_speed_without_jumps(how: str, jumps: bool) -> None:
    track = keys("lights.sun.direction", (1, 0, 0), (1, 1, 0), (-1, 1, 0.5), interpolation=how)
    step = 1e-4

    def speed(a: float, b: float) -> float:
        """Angle per second between two times."""
        p, q = (rotations.unit(np.array(track.values_at(t, _STAGE)[track.address])) for t in (a, b))
        return rotations.arc(p, q) / (b - a)

    jump = abs(speed(1 - 2 * step, 1 - step) - speed(1 + step, 1 + 2 * step))
    # Without a jump: the acceleration, a few units per s^2, times three steps.
    assert (jump > 0.1) == jumps and (jump < 1e-2) != jumps


class _Stage:
    """What a track of keys needs: how directions are interpolated."""

    @staticmethod
    def sort(address: str) -> str:
        return "direction"


_STAGE: Any = _Stage()


# Shortcuts.


def test_an_orbit_keeps_the_distance_and_the_view() -> None:
    scene = moving(vr.OrbitTrack(turns=1))
    for share in np.linspace(0, 1, 9):
        camera, angle = vr.at(scene, share * DURATION).camera, 2 * math.pi * share
        assert camera.origin == pytest.approx((7 * math.sin(angle), 1, 7 * math.cos(angle)), abs=64 * EPS)
        assert (camera.target, camera.up) == (SCENE.camera.target, SCENE.camera.up)


def test_an_orbit_about_another_axis_turns_the_camera_as_a_whole() -> None:
    still, camera = SCENE.camera, vr.at(moving(vr.OrbitTrack(axis=(1, 1, 0), turns=0.3)), DURATION).camera
    turn = rotation({"rotate": 108, "axis": (1, 1, 0)})
    assert camera.origin == pytest.approx(turn @ np.array(still.origin), abs=32 * EPS)
    assert camera.up == pytest.approx(turn @ np.array(still.up), abs=8 * EPS)


def test_an_orbit_follows_a_target_that_moves() -> None:
    target = keys("camera.target", (0, 0, 0), (2, 0, 0))
    for tracks in ((target, vr.OrbitTrack()), (vr.OrbitTrack(), keys("camera.target.0", 0, 2))):
        camera = vr.at(moving(*tracks), 1.0).camera
        assert camera.target == (1, 0, 0) and camera.origin == pytest.approx((1, 1, -7), abs=32 * EPS)


def test_a_spin_turns_what_the_written_transform_made() -> None:
    scene = moving(TRACK_SAMPLES[vr.SpinTrack])
    written = compose(SCENE.objects["box"].transform)
    for share in (0.0, 0.25, 0.6, 1.0):
        matrix = compose(vr.at(scene, share * DURATION).objects["box"].transform)
        turn, center = rotation({"rotate": 360 * share, "axis": (1, 2, 0)}), np.array([-1.6, 0, 0])
        expected = np.column_stack([turn @ written[:, :3], turn @ (written[:, 3] - center) + center])
        assert matrix == pytest.approx(expected, abs=64 * EPS)


@pytest.mark.parametrize(("begin", "end"), [(0.5, 1.5), (0.0, None), (0.5, None)])
def test_a_track_is_complete_at_its_end(begin: float, end: float | None) -> None:
    scene = moving(vr.SpinTrack(of="objects.still", center=(0, 0, 0), turns=0.5, begin=begin, end=end))
    last = DURATION if end is None else end
    for t in np.linspace(0, DURATION, 9):
        share = min(max((t - begin) / (last - begin), 0), 1)
        assert vr.at(scene, t).objects["still"].transform[0].rotate == pytest.approx(180 * share, abs=1e-12)


POINTS = np.array([[0, 0, 0], [1, 0, 0], [1.2, 0.1, 0.3], [5, -2, 1], [5, -2, 1.1]])


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("path", [paths.polygon, paths.spline])
def test_a_path_has_constant_speed(path: Any, closed: bool) -> None:
    """The error is the square of the share by which the steps differ that are even steps of the parameter."""
    made = path(POINTS, closed)
    shares = np.linspace(0, 1, 20001)
    points = np.array([made.at(s) for s in shares])
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) * (len(shares) - 1) / made.lengths[-1]
    speeds_at = np.diff(made.lengths) / np.diff(made.parameters)
    change = (np.abs(np.diff(speeds_at)) / np.minimum(speeds_at[1:], speeds_at[:-1])).max()
    # Few chords lead across a point, where a polygon has a corner.
    assert np.quantile(np.abs(speeds - 1), 0.999) <= change**2 + 1e-6
    assert change < 0.1


@pytest.mark.parametrize("path", [paths.polygon, paths.spline])
@pytest.mark.parametrize("closed", [False, True])
def test_a_path_passes_through_its_points(path: Any, closed: bool) -> None:
    made = path(POINTS, closed)
    ring = [*POINTS, POINTS[0]] if closed else POINTS
    assert len(made.shares()) == len(ring)
    for share, point in zip(made.shares(), ring):
        assert made.at(share) == pytest.approx(point, abs=1e-12)


def pyramid(points: np.ndarray, i: int, share: float) -> np.ndarray:
    """The centripetal Catmull-Rom curve after the point i, in its Bezier form (C. Yuksel et al.): share of the
    parameter."""
    p0, p1, p2, p3 = points[i - 1 : i + 3]
    d1, d2, d3 = (np.linalg.norm(b - a) ** 0.5 for a, b in ((p0, p1), (p1, p2), (p2, p3)))
    b1 = (d1**2 * p2 - d2**2 * p0 + (2 * d1**2 + 3 * d1 * d2 + d2**2) * p1) / (3 * d1 * (d1 + d2))
    b2 = (d3**2 * p1 - d2**2 * p3 + (2 * d3**2 + 3 * d3 * d2 + d2**2) * p2) / (3 * d3 * (d3 + d2))
    s, r = share, 1 - share
    return r**3 * p1 + 3 * r**2 * s * b1 + 3 * r * s**2 * b2 + s**3 * p2


def test_a_smooth_path_is_the_curve_of_its_authors() -> None:
    made = paths.spline(POINTS, False)
    for i in (1, 2):
        for k in (0, 1, 100, 255):
            u = made.parameters[i * made.every + k]
            assert made.at_parameter(u) == pytest.approx(pyramid(POINTS, i, k / made.every), abs=1e-12)


def test_a_smooth_path_is_measured_in_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, one = [], paths._catmull_rom
    monkeypatch.setattr(paths, "_catmull_rom", lambda *given: calls.append(1) or one(*given))
    made = paths.spline(np.random.default_rng(1).random((50, 3)), True)
    assert len(calls) == 1 and len(made.lengths) == 50 * made.every + 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("path", [paths.polygon, paths.spline])
def test_steps_that_rounding_swallows_leave_no_hole_in_a_path(path: Any) -> None:
    """The second step is 1e-9 long, and the length before it is rounded by 1e-7."""
    points = np.array([[0, 0, 0], [1e9, 0, 0], [1e9, 1e-9, 0], [0, 1, 0]])
    made = path(points, False)
    found = np.array([made.at(s) for s in np.linspace(0, 1, 101)])
    assert np.isfinite(found).all() and found[0] == pytest.approx(points[0]) and found[-1] == pytest.approx(points[-1])


def test_a_smooth_path_has_no_corners() -> None:
    made = paths.spline(POINTS, True)
    for share in (*made.shares()[:-1], 0.999999999):
        before, here, after = (made.at(s % 1) for s in (share - 1e-6, share, share + 1e-6))
        a, b = here - before, after - here
        assert a @ b / (np.linalg.norm(a) * np.linalg.norm(b)) > 1 - 1e-5


def test_a_smooth_path_along_a_line_is_the_line() -> None:
    made = paths.spline(np.array([[0.0, 0, 0], [1, 1, 0], [4, 4, 0]]), False)
    for share in np.linspace(0, 1, 21):
        assert made.at(share) == pytest.approx([4 * share, 4 * share, 0], abs=1e-4)


@given(st.floats(0, DURATION))
def test_ellipses_are_those_of_the_original(t: float) -> None:
    """p = center + (rx cos a, 0, rz sin a), with a = 3 pi / 2 + 2 pi t / period."""
    inner = vr.Ellipse(radii=(0.2, 0.1), period=-0.5)
    tracks = vr.EllipseTrack(address="objects.ball.center", radii=(3, 2), period=1.6, center=(1, 2, 3), around=inner)
    found = vr.at(moving(tracks), t).objects["ball"].center
    a, b = (1.5 * math.pi + 2 * math.pi * t / period for period in (1.6, -0.5))
    expected = 1 + 3 * math.cos(a) + 0.2 * math.cos(b), 2, 3 + 2 * math.sin(a) + 0.1 * math.sin(b)
    assert found == pytest.approx(expected, abs=1e-12)


def test_an_ellipse_without_a_center_goes_about_the_point_of_the_scene() -> None:
    scene = moving(vr.EllipseTrack(address="objects.still.center", radii=(1, 1), period=1, phase=0))
    assert vr.at(scene, 0).objects["still"].center == (2.5, -1, 0)


# Moments and frames.


@pytest.mark.parametrize("kind", KINDS)
def test_a_moment_is_a_plain_scene(kind: type) -> None:
    scene, track = moving(TRACK_SAMPLES[kind]), TRACK_SAMPLES[kind]
    moment = vr.at(scene, 1.2)
    assert moment.animation is None and moment == vr.at(scene, 1.2)
    still = vr.replaced(scene, "animation", None)
    for address in track.addresses():
        assert vr.value(moment, address) != vr.value(still, address)
        still = vr.replaced(still, address, vr.value(moment, address))
    assert still == moment


@pytest.mark.parametrize("kind", KINDS)
def test_a_track_writes_its_addresses_and_no_others(kind: type) -> None:
    for t in (0.0, 0.3, DURATION):
        assert tuple(assignments(checked(moving(TRACK_SAMPLES[kind])), t)) == TRACK_SAMPLES[kind].addresses()


@pytest.mark.parametrize("what", ADDRESSES)
def test_keys_move_all_sorts_of_values(what: str) -> None:
    track = ADDRESSES[what]
    scene = moving(track)
    for time, value in zip(track.times, track.values):
        still = vr.replaced(vr.replaced(scene, "animation", None), track.address, value)
        assert vr.at(scene, time) == still
    between = vr.at(scene, 0.4)
    assert between != vr.at(scene, 0) or track.interpolation == "step"


def test_objects_that_do_not_move_are_the_same_instances() -> None:
    scene = checked(moving(TRACK_SAMPLES[vr.SpinTrack]))
    moment = vr.at(scene, 0.5)
    # A polynomial has a dict of parameters, which may change: it is a new one each time.
    assert [name for name in scene.objects if moment.objects[name] is not scene.objects[name]] == ["box", "wave"]


def test_a_scene_whose_dict_was_changed_is_checked_anew() -> None:
    scene = moving(TRACK_SAMPLES[vr.SpinTrack])
    vr.at(scene, 0)
    scene.animation.tracks["track0"] = vr.SpinTrack(of="objects.nothing")
    with pytest.raises(vr.UserError, match=r'animation.tracks.track0.of = "objects.nothing"'):
        vr.at(scene, 0)


def test_numbers_of_rows_move() -> None:
    table = {"lon": [0.0, 10.0], "lat": [0.0, 40.0], "rain": [1.0, 2.0]}
    layer = vr.DataLayer(source=table, height=vr.SizeRule(column="rain", domain=(0, 4)))
    scene = vr.Scene(
        data=vr.Data(layers={"rain": layer}),
        animation=vr.Animation(
            duration=1, tracks={"a": vr.KeysTrack(address="data.rain.1.height", times=(0, 1), values=(2, 4))}
        ), camera=vr.Camera(), lights={},
    )  # fmt: skip
    assert vr.value(vr.at(scene, 0.25), "data.rain.1.height") == 2.5


@pytest.mark.parametrize("t", [-0.1, DURATION + 0.1, math.nan, math.inf, "x", None])
def test_a_time_outside_is_refused(t: Any) -> None:
    with pytest.raises(vr.UserError, match=r"^t = .*: must be a time of the animation, from 0 to 2 s$"):
        vr.at(moving(vr.OrbitTrack()), t)


def test_a_scene_without_an_animation_has_no_moments() -> None:
    with pytest.raises(vr.UserError, match=r"^at: the scene has no animation"):
        vr.at(SCENE, 0)


@pytest.mark.parametrize(
    ("frames", "numbers"),
    [(None, range(20)), ("0:4", range(4)), ("::5", range(0, 20, 5)), ("-2:", (18, 19)), ("7", (7,)), ("-1", (19,)),
     ("5:2:-1", (5, 4, 3)), (slice(3, 5), (3, 4)), (6, (6,)), (":", range(20)), ("0:20", range(20))],
)  # fmt: skip
def test_frames_are_chosen_as_by_slices(frames: Any, numbers: Any) -> None:
    animation = vr.Animation(duration=2, fps=10)
    assert frame_times(animation, frames) == [(k, k / 10) for k in numbers]


def test_a_loop_closes_and_short_animations_have_a_frame() -> None:
    assert frame_times(vr.Animation(duration=1, fps=4)) == [(0, 0), (1, 0.25), (2, 0.5), (3, 0.75)]
    assert frame_times(vr.Animation(duration=1, fps=4), fps=2.0) == [(0, 0), (1, 0.5)]
    assert frame_times(vr.Animation(duration=0.01, fps=4)) == [(0, 0)]


@pytest.mark.parametrize(
    ("frames", "text"),
    [("0:21", "is outside; the animation has 20 frames, 0 to 19"), ("20", "is outside"), ("-21:", "is outside"),
     ("5:5", "chooses no frame"), ("1:5:0", "the step must not be 0"), ("a:b", "is no range of frames"),
     (99, "is outside")],
)  # fmt: skip
def test_wrong_frames_are_refused(frames: Any, text: str) -> None:
    with pytest.raises(vr.UserError, match=f"^frames = .*: {text}"):
        frame_times(vr.Animation(duration=2, fps=10), frames)


def test_endless_lists_of_frames_are_refused() -> None:
    long = vr.Animation(duration=86400, fps=1e6)
    with pytest.raises(vr.UserError, match=r"^frames: these are 86400000000, and at most 1000000 are made at once"):
        frame_times(long)
    assert frame_times(long, "86399999999") == [(86399999999, 86399.999999)]


@pytest.mark.parametrize("fps", [0, -1, 1e6 + 1, 1e308, 10**99, math.inf, math.nan])
def test_wrong_rates_are_refused(fps: float) -> None:
    with pytest.raises(vr.UserError, match=r"^fps = .*: must be greater than 0, and at most 1e\+06$"):
        frame_times(vr.Animation(duration=2), fps=fps)


@pytest.mark.parametrize(
    "frames",
    ["9" * 5000, f"-{'9' * 5000}:", f"0:{10**4000}", 10**5000, slice(0, 10**5000)],
    ids=["text", "begin", "end", "number", "slice"],
)
def test_numbers_of_thousands_of_digits_are_outside(frames: Any) -> None:
    with pytest.raises(vr.UserError, match=r"^frames = .{1,60}: is outside; the animation has 20 frames") as refused:
        chosen_frames(vr.Animation(duration=2, fps=10), frames)
    assert len(refused.value.lines) == 1


def test_zeros_before_a_number_change_nothing() -> None:
    assert frame_times(vr.Animation(duration=2, fps=10), f"{'0' * 5000}7") == [(7, 0.7)]


# Files.


@pytest.mark.parametrize("what", [*(kind.type for kind in KINDS), *ADDRESSES])
def test_a_file_has_the_same_tracks(what: str, tmp_path: Path) -> None:
    tracks = {kind.type: track for kind, track in TRACK_SAMPLES.items()} | ADDRESSES
    scene, file = checked(moving(tracks[what])), tmp_path / "scene.json"
    file.write_text(vr.dump(scene))
    assert vr.load(file) == scene and vr.load(file).hash() == scene.hash()
    assert vr.at(vr.load(file), 1.1) == vr.at(scene, 1.1)


def test_a_track_without_a_type_has_keys(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    track = {"address": "camera.fov", "times": [0, 1], "values": [40, 20]}
    file.write_text(json.dumps({"animation": {"duration": 1, "tracks": {"zoom": track}}}))
    assert vr.at(vr.load(file), 0.5).camera.fov == 30
    assert '"type"' not in vr.dump(vr.load(file))


def test_directions_are_told_by_their_type() -> None:
    """The unit of directions is that of no other triple."""
    mark = next(m for m in Direction.__metadata__ if isinstance(m, Quantity))
    assert quantities(vr.DirectionalLight)["direction"] == mark != quantities(vr.PointLight)["position"]


DAYS = {
    "lon": [0.0, 0.0], "lat": [0.0, 0.0], "name": ["here", "here"], "when": ["2020-02-21", "2020-03-02"],
    "rain": [1.0, 11.0],
}  # fmt: skip


def of_days(*values: Any, date: Any = None) -> vr.Scene:
    """A scene with data of two days, whose date moves in two seconds."""
    layer = vr.DataLayer(source=DAYS, time="when", height=vr.SizeRule(column="rain", domain=(0, 20)))
    return vr.Scene(
        data=vr.Data(layers={"rain": layer}, date=date),
        animation=vr.Animation(
            duration=2, tracks={"a": vr.KeysTrack(address="data.date", times=(0, 2), values=values)}
        ),
        camera=vr.Camera(),
        lights={},
    )


@pytest.mark.parametrize("date", [None, "2020-02-22"])
def test_dates_move_day_by_day(date: Any) -> None:
    """Ten days from the first day to the last one, as February has 29."""
    scene = of_days("2020-02-21", "2020-03-02", date=date)
    assert vr.at(scene, 1).data.date == "2020-02-26T00:00:00.000000"
    for t, rain in ((0, 1), (0.2, 2), (1, 6), (2, 11)):
        assert vr.value(vr.at(scene, t), "data.rain.0.height") == pytest.approx(rain, abs=1e-9)


def test_a_number_as_date_is_a_year() -> None:
    first, last = 2020 + 51.5 / 366, 2020 + 60.5 / 366
    assert vr.value(vr.at(of_days(first, last), 1), "data.rain.0.height") == pytest.approx(6, abs=1e-6)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (("2020-02-21", "soon"), r'values.1 = "soon": must be a date such as 2020-06-15, or a number'),
        (("2020-02-21", 2020.5), r"values.1 = 2020.5: must be a date like the first key, or a number like it"),
        (("2020-02-21", "2021"), r'values.1 = "2021": is outside of the dates of the data, from 2020-02-21'),
    ],
)
def test_wrong_dates_are_refused(values: tuple, text: str) -> None:
    with pytest.raises(vr.UserError, match=f"^animation.tracks.a.{text}"):
        vr.at(of_days(*values), 0)
