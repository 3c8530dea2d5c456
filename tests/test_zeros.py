"""Scenes in which much is zero: every pair of choices meets in some scene, and the rest of the picture goes on.

The oracle: the picture with all effects forced on is the same, bit for bit. It holds no literal black.
"""

import random
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
from light_samples import LIGHT_SAMPLES
from test_features import BLACK, FULL, both, exposed, film, lens, light, material, settings, traced, whole

from visray import modes
from visray.camera import OrthographicCamera
from visray.feature_rules import RULES
from visray.features import features
from visray.gradients import gradient
from visray.lights import KINDS, PointLight
from visray.passes import expose
from visray.primitives import Plane, Polynomial, Sphere
from visray.scene.scene import Film, Occlusion, Scatter, Scene
from visray.setup import prepare
from visray.textures import CheckerTexture

Change = Callable[[Scene], Scene]
SOME = (0.4, 0.3, 0.5)
# Fewer samples, so that kernels differ little in what they cost to run.
LAMPS = {k.__name__: LIGHT_SAMPLES[k.__name__].posed for k in KINDS}
LAMPS = {n: replace(l, samples=2) if l.has_area else l for n, l in LAMPS.items()}
MANY = {f"lamp {i}": PointLight(position=(i - 20, 5, 4)) for i in range(40)}
TWO = {"ball": Sphere(center=(0, 1, 0), material="gloss"), "other": Sphere(center=(1.5, 0.6, 1), material="wall")}
HEART = {"heart": Polynomial(expression="x^2 + y^2 + z^2 - 1", material="gloss")}


def lamps(**lights: Any) -> Change:
    return lambda s: replace(s, lights=lights)


def things(**objects: Any) -> Change:
    return lambda s: replace(s, objects=objects)


# What a scene may have or not have, each with the values that it can take. The first one is the barest.
CHOICES: dict[str, list[Change]] = {
    "lights": [lamps(), lamps(off=PointLight(position=(0, 5, 0), intensity=0.0)),
               *(lamps(**{n: l}) for n, l in LAMPS.items()), lamps(**LAMPS), lamps(**MANY)],
    "Ia": [light(Ia=BLACK), light(Ia=SOME)],
    "Id": [light(Id=BLACK), light(Id=SOME)],
    "Is": [light(Is=BLACK), light(Is=SOME)],
    "a": [light(a=0.0), light(a=0.5)],
    "ambient": [whole(ambient=BLACK), whole(ambient=SOME)],
    "background": [whole(background=BLACK), whole(background=SOME), whole(background=FULL.background)],
    "ka": [material(ka=BLACK), material(ka=SOME)],
    "kd": [material(kd=BLACK), material(kd=SOME), material("wall", kd=BLACK)],
    "ks": [material(ks=BLACK), material(ks=SOME, shininess=8.0), material(ks=SOME, shininess=8.5)],
    "kr": [material(kr=BLACK), material("gloss", kr=SOME), material(kr=SOME)],
    "kt": [material(kt=BLACK), material("gloss", kt=SOME), material(kt=SOME)],
    "texture": [whole(), both(whole(textures={"t": CheckerTexture()}), material("wall", texture="t"))],
    "occlusion": [settings(occlusion=Occlusion(sky=sky, near=near)) for sky, near in ((0, 0), (2, 0), (0, 2), (2, 2))],
    "scatter": [settings(scatter=s) for s in (Scatter(), Scatter(rays=1), Scatter(rays=2, depth=2))],
    "shadows": [settings(shadows=False), settings(shadows=True)],
    "depth": [settings(depth=n) for n in (0, 1, 3)],
    "misses": [settings(misses="background"), settings(misses="ambient")],
    "local": [settings(local="weighted"), settings(local="full")],
    "area": [settings(area="samples"), settings(area="centre")],
    "shading": [settings(shading=name) for name in modes.NAMES],
    "camera": [whole(), lens(0.2), whole(camera=OrthographicCamera(origin=(0.5, 2, 6), target=(0, 0.5, 0)))],
    "film": [film(transparent=False), film(transparent=True)],
    "objects": [things(), things(floor=Plane(material="wall")), things(**TWO), things(**HEART, **TWO), whole()],
    "accelerator": [settings(accelerator=name) for name in ("auto", "none", "tree")],
    "precision": [settings(precision="single"), settings(precision="double")],
}  # fmt: skip
BARE = replace(FULL, film=Film(width=9, height=6), settings=replace(FULL.settings, spp=2))
Row = tuple[int, ...]


