"""The first root of a polynomial along a chord, with a certificate.

The chord is the set of points centre + s axis for s from -1 to 1. A polynomial surface is evaluated along it by the
operations of its program, applied to polynomials in s. So the coefficients are as accurate as the expression was
written, and they cost less than interpolation from samples.

Isolation: a march walks along the chord. On an interval [a, a + w] the Bernstein coefficients bound the polynomial. If
no coefficient has the other sign, there is no root in the interval. If the signs change once and the last coefficient
is certain, there is exactly one root. A coefficient that is within rounding noise of zero takes the sign that is
carried along, and that sign is never computed again. So no root at the end of an interval is lost or found twice.
Source: Collins and Akritas 1976; Lane and Riesenfeld 1981; Eigenwillig et al. 2005.

Refinement: the isolated root is refined with values of the program itself. Source: Chandrupatla 1997.
"""

from visray.roots.chord import ChordSegment
from visray.roots.crossing import first_crossing
from visray.roots.signed_distance import has_normal, signed_distance

__all__ = ["ChordSegment", "first_crossing", "has_normal", "signed_distance"]
