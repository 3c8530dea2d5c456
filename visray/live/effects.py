"""The part of the page of a live picture that switches effects, and measures what they cost."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from visray import clock
from visray.features import Feature, features
from visray.live.engine import Change
from visray.live.live import Live, escaped
from visray.live.measuring import EffectCost, Measurement
from visray.live.tabs import tab
from visray.setup import Prepared

# Seconds between two reports of how far a measurement is.
PAUSE = 0.2
END = object()
MEASURE = "Measure what each costs"


@dataclass
class Row:
    """What the page shows of an effect: a switch, and a line of text."""

    switch: Any
    text: Any


class EffectsPart:
    """Switches of effects, each with its reason, and with its cost if that was measured.

    A measurement is of the picture of the browser that asks for it. It is done in short pieces in the thread that
    renders, so pictures go on meanwhile. Costs are dropped when the scene or its effects become others, and marked when
    values of the scene change.
    """

    def __init__(self, live: Live):
        self.live, self._lock = live, threading.RLock()
        self.listed: tuple[Feature, ...] = ()
        self.rows: dict[str, Row] = {}
        self.measurement: Measurement | None = None
        self.pieces: Iterator[None] | None = None
        self.is_stale, self.told_at, self.told = False, 0.0, ""
        # When the first effect was begun, and when each one was done.
        self.moments: list[float] = []
        self.size = ""
        gui = live.server.gui
        with tab(live.server, "Price"), gui.add_folder("Effects", order=2):
            self.button = gui.add_button(MEASURE, hint="What each costs on this machine. Takes some seconds for each")
            self.state = gui.add_html("")
            self.folder = gui.add_folder(None)
            with gui.add_folder("Not needed by the scene", expand_by_default=False):
                self.absent = gui.add_html("")
        self.button.on_click(live.safely(self.pressed))
        live.engine.on_scene(self.changed)
        live.on_stop(self.cancel)
        self._list_again()

    # Which effects there are.

    def changed(self, change: Change) -> None:
        """The scene has changed. In the thread that renders."""
        if change.kind in ("scene", "effects"):
            self.cancel()
            self.measurement = None
        elif self.measurement is not None:
            self.is_stale = True
        self._list_again()

    def _list_again(self) -> None:
        """Shows the effects as they are now."""
        viewer = next((c.viewer for c in self.live.clients.values()), None)
        self.live.engine.ask(lambda prepared: self.show(prepared, self.live.engine.left_out), viewer)

    def show(self, prepared: Prepared, off: tuple[str, ...]) -> None:
        """Shows the effects of a scene, with switches for those that it needs. off: those that somebody has switched
        off"""
        listed = prepared.features.listed
        with self._lock:
            if [(f.name, f.on, f.reason) for f in listed] != [(f.name, f.on, f.reason) for f in self.listed]:
                self.listed = listed
                needed = {f.name for f in listed if f.on} | set(off)
                if off:
                    # Effects that only refine one that is off are shown, but cannot be switched.
                    needed |= set(features(prepared.scene).names())
                self._make_rows([f for f in listed if f.name in needed])
                for f in listed:
                    if f.name in needed:
                        row = self.rows[f.name]
                        row.switch.value, row.switch.disabled = f.on, not (f.on or f.name in off)
                self.absent.content = absent_text([f for f in listed if f.name not in needed])
            self._show_costs()

    def _make_rows(self, shown: list[Feature]) -> None:
        """Makes a row for each effect, unless they are there."""
        if list(self.rows) == [f.name for f in shown]:
            return
        for row in self.rows.values():
            row.switch.remove()
            row.text.remove()
        self.rows = {}
        for f in shown:
            with self.folder:
                switch = self.live.server.gui.add_checkbox(f.name, f.on)
                self.rows[f.name] = Row(switch, self.live.server.gui.add_html(""))
            switch.on_update(self.live.safely(self.switched))

    def switched(self, event: Any) -> None:
        """Somebody has switched an effect."""
        if event.client is None:
            return
        off = (name for name, row in self.rows.items() if not (row.switch.value or row.switch.disabled))
        self.live.engine.leave_out(tuple(off))

    # What they cost.

    def pressed(self, event: Any) -> None:
        """The button: begins to measure, or ends it."""
        if self.pieces is not None:
            self.cancel()
            return
        client = self.live.client_of(event)
        self.button.label, self.is_stale = "Stop", False
        self.state.content = _small("preparing")
        self.live.engine.ask(self._begin, client and client.viewer).add_done_callback(self._go_on)

    def _begin(self, prepared: Prepared) -> None:
        """Begins to measure. In the thread that renders."""
        self.measurement, self.moments = Measurement(prepared), []
        self.pieces = self.measurement.pieces()
        self.size = "{} x {}".format(*prepared.scene.film.raster)

    def _go_on(self, piece: Any) -> None:
        """Asks for the next piece of work after one. In the thread that renders."""
        if piece.cancelled():
            return
        error = piece.exception()
        if error is not None:
            self.live.tell(f"the costs cannot be measured: {error}", bad=True)
        if error is not None or self.pieces is None or piece.result() is END:
            self.cancel()
            return
        now, doing = clock.now(), self.measurement.doing
        if self.measurement.number and len(self.moments) == len(self.measurement.costs):
            self.moments.append(now)
        # What comes next may take seconds.
        if now - self.told_at > PAUSE or doing != self.told:
            self.told_at, self.told = now, doing
            self._show_costs()
        pieces = self.pieces
        self.live.engine.ask(lambda _: next(pieces, END)).add_done_callback(self._go_on)

    def cancel(self) -> None:
        """Ends a measurement. Costs that are known stay."""
        self.pieces = None
        self.button.label = MEASURE
        self._show_costs()

    def _show_costs(self) -> None:
        """Shows what is known of the costs."""
        with self._lock:
            measurement = self.measurement
            costs = measurement.costs if measurement else {}
            reasons = {f.name: f.reason for f in self.listed}
            for name, row in self.rows.items():
                text = row_text(reasons[name], costs.get(name))
                if row.text.content != text:
                    row.text.content = text
            self.state.content = (
                progress_text(measurement, self.moments, clock.now())
                if measurement and self.pieces is not None
                else state_text(measurement, self.is_stale, self.size)
            )


def row_text(reason: str, cost: EffectCost | None) -> str:
    """The line below a switch, as HTML.

    reason: why the effect is simulated
    cost: what it costs; None if that was not measured
    """
    if cost is None:
        return _small(escaped(reason))
    along = f" (with {escaped(', '.join(cost.along))})" if cost.along else ""
    return _small(f"<b>{escaped(cost.text())}</b>{along}<br>{escaped(reason)}")


def absent_text(absent: list[Feature]) -> str:
    """The effects that are not simulated, each with the reason, as HTML."""
    return "".join(_small(f"<b>{escaped(f.name)}</b>: {escaped(f.reason)}") for f in absent)


def progress_text(measurement: Measurement, moments: list[float], now: float) -> str:
    """How far a measurement is, as HTML.

    moments: when the first effect was begun, and when each one was done, in seconds; now: the same for now
    """
    total = len(measurement.effects)
    where = f"effect {measurement.number} of {total}: " if measurement.number else ""
    left, done = "", len(moments) - 1
    if done > 0:
        each = (moments[-1] - moments[0]) / done
        left = f"; about {seconds_text(each * (total - done) - (now - moments[-1]))} left"
    bar = f"height:4px;width:{100 * measurement.share_done:.0f}%;background:#228be6;border-radius:2px"
    return _small(f'{escaped(where + measurement.doing + left)}<div style="{bar}"></div>')


def seconds_text(seconds: float) -> str:
    """A time that is about to pass, such as 20 s or 3 min."""
    seconds = max(seconds, 1)
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def state_text(measurement: Measurement | None, is_stale: bool, size: str) -> str:
    """What is said above the switches when nothing is measured, as HTML."""
    if measurement is None or measurement.total is None:
        return ""
    took = f"One sample of each of {size} pixels took {1e3 * measurement.total.middle:.3g} ms"
    stale = " before the last change of the scene" if is_stale else ""
    return _small(escaped(f"{took}{stale}. Medians of the time of kernels, with 99 % intervals."))


def _small(text: str) -> str:
    """Small text, as HTML. text: HTML"""
    style = "padding:0 1em 0.5em;font-size:0.78em;opacity:0.75;overflow-wrap:anywhere"
    return f'<div style="{style}">{text}</div>'
