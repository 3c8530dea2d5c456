"""Which keys of a track are looked at in whole scenes. A scene takes milliseconds, and a track may have thousands of
keys, so all keys are checked by the type of their field, and a few in scenes.
"""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass

from pydantic import TypeAdapter, ValidationError

from visray.scene.edits import entry_of, is_below_layer, with_value
from visray.scene.messages import MOST
from visray.scene.scene import Scene
from visray.scene.validated import plain

# Largest number of scenes in which the right keys of a track, or the moments of an animation, are looked at.
MOST_SCENES = 64


def spread(items: Sequence, most: int = MOST_SCENES) -> list:
    """All items, or if there are more than `most` so many of them at even steps, with the first and the last one."""
    last = len(items) - 1
    return list(items) if last < most else [items[k * last // (most - 1)] for k in range(most)]


def keys_to_check(scene: Scene, address: str, values: tuple) -> list[int]:
    """Numbers of the keys that are to be looked at in a scene: those whose values the type of the field refuses, as
    many as messages are shown, and some of all others.

    Domain: an address of the scene. Its own value has the form of the values.
    """
    wrong = [] if len(values) <= MOST_SCENES or is_below_layer(scene, address) else _refused(scene, address, values)
    return sorted({*wrong[: MOST + 1], *spread(range(len(values)))})


def _refused(scene: Scene, address: str, values: tuple) -> list[int]:
    """Numbers of the values that the type of the field at an address refuses."""
    keys, node, found = address.split("."), scene, None
    for i, key in enumerate(keys):
        if is_dataclass(node):
            found = node, key, keys[i + 1 :]
        node = entry_of(node, key)
    owner, name, inner = found
    [annotation] = (f.type for f in fields(owner) if f.name == name)
    current = plain(getattr(owner, name))
    try:
        TypeAdapter(tuple[annotation, ...]).validate_python(tuple(with_value(current, inner, x) for x in values))
    except ValidationError as error:
        return sorted({e["loc"][0] for e in error.errors(include_url=False, include_context=False)})
    return []
