"""`vr.surface_scene`: the scene that `visray surface` renders, for Python."""

import re
import warnings
from collections.abc import Mapping, Sequence
from math import isfinite

from visray.arguments import checked_arguments, python_number, shown
from visray.colors import color_of_text
from visray.errors import UserError
from visray.scene.adjusted import adjusted
from visray.scene.check import checked
from visray.scene.scene import Scene
from visray.surface_picture.picture import SIZE, Wishes, surface_picture


class SurfaceWarning(UserWarning):
    """Warning about a choice that was made for a picture of a surface, and that may not be what is expected."""


@checked_arguments
def surface_scene(
    formula: str,
    parameters: Mapping | None = None,
    *,
    size: Sequence = SIZE,
    clip: float | None = None,
    view: Sequence | None = None,
    color: str | Sequence | None = None,
    inside: str | Sequence | None = None,
) -> Scene:
    """A scene that shows a surface f(x, y, z) = 0, with nothing else to be written.

    formula: f as a text such as "x^2 + y^2 - z^2 - a", an equation, or the name of a known surface.
    parameters: numbers by name. A letter without a number is 1.
    size: width and height of the picture in pixels.
    clip: radius of the ball about the origin in which the surface is drawn.
    view: direction from the surface towards the camera, as three numbers; z is upwards.
    color, inside: colours of the side that is seen more, and of the other: a name, "#rrggbb", or red, green and blue in
        linear light.

    What is chosen and may not be expected is told by warnings. Raises a UserError if an argument is wrong.
    """
    film = adjusted(Scene(), size=size).film
    if clip is not None and (isinstance(clip, bool) or not isinstance(clip, (int, float))):
        raise UserError(f"clip = {shown(clip)}: must be a number greater than 0")
    wishes = Wishes(
        size=film.size,
        clip=clip,
        towards=_triple("view", view),
        color=_color("color", color),
        inside=_color("inside", inside),
    )
    try:
        made = surface_picture(formula, dict(parameters or {}), wishes)
    except UserError as error:
        raise UserError(*map(_in_python, error.lines)) from None
    scene = checked(made.scene)
    for text in made.notes:
        warnings.warn(_in_python(text), SurfaceWarning, stacklevel=3)
    return scene


def _color(name: str, given: str | Sequence | None) -> tuple[float, float, float] | None:
    """A colour in linear light. Raises a UserError if it is none."""
    if not isinstance(given, str):
        return _triple(name, given)
    try:
        return color_of_text(given)
    except ValueError as error:
        raise UserError(f"{name} = {shown(given)}: {error}") from None


def _triple(name: str, given: Sequence | None) -> tuple[float, float, float] | None:
    """Three numbers. Raises a UserError if they are none."""
    if given is None:
        return None
    numbers = [python_number(x) for x in given]
    if len(numbers) != 3 or not all(isinstance(x, (int, float)) and isfinite(x) for x in numbers):
        raise UserError(f"{name} = {shown(given)}: must be three numbers, such as (1, -2, 1)")
    return tuple(map(float, numbers))


def _in_python(text: str) -> str:
    """A message in which options of the command have become arguments."""
    text = re.sub(r"--param (\w+)=(\S+)", r'parameters={"\1": \2}', text)
    return re.sub(r"--(\w+)", r"\1", text.replace("--from", "view"))
