"""Scenes that are built step by step in Python: entries in place of names, lists, with_... and without."""

import pytest

import visray as vr
from visray.scene.building import SECTIONS
from visray.scene.check import checked
from visray.scene.scene import ADAPTER

RED, CHECKER = vr.Material(kd=(0.8, 0.1, 0.1)), vr.CheckerTexture()
LIGHT = vr.PointLight((4, 6, 5))
# For each section a method and an entry.
ADD = {
    "objects": (vr.Scene.with_object, vr.Sphere((0, 1, 0), 1)),
    "lights": (vr.Scene.with_light, LIGHT),
    "materials": (vr.Scene.with_material, RED),
    "textures": (vr.Scene.with_texture, CHECKER),
    "geometries": (vr.Scene.with_geometry, vr.Torus()),
}


def test_a_scene_can_be_built_in_steps():
    scene = (
        vr.Scene(film=vr.Film(32, 24))
        .with_camera(vr.Camera((0, 2, 8), (0, 1, 0)))
        .with_light("key", LIGHT)
        .with_object("ball", vr.Sphere((0, 1, 0), 1, material="red"))
        .with_material("red", vr.Material(kd=(0.8, 0.1, 0.1), texture="tiles"))
        .with_texture("tiles", CHECKER)
    )
    assert scene == vr.Scene(
        film=vr.Film(width=32, height=24),
        camera=vr.Camera(origin=(0, 2, 8), target=(0, 1, 0)),
        lights={"key": vr.PointLight(position=(4, 6, 5))},
        materials={"red": vr.Material(kd=(0.8, 0.1, 0.1), texture="tiles")},
        textures={"tiles": vr.CheckerTexture()},
        objects={"ball": vr.Sphere(center=(0, 1, 0), radius=1, material="red")},
    )
    assert ADAPTER.validate_json(ADAPTER.dump_json(checked(scene))) == scene


def test_every_section_has_a_method():
    assert set(ADD) == set(SECTIONS)
    for section, (add, entry) in ADD.items():
        scene = add(vr.Scene(), "a", entry)
        assert getattr(scene, section) == {"a": entry} and getattr(add(scene, "a", entry), section) == {"a": entry}
        assert not getattr(scene.without("a"), section) and not getattr(scene.without(f"{section}.a"), section)
        for name in ("", "a.b", " a", 5, None):
            with pytest.raises(vr.UserError, match="is not a valid name"):
                add(scene, name, entry)
        for wrong in (5, None, "red", {"type": "sphere"}, vr.Scatter(), vr.Sphere):
            with pytest.raises(vr.UserError, match=r"a: must be an? .*, such as vr"):
                add(scene, "a", wrong)


def test_materials_and_textures_in_place_of_names():
    tiles = vr.Material(texture=CHECKER)
    again = vr.Material(kd=(0.8, 0.1, 0.1))
    scene = vr.Scene(
        materials={"gold": vr.Material(kd=(0.8, 0.6, 0.1))},
        objects={
            "floor": vr.Plane(material=tiles),
            "ball": vr.Sphere(material=RED),
            "egg": vr.Ellipsoid(material=again),
            "ring": vr.Torus(material=vr.Material(kd=(0.8, 0.6, 0.1))),
            "default": vr.Box(material=vr.Material(kd=(0.1, 0.1, 0.1), back=RED)),
        },
    )
    assert list(scene.materials) == ["gold", "floor", "ball", "default 2"]
    assert {name: x.material for name, x in scene.objects.items()} == {
        "floor": "floor", "ball": "ball", "egg": "ball", "ring": "gold", "default": "default 2",
    }  # fmt: skip
    assert scene.materials["floor"].texture == "floor" and scene.textures == {"floor": CHECKER}
    assert scene.materials["default 2"].back == "ball"
    assert checked(scene).materials == scene.materials
    blue = vr.Material(kd=(0.1, 0.1, 0.8))
    assert scene.with_object("ball", vr.Sphere(material=blue)).objects["ball"].material == "ball 2"


def test_entries_in_operands_instances_and_data_get_names():
    cut = vr.Sphere(cut=[vr.Box(material=RED)], cut_material=vr.Material(kd=(0.5, 0.5, 0.5)))
    scene = vr.Scene(objects={"a": cut, "b": vr.Instance(vr.Torus())})
    assert list(scene.materials) == ["a cut", "a 0"] and list(scene.geometries) == ["b"]
    assert scene.objects["a"].cut[0].material == "a 0" and scene.objects["b"].geometry == "b"
    assert checked(scene).objects == scene.objects
    layer = vr.DataLayer(lon=[2.0, 3.0], lat=[41.0, 42.0], material=RED, gizmo="geometry", geometry=vr.Box())
    data = vr.Scene(data=vr.Data(base=vr.GlobeBase(material=vr.Material()), layers={"rain": layer}))
    assert list(data.materials) == ["base", "rain"] and list(data.geometries) == ["rain"]
    assert data.data.layers["rain"].material == data.data.layers["rain"].geometry == "rain"
    assert data.data.base.material == "base"


