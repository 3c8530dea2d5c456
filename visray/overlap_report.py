"""Which of two transparent solids counts where they may overlap, and why: what `visray explain` lists."""

from dataclasses import dataclass, replace

import numpy as np

from visray.data.all_objects import address_of
from visray.feature_rules import used_materials
from visray.features import Overlap
from visray.geometry import gamma
from visray.nesting import Solids, solids_of
from visray.pack import pack
from visray.quantities import Arrays
from visray.scene.scene import Scene

# Number of pairs that are described; the others are counted.
DESCRIBED = 1000


@dataclass(frozen=True)
class _Bounds:
    """Bounding boxes and balls of solids. Shapes: low, high, centre (N, 3), radius (N)."""

    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    radius: np.ndarray

    def pairs(self) -> np.ndarray:
        """Pairs of solids whose boxes and balls overlap by more than rounding, as indices, in order. Shape: (P, 2)."""
        order = np.argsort(self.low[:, 0], kind="stable")
        found = [np.zeros((0, 2), int)]
        last = np.searchsorted(self.low[order, 0], self.high[order, 0], side="right")
        for k, i in enumerate(order):
            j = order[k + 1 : last[k]]
            # Coordinates and radii have a few roundings each.
            slack = gamma(32) * (np.abs(self.centre[j]).sum(1) + self.radius[j] + self.radius[i])[:, None]
            met = (np.maximum(self.low[i], self.low[j]) < np.minimum(self.high[i], self.high[j]) - slack).all(1)
            apart = np.linalg.norm(self.centre[i] - self.centre[j], axis=1)
            met &= apart < self.radius[i] + self.radius[j] - slack[:, 0]
            found.append(np.stack([np.full(met.sum(), i), j[met]], 1))
        pairs = np.sort(np.concatenate(found), axis=1)
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def overlaps(scene: Scene) -> tuple[tuple[Overlap, ...], int]:
    """The pairs of transparent solids of a scene that may overlap: the first DESCRIBED of them, and their number."""
    clear = {name for name, m in used_materials(scene).items() if any(m.kt)}
    # Rows of data become objects, so that unions of them are drawn as several bodies too.
    scene = replace(scene, objects=scene.objects_of(clear), data=None)
    bodies = scene.bodies.items()
    solids = {n: o for n, o in bodies if scene.materials_of(o)[0] in clear and scene.shape_of(o).closed}
    if len(solids) < 2:
        return (), 0
    scene = replace(scene, objects=solids)
    batches, names = pack(scene, Arrays.of()).batches, list(solids)
    parts = Solids.joined([solids_of(scene, columns) for columns in batches])
    bounds = [columns.numbers.bounds(columns.outer) for columns in batches]
    boxes = _Bounds(*(np.concatenate([_rows(getattr(b, name), len(c)) for b, c in zip(bounds, batches)])
                      for name in _Bounds.__dataclass_fields__))  # fmt: skip
    # From here on, solids are in the order of the scene.
    place = np.argsort(parts.number)
    parts = parts.at(place)
    boxes = _Bounds(*(getattr(boxes, name)[place] for name in _Bounds.__dataclass_fields__))
    rank = np.argsort(parts.order())
    pairs = boxes.pairs()
    listed = []
    for pair in pairs[:DESCRIBED]:
        counts, hidden = sorted(pair, key=rank.__getitem__)
        listed.append(Overlap(address_of(names[counts]), address_of(names[hidden]), _reason(parts, counts, hidden)))
    return tuple(listed), len(pairs)


def _rows(x: object, count: int) -> np.ndarray:
    """A Dr.Jit array with one entry a solid as a NumPy array. Shapes: (N) or (N, 3)."""
    x = np.array(x, float).T
    return np.broadcast_to(x, (count, *x.shape[1:]))


def _reason(solids: Solids, counts: int, hidden: int) -> str:
    """Why one solid counts and another one does not."""
    priority, other_priority = (solids.priority[i] for i in (counts, hidden))
    if priority != other_priority:
        return f"priority {priority:g} is higher than {other_priority:g}"
    (volume, error), (other, other_error) = ((solids.volume[i], solids.error[i]) for i in (counts, hidden))
    texts = [f"{v:.4g}" + (f" +- {e:.1g}" if e else "") for v, e in ((volume, error), (other, other_error))]
    if np.ptp(solids.at(np.array([counts, hidden])).rounded_volume()) == 0:
        return f"both have the volume {texts[0]}, and it comes first in the scene"
    text = f"volume {texts[0]} is smaller than {texts[1]}"
    if other - volume < error + other_error:
        text += "; the volumes are bounds that overlap, so write a priority to be sure"
    return text
