"""What visray knows of a scene before it is rendered: the effects that are simulated, and why."""

from dataclasses import replace

from visray.animation.moment import still_at
from visray.animation_report import animation_notes
from visray.arguments import checked_arguments
from visray.clip_report import clip_notes
from visray.constant_report import constant_notes
from visray.csg_report import csg_notes
from visray.data_report import data_notes
from visray.environment_report import unlit_notes
from visray.features import Features, features
from visray.filter_report import filter_notes
from visray.glass_report import glass_notes
from visray.material_report import color_notes, energy_notes, sheet_notes
from visray.mesh_report import mesh_facts
from visray.overlap_report import overlaps
from visray.ray_families import ray_families
from visray.scene.check import checked
from visray.scene.scene import Scene


@checked_arguments
def explain(scene: Scene) -> Features:
    """The effects that a scene needs and those that it does not, each with the reason; how rays find objects; facts
    about meshes; which transparent solids count where they overlap; of what CSG objects are made; and what is odd about
    materials, clips and CSG. Of an animated scene: of its beginning, with notes about what moves."""
    given = checked(scene)
    scene = still_at(given, None)
    on = features(scene)
    listed, count = overlaps(scene) if on["nested media"] else ((), 0)
    of_scene = (*csg_notes(scene), *constant_notes(scene), *clip_notes(scene), *data_notes(scene), *filter_notes(scene))
    of_glass = (*sheet_notes(scene, on), *glass_notes(scene, on))
    of_materials = (*of_glass, *energy_notes(scene), *color_notes(scene), *unlit_notes(scene))
    notes = (*animation_notes(given), *of_materials, *of_scene)
    more = {"meshes": mesh_facts(scene), "overlaps": listed, "overlap_count": count, "notes": notes}
    return replace(on, rays=ray_families(scene, on), **more)
