"""`vr.surface_scene`: the scene that `visray surface` renders, for Python."""

import warnings
from collections.abc import Mapping, Sequence

from visray.arguments import checked_arguments
from visray.scene.check import checked
from visray.scene.scene import Scene
from visray.surface_picture.picture import surface_picture


class SurfaceWarning(UserWarning):
    """Warning about a choice that was made for a picture of a surface, and that may not be what is expected."""


@checked_arguments
def surface_scene(
    formula: str,
    parameters: Mapping | None = None,
    *,
    size: Sequence = (640, 640),
    clip: float | None = None,
    view: Sequence | None = None,
    color: Sequence | None = None,
) -> Scene:
    """A scene that shows a surface f(x, y, z) = 0, with nothing else to be written.

    formula: f as a text such as "x^2 + y^2 - z^2 - a", an equation, or the name of a known surface.
    parameters: numbers by name. A letter without a number is 1.
    size: width and height of the picture in pixels.
    clip: radius of the ball about the origin in which the surface is drawn.
    view: direction from the surface towards the camera, as three numbers; z is upwards.
    color: colour of the outside, linear red, green and blue.

    What is chosen and may not be expected is told by warnings. Raises a UserError if an argument is wrong.
    """
    made = surface_picture(formula, parameters or {}, tuple(size), clip, view and tuple(view), color and tuple(color))
    for text in made.notes:
        warnings.warn(text, SurfaceWarning, stacklevel=3)
    return checked(made.scene)
