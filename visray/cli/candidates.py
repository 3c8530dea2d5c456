"""What the shell may complete in place of a value: layers, addresses in the scene, known surfaces.

Each function gets cyclopts' CompletionContext, and is called when the user presses Tab. The shell keeps what begins
with the word so far.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.output.layers import NAMES
from visray.scene.source import read

# Of a scene with more addresses, only so many are offered.
MOST = 5000


def layers(context: Any) -> list[str]:
    """Names of layers, behind those that are written already with commas between."""
    before, comma, _ = context.incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in NAMES if name not in before.split(",")]


def addresses(context: Any) -> list[str]:
    """The addresses that the scene's file has, each with an equals sign."""
    scene = context.get("scene")
    try:
        raw = read(Path(scene.raw)).raw if scene is not None and scene.provided else {}
    except UserError:
        return []
    found = (f"{address}=" for address in _addresses(raw, ""))
    return [address for address, _ in zip(found, range(MOST))]


def _addresses(node: Any, prefix: str) -> Iterator[str]:
    """Addresses of the values below a node. prefix: its address, and a dot."""
    for key, value in node.items() if isinstance(node, dict) else ():
        if key == "$schema":
            continue
        if isinstance(value, dict):
            yield from _addresses(value, f"{prefix}{key}.")
        else:
            yield prefix + key


def surfaces(_: Any) -> list[str]:
    """Names of the known surfaces."""
    from visray.polynomials.catalogue import SURFACES

    return list(SURFACES)
