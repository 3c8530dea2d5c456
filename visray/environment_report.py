"""What visray says about the environment map and the light of the background, before a picture is rendered."""

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


class EnvironmentWarning(UserWarning):
    """An environment map takes much memory, or the light of the background counts twice."""


def warn_of_environment(scene: Scene) -> None:
    """Warns of a large environment map, and of light of the background that counts twice. Each is shown once. Raises
    UserError if the map cannot be used."""
    for text in environment_notes(scene):
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
