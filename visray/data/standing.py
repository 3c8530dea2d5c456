"""How the gizmos of points stand on a base."""

from dataclasses import dataclass, replace

import numpy as np

from visray.data.base import Base, FlatBase, Ground
from visray.data.gizmos import GIZMOS, Gizmo, Stand
from visray.data.layer import DataLayer
from visray.data.touching import LOWER

# How far disks are above the base, and hanging bars below it, if the layer has no lift: a share of the base's size.
LIFT = 0.001
# Size of hidden gizmos, and how far below the base they are: shares of the base's size. No ray is likely to meet one.
TINY, BURIED = 1e-6, 0.25


@dataclass(frozen=True, eq=False)
class Standing:
    """Where gizmos stand.

    stand: feet, directions and sizes
    lift: height of the feet above the base. Shape: (N)
    """

    stand: Stand
    lift: np.ndarray

    @staticmethod
    def of(layer: DataLayer, base: Base, ground: Ground, sizes: dict[str, np.ndarray]) -> "Standing":
        """The gizmos of a layer. ground: of their places. sizes: signed, by property. Shapes: (N) each."""
        signed = sizes.get("height", sizes["radius"])
        sign = np.where(signed < 0, -1.0, 1.0)
        lift = _lift(layer, base, GIZMOS[layer.gizmo], sign)
        up, east = ground.up.T, ground.east.T
        stand = Stand(ground.point.T + up * lift, up, east, np.cross(ground.up, ground.east).T,
                      np.abs(signed), sign, np.abs(sizes["radius"]), layer.sunk)  # fmt: skip
        return Standing(stand, lift)

    def signed(self, slopes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Derivatives of sizes without their signs, and of colours with the shape (3, N), from those of signed sizes
        and of colours with the shape (N, 3)."""
        return {key: x.T if key == "color" else x * self.stand.sign for key, x in slopes.items()}

    def with_hidden(self, hidden: np.ndarray, base: Base) -> "Standing":
        """The same, with some gizmos tiny and below the base. hidden: mask of these. Shape: (N)."""
        if not hidden.any():
            return self
        lift = np.where(hidden, -BURIED * base.size, self.lift)
        foot = self.stand.foot + self.stand.up * (lift - self.lift)
        small = {key: np.where(hidden, TINY * base.size, getattr(self.stand, key)) for key in ("height", "radius")}
        return Standing(replace(self.stand, foot=foot, **small), lift)


def _lift(layer: DataLayer, base: Base, gizmo: Gizmo, sign: np.ndarray) -> np.ndarray:
    """Height of each gizmo's foot above the base. Those that would lie in a map, with a flat side, are moved a little,
    so that the picture shows no noise of both. sign: of their sizes. Shape: (N)."""
    if layer.lift is not None:
        return np.full(len(sign), layer.lift)
    little = LIFT * base.size
    hangs = isinstance(base, FlatBase) and layer.sunk == 0 and gizmo.name in LOWER
    return np.where(hangs & (sign < 0), -little, little if gizmo.flat else 0.0)
