"""The same scene, seed and samples give the same bits, however the work was cut: into passes, films, files, threads."""

import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_adaptive import EDGES, with_settings
from test_render import CHANGES, SHOW, at, compiled, many
from virtual import Machine

from visray import integrator, passes
from visray.errors import StoppedWarning, UserError
from visray.film import Film, PictureIdentity
from visray.geometry import gamma
from visray.lights import RectangleLight
from visray.moments import BLOCK, index_in_block
from visray.passes import empty_film, expose, exposed_once, subset
from visray.progress import Interrupts
from visray.renderer import render
from visray.sampling import SamplePlan
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare

SAMPLERS = ("stratified", "sobol", "independent")
# No square, and no whole number of blocks.
SPP = 3 * BLOCK + 5
PANEL = RectangleLight(position=(-2, 5, 2), width=(1.5, 0, 0), height=(0, 0, 1.5), samples=2)
SOFT = replace(SHOW, lights=SHOW.lights | {"panel": PANEL}, film=replace(SHOW.film, width=21, height=14))


@cache
def made_of(sampler: str, transparent: bool = False, precision: str = "single") -> Prepared:
    scene = with_settings(SOFT, sampler=sampler, spp=SPP, precision=precision)
    return prepare(replace(scene, film=replace(scene.film, transparent=transparent)))


@cache
def at_once(sampler: str, transparent: bool = False, precision: str = "single") -> Film:
    made = made_of(sampler, transparent, precision)
    return exposed_once(made, empty_film(made), SPP)


def same(one: Film, other: Film) -> bool:
    """Whether two films are equal bit for bit: what is in them, and what is read from them."""
    parts = zip(*((*f.moments.arrays, f.mean, f.squares, f.coverage) for f in (one, other)))
    equal = all(np.array(x).tobytes() == np.array(y).tobytes() for x, y in parts)
    return equal and np.array_equal(one.counts, other.counts) and np.array_equal(one.pixels, other.pixels)


EACH = pytest.mark.parametrize("sampler", SAMPLERS)
FILMS = pytest.mark.parametrize("transparent", [False, True], ids=["opaque", "transparent"])
CUTS = st.sets(st.integers(1, SPP - 1), max_size=6).map(sorted)


@pytest.fixture
def threads() -> Iterator[Callable[[int], None]]:
    before = dr.thread_count()
    yield dr.set_thread_count
    dr.set_thread_count(before)


# Passes


@EACH
@FILMS
@settings(max_examples=12, deadline=None)
@given(cuts=CUTS, read=st.booleans())
@pytest.mark.slow
def test_cut_into_passes(sampler: str, transparent: bool, cuts: list[int], read: bool) -> None:
    """Anywhere within blocks, and read in between or not."""
    made = made_of(sampler, transparent)
    film = empty_film(made)
    for target in (*cuts, SPP):
        film = exposed_once(made, film, target)
        assert not read or np.isfinite(np.array(film.mean)).all()
    assert same(film, at_once(sampler, transparent))


@EACH
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
@pytest.mark.slow
def test_each_lane_in_steps_of_its_own(sampler: str, seed: int) -> None:
    """Where lanes are apart: strata too go by the index of a sample alone."""
    made, rng = made_of(sampler, True), np.random.default_rng(seed)
    film, n = empty_film(made), len(made.order)
    while film.counts.min() < SPP:
        film = exposed_once(made, film, np.minimum(film.counts + rng.integers(0, 30, n), SPP))
    assert same(film, at_once(sampler, True))


def test_in_double() -> None:
    made = made_of("stratified", True, "double")
    film = empty_film(made)
    for target in (1, 7, 39, SPP):
        film = exposed_once(made, film, target)
    assert same(film, at_once("stratified", True, "double"))


@EACH
def test_what_is_read_is_right_in_the_middle_of_a_block(sampler: str) -> None:
    """Mean and variance against NumPy in double, of the samples one by one. Only sums of one block are in single
    precision: more blocks are off by no more."""
    made = made_of(sampler)
    each = [
        integrator.attached_mean(made.kernel, SamplePlan.of(made.a, 0, SPP, i, 1), made.x, made.y) for i in range(SPP)
    ]
    samples, film = np.array([np.array(x, float) for x in each]), empty_film(made)
    most = samples.max() + 1
    bound = gamma(2 * BLOCK + 4, "single") * most
    for count in (1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK, SPP):
        film = exposed_once(made, film, count)
        here = samples[:count]
        assert np.abs(np.array(film.mean) - here.mean(0)).max() <= bound
        assert np.abs(np.array(film.squares) - count * here.var(0)).max() <= 4 * count * bound * most
        assert not index_in_block(np.int64(count)) or not np.array_equal(
            np.array(film.mean), np.array(film.moments.mean)
        )
        assert (np.array(film.coverage) == 0).all()


