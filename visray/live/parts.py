"""The parts of the page of a live picture, in the order in which they are built (live.py says what a part is)."""

from importlib import import_module
from importlib.util import find_spec

from visray.live.live import Live

PARTS = (
    ("visray.live.status", "StatusPart"),
    ("visray.live.panel", "PanelPart"),
    ("visray.live.pixel_part", "PixelPart"),
    ("visray.live.handles", "HandlesPart"),
    ("visray.live.effects", "EffectsPart"),
    ("visray.live.error_chart", "ErrorChartPart"),
    ("visray.live.saving", "SavingPart"),
    ("visray.live.watching", "WatchingPart"),
)


def build(live: Live) -> list:
    """Builds all parts."""
    return [getattr(import_module(m), name)(live) for m, name in PARTS if find_spec(m) is not None]
