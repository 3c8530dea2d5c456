"""Notes about a filter that needs other numbers of samples than the scene has."""

from visray.scene.scene import Scene
from visray.warn import warn


class FilterWarning(UserWarning):
    """Warning that the filter of pixels makes some pixels too dark and others too bright."""


def filter_notes(scene: Scene) -> list[str]:
    """List with the sentence about the film's filter, which begins with an address; empty if all is right."""
    film, spp, sampler = scene.film, scene.settings.spp, scene.settings.sampler
    off = film.filter.uneven(spp, sampler == "independent")
    if not off:
        return []
    if sampler == "independent":
        where, advice = "settings.sampler = independent", 'write "sobol"'
    else:
        where, advice = f"settings.spp = {spp}", f"with an even number, such as {spp + 1}, no pixel is"
    text = "with a filter that has negative weights, pixels are too dark or too bright"
    return [f"{where}: {text}, by {100 * off:.2g} % (root mean square); {advice}"]


def warn_of_filter(scene: Scene) -> None:
    """Warns of a filter that makes pixels too dark or too bright."""
    for text in filter_notes(scene):
        warn(text, FilterWarning)
