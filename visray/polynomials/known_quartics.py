"""Known surfaces of degree 4. This module contains only data."""

from visray.polynomials.known_surface import KnownSurface, View, chebyshev, permuted, signed, sum_over

_T4 = "(2*(2*{0}^2 - 1)^2 - 1)"
_COS4 = {1: "1/sqrt(2)", 2: "0", 3: "-1/sqrt(2)"}
_KUMMER = (
    "(x^2 + y^2 + z^2 - mu^2)^2 - (3*mu^2 - 1)/(3 - mu^2)"
    "*(1 - z - sqrt(2)*x)*(1 - z + sqrt(2)*x)*(1 + z + sqrt(2)*y)*(1 + z - sqrt(2)*y)"
)

SURFACES: dict[str, KnownSurface] = {
    "report-quartic": KnownSurface(
        "VisRayTrace quartic", "0.9*x^2 + z^2 + y^4 + y^3 - 3*y^2 - 1", 3.5,
        "report on the original VisRayTrace", True,
        view=View((8, 3, 2.5)),
    ),
    "torus": KnownSurface(
        "Torus", "(x^2 + y^2 + z^2 + 21/25)^2 - 4*(x^2 + y^2)", 1.41, "elementary: radii 1 and 2/5", True,
        view=View((3, -8, 6)),
    ),
    "spindle-torus": KnownSurface(
        "Spindle torus", "(x^2 + y^2 + z^2 - 3/4)^2 - (x^2 + y^2)", 1.51, "elementary: radii 1/2 and 1", True,
        singular=signed(("0", "0", "sqrt(3)/2")), singular_count=2,
        view=View((3, -8, 3), clip=1.32),
    ),
    "dupin-cyclide": KnownSurface(
        "Dupin ring cyclide", "(x^2 + y^2 + z^2 + 3/16)^2 - 4*(x - 3/8)^2 - 3*y^2", 2.3,
        "MathWorld, Cyclide: a = 1, b^2 = 3/4, c = 1/2, d = 3/4", True,
        view=View((3, -4, 8)),
    ),
    "roman": KnownSurface(
        "Roman surface of Steiner", "x^2*y^2 + x^2*z^2 + y^2*z^2 - 2*x*y*z", 1.2, "Steiner 1844", False,
        singular=((0, 0, 0),) + signed(*permuted(("1", "0", "0"), ("1/2", "0", "0"))),
        singular_count=None, singular_curves="the three axes",
        view=View((5, -7, 5)),
    ),
    "cross-cap": KnownSurface(
        "Cross-cap", "4*x^2*(x^2 + y^2 + z^2 + z) + y^2*(y^2 + z^2 - 1)", 1.2, "MathWorld, Cross-Cap", False,
        singular=((0, 0, 0), (0, 0, "1/2"), (0, 0, 1), (0, 0, -1)),
        singular_count=None, singular_curves="the z axis",
        view=View((8, -3, 4)),
    ),
    "kummer": KnownSurface(
        "Kummer surface", _KUMMER, 3.5, "MathWorld, Kummer Surface: 16 nodes", False,
        parameters={"mu": 1.3},
        singular=(("0", "sqrt(mu^2 - 1)", "1"), ("0", "-sqrt(mu^2 - 1)", "1"),
                  ("sqrt(mu^2 - 1)", "0", "-1"), ("-sqrt(mu^2 - 1)", "0", "-1")),
        singular_count=16,
        view=View((8, -2, 3), clip=2.3),
    ),
    "tangle": KnownSurface(
        "Tangle cube", "x^4 - 5*x^2 + y^4 - 5*y^2 + z^4 - 5*z^2 + 59/5", 4.2, "MathWorld, Tanglecube", True,
        view=View((5, -8, 5)),
    ),
    "piriform": KnownSurface(
        "Piriform surface", "x^4 - x^3 + y^2 + z^2", 1.2, "MathWorld, Piriform Surface", True,
        singular=((0, 0, 0),), singular_count=1,
        view=View((-4, -6, 2.5), zoom=0.92),
    ),
    "chair": KnownSurface(
        "Chair", "(x^2 + y^2 + z^2 - a*k^2)^2 - b*((z - k)^2 - 2*x^2)*((z + k)^2 - 2*y^2)", 8.5,
        "MathWorld, Chair Surface", True,
        parameters={"a": 0.95, "b": 0.8, "k": 5.0},
        view=View((3, -8, 4)),
    ),
    "chmutov-4": KnownSurface(
        "Chmutov quartic", sum_over(_T4, " + 1"), 1.7321, "Chmutov 1992", True,
        singular=chebyshev(4, _COS4, (1, 3)), singular_count=12,
        view=View((5, -8, 5)),
    ),
    "kolibri": KnownSurface(
        "Kolibri", "x^3 + x^2*z^2 - y^2", 2.0, "Hauser's gallery", False,
        singular=((0, 0, 0), (0, 0, 1), (0, 0, "-1/2")),
        singular_count=None, singular_curves="the z axis",
        view=View((3, -8, 4)),
    ),
    "vis-a-vis": KnownSurface(
        "Vis à vis", "x^2 - x^3 + y^2 + y^4 + z^3 - z^4", 2.0, "Hauser's gallery", False,
        singular=((0, 0, 0),), singular_count=1,
        view=View((3, -8, 4)),
    ),
    "helix": KnownSurface(
        "Helix", "6*x^2 - 2*x^4 - y^2*z^2", 3.0, "Hauser's gallery", False,
        singular=((0, 0, 0), (0, 1, 0), (0, "-1/2", 0), (0, 0, 1), (0, 0, 2)),
        singular_count=None, singular_curves="the y and z axes",
        view=View((4, -8, 5)),
    ),
}  # fmt: skip
