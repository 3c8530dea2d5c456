"""The scene that shows a surface: clip, camera, lights and colours are fitted to it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from visray.errors import UserError
from visray.primitives.clips import Ball
from visray.scene.scene import Film, Occlusion, Scene, Settings
from visray.surface_picture.field import Field
from visray.surface_picture.look import AMBIENT_LIGHT, BACKGROUND, RIG, materials, side
from visray.surface_picture.points import surface_points
from visray.surface_picture.reading import SURFACE, Asked, asked
from visray.surface_picture.viewing import axes_towards, best_direction, camera_for, lights_for, seen
from visray.surface_picture.whereabouts import whereabouts

SIZE = (640, 640)
UP = (0.0, 0.0, 1.0)
# The clip of a surface that ends is larger than the surface by this share.
MARGIN = 0.02
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
    clip: radius of the ball about the origin in which the surface is drawn.
    towards: direction from the surface towards the camera.
    color, inside: linear colours of the side that is seen more, and of the other side.
    """

    size: tuple[int, int] = SIZE
    clip: float | None = None
    towards: Triple | None = None
    color: Triple | None = None
    inside: Triple | None = None


def surface_picture(formula: str, parameters: Mapping[str, float], wishes: Wishes = Wishes()) -> SurfacePicture:
    """The scene that shows a surface. Raises a UserError if the formula, a parameter or a wish is wrong."""
    surface = asked(formula, parameters)
    field = Field(surface.compiled)
    ball, whole = _clip(surface, field, wishes.clip)
    points = surface_points(field, np.array(ball.center), ball.radius)
    if not len(points):
        raise UserError(_nothing_in(surface, field, ball))
    view = surface.known.view if surface.known else None
    up, zoom = (view.up, view.zoom) if view and wishes.towards is None else (UP, 1.0)
    towards = wishes.towards or (view.direction if view else best_direction(field, ball))
    front = seen(field, ball, axes_towards(towards, up), ACROSS).front
    width, height = wishes.size
    scene = Scene(
        camera=camera_for(points, towards, up, width / height, zoom),
        film=Film(width=width, height=height),
        background=BACKGROUND,
        ambient=AMBIENT_LIGHT,
        materials=materials(front, wishes.color, wishes.inside),
        lights=lights_for(ball, towards, up, RIG),
        objects={SURFACE: replace(surface.shape, clip=ball, material=side(front))},
        settings=Settings(sampler="sobol", occlusion=Occlusion(sky=1)),
    )
    return SurfacePicture(scene, surface.name, _choices(surface, ball, whole, towards), surface.notes)


def _clip(surface: Asked, field: Field, radius: float | None) -> tuple[Ball, bool]:
    """The ball in which the surface is drawn, and whether it holds the whole surface. radius: that is asked for."""
    known = surface.known
    if radius is not None:
        if not (isinstance(radius, (int, float)) and math.isfinite(radius) and radius > 0):
            raise UserError(f"--clip = {radius!r}: must be a number greater than 0, the radius of a ball")
        return Ball(center=known.centre if known else (0.0, 0.0, 0.0), radius=float(radius)), False
    if known:
        own = known.view.clip if known.view else None
        return Ball(center=known.centre, radius=own or known.radius), known.compact and own is None
    found = whereabouts(field)
    if found is None:
        raise UserError(_nowhere(surface))
    unit = 10.0 ** math.floor(math.log10(0.02 * found.radius))
    centre = np.round(found.centre / unit) * unit
    places = max(0, -round(math.log10(unit)))
    centre = tuple(round(float(x), places) + 0.0 for x in centre)
    if not found.compact:
        return Ball(center=centre, radius=_two_digits(found.radius, round)), False
    reach = found.radius + float(np.linalg.norm(found.centre - np.array(centre)))
    return Ball(center=centre, radius=_two_digits((1 + MARGIN) * reach, math.ceil)), True


def _two_digits(x: float, rounding) -> float:
    """A number > 0, rounded to two digits."""
    power = math.floor(math.log10(x)) - 1
    return float(f"{rounding(x / 10.0**power)}e{power}")


def _nowhere(surface: Asked) -> str:
    """The error of a formula whose surface is found nowhere."""
    values = ", ".join(f"{name} = {value:g}" for name, value in surface.shape.parameters.items())
    given = f" with {values}" if values else ""
    return (
        f"{surface.label}{given}: has no real points that make a surface: between 0 and 10,000 from the origin, f has "
        "the same sign wherever it was looked at; a surface is where f changes its sign, so change a sign or a number"
    )


def _nothing_in(surface: Asked, field: Field, ball: Ball) -> str:
    """The error of a clip that the surface misses."""
    found = whereabouts(field)
    if found is None:
        return _nowhere(surface)
    reach = _two_digits(float(np.linalg.norm(found.centre)) + found.radius, math.ceil)
    return (
        f"--clip = {ball.radius:g}: no point of {surface.label} is so near to the origin; without --clip it is fitted, "
        f"and {reach:g} shows the surface"
    )


def _choices(surface: Asked, ball: Ball, whole: bool, towards: Triple) -> dict[str, str]:
    """What was chosen, as texts by names."""
    centre = "" if not any(ball.center) else " about " + ", ".join(f"{x:g}" for x in ball.center)
    cut = "the whole surface is in it" if whole else "which cuts the surface"
    chosen = {"degree": f"{surface.degree}"}
    if surface.shape.parameters:
        chosen["parameters"] = ", ".join(f"{name} = {value:g}" for name, value in surface.shape.parameters.items())
    chosen["clip"] = f"a ball of radius {ball.radius:g}{centre}, {cut}"
    return chosen | {"seen from": ", ".join(f"{x:.3g}" for x in towards)}
