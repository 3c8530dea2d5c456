"""The scene that shows a surface: clip, camera, lights and colours are fitted to it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from visray.colors import hexadecimal, looks_like_bytes
from visray.errors import UserError
from visray.quantities import FARTHEST
from visray.scene.film import Film
from visray.scene.scene import Occlusion, Scene, Settings
from visray.surface_picture.clip import Cut, clip_for, facts
from visray.surface_picture.field import Field
from visray.surface_picture.look import AMBIENT_LIGHT, BACKGROUND, RIG, materials, side
from visray.surface_picture.reading import SURFACE, Asked, asked
from visray.surface_picture.viewing import axes_towards, best_direction, camera_for, lights_for, seen

SIZE = (640, 640)
UP = (0.0, 0.0, 1.0)
# Rays across the picture that decide which side of the surface is seen more.
ACROSS = 60

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class SurfacePicture:
    """A scene that shows a surface.

    name: name for its file, without an ending.
    choices: what was chosen, each a text by a name.
    notes: what may not be expected.
    """

    scene: Scene
    name: str
    choices: dict[str, str]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Wishes:
    """What is asked for beside the formula; None: to be chosen.

    size: width and height of the picture in pixels.
    clip: radius of the ball in which the surface is drawn, > 0.
    towards: direction from the surface towards the camera.
    color, inside: linear colours of the side that is seen more, and of the other side.
    """

    size: tuple[int, int] = SIZE
    clip: float | None = None
    towards: Triple | None = None
    color: Triple | None = None
    inside: Triple | None = None

    def check(self) -> None:
        """Raises a UserError if a wish is wrong."""
        if self.clip is not None and not 0 < self.clip <= FARTHEST:
            raise UserError(f"--clip = {self.clip:g}: must be greater than 0, and at most {FARTHEST:g}")
        if self.towards is not None and not 1e-100 < np.linalg.norm(self.towards) < 1e100:
            raise UserError("--from: has no length, or one that is too large; write a direction such as 1,-2,1")
        for name, color in (("color", self.color), ("inside", self.inside)):
            if color is not None and not all(0 <= x <= 1 for x in color):
                shown = ",".join(f"{x:g}" for x in color)
                raise UserError(f"--{name} = {shown}: must be red, green and blue, each from 0 to 1{_screen(color)}")


def _screen(color: Triple) -> str:
    """What is right instead of a colour whose numbers are from 0 to 255, as the end of a sentence."""
    return f"; a colour of a screen is written {hexadecimal(color)}" if looks_like_bytes(color) else ""


@np.errstate(all="ignore")
def surface_picture(formula: str, parameters: Mapping[str, float], wishes: Wishes = Wishes()) -> SurfacePicture:
    """The scene that shows a surface. Raises a UserError if the formula, a parameter or a wish is wrong."""
    wishes.check()
    surface = asked(formula, parameters)
    field = Field(surface.compiled)
    cut = clip_for(surface, field, wishes.clip)
    ball = cut.ball
    view = surface.model.view if surface.model else None
    up, zoom = (view.up, view.zoom) if view and wishes.towards is None else (UP, 1.0)
    towards = wishes.towards or (view.direction if view else best_direction(field, ball, cut.points))
    front = seen(field, ball, axes_towards(towards, up), ACROSS).front
    width, height = wishes.size
    scene = Scene(
        camera=camera_for(cut.points, towards, up, width / height, zoom),
        film=Film(width=width, height=height),
        background=BACKGROUND,
        ambient=AMBIENT_LIGHT,
        materials=materials(front, wishes.color, wishes.inside),
        lights=lights_for(ball, towards, up, RIG),
        objects={SURFACE: replace(surface.shape, clip=ball, material=side(front))},
        settings=Settings(sampler="sobol", occlusion=Occlusion(sky=1)),
    )
    notes = surface.notes if surface.known else (*surface.notes, *facts(surface, ball).notes)
    return SurfacePicture(scene, surface.name, _choices(surface, cut, towards), notes)


def _choices(surface: Asked, cut: Cut, towards: Triple) -> dict[str, str]:
    """What was chosen, as texts by names."""
    ball = cut.ball
    centre = f" about {', '.join(f'{x:g}' for x in ball.center)}" if any(ball.center) else ""
    whole = {None: "", True: ", which holds the whole surface", False: ", which cuts the surface"}[cut.whole]
    chosen = {"degree": f"{surface.degree}"}
    if surface.shape.parameters:
        chosen["parameters"] = ", ".join(f"{name} = {value:g}" for name, value in surface.shape.parameters.items())
    chosen["clip"] = f"a ball of radius {ball.radius:g}{centre}{whole}"
    return chosen | {"seen from": ", ".join(f"{x:.3g}" for x in towards)}
