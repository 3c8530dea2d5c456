"""Flaws of operands: no solids where one is needed, and materials and transforms that do not go together."""

from collections.abc import Iterator, Mapping

from visray.materials import Material
from visray.meshes.triangle_mesh import MeshError
from visray.operands import named_operands
from visray.primitives.csg import Csg
from visray.primitives.csg_operands import CUTTING, NO_MATERIAL, Operand, bodies, has_operands, is_solid, operands
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive
from visray.scene.messages import line
from visray.scene.nesting_flaws import nesting_flaws
from visray.scene.scene import DEFAULT_MATERIAL, Scene
from visray.scene.shape_flaws import own_flaws, unknown_names, uv_flaw
from visray.scene.transform_flaws import clearly_valid, transform_flaw, transform_lines
from visray.transforms import bounds, joined


def operand_flaws(address: str, obj: Primitive) -> Iterator[str]:
    """Yields the flaws of an object's or a geometry's operands that do not depend on other parts of the scene."""
    if not (has_operands(obj) or obj.cut_material is not None):
        return
    for operand in operands(address, obj, {}):
        yield from _count_flaws(operand)
        if operand.around is not None:
            yield from own_flaws(operand.address, operand.shape)
            yield from transform_lines(operand.address, operand.shape, transform_flaw(operand.shape.transform))


def _count_flaws(operand: Operand) -> Iterator[str]:
    """Yields the flaws of the fields of an object that is made of others: `of`, `cut`, `ends` and `cut_material`."""
    shape, address = operand.shape, operand.address
    if shape.cut is not None and not shape.cut:
        yield f"{address}.cut: is empty; name at least one solid, or leave it out"
    if isinstance(shape, Csg):
        count = len(shape.of)
        if count < 2:
            has = "only one operand" if count else "no operand"
            yield f"{address}.of: has {has}; {_article(shape.op)} {shape.op} is made of at least two"
        if shape.ends == "open" and shape.op not in CUTTING:
            text = f"{_article(shape.op)} {shape.op} cuts nothing open; leave ends out"
            yield line(f"{address}.ends", shape.ends, text)
    if shape.cut_material is not None and (text := _unused(operand)):
        yield line(f"{address}.cut_material", shape.cut_material, text)


def _unused(operand: Operand) -> str | None:
    """What is wrong with the `cut_material` of an operand: there is no face that it is for. None if there may be."""
    if _is_cut(operand.shape):
        return None if _may_be_solid(operand.shape) else "a cut makes no face in what is open; leave it out"
    below = [x.address for x in operand.operands({}) if _is_cut(x.shape)]
    if not below:
        return "nothing is cut here; leave it out"
    first = " and ".join(below[:2]) + (f" and {len(below) - 2:,} more" if len(below) > 2 else "")
    return f"nothing is cut here, but in {first}; write it there"


def _is_cut(shape: Primitive) -> bool:
    """Whether something is taken away from an object, or cuts it as an operand."""
    return shape.cut is not None or (isinstance(shape, Csg) and shape.op in CUTTING)


def _may_be_solid(shape: Primitive) -> bool:
    """Whether an object is a solid, as far as it is known without the scene's geometries."""
    first = shape
    while first.composite and first.ends == "capped" and first.of:
        first = next(iter(named_operands(first.of).values()))
    if isinstance(first, Instance) or (first.composite and not first.of):
        return True
    try:
        return is_solid(first, {})
    except MeshError:
        return True  # another line says what is wrong with the mesh


def _article(word: str) -> str:
    """The indefinite article of the name of an operation."""
    return "an" if word[0] == "i" else "a"


def with_operands(scene: Scene) -> dict[str, list[Operand]]:
    """The geometries and objects that have operands, by address: each with its operands, as they are written."""
    sections = (("geometries", scene.geometries), ("objects", scene.objects))
    made = {f"{section}.{name}": x for section, shapes in sections for name, x in shapes.items() if has_operands(x)}
    return {address: list(operands(address, obj, {})) for address, obj in made.items()}


def reference_flaws(scene: Scene, made: Mapping[str, list[Operand]]) -> Iterator[str]:
    """Yields the flaws of all operands that depend on other parts of the scene: on materials, geometries and files.

    made: what `with_operands` returns.
    """
    if not made:
        return
    nesting = list(nesting_flaws(scene, made))
    yield from nesting
    geometries = {} if nesting else scene.geometries
    for walk in made.values():
        for operand in walk[1:]:
            yield from unknown_names(scene, operand.address, operand.shape)
            yield from _solid_flaws(operand, geometries)
    if not nesting:
        yield from _joint_flaws(scene, made)


def _solid_flaws(operand: Operand, geometries: Mapping[str, Primitive]) -> Iterator[str]:
    """Yields a line if an operand is no solid and must be one."""
    around = operand.around.shape
    if operand.role == "of" and operand.first and around.op in CUTTING:
        return
    try:
        part = None if is_solid(operand.shape, geometries) else _open_part(operand, geometries)
        if part is None:
            return
        advice = 'write "ends": "capped"' if isinstance(part.shape, Csg) else part.shape.advice_for_solid()
    except MeshError:
        return  # another line says what is wrong with the mesh
    if operand.role == "cut":
        rule = "what is taken away must be a solid"
    elif around.op in CUTTING:
        rule = f"only the first operand of {_article(around.op)} {around.op} may be open"
    else:
        rule = f"the operands of {_article(around.op)} {around.op} must be solids"
    what = f"an open {part.shape.type}"
    what = what if part is operand else f"open, as {part.address} is {what}"
    yield f"{operand.address}: is {what}, and {rule}; {advice}"


