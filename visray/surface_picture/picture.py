"""The scene that shows a surface: clip, camera, lights and colours are fitted to it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from visray import polynomials
from visray.camera import Camera
from visray.data.fit import Balls, fitted_lights, fitted_view
from visray.errors import UserError
from visray.hints import hint
from visray.materials import Material
from visray.polynomials import PolynomialError
from visray.polynomials.catalogue import SURFACES, View
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.scene.scene import Film, Occlusion, Scene, Settings
from visray.surface_picture.field import Field
from visray.surface_picture.whereabouts import surface_points, whereabouts

# Direction towards the camera, with z upwards.
TOWARDS = (0.86, -1.2, 0.75)
OUTSIDE, INSIDE = (0.75, 0.27, 0.07), (0.06, 0.26, 0.5)
PAPER = (0.88, 0.9, 0.92)
# Share of a material's kd that is its ka.
AMBIENT = 0.3
# Names of the surface and of its materials in the scene.
SURFACE, FRONT, BACK = "surface", "outside", "inside"


@dataclass(frozen=True)
class SurfacePicture:
    """A scene that shows a surface.

    name: name for its file, without an ending.
    notes: what was chosen that the user may not expect.
    """

    scene: Scene
    name: str
    notes: tuple[str, ...]


def surface_picture(
    formula: str,
    parameters: Mapping[str, float],
    size: tuple[int, int] = (640, 640),
    clip: float | None = None,
    view: tuple[float, float, float] | None = None,
    color: tuple[float, float, float] | None = None,
) -> SurfacePicture:
    """The scene that shows a surface. Raises a UserError if the formula or a parameter is wrong."""
    shape, name, notes = _shape(formula.strip(), dict(parameters))
    field = Field(_compiled(shape, formula))
    known = (shape.surface and SURFACES[shape.surface].view) or View(TOWARDS)
    ball = _clip(shape, field, clip or known.clip, formula)
    shape = replace(shape, clip=ball, material=FRONT)
    points = surface_points(field, np.array(ball.center), ball.radius)
    # A view from elsewhere has z upwards.
    up = known.up if view is None else (0.0, 0.0, 1.0)
    axes = axes_towards(np.array(view or known.direction, float), np.array(up))
    shown = Balls(points, np.zeros(len(points)))
    camera = fitted_view(shown, axes, size[0] / size[1])
    slope = np.tan(np.radians(camera.fov / 2)) / (known.zoom if view is None else 1.0)
    fov = round(float(np.degrees(2 * np.arctan(slope))), 3)
    camera = Camera(origin=camera.origin, target=camera.target, up=up, fov=fov)
    colors = {FRONT: color or OUTSIDE, BACK: INSIDE}
    return SurfacePicture(
        Scene(
            camera=camera,
            film=Film(width=size[0], height=size[1]),
            background=PAPER,
            ambient=(1.0, 1.0, 1.0),
            materials={k: _material(x, BACK if k == FRONT else None) for k, x in colors.items()},
            lights=fitted_lights(shown, axes),
            objects={SURFACE: shape},
            settings=Settings(sampler="sobol", occlusion=Occlusion(sky=1)),
        ),
        name,
        tuple(notes),
    )


def axes_towards(towards: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Axes of a camera that looks against a direction: to the right, up and forward, an axis in each row."""
    forward = -towards / np.linalg.norm(towards)
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _material(color: tuple, back: str | None) -> Material:
    """A material with a colour, a soft highlight, and the material of its other side."""
    ka = tuple(round(AMBIENT * x, 4) for x in color)
    return Material(ka=ka, kd=color, ks=(0.25, 0.25, 0.25), shininess=60, back=back)


def _shape(formula: str, parameters: dict[str, float]) -> tuple[Polynomial, str, list[str]]:
    """The surface without a clip of its own, its name, and notes."""
    if formula in SURFACES:
        known = SURFACES[formula]
        if unknown := [name for name in parameters if name not in known.parameters]:
            raise UserError(
                f"{unknown[0]}: the surface {formula} has no such parameter; {hint(unknown[0], known.parameters)}"
            )
        return Polynomial(surface=formula, parameters=parameters), formula, []
    return Polynomial(expression=formula, parameters=parameters), SURFACE, []


def _compiled(shape: Polynomial, formula: str) -> polynomials.Compiled:
    """The polynomial in coordinates about the origin."""
    try:
        return polynomials.build(shape.source(), shape.parameters)
    except PolynomialError as error:
        raise UserError(f"{formula}: {error}") from None


def _clip(shape: Polynomial, field: Field, radius: float | None, formula: str) -> Ball:
    """The ball in which the surface is drawn."""
    if shape.surface is not None:
        return Ball(center=SURFACES[shape.surface].centre, radius=radius or SURFACES[shape.surface].radius)
    if radius is not None:
        return Ball(radius=radius)
    found = whereabouts(field)
    if found is None:
        raise UserError(f"{formula}: no real points were found")
    return Ball(center=tuple(np.round(found.centre, 3).tolist()), radius=float(f"{1.03 * found.radius:.3g}"))
