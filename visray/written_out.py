"""Scenes with data, written out: one object and one material for each gizmo. A slow twin of data layers, to compare
them with.

Names of objects have no dot, so row 12 of the layer `rain`, data.rain.12, is the object `data:rain:12`. A line is an
object for each of its segments: `data:roads:3:0`, `data:roads:3:1` and so on.
"""

from dataclasses import replace

from visray.columns import materials_of
from visray.data.all_objects import part_names
from visray.scene.scene import Scene


def written_out(scene: Scene) -> Scene:
    """The scene without data, and with an object for each gizmo. A scene without data is returned as it is."""
    if scene.data is None:
        return scene
    objects = {name.replace(".", ":"): x for name, x in scene.all_objects.parts()}
    materials = dict(scene.materials)
    for name, rows in scene.data.rows.items():
        if rows.color is None:
            continue
        own = materials_of(scene)[rows.material]
        for part, color in zip(part_names(name, rows), rows.color.T.tolist()):
            gizmo = part.replace(".", ":")
            materials[gizmo] = own.with_color(tuple(color))
            objects[gizmo] = replace(objects[gizmo], material=gizmo)
    return replace(scene, objects=objects, materials=materials, data=None)