@EACH
def test_the_loop_that_has_derivatives_has_the_same_samples(sampler: str) -> None:
    made = made_of(sampler)
    mean = np.array(integrator.attached_mean(made.kernel, SamplePlan.of(made.a, 0, SPP, 0, SPP), made.x, made.y))
    largest = max(1.0, np.abs(mean).max())
    assert np.abs(mean - np.array(at_once(sampler).mean)).max() <= gamma(2 * SPP + 4, "single") * largest


@EACH
@FILMS
def test_no_pass_but_the_first_compiles(sampler: str, transparent: bool) -> None:
    """Of whatever size, and from wherever on."""
    made = made_of(sampler, transparent)
    np.array(exposed_once(made, empty_film(made), 3).mean)

    def others() -> None:
        film = exposed_once(made, empty_film(made), 1)
        for target in (2, 16, 37, SPP):
            film = exposed_once(made, film, target)
            np.array(film.mean)

    assert compiled(others) == 0


# The clock and threads


def exposed_on(monkeypatch: pytest.MonkeyPatch, made: Prepared, **machine: Any) -> tuple[Film, int]:
    """The film of a machine that is so fast, and in how many passes it was made."""
    with monkeypatch.context() as patch:
        patch.setattr(passes, "first_pass_samples", lambda made: len(made.order))
        slower = Machine(patch, **machine)
        return expose(made)[0], slower.passes


