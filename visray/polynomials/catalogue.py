"""The catalogue of known polynomial surfaces. It contains only data.

Expressions consist of + - * / ^, x y z, numbers, pi, phi (the golden ratio), sqrt(number) and parameters. They keep the
products and powers of the literature, because the expanded polynomials would be evaluated much less accurately.
"""

from visray.polynomials.known_surface import KnownSurface, View, chebyshev, permuted, signed

__all__ = ["SURFACES", "KnownSurface", "View"]

_T4 = "(2*(2*{0}^2 - 1)^2 - 1)"
_T6 = "(2*(4*{0}^3 - 3*{0})^2 - 1)"
_T8 = "(2*(2*(2*{0}^2 - 1)^2 - 1)^2 - 1)"
_COS4 = {1: "1/sqrt(2)", 2: "0", 3: "-1/sqrt(2)"}
_COS6 = {1: "sqrt(3)/2", 2: "1/2", 3: "0", 4: "-1/2", 5: "-sqrt(3)/2"}
_COS8 = {1: "sqrt(2 + sqrt(2))/2", 2: "1/sqrt(2)", 3: "sqrt(2 - sqrt(2))/2", 4: "0"}
_COS8 |= {8 - i: "-" + v for i, v in _COS8.items() if i < 4}


def _sum(form: str, last: str) -> str:
    """Text of the sum of `form` with x, y and z in place of {0}, and of the text `last`."""
    return " + ".join(form.format(v) for v in "xyz") + last


