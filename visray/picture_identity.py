"""The identity of a picture: all that the bits of its samples depend on, except the machine."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from visray.errors import UserError
from visray.filters import STEPS, sign_steps
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.version import __version__

ANOTHER_SCENE = "is of another scene"
NO_REGION = "no region"


class PictureIdentity:
    """Everything that the bits of a film depend on, except the machine. Films of the same picture have equal
    identities.

    The number of samples is included for the stratified sampler only, because it decides the strata; and for a filter
    with negative weights, if it is even and no multiple of STEPS, because it decides how often they are drawn.

    facts: version, backend, precision, size, region, seed, sampler, spp, and the hash of the scene without these
    """

    def __init__(
        self,
        scene: Scene | None = None,
        a: Arrays | None = None,
        shutter: Any = None,
        facts: dict[str, Any] | None = None,
    ):
        """shutter: the moments at which samples see the scene, as Prepared.shutter."""
        self._scene, self._a, self._shutter, self._facts = scene, a, shutter, facts

    @cached_property
    def facts(self) -> dict[str, Any]:
        """The facts by name. Computed when first read, because the hash of a large scene takes a while."""
        if self._facts is not None:
            return self._facts
        scene, s = self._scene, self._scene.settings
        # The accelerator is left out: what "auto" chooses depends on the scene alone, and the others change no bit but
        # the last one of coloured shadows through several transparent objects.
        settings = replace(s, seed=0, spp=1, accelerator="auto")
        few_signs = scene.film.filter.may_be_negative and sign_steps(s.spp) < STEPS
        hashed = replace(scene, settings=settings, film=scene.film.resized((1, 1)))
        return {
            "visray": __version__,
            "backend": self._a.backend,
            "precision": s.precision,
            "size": [*scene.film.size],
            "region": scene.film.region and [*scene.film.region],
            "seed": s.seed,
            "sampler": s.sampler,
            "spp": s.spp if s.sampler == "stratified" or few_signs else None,
            "scene": self._shutter.hash(hashed) if self._shutter else hashed.hash(),
        }

    @staticmethod
    def of_this_program(facts: dict[str, Any], a: Arrays) -> "PictureIdentity":
        """The identity of a picture with these facts, if this version of visray makes it with the types `a`."""
        return PictureIdentity(facts=facts | {"visray": __version__, "backend": a.backend, "precision": a.precision})

    def check(self, other: "PictureIdentity", name: str) -> None:
        """Raises UserError if `other` is the identity of another picture, because films of two pictures cannot be
        combined.

        name: what the message calls the film with the `other` identity
        """
        if difference := self.difference(other):
            remedy = "a film of this one" if difference == ANOTHER_SCENE else "another"
            raise UserError(f"{name}: {difference}; give {remedy}, or begin anew")

    def difference(self, other: "PictureIdentity") -> str | None:
        """What tells the picture of the identity `other` from this one, as a predicate such as "is of seed 7, not 0";
        None if it is the same picture."""
        same = self._scene is other._scene and self._a == other._a and self._shutter is other._shutter
        if self is other or (same and self._scene is not None):
            return None
        for fact, value in self.facts.items():
            if (theirs := other.facts.get(fact)) != value:
                return ANOTHER_SCENE if fact == "scene" else f"is of {_named(fact, theirs)}, not {_shown(fact, value)}"
        return None


def raster_of(facts: Mapping[str, Any]) -> tuple[int, int]:
    """Width and height in pixels of what is rendered, by the facts of a picture's identity."""
    width, height = map(int, facts["size"])
    left, top, right, bottom = map(int, facts["region"] or (0, 0, width, height))
    return right - left, bottom - top


def _named(fact: str, value: Any) -> str:
    """A fact with its name, as text for messages."""
    shown = _shown(fact, value)
    return shown if shown == NO_REGION else f"{fact} {shown}"


def _shown(fact: str, value: Any) -> str:
    """The value of a fact as text for messages; a size as `width x height`."""
    if fact == "region" and not value:
        return NO_REGION
    if fact == "spp" and value is None:
        return f"a multiple of {STEPS}, or odd"
    return " x ".join(map(str, value)) if fact == "size" and isinstance(value, list) else str(value)