def _open_part(operand: Operand, geometries: Mapping[str, Primitive]) -> Operand | None:
    """The part of an open operand that makes it open; None if it has no such part, because something else is wrong."""
    while True:
        shape = operand.shape
        if not operand.is_leaf and not (isinstance(shape, Csg) and shape.ends == "open"):
            inner = [x for x in operand.operands(geometries) if x.first]
            if not inner:
                return None
            operand = inner[0]
        else:
            return operand


def _joint_flaws(scene: Scene, made: Mapping[str, list[Operand]]) -> Iterator[str]:
    """Yields the flaws of operands that depend on the objects around them: transforms one after another, a texture on a
    mesh without texture coordinates, and materials of one solid that do not go together."""
    geometries, limits = scene.geometries, {}
    for address, walk in made.items():
        whole = _whole_walk(walk, geometries)
        yield from _transform_flaws(whole)
        if address.startswith("objects."):
            yield from solid_material_flaws(scene, address, walk[0].shape)
        else:
            limits[address] = _limits(whole)
    seen: set[tuple[str, str]] = set()
    for name, obj in scene.objects.items():
        if not isinstance(obj, Instance) or has_operands(obj) or f"geometries.{obj.geometry}" not in made:
            continue
        address, (steps, count) = f"objects.{name}", limits[f"geometries.{obj.geometry}"]
        if not clearly_valid(joined(steps, bounds(obj.transform)), count + len(obj.transform)):
            yield from _transform_flaws(list(operands(address, obj, geometries)))
        if (obj.geometry, obj.material) not in seen:
            seen.add((obj.geometry, obj.material))
            yield from solid_material_flaws(scene, address, obj)


def _whole_walk(walk: list[Operand], geometries: Mapping[str, Primitive]) -> list[Operand]:
    """The operands of an object and of the geometries in it. walk: its operands, as they are written"""
    whole = walk[0]
    instances = any(isinstance(x.shape, Instance) for x in walk)
    return list(operands(whole.address, whole.shape, geometries)) if instances else walk


def _limits(walk: list[Operand]) -> tuple[tuple[float, float, float], int]:
    """Bounds on the transforms of all operands of a walk (transforms.bounds), and the largest number of steps."""
    least, largest, shift = zip(*(bounds(x.steps) for x in walk))
    return (min(least), max(largest), max(shift)), max(len(x.steps) for x in walk)


def _transform_flaws(walk: list[Operand]) -> Iterator[str]:
    """Yields a line for each operand of a walk whose transform and those around it do not go together."""
    for operand in walk[1:]:
        # A flaw of its own transform is another one, and what is in it has the same flaw.
        if transform_flaw(operand.shape.transform) or transform_flaw(operand.around.steps):
            continue
        if flaw := transform_flaw(operand.steps):
            text = f"followed by the transforms of what is around it, {flaw}"
            yield from transform_lines(operand.address, operand.shape, text)


def solid_material_flaws(scene: Scene, address: str, obj: Primitive) -> Iterator[str]:
    """Yields a line for each solid of an object whose materials do not go together, and for each mesh that has a
    texture but no texture coordinates. Domain: no geometry contains itself."""
    materials = {DEFAULT_MATERIAL: Material()} | scene.materials
    for body in bodies(address, obj, scene.geometries):
        own, disagree = materials.get(body.material), None
        for operand in body.walk(scene.geometries):
            if not operand.is_leaf:
                continue
            owner = operand.owner
            if owner.around is not None and (text := uv_flaw(scene, operand.material, operand.shape)):
                yield line(_named_at(owner), operand.material, text)
            other = materials.get(operand.material)
            if own is not None and other is not None:
                disagree = disagree or _disagreement(owner, other, body.owner, own)
        if disagree:
            yield disagree


def _named_at(operand: Operand) -> str:
    """Address of the field that names the material of an operand: its `material`, or the `cut_material` around it."""
    inner = operand
    while inner.shape.material == NO_MATERIAL and inner.around is not None:
        if inner.cuts and inner.around.shape.cut_material is not None:
            return f"{inner.around.address}.cut_material"
        inner = inner.around
    return f"{operand.address}.material"


def _disagreement(operand: Operand, material: Material, body: Operand, own: Material) -> str | None:
    """The line about an operand whose material does not go together with that of its body; None if it does."""
    clear, own_clear = any(material.kt), any(own.kt)
    address, of_body = _named_at(operand), f'"{body.material}" of {body.address}'
    if clear != own_clear:
        text = f"is {'' if clear else 'not '}transparent, unlike {of_body}; in one solid all materials are, or none is"
        return line(address, operand.material, text)
    for field in ("ior", "dmax", "absorption") if clear else ():
        here, there = getattr(material, field), getattr(own, field)
        if here != there:
            here, there = (list(x) if isinstance(x, tuple) else f"{x:g}" for x in (here, there))
            text = f"has the {field} {here}, and {of_body} has {there}; a transparent solid has one {field}"
            return line(address, operand.material, text)
    return None


def named_geometries(scene: Scene, made: Mapping[str, list[Operand]]) -> set[str]:
    """Names of the geometries that objects and other geometries stand for or contain. made: as in reference_flaws."""
    named = {x.geometry for x in scene.objects.values() if type(x) is Instance}
    return named | {x.shape.geometry for walk in made.values() for x in walk if isinstance(x.shape, Instance)}
