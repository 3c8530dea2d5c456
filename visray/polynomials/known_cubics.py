"""Known surfaces of degrees 2 and 3. This module contains only data."""

from visray.polynomials.known_surface import KnownSurface, View

_CLEBSCH = (
    "81*(x^3 + y^3 + z^3) - 189*(x^2*(y + z) + y^2*(x + z) + z^2*(x + y)) + 54*x*y*z"
    " + 126*(x*y + y*z + z*x) - 9*(x^2 + y^2 + z^2) - 9*(x + y + z) + 1"
)

SURFACES: dict[str, KnownSurface] = {
    "hyperboloid": KnownSurface(
        "Hyperboloid of one sheet", "x^2 + y^2 - z^2 - 1", 3.0, "elementary", False,
        view=View((3, -8, 4)),
    ),
    "double-cone": KnownSurface(
        "Double cone", "x^2 + y^2 - z^2", 2.0, "elementary", False,
        singular=((0, 0, 0),), singular_count=1,
        view=View((3, -8, 4.5)),
    ),
    "cayley-cubic": KnownSurface(
        "Cayley cubic", "4*(x^2 + y^2 + z^2) + 16*x*y*z - 1", 2.0, "MathWorld, Cayley Cubic", False,
        singular=(("1/2", "1/2", "-1/2"), ("1/2", "-1/2", "1/2"), ("-1/2", "1/2", "1/2"), ("-1/2", "-1/2", "-1/2")),
        singular_count=4,
        view=View((2.5, -8, 1.8)),
    ),
    "clebsch-cubic": KnownSurface(
        "Clebsch diagonal cubic", _CLEBSCH, 1.5, "MathWorld, Clebsch Diagonal Cubic: 27 real lines", False,
        view=View((1.3, -0.7, 0.4), up=(1, 1, 1)),
    ),
    "ding-dong": KnownSurface(
        "Ding-dong", "x^2 + y^2 + z^3 - z^2", 2.0, "Hauser's gallery", False,
        singular=((0, 0, 0),), singular_count=1,
        view=View((3, -8, 3.5)),
    ),
    "whitney-umbrella": KnownSurface(
        "Whitney umbrella", "x^2 - y^2*z", 2.0, "Whitney 1944", False,
        singular=((0, 0, 0), (0, 0, "1/2"), (0, 0, "1"), (0, 0, "-1/2")),
        singular_count=None, singular_curves="the z axis",
        view=View((8, -2, 6)),
    ),
    "monkey-saddle": KnownSurface(
        "Monkey saddle", "z - x^3 + 3*x*y^2", 1.5, "MathWorld, Monkey Saddle", False,
        view=View((-2, -8, 6), clip=0.95),
    ),
}  # fmt: skip
