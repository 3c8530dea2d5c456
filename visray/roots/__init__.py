"""The first root of a polynomial along a chord, with a certificate.

The clip is the ball or box that bounds a polynomial surface. The chord is the part of a ray's line inside the clip: the
points centre + s axis for s from -1 to 1. The chord's polynomial in s is found by running the operations of the
surface's program on polynomials in s. This is as accurate as the expression was written, and costs less than
interpolation from samples.

Isolation finds an interval that contains the first root and no other. It goes along the chord from interval to
interval. In an interval, the Bernstein coefficients bound the polynomial. If all of them have the same sign, the
interval contains no root. If their signs change once, and the last coefficient is certainly not zero, the interval
contains exactly one root. A coefficient whose sign is lost in rounding is given the sign of the coefficient before it;
the first one is given the sign with which the interval is entered. That sign is never computed anew. So no root at the
end of an interval is lost or found twice.
Source: Collins and Akritas 1976; Lane and Riesenfeld 1981; Eigenwillig et al. 2005.

Refinement computes the isolated root to the last digit, with values of the program itself.
Source: Chandrupatla 1997.
"""

from visray.roots.chord import ChordSegment
from visray.roots.crossing import first_crossing
from visray.roots.signed_distance import has_normal, signed_distance

__all__ = ["ChordSegment", "first_crossing", "has_normal", "signed_distance"]
