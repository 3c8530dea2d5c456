"""Hints at what may replace a wrong word."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

# Largest number of choices that a hint lists, and of those in which it looks for a similar one.
LISTED, COMPARED = 60, 200
# Words of other programs, and what they are called here. One counts only where it is a choice.
OTHER_WORDS = {"samples": "spp", "sample": "spp", "samples_per_pixel": "spp", "resolution": "size", "bounces": "depth"}


def hint(word: Any, choices: Iterable[str], quote: str = '"') -> str:
    """Hint at what may replace a wrong word, such as `did you mean "sphere"? (one of box, sphere)`. If no choice is
    similar to the word, the hint only lists the choices.

    quote: quotation mark around the suggested word.
    """
    choices = list(choices)
    more = f", and {len(choices) - LISTED} more" if len(choices) > LISTED else ""
    listed = f"one of {', '.join(choices[:LISTED])}{more}" if choices else "there is none"
    found = similar(word, choices) if isinstance(word, str) else []
    return f"did you mean {quote}{found[0]}{quote}? ({listed})" if found else listed


def similar(word: str, choices: list[str]) -> list[str]:
    """List of the choices that are similar to a word, the best first: `kd` for `Kd`, `radius` for `radus`, `spp` for
    `samples`. Choices may be options: `--spp` for `--samples`."""
    if same := [c for c in choices if c.casefold() == word.casefold()]:
        return same
    plain = word.lstrip("-")
    other = OTHER_WORDS.get(plain.casefold().replace("-", "_"))
    if other and (named := word.removesuffix(plain) + other) in choices:
        return [named]
    if len(choices) > COMPARED:
        choices = [c for c in choices if c[:1].casefold() == word[:1].casefold()][:COMPARED]
    return get_close_matches(word, choices, 1)
