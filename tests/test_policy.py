"""How rays find what they hit: every row in one way, one tree for all rays, the setting kept, no bit changed."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import visray as vr
from visray.accel import policy
from visray.accel.policy import BatchSize, plan
from visray.cli import main

SIZES = st.lists(st.builds(BatchSize, st.integers(1, 200), st.booleans()), max_size=8)
SHARED = ("origin", "direction", "nothing")
WAYS = ("auto", "none", "lists", "tree")


@given(SIZES, st.sampled_from(WAYS))
def test_every_batch_is_found_in_one_way_and_no_endless_one_in_a_tree(sizes: list[BatchSize], way: str) -> None:
    for shared in SHARED:
        p = plan(sizes, way, shared)
        assert sorted([*p.unrolled, *p.looped, *p.lists, *p.tree]) == list(range(len(sizes)))
        assert all(sizes[i].bounded for i in (*p.lists, *p.tree)) and p.reason and p.name
        limit = policy.MAX_UNROLLED_SHARED if shared == "origin" else policy.MAX_UNROLLED
        assert all(sizes[i].rows <= limit for i in p.unrolled)
        bounded = {i for i, s in enumerate(sizes) if s.bounded}
        if way == "none":
            assert not p.tree and not p.lists
        if way == "tree":
            assert set(p.tree) == bounded and not p.lists
        if way == "lists" and shared != "nothing":
            assert set(p.lists) == bounded
        assert not (p.lists and shared == "nothing")
        # What code there is for rows that are written out is bounded.
        bounded = sum(sizes[i].rows for i in p.unrolled if sizes[i].bounded)
        assert way != "auto" or bounded <= limit


@given(SIZES, st.sampled_from(WAYS))
def test_rays_that_share_an_origin_look_in_the_tree_that_all_others_have(sizes: list[BatchSize], way: str) -> None:
    one, many = (plan(sizes, way, shared) for shared in ("origin", "nothing"))
    assert one.tree in ((), many.tree)


def crowd(count: int) -> vr.Scene:
    """Objects of several kinds over a floor, one of them of glass, two lights."""
    rng = np.random.default_rng(count)
    makers = (vr.Sphere, vr.Box, vr.Cylinder, vr.Ellipsoid, vr.Capsule)
    things = {
        f"o{i}": makers[i % len(makers)](
            transform=(vr.Scale(scale=0.3), vr.Translate(translate=tuple(map(float, rng.uniform(-2, 2, 3))))),
            material="glass" if i == 1 else "default",
        )
        for i in range(count)
    }
    return vr.Scene(
        film=vr.Film(width=24, height=18),
        materials={"glass": vr.Material(kt=(0.6, 0.7, 0.5), dmax=2.0)},
        lights={"key": vr.PointLight(position=(3, 5, 4)), "soft": vr.DiskLight(position=(-2, 4, 1), samples=2)},
        objects={"floor": vr.Plane(point=(0, -2, 0)), **things},
        settings=vr.Settings(spp=2, depth=2),
        camera=vr.Camera(),
    )


@pytest.mark.parametrize(
    "count", [3, pytest.param(40, marks=pytest.mark.slow), pytest.param(140, marks=pytest.mark.slow)]
)
def test_the_picture_is_the_same_whatever_the_setting(count: int) -> None:
    """All layers; colours through glass multiply in another order where the tree has it so."""
    images = [vr.render(vr.replaced(crowd(count), "settings.accelerator", way), progress=False) for way in WAYS]
    for image in images[1:]:
        for name in ("Z", "N", "P", "id", "UV"):
            assert np.array_equal(image[name], images[0][name], equal_nan=True), name
        assert np.allclose(image["RGB"], images[0]["RGB"], rtol=0, atol=2.0**-20)


def test_explain_says_how_rays_find_objects(tmp_path, capsys) -> None:
    file = tmp_path / "scene.json"
    file.write_text(vr.dump(crowd(140)))
    assert main(["explain", str(file), "--json"]) == 0
    rays = {r["rays"]: r for r in json.loads(capsys.readouterr().out)["rays"]}
    assert set(rays) == {
        "camera", "shadow rays of point and spot lights", "shadow rays of other lights",
        "reflected, refracted and scattered rays",
    }  # fmt: skip
    ways = {name: "lists" if name in ("camera", "shadow rays of point and spot lights") else "tree" for name in rays}
    assert all(ways[n] in r["accelerator"] and "140 bounded objects" in r["reason"] for n, r in rays.items())
    assert main(["explain", str(file), "--set", "settings.accelerator=none"]) == 0
    assert "none: every object is" in capsys.readouterr().out
    assert main(["explain", str(file), "--set", "settings.accelerator=bvh"]) == 2
    assert "one of auto, none, lists, tree" in capsys.readouterr().err
