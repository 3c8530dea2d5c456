"""Scenes made ready for derivatives by some of their numbers, and refused if there are none.

At some values a picture jumps or has a kink, so that a derivative does not exist. There, the formulas of a kernel would
give 0 or any other number, without a word.

An address is the dotted name of a value in a scene, such as `objects.ball.radius`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from visray.errors import UserError
from visray.feature_rules import used_materials
from visray.geometry import UPRIGHT
from visray.lights.light import Light
from visray.polynomials import PolynomialError
from visray.primitives.csg_operands import bodies, has_operands, mapped, operand_at, operands
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Primitive, scalars
from visray.records import altered
from visray.scene.scene import Scene


def differentiable(scene: Scene, wrt: Sequence[str]) -> Scene:
    """The scene, in the structure that has the right derivatives. Raises UserError if there is none by one of the
    addresses.

    The structure of a scene is what is decided by values before kernels are made: a polynomial without the terms that
    are 0, a mesh of an opaque material as single triangles. Here it must also be right for nearby values.

    wrt: addresses of the numbers by which derivatives are taken
    """
    for address in wrt:
        if flaw := _flaw(scene, address, wrt):
            raise UserError(f"{address}: has no derivative {flaw}")
    scene = _with_varied_polynomials(scene, wrt)
    objects, geometries = {}, {}
    for name, obj in scene.objects.items():
        if isinstance(obj, Mesh) and not has_operands(obj) and _asked(wrt, f"materials.{obj.material}.kt"):
            # An instance is a body, as all transparent meshes are. No name of a geometry has a dot.
            geometry = f"objects.{name}"
            geometries[geometry] = obj
            plain = Instance(geometry=name, material=obj.material)
            objects[name] = altered(plain, {"geometry": geometry})
    if not objects:
        return scene
    return replace(scene, objects=scene.objects | objects, geometries=scene.geometries | geometries)


def _asked(wrt: Sequence[str], address: str) -> bool:
    """Whether one of the addresses `wrt` is this address or a part of it."""
    return any(w == address or w.startswith(f"{address}.") for w in wrt)


def _with_varied_polynomials(scene: Scene, wrt: Sequence[str]) -> Scene:
    """The scene, with the right derivatives by parameters of polynomials: of objects, geometries and operands."""
    if not any(".parameters." in address for address in wrt):
        return scene

    def change(address: str, shape: Primitive) -> Primitive:
        return _varied(shape, wrt, address) if isinstance(shape, Polynomial) else shape

    changed = {
        section: {name: mapped(f"{section}.{name}", shape, change) for name, shape in getattr(scene, section).items()}
        for section in ("objects", "geometries")
    }
    return replace(scene, **changed)


def _varied(polynomial: Polynomial, wrt: Sequence[str], address: str) -> Polynomial:
    """The polynomial, with the right derivatives by some of its parameters. address: that of the polynomial"""
    names = [x for w in wrt if (x := w.removeprefix(f"{address}.parameters.")) != w]
    if not (names and set(names) <= set(polynomial.parameters)):
        return polynomial
    try:
        return polynomial.varied_by(names)
    except PolynomialError as error:
        values = ", ".join(f"{name} = {polynomial.parameters[name]:g}" for name in names)
        raise UserError(f"{address}.parameters.{names[0]}: has no derivative at {values}: {error}") from None


def _flaw(scene: Scene, address: str, wrt: Sequence[str]) -> str | None:
    """Where and why the picture has no derivative by the number at an address; None if it has one, or if its kind of
    object decides (_varied)."""
    head, name, field = (*address.split("."), "", "")[:3]
    if head == "lights" and name in scene.lights:
        return _light_flaw(scene.lights[name], field)
    if head == "camera" and name == "focus" and (getattr(scene.camera, "aperture", 0) or "camera.aperture" in wrt):
        return "at 0, which means the distance of the target; write that distance" if not scene.camera.focus else None
    if head == "materials" and name in scene.materials and field in ("kr", "kt"):
        scatter = scene.settings.scatter
        material = used_materials(scene).get(name, scene.materials[name])
        if field == "kt" and (material.back or name in {m.back for m in scene.materials.values()}):
            return "as the two sides of a two-sided material are opaque"
        if field == "kt" and material.fresnel == "metal":
            return "as a metal is opaque"
        if field == "kt" and not any(scene.materials[name].kt) and _in_union(scene, name):
            return "at 0, as an opaque union is one solid and a transparent one is not; write a merge"
        if material.fresnel != "none" and not any((*material.kr, *material.kt)):
            return f"at 0, as a material without kr and kt has no {material.fresnel} fresnel, and one with them has it"
        if material.scatters and scatter.rays and scatter.depth:
            return "at 0 while settings.scatter has rays: a matte material scatters, and one with kr or kt does not"
    if head in ("objects", "geometries"):
        return _upright_flaw(scene, address)
    return None


def _in_union(scene: Scene, material: str) -> bool:
    """Whether an operand of a union, which is a body of its own if it is transparent, has a material."""
    found = (bodies("", obj, scene.geometries) for obj in scene.objects.values())
    return any(len(each) > 1 and any(x.material == material for x in each) for each in found)


def _light_flaw(light: Light, field: str) -> str | None:
    """As _flaw, for a field of a light."""
    if field not in ("a", "b", "c"):
        return None
    if not light.has_position and field != "a":
        return "as a directional light is infinitely far away"
    if not (light.a or light.b or light.c):
        return "at a = b = c = 0, which means no attenuation, as a = 1 does; write a = 1"
    return None


def _upright_flaw(scene: Scene, address: str) -> str | None:
    """As _flaw, for a field of an object, an operand or a geometry that turns its axis, if the axis is upright and
    something in the picture depends on the directions of u and v."""
    head, name, *path = address.split(".")
    if name not in getattr(scene, head):
        return None
    shape, path = operand_at(getattr(scene, head)[name], path)
    if not path or path[0] not in shape.axis_fields:
        return None
    z = np.array(scalars(shape).frame().z, float)
    upright = max(abs(z[0]), abs(z[2])) < UPRIGHT["double"] * np.linalg.norm(z)
    own = address.removesuffix("." + ".".join(path))
    if upright and (scene.settings.shading == "uv" or _is_textured(scene, own)):
        return "where the axis is upright, as the directions of u and v jump there; tilt it a little"
    return None


def _is_textured(scene: Scene, address: str) -> bool:
    """Whether a shape has a texture on any side. address: that of an object, an operand or a geometry"""
    every = (x for n, obj in scene.objects.items() for x in operands(f"objects.{n}", obj, scene.geometries))
    sides = {side for x in every if x.address == address for side in scene.sides_of(x.material)}
    return any(scene.material(side).texture for side in sides)