_KUMMER = (
    "(x^2 + y^2 + z^2 - mu^2)^2 - (3*mu^2 - 1)/(3 - mu^2)"
    "*(1 - z - sqrt(2)*x)*(1 - z + sqrt(2)*x)*(1 + z + sqrt(2)*y)*(1 + z - sqrt(2)*y)"
)
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
_CLEBSCH = (
    "81*(x^3 + y^3 + z^3) - 189*(x^2*(y + z) + y^2*(x + z) + z^2*(x + y)) + 54*x*y*z"
    " + 126*(x*y + y*z + z*x) - 9*(x^2 + y^2 + z^2) - 9*(x + y + z) + 1"
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

SURFACES: dict[str, KnownSurface] = {
    "heart": KnownSurface("Heart", "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3", 1.5, "Taubin 1993", True,
                     singular=_HEART_EQUATOR + (("0", "0", "1"), ("0", "0", "-1"))),
    "hyperboloid": KnownSurface("Hyperboloid of one sheet", "x^2 + y^2 - z^2 - 1", 3.0, "elementary", False),
    "double-cone": KnownSurface("Double cone", "x^2 + y^2 - z^2", 2.0, "elementary", False, singular=((0, 0, 0),)),
    "report-quartic": KnownSurface("Quartic of the report on VisRayTrace", "0.9*x^2 + z^2 + y^4 + y^3 - 3*y^2 - 1", 3.5,
                              "report on the original VisRayTrace", True),
    "cayley-cubic": KnownSurface("Cayley cubic", "4*(x^2 + y^2 + z^2) + 16*x*y*z - 1", 2.0,
                                 "MathWorld, Cayley Cubic", False,
                            singular=(("1/2", "1/2", "-1/2"), ("1/2", "-1/2", "1/2"), ("-1/2", "1/2", "1/2"),
                                      ("-1/2", "-1/2", "-1/2"))),
    "clebsch-cubic": KnownSurface("Clebsch diagonal cubic", _CLEBSCH, 1.5, "MathWorld, Clebsch Diagonal Cubic", False),
    "ding-dong": KnownSurface("Ding-dong", "x^2 + y^2 + z^3 - z^2", 2.0, "Hauser's gallery", False, singular=((0, 0,
                              0),)),
    "whitney-umbrella": KnownSurface("Whitney umbrella", "x^2 - y^2*z", 2.0, "Whitney 1944", False,
                                singular=((0, 0, 0), (0, 0, "1/2"), (0, 0, "1"), (0, 0, "-1/2"))),
    "torus": KnownSurface("Torus", "(x^2 + y^2 + z^2 + 21/25)^2 - 4*(x^2 + y^2)", 1.41,
                          "elementary: radii 1 and 2/5", True),
    "spindle-torus": KnownSurface("Spindle torus", "(x^2 + y^2 + z^2 - 3/4)^2 - (x^2 + y^2)", 1.51,
                             "elementary: radii 1/2 and 1", True, singular=signed(("0", "0", "sqrt(3)/2"))),
    "dupin-cyclide": KnownSurface("Dupin ring cyclide", "(x^2 + y^2 + z^2 + 3/16)^2 - 4*(x - 3/8)^2 - 3*y^2", 2.3,
                             "MathWorld, Cyclide: a = 1, b^2 = 3/4, c = 1/2, d = 3/4", True),
    "roman": KnownSurface("Roman surface of Steiner", "x^2*y^2 + x^2*z^2 + y^2*z^2 - 2*x*y*z", 1.2, "Steiner 1844",
                          False,
                     singular=((0, 0, 0),) + signed(*permuted(("1", "0", "0"), ("1/2", "0", "0")))),
    "boy": KnownSurface("Boy surface of Apéry", _BOY, 2.5, "Apéry 1986", True, singular=(("0", "0", "0"),)),
    "klein-bottle": KnownSurface("Klein bottle", _KLEIN, 4.5, "MathWorld, Klein Bottle (Stewart 1991)", True,
                            singular=(("0", "1 + sqrt(2)", "0"), ("0", "1 - sqrt(2)", "0"), ("sqrt(2)", "1", "0"),
                                      ("-sqrt(2)", "1", "0"), ("1", "2", "0"), ("-1", "2", "0"))),
    "kummer": KnownSurface("Kummer surface", _KUMMER, 3.5, "MathWorld, Kummer Surface: 16 nodes", False,
                      parameters={"mu": 1.3},
                      singular=(("0", "sqrt(mu^2 - 1)", "1"), ("0", "-sqrt(mu^2 - 1)", "1"),
                                ("sqrt(mu^2 - 1)", "0", "-1"), ("-sqrt(mu^2 - 1)", "0", "-1"))),
    "tangle": KnownSurface("Tangle cube", "x^4 - 5*x^2 + y^4 - 5*y^2 + z^4 - 5*z^2 + 59/5", 4.2,
                           "MathWorld, Tanglecube",
                      True),
    "piriform": KnownSurface("Piriform surface", "x^4 - x^3 + y^2 + z^2", 1.2, "MathWorld, Piriform Surface", True,
                        singular=((0, 0, 0),)),
    "chmutov-4": KnownSurface("Chmutov quartic", _sum(_T4, " + 1"), 1.7321, "Chmutov 1992", True,
                         singular=chebyshev(4, _COS4, (1, 3))),
    "togliatti": KnownSurface("Togliatti quintic", _TOGLIATTI, 5.0, "Beauville 1980: 31 nodes", False,
                         singular=((0, 0, -0.3717480344601845), ("1 - sqrt(5)", 0, -1.8587401723009225))),
    "barth-sextic": KnownSurface(
        "Barth sextic", "4*(phi^2*x^2 - y^2)*(phi^2*y^2 - z^2)*(phi^2*z^2 - x^2)"
        " - (1 + 2*phi)*(x^2 + y^2 + z^2 - 1)^2", 2.0, "Barth 1996: 65 nodes, 15 of them at infinity", False,
        singular=_SEXTIC_NODES),
    "chmutov-6": KnownSurface("Chmutov sextic", _sum(_T6, " + 1"), 1.7321, "Chmutov 1992", True,
                         singular=chebyshev(6, _COS6, (1, 3, 5))),
    "banchoff-chmutov-6": KnownSurface("Banchoff-Chmutov sextic", _sum(_T6, ""), 1.7321, "Banchoff 1991", True),
    "distel": KnownSurface("Distel", "x^2 + y^2 + z^2 + 1000*(x^2 + y^2)*(x^2 + z^2)*(y^2 + z^2) - 1", 1.05,
                      "Hauser's gallery", True),
    "daisy": KnownSurface("Daisy", "(x^2 - y^3)^2 - (z^2 - y^2)^3", 1.8, "Hauser's gallery", False,
                     singular=((0, 0, 0), (1, 1, 1), (1, 1, -1), (-1, 1, 1), (-1, 1, -1))),
    "hunt": KnownSurface("Hunt surface", "4*(x^2 + y^2 + z^2 - 13)^3 + 27*(3*x^2 + y^2 - 4*z^2 - 12)^2", 3.7,
                    "MathWorld, Hunt's Surface", True, singular=_HUNT_EDGE),
    "nepali": KnownSurface("Nepali", "(x*y - z^3 - 1)^2 - (1 - x^2 - y^2)^3", 1.8, "Hauser's gallery", True,
                      singular=((1, 0, -1), (0, 1, -1), (-1, 0, -1), (0, -1, -1))),
    "labs-septic": KnownSurface("Labs septic", _LABS, 3.5, "Labs 2006: 99 nodes, of which 71 are in the sphere", False,
                           parameters={"alpha": -0.14010685498712477},
                           singular=((0, 0, -1), (0.66117659357157610, 0, -0.59569952699376094),
                                     (0.42080601114678146, 0, -0.58729535252983311),
                                     (-0.49822800141315243, 0, -0.55975407858813642),
                                     (0.53142958171707089, 0, -0.47880150860948550),
                                     (-0.59110597854170510, 0, -0.36854854943848053),
                                     (0.83106941791721556, 0, -0.18493034305746936))),
    "chmutov-8": KnownSurface("Chmutov octic", _sum(_T8, " + 1"), 1.7321, "Chmutov 1992", True,
                         singular=chebyshev(8, _COS8, (1, 3, 5, 7))),
    "endrass-octic": KnownSurface("Endraß octic", _ENDRASS, 2.6, "MathWorld, Endrass Octic: 168 nodes, 24 at infinity",
                             False, singular=signed(("1/sqrt(2)", "0", "0"), ("0", "1/sqrt(2)", "0"),
                                                     ("1", "(sqrt(2) - 1)", "1/2"), ("sqrt(2)", "0", "1/2"),
                                                     ("(1 + sqrt(2))/2", "1/2", "0"), ("sqrt(2)", "0", "3/2"))),
    "barth-decic": KnownSurface("Barth decic", _DECIC, 2.6, "Barth 1996: 345 nodes, 45 of them at infinity", False,
                           singular=signed(*permuted(("1", "0", "0"),
                                                     ("0.5720614028176843", "0.21850801222441055",
                                                      "0.08346263385554731")))),
}  # fmt: skip