@EACH
def test_fast_and_slow_machines(sampler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made, rng = made_of(sampler, True), np.random.default_rng(0)
    passes = []
    for rate in (1e-9, 1e-4, 1e-3):
        film, number = exposed_on(monkeypatch, made, rate=rate, slow=lambda: float(rng.lognormal()))
        assert same(film, at_once(sampler, True))
        passes.append(number)
    assert len(set(passes)) == 3


@EACH
def test_one_thread_and_many(sampler: str, threads: Callable[[int], None]) -> None:
    """With more lanes than Dr.Jit gives to a thread at once, 2^14."""
    scene = with_settings(SOFT, sampler=sampler, spp=20)
    made = prepare(replace(scene, film=replace(scene.film, width=230, height=150, transparent=True)))
    films = []
    for n in (1, 2, 3):
        threads(n)
        films.append(expose(made)[0])
    assert same(films[0], films[1]) and same(films[0], films[2])


@pytest.mark.parametrize("n", [1000, 2**16 + 1, 2 * 10**6 + 1])
def test_sums_do_not_depend_on_threads(n: int, threads: Callable[[int], None]) -> None:
    """On which adaptive pictures decide."""
    a = made_of("sobol").a
    numbers = a.put(a.D, np.random.default_rng(n).random(n))
    dr.eval(numbers)
    found = set()
    for number in (1, 2, 3, 7):
        threads(number)
        found |= {dr.sum(numbers * dr.opaque(a.D, 1 / 3)).numpy().tobytes() for _ in range(3)}
    assert len(found) == 1


def layers(scene: Scene, **goal: float) -> dict[str, np.ndarray]:
    image = render(scene, progress=False, **goal)
    return image.layers | {name: np.array(image.metadata[name]) for name in ("error", "error_low", "error_high")}


@pytest.mark.parametrize(
    ("sampler", "error"), [("stratified", 0.05), ("sobol", 0.05), ("independent", 0.05), ("sobol", 0.006)]
)
def test_pictures_to_an_error(
    sampler: str, error: float, monkeypatch: pytest.MonkeyPatch, threads: Callable[[int], None]
) -> None:
    """On a fast machine and on slow ones, with one thread and two; with a transparent film."""
    scene = with_settings(replace(EDGES, film=replace(EDGES.film, transparent=True)), sampler=sampler)
    rng, passes = np.random.default_rng(1), []
    first = layers(scene, error=error)
    for number, rate in ((1, 1e-8), (2, 1e-5), (2, 1e-4)):
        threads(number)
        with monkeypatch.context() as patch:
            machine = Machine(patch, rate=rate, slow=lambda: float(rng.lognormal()))
            found = layers(scene, error=error)
            passes.append(machine.passes)
        assert found.keys() == first.keys()
        for name, values in found.items():
            assert values.tobytes() == first[name].tobytes(), name
    assert len(set(passes)) > 1 or error > 0.01


def test_a_picture_to_an_error_with_mirrors(monkeypatch: pytest.MonkeyPatch) -> None:
    """What depth leaves out is looked at by samples too."""
    mirrored = replace(SOFT.materials["red"], kr=(0.7, 0.7, 0.7))
    scene = with_settings(replace(SOFT, materials=SOFT.materials | {"red": mirrored}), sampler="sobol", depth=3)
    first = layers(scene, error=0.02)
    for rate in (1e-8, 1e-5):
        with monkeypatch.context() as patch:
            Machine(patch, rate=rate)
            found = layers(scene, error=0.02)
        assert all(values.tobytes() == first[name].tobytes() for name, values in found.items())


# Tiles


def tiles(made: Prepared, rng: np.random.Generator) -> list[np.ndarray]:
    """Some sets of lanes, one of them of one lane alone, which have all."""
    where = rng.integers(0, 5, len(made.order))
    where[where == 4] = 3
    where[rng.integers(len(where))] = 4
    return [np.flatnonzero(where == i) for i in rng.permutation(5)]


@EACH
@FILMS
def test_tiles_in_any_order(sampler: str, transparent: bool) -> None:
    """Each in passes of its own, merged at once or one by one."""
    made, rng = made_of(sampler, transparent), np.random.default_rng(3)
    films = []
    for lanes in tiles(made, rng):
        tile = subset(made, lanes)
        film = exposed_once(tile, empty_film(tile), int(rng.integers(1, SPP)))
        films.append(expose(tile, film=film)[0])
    whole = at_once(sampler, transparent)
    assert same(Film.merged(films), whole) and same(Film.merged(films[::-1]), whole)
    assert same(Film.merged([Film.merged(films[2:]), Film.merged(films[:2])]), whole)


def test_tiles_that_are_not_done_go_on_together() -> None:
    """Each from where it is."""
    made, rng = made_of("stratified", True), np.random.default_rng(4)
    films = []
    for lanes in tiles(made, rng):
        tile = subset(made, lanes)
        films.append(exposed_once(tile, empty_film(tile), int(rng.integers(1, SPP))))
    merged = Film.merged(films)
    assert len(np.unique(merged.counts)) > 1
    film, done = expose(made, film=merged)
    assert done == SPP and same(film, at_once("stratified", True))


def test_many_objects_tile_by_tile() -> None:
    """In a tree, and in loops, where the packets of lanes are others."""
    made = prepare(with_settings(many(SOFT), spp=5))
    films = [expose(subset(made, lanes))[0] for lanes in tiles(made, np.random.default_rng(5))]
    assert same(Film.merged(films), expose(made)[0])


def test_films_that_do_not_belong_together_are_not_merged() -> None:
    made, n = made_of("sobol"), len(made_of("sobol").order)
    left, right = (empty_film(subset(made, lanes)) for lanes in (np.arange(n - 5), np.arange(n - 7, n)))
    with pytest.raises(UserError, match=r"^films: more than one has pixel \d+, \d+; merge films that have no pixel in"):
        Film.merged([left, right])
    other = prepare(with_settings(made.scene, seed=8))
    with pytest.raises(UserError, match=r"^films\[1\]: is of seed 8, not 0; give another, or begin anew"):
        Film.merged([left, empty_film(subset(other, np.arange(n - 5, n)))])


# Files


@EACH
@FILMS
@settings(max_examples=4, deadline=None)
@given(stop=st.integers(1, SPP - 1))
def test_stop_save_load_go_on(sampler: str, transparent: bool, stop: int, tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("films") / "a.film"
    made = made_of(sampler, transparent)
    film = exposed_once(made, empty_film(made), stop)
    film.save(path)
    loaded = Film.load(made.a, path, PictureIdentity(made.scene, made.a))
    assert same(loaded, film)
    done, count = expose(made, film=loaded)
    assert count == SPP and same(done, at_once(sampler, transparent)) and same(loaded, film)
    done.save(path)
    assert same(Film.load(made.a, path), done)
    # All samples are taken: another exposure adds none.
    assert same(expose(made, film=done)[0], done)


def test_stopped_by_ctrl_c_and_taken_up(monkeypatch: pytest.MonkeyPatch) -> None:
    made, interrupts = made_of("stratified"), Interrupts()
    monkeypatch.setattr(passes, "first_pass_samples", lambda made: 20 * len(made.order))
    interrupts.requested = True
    film, done = expose(made, interrupts=interrupts)
    assert 0 < done < SPP and same(expose(made, film=film)[0], at_once("stratified"))


def test_a_loaded_film_compiles_nothing(tmp_path: Path) -> None:
    made, path = made_of("sobol"), tmp_path / "a.film"
    film = exposed_once(made, empty_film(made), 7)
    film.save(path)
    np.array(exposed_once(made, Film.load(made.a, path), 9).mean)
    assert compiled(lambda: np.array(exposed_once(made, Film.load(made.a, path), 21).mean)) == 0


def test_more_samples_than_were_asked_for_first() -> None:
    """Only strata are decided by their number."""
    few = with_settings(SOFT, sampler="sobol", spp=20)
    film, _ = expose(prepare(few))
    more = prepare(with_settings(few, spp=SPP))
    assert same(expose(more, film=film)[0], at_once("sobol"))
    film, _ = expose(prepare(with_settings(few, sampler="stratified")))
    with pytest.raises(UserError, match=rf"^film: is of spp 20, not {SPP}; give another, or begin anew"):
        expose(made_of("stratified"), film=film)


FOREIGN = {
    "seed 7": lambda s: with_settings(s, seed=7),
    "size 20 x 14": lambda s: replace(s, film=replace(s.film, width=20)),
    "sampler independent": lambda s: with_settings(s, sampler="independent"),
    "precision double": lambda s: with_settings(s, precision="double"),
    "another scene": CHANGES["a moved object"],
    "another scene ": at("film.transparent", True),
    "another scene  ": lambda s: with_settings(s, depth=9),
}  # fmt: skip


@pytest.mark.parametrize("what", FOREIGN)
def test_a_film_of_another_picture_is_refused(what: str, tmp_path: Path) -> None:
    made, other = made_of("sobol"), prepare(FOREIGN[what](made_of("sobol").scene))
    film, path = exposed_once(other, empty_film(other), 1), tmp_path / "a.film"
    film.save(path)
    with pytest.raises(UserError, match=rf"^film: is of {what.strip()}[,;] ") as refused:
        expose(made, film=film)
    assert len(refused.value.lines) == 1
    with pytest.raises(UserError, match=rf"a\.film: is of {what.strip()}[,;] ") as refused:
        Film.load(made.a, path, PictureIdentity(made.scene, made.a))
    assert len(refused.value.lines) == 1


def test_a_film_of_other_pixels_is_refused() -> None:
    made = made_of("sobol")
    with pytest.raises(UserError, match=r"^film: has other pixels than are to be exposed"):
        expose(made, film=empty_film(subset(made, np.arange(9))))


def test_a_film_of_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made, path = made_of("sobol"), tmp_path / "a.film"
    monkeypatch.setattr("visray.picture_identity.__version__", "0.0.9")
    empty_film(made).save(path)
    monkeypatch.undo()
    with pytest.raises(UserError, match=r"a\.film: is of visray 0\.0\.9, not "):
        Film.load(made.a, path)


def test_what_is_no_film_is_refused(tmp_path: Path) -> None:
    """A file that is cut or altered anywhere, of something else, or not there; and an old one is not lost."""
    made, path, rng = made_of("sobol"), tmp_path / "a.film", np.random.default_rng(0)
    film = exposed_once(made, empty_film(made), 5)
    film.save(path)
    whole = path.read_bytes()
    broken = [whole[:n] for n in (0, 10, len(whole) // 2, len(whole) - 1)]
    numbers = np.array(film.moments.reference).tobytes()
    spot = whole.index(numbers) + len(numbers) // 2
    broken.append(whole[:spot] + bytes([whole[spot] ^ 1]) + whole[spot + 1 :])
    for content in (*broken, b"\x93NUMPY", b"{}", b"\x80\x04."):
        path.write_bytes(content)
        with pytest.raises(UserError, match=r"a\.film: is no film of visray, or is damaged; begin anew") as refused:
            Film.load(made.a, path)
        assert len(refused.value.lines) == 1
    # Of what is no number of a film, such as the date of a file, nothing is lost.
    for at_byte in rng.integers(0, len(whole), 40).tolist():
        path.write_bytes(whole[:at_byte] + bytes([whole[at_byte] ^ 255]) + whole[at_byte + 1 :])
        with suppress(UserError):
            assert same(Film.load(made.a, path), film)
    np.savez(tmp_path / "b.npz", x=np.ones(3))
    with pytest.raises(UserError, match="is no film of visray"):
        Film.load(made.a, tmp_path / "b.npz")
    with pytest.raises(UserError, match=r"none\.film: cannot be read, No such file"):
        Film.load(made.a, tmp_path / "none.film")
    path.write_bytes(whole)
    with pytest.raises(UserError, match="does not exist; create it first"):
        exposed_once(made, empty_film(made), 5).save(tmp_path / "no" / "a.film")
    assert path.read_bytes() == whole and sorted(p.name for p in tmp_path.iterdir()) == ["a.film", "b.npz"]


def cut(monkeypatch: pytest.MonkeyPatch, room: int) -> list[int]:
    """Makes each launch take at most `room` samples. Returns a list to which the pixels of each launch are added."""
    launches: list[int] = []

    def counted(made: Prepared, film: Film, *more: Any) -> Film:
        launches.append(len(film.counts))
        return exposed_once(made, film, *more)

    monkeypatch.setattr(passes, "first_pass_samples", lambda made: 1)
    monkeypatch.setattr(passes, "_least_samples", lambda made: room)
    monkeypatch.setattr(passes.PassTimer, "next_samples", lambda timer: room)
    monkeypatch.setattr(passes, "exposed_once", counted)
    return launches


@EACH
@FILMS
def test_a_pass_of_several_launches_is_one_of_one(
    sampler: str, transparent: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, launches = made_of(sampler, transparent), cut(monkeypatch, 100)
    monkeypatch.setattr(passes.PassTimer, "next_samples", lambda timer: 100 if len(launches) < 8 else 1e6)
    film, done = expose(made)
    assert done == SPP and same(film, at_once(sampler, transparent))
    n = len(made.order)
    assert launches[:4] == [96, 96, n - 192, 96] and launches[-1] == n


def test_stopped_within_a_sample_and_taken_up(monkeypatch: pytest.MonkeyPatch) -> None:
    made, interrupts, n = made_of("sobol"), Interrupts(has_results=False), len(made_of("sobol").order)
    interrupts.requested = True
    launches = cut(monkeypatch, 100)
    film, done = expose(made, interrupts=interrupts)
    assert done == 0 and launches == [96] and film.counts.sum() == 96 and interrupts.has_results
    monkeypatch.undo()
    assert same(expose(made, film=film)[0], at_once("sobol"))
    # The pixels that have a sample are spread over the picture.
    sampled = np.zeros(n, bool)
    sampled[made.order] = film.counts > 0
    rows, columns = sampled.reshape(14, 21).any(1), sampled.reshape(14, 21).any(0)
    assert rows.mean() > 0.5 < columns.mean()


def test_lanes_are_spread_evenly() -> None:
    for n in (1, 15, 16, 17, 294, 1000):
        lanes = passes.spread_lanes(n)
        assert np.array_equal(np.sort(lanes), np.arange(n))
    lanes = passes.spread_lanes(4096)
    for k in range(0, 4096, 512):
        assert abs(lanes[k : k + 512].mean() / 4096 - 0.5) < 0.1
        assert all((lanes[k : k + 512] // 1024 == q).sum() == 128 for q in range(4))


def test_a_picture_without_some_samples_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    launches = cut(monkeypatch, 100)

    def stopped(made: Prepared, film: Film, *more: Any) -> Film:
        launches.append(len(film.counts))
        signal.raise_signal(signal.SIGINT)
        return exposed_once(made, film, *more)

    monkeypatch.setattr(passes, "exposed_once", stopped)
    with pytest.warns(StoppedWarning, match="^stopped when 96 of 294 pixels had a sample; the others are transparent$"):
        image = render(made_of("sobol"), progress=False)
    assert image.metadata["spp"] == 0 and image.metadata["interrupted"] == 1 and launches == [96]
    seen = image["A"] > 0
    assert seen.sum() == 96 and not image["RGB"][~seen].any() and image["RGB"][seen].any()
    monkeypatch.undo()
    whole = render(replace(made_of("sobol").scene, settings=replace(SOFT.settings, sampler="sobol", spp=1)))
    assert np.array_equal(image["RGB"][seen], whole["RGB"][seen])
