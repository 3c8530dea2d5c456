"""What visray says about `fresnel`, `absorption` and `priority` in a scene that do not do what they seem to say."""

import math

from visray import modes
from visray.data.all_objects import address_of
from visray.feature_rules import used_materials
from visray.features import Features
from visray.material_report import MaterialWarning
from visray.materials import Material
from visray.primitives.primitive import Primitive, bounding_box
from visray.scene.scene import Scene
from visray.warn import warn

# Of the light that crosses a solid, less than this share is left in every channel: the solid is black.
DARK = 1e-4


def warn_of_glass(scene: Scene, effects: Features) -> None:
    """Warns of what `glass_notes` says. Each is shown once. effects: those that are simulated."""
    for text in glass_notes(scene, effects):
        warn(text, MaterialWarning)


def glass_notes(scene: Scene, effects: Features) -> list[str]:
    """A list with a sentence for each material whose `fresnel`, `absorption` or `priority` changes nothing, and for the
    first object of each material for which it does not do what it says.

    effects: those that are simulated
    """
    if not modes.BY_NAME[scene.settings.shading].lit:
        return []
    materials = used_materials(scene)
    notes = [f"materials.{name}: {text}" for name, m in materials.items() if (text := _of_material(m))]
    if not effects["absorption"]:
        return notes
    of_objects: dict[str, str] = {}
    for name, obj in scene.representatives.items():
        material = scene.materials_of(obj)[0]
        m = materials[material]
        if any(m.kt) and any(m.absorption) and (text := _of_solid(scene, obj, material, m)):
            of_objects.setdefault(text, f"{address_of(name)}: {text}")
    return [*notes, *of_objects.values()]


def _of_material(m: Material) -> str | None:
    """What is said about a material, whatever has it; None if there is nothing to say."""
    if any(m.absorption) and not any(m.kt):
        return (
            "absorption changes nothing, as kt is 0: no light passes through; write the kt [1, 1, 1] or no absorption"
        )
    if m.priority != Material().priority and not any(m.kt):
        return "priority changes nothing, as kt is 0: only transparent solids have one; write a kt or no priority"
    if m.fresnel == "none" or any(m.kr):
        return None
    if any(m.kt):
        return (
            'fresnel "dielectric" takes light from kt and gives it to kr, which is 0: nothing is mirrored, and total '
            "reflection is black; write the kr [1, 1, 1]"
        )
    right = "the kr [1, 1, 1] for a coat, and also the kt [1, 1, 1] for glass"
    right = "the colour of the metal as kr" if m.fresnel == "metal" else right
    return f'fresnel "{m.fresnel}" changes nothing, as kr and kt are 0; write {right}'


def _of_solid(scene: Scene, obj: Primitive, material: str, m: Material) -> str | None:
    """What is said about an object whose material absorbs; None if there is nothing to say. material: its name"""
    shape = scene.placed_shape(obj)
    if not shape.closed:
        kind = scene.shape_of(obj).type
        return f"a {kind} that is open has no inside, so materials.{material}.absorption changes nothing"
    if (box := bounding_box(shape)) is None:
        return (
            f"the object has no end, and light that runs in it without end is not absorbed by materials.{material}; "
            "use an object of limited size"
        )
    thickness, least = float(min(box[1] - box[0])), min(m.absorption)
    left = math.exp(-least * thickness)
    if left >= DARK:
        return None
    return (
        f"{thickness:.3g} units of materials.{material} let {left:.1g} of the light through at most: it is black; "
        f"absorption is per world unit, and {1 / thickness:.2g} would leave 37 %"
    )
