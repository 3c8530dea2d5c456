"""Widgets of viser for the controls of a scene: sliders, pickers and numbers."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from visray.live.controls import Control, Value
from visray.live.live import escaped
from visray.live.ranges import ENDLESS

# Each widget of a control is followed by its error and by the button that puts it back, which are mostly hidden.
ERROR, BACK, ORDERS = 1, 2, 4


class ControlWidget:
    """The widget of one control, which all browsers share.

    control: what it shows and changes; its value is that of the scene
    handle: the widget of viser
    """

    def __init__(
        self,
        gui: Any,
        folder: Any,
        control: Control,
        order: int,
        changed: Callable[["ControlWidget"], None],
        back: Callable[["ControlWidget"], None],
    ):
        """gui, folder: what adds widgets, and where. order: its place among others. changed: is called after somebody
        has moved it. back: is called when the button is pressed that puts the value back."""
        self.control, self._gui, self._folder, self._order, self._back = control, gui, folder, ORDERS * order, back
        with folder:
            self.handle = _added(gui, control, self._order)
        self.shown = self.handle.value
        self._error, self._button = None, None
        self.handle.on_update(lambda event: changed(self))

    @property
    def moved(self) -> bool:
        """Whether somebody has moved it since it was looked at, or since it was told what to show."""
        return self.handle.value != self.shown

    def taken(self) -> Value:
        """The value that it has been moved to."""
        self.shown = self.handle.value
        return value_of(self.control, self.shown)

    def follow(self, control: Control) -> None:
        """Shows the value of a control of the same address. What is assigned for it may have changed, too."""
        self.control = replace(self.control, rule=control.rule, center=control.center)
        self.show(control.value)

    def show(self, value: Value) -> None:
        """Shows a value of the scene. Its slider gets longer, if that is needed."""
        self.control = self.control.with_value(value)
        if value == value_of(self.control, self.shown):
            return
        if self.control.has_slider and hasattr(self.handle, "min"):
            for name, end in (("min", self.control.low), ("max", self.control.high)):
                if getattr(self.handle, name) != end and getattr(self.handle, name) is not None:
                    setattr(self.handle, name, end)
        self.shown = shown_as(self.control, value)
        self.handle.value = self.shown

    def say(self, text: str) -> None:
        """Shows an error below the widget; "" shows none."""
        if not text and self._error is None:
            return
        if self._error is None:
            with self._folder:
                self._error = self._gui.add_html("", order=self._order + ERROR)
        self._error.content = error_text(text) if text else ""
        self._error.visible = bool(text)

    def offer(self, back: str) -> None:
        """Shows a button that puts the value back. back: the value of the file, as text; "": no button."""
        if not back and self._button is None:
            return
        if self._button is None:
            hint = f"{self.control.address}: back to the value of the file"
            with self._folder:
                self._button = self._gui.add_button(
                    back, order=self._order + BACK, icon="arrow-back-up", color="gray", hint=hint
                )
            self._button.on_click(lambda event: self._back(self))
        self._button.label = back or self._button.label
        self._button.visible = bool(back)


def _added(gui: Any, control: Control, order: int) -> Any:
    """The widget of viser for a control."""
    common = {"hint": control.hint, "order": order, "disabled": bool(control.track)}
    shown, label = shown_as(control, control.value), control.label
    if control.kind in ("color", "share"):
        return gui.add_rgb(label, shown, **common)
    if control.kind == "range":
        return gui.add_multi_slider(label, control.low, control.high, control.step, shown, **common)
    if type(control.value) is tuple:
        add = gui.add_vector2 if len(control.value) == 2 else gui.add_vector3
        return add(label, shown, step=control.step, **common)
    if control.has_slider:
        return gui.add_slider(label, control.low, control.high, control.step, shown, **common)
    ends = {"min": control.low, "max": control.high}
    ends = {name: end for name, end in ends.items() if math.isfinite(end) and abs(end) < 10 * ENDLESS}
    return gui.add_number(label, shown, step=control.step, **ends, **common)


def shown_as(control: Control, value: Value) -> Any:
    """A value as a widget shows it: colours as numbers of a screen, from 0 to 255."""
    return control.with_value(value).picker if control.kind in ("color", "share") else value


def value_of(control: Control, shown: Any) -> Value:
    """The value that a widget shows. Digits that its steps leave behind are cut off."""
    if control.kind in ("color", "share"):
        return control.picked(shown)
    return tuple(map(rounded, shown)) if type(shown) is tuple else rounded(shown)


def rounded(x: float) -> float:
    """A number without the digits that only come from counting in steps, as in 0.30000000000000004."""
    return float(f"{x:.12g}")


def error_text(text: str) -> str:
    """An error as HTML."""
    style = "margin:0 0.8em 0.5em;padding-left:0.6em;border-left:3px solid #c92a2a;font-size:0.8em"
    return f'<div style="{style};overflow-wrap:anywhere">{escaped(text)}</div>'


def short(value: Any) -> str:
    """A value in a few characters."""
    if isinstance(value, tuple):
        return ", ".join(map(short, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
