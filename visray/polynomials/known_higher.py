"""Known surfaces of degree 5 and more. This module contains only data."""

from visray.polynomials.known_surface import KnownSurface, View, chebyshev, permuted, signed, sum_over

_T6 = "(2*(4*{0}^3 - 3*{0})^2 - 1)"
_T8 = "(2*(2*(2*{0}^2 - 1)^2 - 1)^2 - 1)"
_COS6 = {1: "sqrt(3)/2", 2: "1/2", 3: "0", 4: "-1/2", 5: "-sqrt(3)/2"}
_COS8 = {1: "sqrt(2 + sqrt(2))/2", 2: "1/sqrt(2)", 3: "sqrt(2 - sqrt(2))/2", 4: "0"}
_COS8 |= {8 - i: "-" + v for i, v in _COS8.items() if i < 4}
_TOGLIATTI = (
    "64*(x - 1)*(x^4 - 4*x^3 - 10*x^2*y^2 - 4*x^2 + 16*x - 20*x*y^2 + 5*y^4 + 16 - 20*y^2)"
    " - 5*sqrt(5 - sqrt(5))*(2*z - sqrt(5 - sqrt(5)))*(4*(x^2 + y^2 - z^2) + 1 + 3*sqrt(5))^2"
)
_ENDRASS = (
    "64*(x^2 - 1)*(y^2 - 1)*((x + y)^2 - 2)*((x - y)^2 - 2) - (-4*(1 + sqrt(2))*(x^2 + y^2)^2"
    " + (8*(2 + sqrt(2))*z^2 + 2*(2 + 7*sqrt(2)))*(x^2 + y^2) - 16*z^4 + 8*(1 - 2*sqrt(2))*z^2 - (1 + 12*sqrt(2)))^2"
)
_DECIC = (
    "8*(x^2 - phi^4*y^2)*(y^2 - phi^4*z^2)*(z^2 - phi^4*x^2)"
    "*(x^4 + y^4 + z^4 - 2*x^2*y^2 - 2*x^2*z^2 - 2*y^2*z^2)"
    " + (3 + 5*phi)*(x^2 + y^2 + z^2 - 1)^2*(x^2 + y^2 + z^2 - (2 - phi))^2"
)
# alpha is the real root of 7 a^3 + 7 a + 1. The grammar cannot express alpha exactly. As a double it has an error of at
# most 2^-56, which changes f by no more than rounding to double does. So the nodes are exact only to within rounding.
_LABS = (
    "x*(x^6 - 21*x^4*y^2 + 35*x^2*y^4 - 7*y^6) + 7*z*((x^2 + y^2)^3 - 8*z^2*(x^2 + y^2)^2 + 16*z^4*(x^2 + y^2))"
    " - 64*z^7 - (z + 49*alpha^2 - 7*alpha + 50)*((z + 1)*(x^2 + y^2) - (12/7*alpha^2 + 384/49*alpha + 8/7)*z^3"
    " - (32/7*alpha^2 - 24/49*alpha + 4)*z^2 - (4*alpha^2 - 24/49*alpha + 4)*z"
    " - (8/7*alpha^2 - 8/49*alpha + 8/7))^2"
)
_BOY = (
    "64*(1 - z)^3*z^3 - 48*(1 - z)^2*z^2*(3*x^2 + 3*y^2 + 2*z^2)"
    " + 12*(1 - z)*z*(27*(x^2 + y^2)^2 - 24*z^2*(x^2 + y^2) + 36*sqrt(2)*y*z*(y^2 - 3*x^2) + 4*z^4)"
    " + (9*x^2 + 9*y^2 - 2*z^2)*(-81*(x^2 + y^2)^2 - 72*z^2*(x^2 + y^2) + 108*sqrt(2)*x*z*(x^2 - 3*y^2) + 4*z^4)"
)
_KLEIN = "(x^2 + y^2 + z^2 + 2*y - 1)*((x^2 + y^2 + z^2 - 2*y - 1)^2 - 8*z^2) + 16*x*z*(x^2 + y^2 + z^2 - 2*y - 1)"
_SEXTIC_NODES = signed(("1", "1", "1")) + signed(
    *permuted(("0", "(phi - 1)", "phi"), ("1", "0", "0"), ("1/2", "phi/2", "(phi - 1)/2"))
)
# Points of the curve x^2 + 9/4 y^2 = 1, z = 0, on which f has zeros of multiplicity 3.
_HEART_EQUATOR = signed(("1", "0", "0"), ("0", "2/3", "0"), ("3/5", "8/15", "0"), ("4/5", "2/5", "0"))
_HUNT_EDGE = signed(
    ("sqrt(64/7)", "0", "sqrt(27/7)"), ("2", "6/sqrt(5)", "3/sqrt(5)"), ("0", "sqrt(64/5)", "sqrt(1/5)")
)
# The polynomial 243 S - 22 Q of Sarti, with w = 1 and with the differences of l2, l3 and l4 factorized.
_L1 = "(x^4 + y^4 + z^4 + 1)"
_L2, _L3, _L4 = "(x^2*y^2 + z^2)", "(x^2*z^2 + y^2)", "(y^2*z^2 + x^2)"
_E1, _E2 = f"({_L2} + {_L3} + {_L4})", f"({_L2}*{_L3} + {_L3}*{_L4} + {_L4}*{_L2})"
_E3, _POWERS = f"{_L2}*{_L3}*{_L4}", f"({_L2}^2 + {_L3}^2 + {_L4}^2)"
_DODECIC = (
    "243*(-33*sqrt(5)*(x^2 - 1)*(y^2 - z^2)*(z^2 - 1)*(x^2 - y^2)*(y^2 - 1)*(z^2 - x^2)"
    f" + 19*({_E1}*{_E2} - 3*{_E3}) + 10*({_L2}^3 + {_L3}^3 + {_L4}^3) - 14*{_L1}*{_E2} + 2*{_L1}^2*{_E1}"
    f" - 6*{_L1}*{_POWERS} - 352*(x*y*z)^2*{_E1} + 336*(x*y*z)^2*{_L1} + 48*{_E3})"
    " - 22*(x^2 + y^2 + z^2 + 1)^6"
)

