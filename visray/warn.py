"""Warnings with the place in the user's program that they are about."""

import sys
import warnings
from pathlib import Path

PACKAGE = str(Path(__file__).parent)
# The place at which each text was said first, and Python's record of the warnings that were shown. A text has one
# place, so Python shows it once, however many lines of the program lead to it.
_PLACES: dict[tuple[str, type[Warning]], tuple[str, int]] = {}
_SHOWN: dict = {}
# What was said once and for all: texts, each with what it is about.
_SAID: set[tuple[str, str]] = set()


def warn_once(text: str, category: type[Warning], about: str) -> None:
    """Warns the user of what is said once in a process, whatever Python's filters of warnings let through.

    about: what the text is about; of something else it is said again
    """
    if (text, about) not in _SAID:
        _SAID.add((text, about))
        warn(text, category)


def warn(text: str, category: type[Warning]) -> None:
    """Warns the user. The place of the warning is the line of the program that called visray."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame = frame.f_back
    place = _PLACES.setdefault((text, category), (frame.f_code.co_filename, frame.f_lineno))
    warnings.warn_explicit(text, category, *place, registry=_SHOWN)
