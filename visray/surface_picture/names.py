"""Names of the known surfaces, as people write them."""

import re
from itertools import islice

from visray.hints import similar
from visray.polynomials.catalogue import SURFACES

# Most names that a hint offers.
OFFERED = 3


def known_name(text: str) -> str | None:
    """The name of a known surface in a text, whatever its capitals: barth-sextic, Barth sextic or its title. None if
    the text names none."""
    word = _plain(text)
    titles = {_plain(known.title): name for name, known in SURFACES.items()}
    return {_plain(name): name for name in SURFACES}.get(word) or titles.get(word)


def near_names(text: str) -> list[str]:
    """Names of known surfaces that are similar to a text, or that have its words."""
    word = _plain(text)
    found = similar(word, list(SURFACES))
    parts = set(word.split("-"))
    having = (name for name in SURFACES if parts <= set(name.split("-")) or (len(word) > 3 and word in name))
    return list(dict.fromkeys([*found, *islice(having, OFFERED)]))[:OFFERED]


def advice(text: str) -> str:
    """What to write in place of a text that names no surface: `did you mean "klein-bottle"?`; "" if nothing is near."""
    near = " or ".join(f'"{name}"' for name in near_names(text))
    return f"did you mean {near}?" if near else ""


def _plain(text: str) -> str:
    """A text in small letters with hyphens."""
    return re.sub(r"[\s_-]+", "-", text.strip()).casefold()
