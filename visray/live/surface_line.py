"""The command line of `visray surface` that makes the picture of a surface again, as it is seen in the browser."""

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace

from visray.errors import UserError
from visray.live.reproducing import Seen, Wish
from visray.scene.address import changed, parse_assignments
from visray.scene.scene import Scene
from visray.scene.write import value_text
from visray.surface_picture.reading import SURFACE
from visray.surface_picture.recipe import Recipe, different, fitted_values


def surface_line(recipe: Recipe, seen: Seen, wish: Wish, outputs: Sequence[str] = ()) -> str:
    """The command line that makes the picture again, for a shell: the shortest of those that are known to do so.

    recipe: of the scene before changes in the browser
    outputs: names of the files to write

    Raises UserError if no command line makes this picture.
    """
    wanted = seen.as_file()
    size = wish.size or wanted.film.size
    wanted = replace(wanted, film=wanted.film.resized(size))
    lines = list(_lines(recipe, wanted, seen.edits, size))
    if not lines:
        raise UserError("no command line makes this scene; download it, and render that file")
    more = [*replace(wish, size=None).words(), *(word for name in outputs for word in ("-o", name))]
    words = min(lines, key=lambda line: len(shlex.join(line)))
    # What stands behind two hyphens stays at the end.
    end = words.index("--") if "--" in words else len(words)
    return shlex.join([*words[:end], *more, *words[end:]])


def _lines(recipe: Recipe, wanted: Scene, edits: Sequence[str], size: tuple[int, int]) -> Iterator[list[str]]:
    """The words of command lines that make the scene `wanted`: with the parameters as they were, and as they are."""
    for values in ({}, wanted.objects[SURFACE].parameters):
        again = recipe.with_values(values, size)
        try:
            base, _ = again.picture()
        except UserError:
            continue
        texts = [f"{a}={value_text(x)}" for a, x in fitted_values(base, wanted).items()]
        texts += [f"{a}={value_text(x)}" for a, x in different(base, wanted, edits).items() if not _has(texts, a)]
        made = changed(base, parse_assignments(texts)) if texts else base
        if made.hash() == wanted.hash():
            yield replace(again, settings=(*recipe.settings, *texts)).words()


def _has(texts: list[str], address: str) -> bool:
    """Whether one of the assignments sets a value."""
    return any(text.startswith(f"{address}=") for text in texts)
