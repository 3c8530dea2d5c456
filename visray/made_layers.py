"""The layers that a picture will have, before it is rendered."""

from collections.abc import Collection

from visray.legend.layer import has_legend
from visray.output.layers import names_from
from visray.scene.scene import Scene


def made_layers(scene: Scene, layers: Collection[str], to_goal: bool, legend: bool) -> tuple[str, ...]:
    """Names of those layers that the picture of a finished render has. To a goal, `variance` may still be missing:
    where a half of a pixel has a single sample.

    layers: names of the layers that are asked for.
    to_goal: whether it is rendered to an error or in a time.
    legend: whether a legend is drawn.
    """
    absent = () if legend and has_legend(scene) else names_from("overlay")
    absent += () if to_goal else names_from("adaptive")
    absent += () if to_goal or scene.settings.spp > 1 else ("variance",)
    absent += () if scene.animation is not None else names_from("motion")
    certificate = names_from("certificate")
    absent += certificate if set(layers).isdisjoint(certificate) or not _finds_roots(scene) else ()
    return tuple(name for name in layers if name not in absent)


def _finds_roots(scene: Scene) -> bool:
    """Whether crossings of rays with some object are roots that are searched."""
    return any(scene.placed_shape(x).kind.finds_roots for x in scene.representatives.values())
