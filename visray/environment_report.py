"""What visray says about the environment map, the light of the background, and surfaces that glow, before a picture is
rendered."""

from visray import modes
from visray.environment_map import EnvironmentMap
from visray.feature_rules import background_is_ambient, used_materials
from visray.images.environment import ADDRESS, read_map
from visray.scene.scene import Scene
from visray.warn import warn

# A map with more pixels than this takes much memory, and is finer than most pictures show.
LARGE = 8192 * 4096
# Bytes of a pixel in a kernel: four numbers in single precision.
BYTES = 16
# What brings the light of all surfaces and of the background to matte surfaces.
SCATTER = "settings.scatter.rays=1"


class EnvironmentWarning(UserWarning):
    """An environment map takes much memory or lights nothing, emission lights nothing, or the light of the background
    counts twice."""


def warn_of_environment(scene: Scene) -> None:
    """Warns of a large environment map, of light of the background that counts twice, and of a map or emission that
    light nothing. Each is shown once. Raises UserError if the map cannot be used."""
    for text in (*environment_notes(scene), *unlit_notes(scene)):
        warn(text, EnvironmentWarning)


def environment_notes(scene: Scene) -> list[str]:
    """List with a sentence for each. Reads the map."""
    notes = []
    if isinstance(scene.background, EnvironmentMap):
        height, width, _ = read_map(scene.background).shape
        if width * height > LARGE:
            size = f"{width} x {height} pixels take {width * height * BYTES / 2**30:.1f} GiB while it renders"
            notes.append(
                f'{ADDRESS} = "{scene.background.file}": {size}; a map of 8192 x 4096 shows as much in most scenes'
            )
    settings = scene.settings
    if background_is_ambient(scene) and settings.scatter.rays and settings.scatter.depth:
        twice = [n for n, m in used_materials(scene).items() if m.scatters and any(m.ka) and not m.unlit]
        if twice and modes.BY_NAME[settings.shading].lit and settings.misses == "background":
            problem = f"materials.{twice[0]} gets the background twice, by sky rays (ka) and by scattering (kd)"
            notes.append(f"settings.occlusion.light: {problem}; set scatter.rays to 0, or its ka to 0")
    return notes


def unlit_notes(scene: Scene) -> list[str]:
    """List of one sentence, or of none: an environment map or emission may be meant to light the scene, but does not.

    It is said only if no light shines, nothing scatters, and there is a matte surface to be lit.
    """
    settings, materials = scene.settings, used_materials(scene)
    shines = any(l.intensity and any((*l.Ia, *l.Id, *l.Is)) for l in scene.lights.values())
    scatters = settings.scatter.rays and settings.scatter.depth
    if shines or scatters or not modes.BY_NAME[settings.shading].lit:
        return []
    if not any(m.scatters and not any(m.emission) for m in materials.values()):
        return []
    if isinstance(scene.background, EnvironmentMap) and not background_is_ambient(scene):
        sky = "settings.occlusion.sky=16 and settings.occlusion.light=background"
        return [f"the environment map lights nothing by itself, and there is no light; set {sky}, or {SCATTER}"]
    glows = next((name for name, m in materials.items() if any(m.emission)), None)
    if glows is None or background_is_ambient(scene):
        return []
    light = 'add a light (an area light may be "visible": true)'
    return [f"materials.{glows}: emission lights nothing, and there is no light; {light}, or set {SCATTER}"]
