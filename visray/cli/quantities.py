"""Numbers with a unit on the command line: an error such as 1%, and a time such as 2min."""

import re
from collections.abc import Sequence
from math import isfinite

from cyclopts import Token

from visray.errors import UserError

# Seconds of each unit of time.
UNITS = {
    "": 1.0, "ms": 1e-3,
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("m", "min", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hour", "hours"), 3600.0),
}  # fmt: skip
_WITH_UNIT = re.compile(r"(.*?)\s*([a-z]*)", re.DOTALL)


def parse_integer(_: type, tokens: Sequence[Token]) -> int:
    """The integer in the first token. Raises a UserError for any other text, also for 1.5, which cyclopts itself would
    round."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise UserError(f"{_option(tokens[0])} = {tokens[0].value!r}: must be a whole number, such as 16") from None


def parse_share(_: type, tokens: Sequence[Token]) -> float:
    """The error in the first token, as a share: 0.01, or as a percentage: 1% is 0.01. Raises a UserError for any other
    text, and for an error that is not below 100 %."""
    option, text = _option(tokens[0]), tokens[0].value.strip()
    percent = text.endswith("%")
    number = _number(text.removesuffix("%"))
    share = number / 100 if percent else number
    if isfinite(share) and share >= 1:
        right = "write 1% or 0.01"
        if not percent and share < 100:
            right = f"write {number:g}% or {number / 100:g}"
        raise UserError(f"{option} = {text}: would be {100 * share:g} %, and an error is below 100 %; {right}")
    if not share > 0:
        raise UserError(f"{option} = {text!r}: must be an error above 0 and below 100 %, such as 1% or 0.01")
    return share


def parse_seconds(_: type, tokens: Sequence[Token]) -> float:
    """Seconds from the first token: 20, 20s, 2min, 1h, 500ms. Raises a UserError for any other text."""
    option, text = _option(tokens[0]), tokens[0].value.strip()
    digits, unit = _WITH_UNIT.fullmatch(text.lower()).groups()
    number = _number(digits)
    if unit not in UNITS or not isfinite(number):
        raise UserError(f"{option} = {text!r}: must be a time, such as 20 or 20s, 2min, 1h")
    return number * UNITS[unit]


def _number(text: str) -> float:
    """The number that a text is; NaN if it is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _option(token: Token) -> str:
    """The option as it is written on the command line."""
    return token.keyword or "the value"