def test_lists_get_names_by_their_types():
    scene = vr.Scene(objects=[vr.Plane(), vr.Sphere(), vr.Sphere((2, 0, 0))], lights=[LIGHT, LIGHT])
    assert list(scene.objects) == ["plane", "sphere", "sphere2"] and list(scene.lights) == ["point", "point2"]
    assert scene.objects["sphere2"].center == (2.0, 0.0, 0.0) and checked(scene).objects == scene.objects


def test_without_refuses_what_is_used_and_what_is_not_there():
    scene = vr.Scene(
        lights={"key": LIGHT},
        objects={"ball": vr.Sphere(material=vr.Material(texture=CHECKER)), "ring": vr.Instance(vr.Torus())},
    )
    assert list(scene.without("ball").objects) == ["ring"] and "ball" in scene.without("ball").materials
    for names, text in (
        (["materials.ball"], r"^materials.ball: objects.ball.material refers to it; "),
        (["textures.ball", "ball"], r"^textures.ball: materials.ball.texture refers to it; "),
        (["geometries.ring"], r"^geometries.ring: objects.ring.geometry refers to it; "),
        (["bal"], "^without: the scene has no 'bal'; did you mean \"ball\""),
        (["objects.bal"], "^without: objects has no 'bal'; did you mean \"ball\""),
        (["ball", "objects.ball"], "^without: objects has no 'ball'; "),
        ([5], "^without: the scene has no 5; one of "),
    ):
        with pytest.raises(vr.UserError, match=text):
            scene.without(*names)
    bare = scene.without("textures.ball", "materials.ball", "ball", "ring", "geometries.ring", "key")
    assert bare == vr.Scene(lights={})
    moving = vr.Scene(animation=vr.Animation(duration=2))
    assert moving.without("animation") == vr.Scene()


def test_an_unknown_part_of_a_scene_is_told():
    with pytest.raises(TypeError, match=r"Scene\(\) has no 'object'; did you mean 'objects'"):
        vr.Scene(object={})


def test_a_scene_is_shown_in_one_line_and_as_a_table():
    scene = vr.Scene(objects=[vr.Plane(), vr.Sphere(), vr.Sphere(), vr.Torus(), vr.Torus(), vr.Box(), vr.Box()])
    assert repr(scene) == ("Scene: 7 objects (2 spheres, 2 tori, 2 boxes, 1 plane), fitted lights, 640 x 480")
    scene = vr.Scene(
        objects={"<ball>": vr.Sphere(material="red")}, lights={}, materials={"red": RED}, film=vr.Film(32, 24),
        animation=vr.Animation(duration=2), geometries={"a": vr.Torus(), "b": vr.Torus()},
        data=vr.Data(base=vr.GlobeBase(), layers={"rain": vr.DataLayer(lon=[2.0], lat=[41.0])}),
    )  # fmt: skip
    assert repr(scene) == (
        "Scene: 1 object (1 sphere), 2 geometries, 1 material, 1 layer of data, 2.0 s of animation, 32 x 24"
    )
    html = scene._repr_html_()
    assert "<td>objects.&lt;ball&gt;</td><td><code>Sphere(material=&#x27;red&#x27;)</code></td>" in html
    assert "Material(kd=(0.8, 0.1, 0.1))" in html and "<ball>" not in html
    for wrong in (5, None, "x", [5], {"a": 5}, {1: None}):
        for name in vr.Scene.__dataclass_fields__:
            if (name, wrong) == ("background", "x"):
                continue  # it is refused where the scene is made
            made = vr.Scene(**{name: wrong})
            assert "\n" not in repr(made) and made._repr_html_()


def test_what_is_prepared_and_explained_is_shown_in_one_line():
    scene = vr.Scene(objects={"a": vr.Sphere()}, lights={"key": LIGHT}, camera=vr.Camera(), film=vr.Film(8, 6))
    assert repr(vr.prepare(scene)) == "Prepared: 1 object (1 sphere), 1 light, 8 x 6"
    effects = vr.explain(scene)
    assert repr(effects).startswith(f"Features: {', '.join(effects.names())}; off: ") and "\n" not in repr(effects)
