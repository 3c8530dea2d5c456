"""The catalogue of known polynomial surfaces, by degree.

Expressions consist of + - * / ^, x y z, numbers, pi, phi (the golden ratio), sqrt(number) and parameters. They keep the
products and powers of the literature, because the expanded polynomials would be evaluated much less accurately.
"""

from visray.polynomials import known_cubics, known_higher, known_quartics
from visray.polynomials.known_surface import KnownSurface, View

__all__ = ["SURFACES", "KnownSurface", "View"]

SURFACES: dict[str, KnownSurface] = known_cubics.SURFACES | known_quartics.SURFACES | known_higher.SURFACES
