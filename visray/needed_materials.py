"""What effects of a scene read of its materials. Kernels leave everything else out."""

from dataclasses import replace
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.batches import Batch
from visray.columns import BackSide, Columns, Looks
from visray.features import Features
from visray.materials import Material
from visray.pytree import Packets, evaluated, leaves
from visray.quantities import Arrays, quantities

# The effects that read these fields of a material. If none of them is simulated, the kernel leaves the field out. All
# other fields are always read.
FIELD_READERS = {
    "ks": ("specular",),
    "shininess": ("specular",),
    "kr": ("reflection", "scatter"),
    "kt": ("refraction", "coloured shadows", "scatter"),
    "ior": ("refraction", "fresnel"),
    "dmax": ("coloured shadows",),
    "absorption": ("absorption",),
    "fresnel": ("fresnel",),
    "shading": ("unlit",),
    "emission": ("emission",),
}


def needed(material: Material, features: Features) -> Material:
    """The materials, with None for each field that no effect of the scene reads."""
    unused = [name for name, effects in FIELD_READERS.items() if not any(features[e] for e in effects)]
    return replace(material, **dict.fromkeys(unused))


def asked_fields(materials: Material, batches: tuple[Batch, ...], attached_textures: bool) -> frozenset[str]:
    """Names of the fields of materials that carry derivatives: their own, those of the colours of rows, or those of the
    colour of a texture that changes from point to point."""
    looks = (batch.looks.material for batch in batches if batch.looks is not None)
    tables = materials, *(batch.material for batch in batches), *looks
    own = (name for name in quantities(Material) if any(dr.grad_enabled(getattr(x, name)) for x in tables))
    return frozenset(own) | (frozenset({"kd"}) if attached_textures else frozenset())


def with_needed(batch: Batch, columns: Columns, features: Features, a: Arrays, rank: Any) -> Batch:
    """The batch with the ranks of its rows, and with only those numbers of its materials that effects of the scene
    read."""
    sides = _needed_sides(batch, columns, features)
    tables = sides["material"], sides["back"] and sides["back"].material
    many = dr.width(batch.object) > policy.MAX_INLINED and not dr.grad_enabled(leaves(tables))
    packets = evaluated(Packets.of(a.Q32, tables)) if many and a.F is a.F32 else None
    looks = batch.looks and replace(batch.looks, **_needed_sides(batch.looks, columns.looks, features))
    return replace(batch, packets=packets, rank=rank, looks=looks, **sides)


def _needed_sides(shown: Batch | Looks, columns: Columns | Looks, features: Features) -> dict[str, Any]:
    """The fields `material` and `back` of a batch or of looks, as a dict, with what effects of the scene read."""
    back = None
    if features["two-sided"]:
        # If the effect is forced although no material of the scene has a back, the back is as the front.
        back = BackSide(shown.material, shown.texture) if columns.back is None else shown.back
    back = back and replace(back, material=needed(back.material, features))
    return {"material": needed(shown.material, features), "back": back}
