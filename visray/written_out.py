"""Scenes with data, written out: one object and one material for each row. A slow twin of data layers, for comparisons.

Names of objects have no dot, so row 12 of the layer `rain`, data.rain.12, is the object `data:rain:12`.
"""

from dataclasses import replace

from visray.columns import materials_of
from visray.scene.scene import Scene


def written_out(scene: Scene) -> Scene:
    """The scene without data, and with an object for each row. A scene without data is returned as it is."""
    if scene.data is None:
        return scene
    objects = {name.replace(".", ":"): x for name, x in scene.all_objects.items()}
    materials = dict(scene.materials)
    for name, rows in scene.data.rows.items():
        if rows.color is None:
            continue
        own = materials_of(scene)[rows.material]
        for number, color in zip(rows.number.tolist(), rows.color.T.tolist()):
            row = f"data:{name}:{number}"
            materials[row] = own.with_color(tuple(color))
            objects[row] = replace(objects[row], material=row)
    return replace(scene, objects=objects, materials=materials, data=None)
