"""The share of light that a smooth surface reflects, by the angle at which light meets it.

Source: Born and Wolf, Principles of Optics, 1.5.2; Pharr, Jakob and Humphreys, Physically Based Rendering, 9.3.5;
Schlick, An Inexpensive BRDF Model for Physically-Based Rendering, 1994.
"""

from typing import Any

import drjit as dr


def dielectric(cosine: Any, ratio: Any) -> Any:
    """Fresnel reflectance of unpolarised light at an interface of two dielectrics: the mean of the reflectances of both
    polarisations. Beyond the critical angle it is 1.

    cosine: |cosine| of the angle between the ray and the normal, from 0 to 1, in double
    ratio: index of refraction on the side that the ray comes from divided by the index on the other side, > 0, in
        double

    Where both indices are equal, the reflectance is exactly 0. The derivative by either argument grows without limit
    where the angle comes near the critical angle from below; beyond it, the derivative is 0.
    Error: absolute, at most gamma(24), and 1e-7 within 1e-14 of the critical angle, where the square root has an
        infinite slope (tests/test_fresnel.py).
    """
    # This form of 1 - ratio^2 sin^2 loses no digits where the indices are nearly equal.
    squared = dr.square(cosine) + (1 - ratio) * (1 + ratio) * (1 - dr.square(cosine))
    passes = squared > 0
    behind = dr.sqrt(dr.select(passes, squared, 1))
    # The Fresnel equations, with both fractions over the same denominator.
    s_sum, p_sum = dr.fma(ratio, cosine, behind), dr.fma(ratio, behind, cosine)
    s_difference, p_difference = ratio * cosine - behind, cosine - ratio * behind
    both = s_sum * p_sum
    reflectance = 0.5 * (dr.square(s_difference * p_sum) + dr.square(p_difference * s_sum)) / dr.square(both)
    return dr.select(ratio == 1, 0, dr.select(passes, reflectance, 1))


def thin_sheet(reflectance: Any) -> Any:
    """Reflectance of a thin sheet with two equal surfaces: R + T R T + T R^3 T + ... = 2 R / (1 + R), with T = 1 - R.

    reflectance: that of one of its surfaces, R
    """
    return 2 * reflectance / (1 + reflectance)


def schlick(cosine: Any) -> Any:
    """(1 - cosine)^5, the weight w of Schlick's approximation of a metal's reflectance: kr + (1 - kr) w.

    cosine: |cosine| of the angle between the ray and the normal, from 0 to 1
    """
    rest = dr.maximum(1 - cosine, 0)
    squared = dr.square(rest)
    return dr.square(squared) * rest
