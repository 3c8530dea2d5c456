"""The rows of a layer with a time at one moment."""

from dataclasses import replace

import numpy as np

from visray.data.gizmos import Stand
from visray.data.rows import InTime, Rows
from visray.data.standing import Standing
from visray.data.timed_layer import TimedLayer
from visray.data.touching import notes_of_touching


def timed_rows(timed: TimedLayer, moment: float) -> Rows:
    """The rows of a layer at a moment: one for each place that is shown at any date. Domain: no flaws."""
    now, layer, base, shown = timed.at(moment), timed.layer, timed.base, timed.shown
    ground = base.place(now.values["lon"], now.values["lat"])
    standing = Standing.of(layer, base, ground, now.sizes).with_hidden(now.hidden, base)
    stand, seen = standing.stand, ~now.hidden
    touching = notes_of_touching(
        shown.gizmo, base, _some(stand, seen), standing.lift[seen], timed.place[seen], now.color is not None
    )
    text = timed.timeline.moments.text(moment)
    return Rows(
        gizmo=shown.gizmo, geometry=layer.geometry, material=layer.material, number=timed.place, values=now.values,
        ground=ground, stand=stand, slopes=standing.signed(now.slopes), fields=shown.gizmo.fields(stand),
        color=None if now.color is None else now.color.T, texts=timed.texts, lift=standing.lift, rules=shown.rules,
        fitted=frozenset(shown.fitted), counts=timed.counts, notes=(*timed.notes, *now.notes, *touching),
        in_time=InTime(text, now.hidden, shown.t.values, timed.largest, timed.sizes),
    )  # fmt: skip


def _some(stand: Stand, mask: np.ndarray) -> Stand:
    """Some of the gizmos. mask: of them. Shape: (N)."""
    arrays = {name: x[..., mask] for name, x in vars(stand).items() if isinstance(x, np.ndarray)}
    return replace(stand, **arrays)
