"""Where a polynomial first crosses zero along a chord, with proof.

The chord is l + s e for s from -1 to 1. A polynomial surface is evaluated along it by its written structure, with
polynomials in s for numbers: so the coefficients are as good as the structure, and cost less than samples of it.

The march walks along the chord. On [a, a + w] the coefficients in Bernstein's basis bound the polynomial: if none of
them has the other sign, nothing is crossed there; if their sign changes once and the last is certain, it is crossed
exactly once. A coefficient within `noise` of zero counts as of the sign carried along, which is never computed anew:
so no crossing at the end of an interval is lost or found twice. Source: Collins and Akritas 1976; Lane and Riesenfeld
1981; Eigenwillig et al. 2005. What is isolate is refine on the surface's own structure (Chandrupatla 1997).
"""

from visray.roots.crossing import ChordSegment, first_crossing
from visray.roots.signed_distance import has_normal, signed_distance

__all__ = ["ChordSegment", "first_crossing", "has_normal", "signed_distance"]