def covering(sizes: list[int], strength: int, seed: int = 0, tries: int = 12) -> list[Row]:
    """Rows of choices in which every `strength` columns take all combinations of their values.

    Greedy: each row is the best of some random ones that hold a combination that is still missing.
    """
    rng = random.Random(seed)
    missing = {tuple(zip(c, v)) for c in combinations(range(len(sizes)), strength)
               for v in product(*(range(sizes[i]) for i in c))}  # fmt: skip
    rows = []
    while missing:
        need = min(missing)
        best, covers = None, set()
        for _ in range(tries):
            row = [rng.randrange(n) for n in sizes]
            for column, value in need:
                row[column] = value
            held = {c for c in (tuple((i, row[i]) for i in k) for k in combinations(range(len(row)), strength))
                    if c in missing}  # fmt: skip
            if len(held) > len(covers):
                best, covers = tuple(row), held
        rows.append(best)
        missing -= covers
    return rows


def scene_of(row: Row) -> Scene:
    return both(*(values[i] for values, i in zip(CHOICES.values(), row)))(BARE)


def name_of(row: Row) -> str:
    return "-".join(map(str, row))


SIZES = [len(values) for values in CHOICES.values()]
PAIRS = covering(SIZES, 2)


def check(row: Row) -> None:
    """The scene renders, its loops are traced once, and the picture with all effects has the same bits."""
    scene = scene_of(row)
    without, forced = exposed(scene, False), exposed(scene, True)
    for name in without:
        assert np.isfinite(without[name]).all()
        assert without[name].tobytes() == forced[name].tobytes(), name


def test_every_pair_of_choices_is_in_some_scene() -> None:
    for (i, m), (j, n) in combinations(enumerate(SIZES), 2):
        assert {(row[i], row[j]) for row in PAIRS} == set(product(range(m), range(n)))


@pytest.mark.parametrize(
    "row", [pytest.param(r, id=name_of(r), marks=[] if i % 20 == 0 else pytest.mark.slow) for i, r in enumerate(PAIRS)]
)
def test_pairs(row: Row) -> None:
    check(row)


# Where almost all is zero, what is left has nothing to work on: a mirror, a path or a lamp with nothing to show.
SPARSE = {
    "mirror": {"kr": 1, "objects": 2, "depth": 2},
    "glass": {"kt": 2, "objects": 3, "depth": 2},
    "glass and mirror": {"kr": 1, "kt": 1, "objects": 4, "depth": 2},
    "mirror that misses black ambient": {"kr": 2, "objects": 2, "depth": 2, "misses": 1},
    "mirror and many lamps": {"kr": 1, "objects": 4, "depth": 2, "lights": len(CHOICES["lights"]) - 1, "shadows": 1},
    "many lamps that only make ambient light": {"ka": 1, "objects": 4, "lights": len(CHOICES["lights"]) - 1, "Ia": 1},
    "scattering": {"kd": 1, "objects": 4, "scatter": 2},
    "scattering and a mirror": {"kd": 1, "kr": 1, "objects": 4, "scatter": 2, "depth": 1},
    "lamps without any light": {"kd": 1, "ks": 2, "kr": 1, "objects": 4, "depth": 2, "shadows": 1,
                                "lights": len(CHOICES["lights"]) - 2},
    "occlusion of no light": {"ka": 1, "kr": 1, "objects": 4, "depth": 2, "occlusion": 3},
}  # fmt: skip


def sparse(case: str) -> Scene:
    return scene_of(tuple(SPARSE[case].get(name, 0) for name in CHOICES))


@pytest.mark.parametrize("case", SPARSE)
def test_sparse(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = sparse(case)
    check(tuple(SPARSE[case].get(name, 0) for name in CHOICES))
    assert set(traced(scene, monkeypatch)) == {1}
    # Nothing shines, so that no effect is left, or only ambient light does.
    assert features(scene).names() == (["ambient"] if "Ia" in SPARSE[case] else [])


@pytest.mark.parametrize("case", SPARSE)
def test_derivatives_where_nothing_shines(case: str) -> None:
    """By a material 0; by light that is 0 they are what the scene would send on."""
    scene = sparse(case)
    # A matte material that scatters has no derivative by kr.
    address = "materials.gloss.kd" if case == "scattering" else "materials.gloss.kr"
    assert not gradient(scene, [address])[address].any()
    sky = gradient(scene, ["background"])["background"]
    assert (sky > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_without_some_effects(seed: int) -> None:
    """Studies leave effects out: what they had brought is then missing in all others."""
    rng = random.Random(seed)
    scene = scene_of(tuple(0 if rng.random() < 0.4 else rng.randrange(n) for n in SIZES))
    left_out = tuple(rng.sample([r.name for r in RULES], 5))
    film, _ = expose(prepare(scene, without=left_out))
    assert np.isfinite(np.array(film.mean)).all()
