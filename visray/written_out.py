"""Scenes with data, written out: one object and one material for each row. A slow twin of data layers, for comparisons.

Such a scene has names with dots, which no scene file can have.
"""

from dataclasses import replace

from visray.columns import materials_of
from visray.scene.scene import Scene


def written_out(scene: Scene) -> Scene:
    """The scene without data, and with an object for each row. A scene without data is returned as it is."""
    if scene.data is None:
        return scene
    objects, materials = dict(scene.all_objects), dict(scene.materials)
    for name, rows in scene.data.rows.items():
        if rows.color is None:
            continue
        own = materials_of(scene)[rows.material]
        for number, color in zip(rows.number.tolist(), rows.color.T.tolist()):
            row = f"data.{name}.{number}"
            materials[row] = own.with_color(tuple(color))
            objects[row] = replace(objects[row], material=row)
    return replace(scene, objects=objects, materials=materials, data=None)
