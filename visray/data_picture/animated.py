"""The animation of a picture of a table: the date goes from the first to the last one, and a globe turns."""

from dataclasses import replace

import numpy as np

from visray.animation.animation import Animation
from visray.animation.keys import KeysTrack
from visray.animation.spin import SpinTrack
from visray.data.base import Base, GlobeBase
from visray.data.data_scene import Data
from visray.data.layer import DataLayer
from visray.data.resolve import timed_layer
from visray.data_picture.wishes import Wishes
from visray.errors import UserError

# Names of the tracks.
DATES, TURN = "dates", "turn"


def animation_of(layer: DataLayer, base: Base, wishes: Wishes) -> Animation | None:
    """The animation that a user asks for; None for none. Raises a UserError if nothing would move.

    Domain: the layer has no flaws.
    """
    if wishes.animate is None:
        return None
    is_globe = isinstance(base, GlobeBase)
    if wishes.turns and not is_globe:
        raise UserError("--turns: a map does not turn; leave it out, or write --base globe")
    turns = (1.0 if is_globe else 0.0) if wishes.turns is None else wishes.turns
    tracks, (first, last) = {}, _ends(layer, base)
    if first != last:
        tracks[DATES] = KeysTrack(address="data.date", times=(0.0, wishes.animate), values=(first, last))
    if turns:
        tracks[TURN] = SpinTrack(of="data.base", turns=turns)
    if not tracks:
        raise UserError(f"--animate: all rows have one date, {first}, so nothing moves; leave it out")
    return Animation(duration=wishes.animate, tracks=tracks)


def _ends(layer: DataLayer, base: Base) -> tuple[str, str] | tuple[float, float]:
    """The dates at which the animation begins and ends: texts, or plain numbers. Numbers that are held are shown until
    the end of the last month, day and so on."""
    time = timed_layer(layer, base).timeline
    (first, last), moments = time.limits, time.moments
    if not moments.calendar:
        return first, last
    return moments.text(first), moments.text(moments.end(last) if time.held and first != last else last)


def turns(animation: Animation | None) -> bool:
    """Whether the base turns."""
    return animation is not None and TURN in animation.tracks


def places_move(layer: DataLayer, base: Base) -> bool:
    """Whether places of a layer with a time move. Domain: the layer has no flaws."""
    timed = timed_layer(layer, base)
    time, moves = timed.timeline, np.zeros(len(timed.timeline), bool)
    for key in ("lon", "lat"):
        values = timed.shown.t.values[key][time.order]
        # A missing number is no move.
        moves |= np.fmax.reduceat(values, time.start[:-1]) > np.fmin.reduceat(values, time.start[:-1])
    return bool(moves[timed.place].any())


def with_names(data: Data, animation: Animation) -> tuple[Data, list[str]]:
    """The data with names of places only where they stand still, and a note if some are left out. Domain: the legend
    names all places."""
    [(name, rows)] = data.rows.items()
    more = "--places all writes all of them"
    layer = data.layers[name]
    if turns(animation) or places_move(layer, data.base):
        why = "globe turns" if turns(animation) else "places move"
        return _named(data, "none"), [f"the places have no names, which would jump while the {why}; {more}"]
    gone = _gone(layer, data.base)
    if not gone.any():
        return data, []
    kept = tuple(dict.fromkeys(text for text, left_out in zip(rows.texts, gone) if not left_out and text.strip()))
    text = f"{int(gone.sum()):,} of {len(rows):,} places have no name, as they are not shown at all dates; {more}"
    return _named(data, kept or "none"), [text]


def _named(data: Data, places: str | tuple[str, ...]) -> Data:
    """The data with the names of some places."""
    return replace(data, legend=replace(data.legend, places=places))


def _gone(layer: DataLayer, base: Base) -> np.ndarray:
    """Whether each place is not shown at some date. Shape: (number of places)."""
    timed = timed_layer(layer, base)
    number = timed.timeline.moments.number[timed.timeline.order]
    return np.logical_or.reduce([timed.at(moment).hidden for moment in np.unique(number).tolist()])
