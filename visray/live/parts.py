"""The parts of the page of a live picture, in the order in which they are built (live.py says what a part is)."""

from typing import Any

from visray.live.effects import EffectsPart
from visray.live.error_chart import ErrorChartPart
from visray.live.fitting import FittingPart
from visray.live.handles import HandlesPart
from visray.live.live import Live
from visray.live.notices import NoticesPart
from visray.live.panel import PanelPart
from visray.live.pixel_part import PixelPart
from visray.live.saving import SavingPart
from visray.live.status import StatusPart
from visray.live.watching import WatchingPart

PARTS = (
    StatusPart, NoticesPart, FittingPart, PanelPart, PixelPart, HandlesPart, ErrorChartPart, EffectsPart, SavingPart,
    WatchingPart,
)  # fmt: skip


def build(live: Live) -> list[Any]:
    """Builds all parts."""
    return [part(live) for part in PARTS]