SURFACES: dict[str, KnownSurface] = {
    "togliatti": KnownSurface(
        "Togliatti quintic", _TOGLIATTI, 5.0, "Beauville 1980: 31 nodes", False,
        singular=((0, 0, -0.3717480344601845), ("1 - sqrt(5)", 0, -1.8587401723009225)), singular_count=26,
        view=View((3, -8, 5), clip=6.0),
    ),
    "heart": KnownSurface(
        "Heart", "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3", 1.5, "Taubin 1993", True,
        singular=_HEART_EQUATOR + (("0", "0", "1"), ("0", "0", "-1")),
        singular_count=None, singular_curves="an ellipse, and 2 points",
        view=View((3, -8, 2.5)),
    ),
    "boy": KnownSurface(
        "Boy surface of Apéry", _BOY, 2.5, "Apéry 1986", True,
        singular=(("0", "0", "0"),), singular_count=None, singular_curves="three loops that meet in a point",
        view=View((5, -6, 3)),
    ),
    "klein-bottle": KnownSurface(
        "Klein bottle", _KLEIN, 4.5, "MathWorld, Klein Bottle (Stewart 1991)", True,
        singular=(("0", "1 + sqrt(2)", "0"), ("0", "1 - sqrt(2)", "0"), ("sqrt(2)", "1", "0"), ("-sqrt(2)", "1", "0"),
                  ("1", "2", "0"), ("-1", "2", "0")),
        singular_count=None, singular_curves="a circle",
        view=View((8, -2, 4)),
    ),
    "barth-sextic": KnownSurface(
        "Barth sextic",
        "4*(phi^2*x^2 - y^2)*(phi^2*y^2 - z^2)*(phi^2*z^2 - x^2) - (1 + 2*phi)*(x^2 + y^2 + z^2 - 1)^2",
        2.0, "Barth 1996: 65 nodes, 15 of them at infinity", False,
        singular=_SEXTIC_NODES, singular_count=50,
        view=View((1, -6, 2.5)),
    ),
    "chmutov-6": KnownSurface(
        "Chmutov sextic", sum_over(_T6, " + 1"), 1.7321, "Chmutov 1992", True,
        singular=chebyshev(6, _COS6, (1, 3, 5)), singular_count=54,
        view=View((5, -8, 5)),
    ),
    "banchoff-chmutov-6": KnownSurface(
        "Banchoff-Chmutov sextic", sum_over(_T6, ""), 1.7321, "Banchoff 1991", True,
        view=View((5, -8, 5)),
    ),
    "distel": KnownSurface(
        "Distel", "x^2 + y^2 + z^2 + 1000*(x^2 + y^2)*(x^2 + z^2)*(y^2 + z^2) - 1", 1.05, "Hauser's gallery", True,
        view=View((4, -7, 4), zoom=0.75),
    ),
    "daisy": KnownSurface(
        "Daisy", "(x^2 - y^3)^2 - (z^2 - y^2)^3", 1.8, "Hauser's gallery", False,
        singular=((0, 0, 0), (1, 1, 1), (1, 1, -1), (-1, 1, 1), (-1, 1, -1)),
        singular_count=None, singular_curves="two curves, x^2 = y^3 with y = z or y = -z",
        view=View((6, -6, 5)),
    ),
    "hunt": KnownSurface(
        "Hunt surface", "4*(x^2 + y^2 + z^2 - 13)^3 + 27*(3*x^2 + y^2 - 4*z^2 - 12)^2", 3.7,
        "MathWorld, Hunt's Surface", True,
        singular=_HUNT_EDGE, singular_count=None, singular_curves="two closed edges, and points",
        view=View((3, -8, 6), zoom=0.94),
    ),
    "nepali": KnownSurface(
        "Nepali", "(x*y - z^3 - 1)^2 - (1 - x^2 - y^2)^3", 1.8, "Hauser's gallery", True,
        singular=((1, 0, -1), (0, 1, -1), (-1, 0, -1), (0, -1, -1)),
        singular_count=None, singular_curves="a closed edge, on the cylinder x^2 + y^2 = 1",
        view=View((3, -8, 4), zoom=0.94),
    ),
    "zitrus": KnownSurface(
        "Zitrus", "x^2 + z^2 - y^3*(1 - y)^3", 0.52, "Hauser's gallery", True, centre=(0.0, 0.5, 0.0),
        singular=((0, 0, 0), (0, 1, 0)), singular_count=2,
        view=View((8, -3, 3), up=(0, 1, 1), zoom=0.9),
    ),
    "crixxi": KnownSurface(
        "Crixxi", "(y^2 + z^2 - 1)^2 + (x^2 + y^2 - 1)^3", 1.5, "Hauser's gallery", True,
        singular=((0, 0, 0), (0, 1, 0), (0, -1, 0)) + signed(("3/5", "4/5", "3/5"), ("1", "0", "1")),
        singular_count=None, singular_curves="two ellipses, and a point",
        view=View((5, -6, 3)),
    ),
    "labs-septic": KnownSurface(
        "Labs septic", _LABS, 3.5, "Labs 2006: 99 nodes, of which 71 are in the sphere", False,
        parameters={"alpha": -0.14010685498712477},
        singular=((0, 0, -1), (0.66117659357157610, 0, -0.59569952699376094),
                  (0.42080601114678146, 0, -0.58729535252983311), (-0.49822800141315243, 0, -0.55975407858813642),
                  (0.53142958171707089, 0, -0.47880150860948550), (-0.59110597854170510, 0, -0.36854854943848053),
                  (0.83106941791721556, 0, -0.18493034305746936)),
        singular_count=71,
        view=View((3, -8, 5)),
    ),
    "chmutov-8": KnownSurface(
        "Chmutov octic", sum_over(_T8, " + 1"), 1.7321, "Chmutov 1992", True,
        singular=chebyshev(8, _COS8, (1, 3, 5, 7)), singular_count=144,
        view=View((5, -8, 5)),
    ),
    "endrass-octic": KnownSurface(
        "Endraß octic", _ENDRASS, 2.6, "MathWorld, Endrass Octic: 168 nodes, 24 at infinity", False,
        singular=signed(("1/sqrt(2)", "0", "0"), ("0", "1/sqrt(2)", "0"), ("1", "(sqrt(2) - 1)", "1/2"),
                        ("sqrt(2)", "0", "1/2"), ("(1 + sqrt(2))/2", "1/2", "0"), ("sqrt(2)", "0", "3/2")),
        singular_count=112,
        view=View((3, -8, 4)),
    ),
    "enneper": KnownSurface(
        "Enneper surface", "(9*(y^2 - x^2) + 4*z^3 + 12*z)^3 - 27*z*(9*(y^2 - x^2) - 9*z*(x^2 + y^2) - 8*z^3 + 8*z)^2",
        4.0, "Enneper 1864; MathWorld, Enneper's Minimal Surface", False,
        singular=((0, 0, 3), (0, 0, -3), (0, "25/24", "25/8"), ("25/24", 0, "-25/8"), (0, 0, 0), (1, 1, 0), (1, -1, 0)),
        singular_count=None, singular_curves="two lines, and two curves in which it meets itself",
        view=View((2, -8, 3), clip=5.0),
    ),
    "barth-decic": KnownSurface(
        "Barth decic", _DECIC, 2.6, "Barth 1996: 345 nodes, 45 of them at infinity", False,
        singular=signed(*permuted(("1", "0", "0"), ("0.5720614028176843", "0.21850801222441055",
                                                    "0.08346263385554731"))),
        singular_count=300,
        view=View((8, -3, 5), clip=2.2),
    ),
    "sarti-dodecic": KnownSurface(
        "Sarti dodecic", _DODECIC, 3.0, "Sarti 2001: 600 nodes, of which 320 are in the sphere", False,
        singular=signed(("1/3", "1/3", "1/3"),
                        *permuted(("(2 - phi)", "0", "0"), ("(1 + phi)", "0", "0"), ("0", "1", "1"))),
        singular_count=320,
        view=View((5, -6, 4), clip=2.1),
    ),
}  # fmt: skip
