"""The lights of original VisRayTrace setups as plain dicts of visray's fields."""

from collections.abc import Callable
from math import acos, degrees, hypot, nan
from typing import Any

from visray.scene.legacy.entry import BLACK, Entry, Log
from visray.scene.legacy.keys import LIGHTS
from visray.scene.messages import line

# Shadow samples for each unit of area, and as many as a light may have here.
DENSITY, MOST = 5, 2**16
# The keys that tell how wide a spot light is, each with the angle in degrees that it means and what it may say.
WIDTHS: dict[str, tuple[Callable[[float], float], str]] = {
    "angle": (degrees, "from 0.000175 to pi; it is half of the cone's angle, in radians (in degrees it is theta)"),
    "theta": (float, "from 0.01 to 180; it is half of the cone's angle, in degrees"),
    "cosineCutoff": (
        lambda cosine: degrees(acos(cosine)) if -1 <= cosine <= 1 else nan,
        "from -1 to below 1; it is the cosine of half of the cone's angle",
    ),
}
# What any of them may say: it stands in for a number that is an error already.
UNTOLD = 0.5
# pi as files write it, with few digits, still means all directions.
FULL, FULL_AS_WRITTEN = 180.0, degrees(3.1416)


def lights(raw: list[Any], log: Log) -> dict[str, dict]:
    """The lights by name: they have none in the file, and are numbered from 1."""
    made = {}
    for i, found in enumerate(raw):
        if not isinstance(found, dict):
            log.error(line(f"lights.{i}", found, "must be an object {...}"))
            continue
        light = _light(found, f"lights.{i}", log)
        if light:
            made[f"light {i + 1}"] = light
    return made


def _light(found: dict, address: str, log: Log) -> dict | None:
    typed = Entry({"type": found["type"]} if "type" in found else {}, address, {"type": ()}, log)
    kind = typed.chosen("type", LIGHTS)
    if not typed.has("type"):
        log.warn(f"{address}: has no type; a pointLight is used, as in the original")
        kind = "pointLight"
    if kind is None:
        return None
    if kind == "pointLight" and "width" in found and "height" in found:
        log.warn(f"{address}: has a width and a height, which belong to an areaLight; it is a pointLight without them")
        found = {k: v for k, v in found.items() if k not in ("width", "height")}
    e = Entry(found, address, LIGHTS[kind], log)
    errors = len(log.errors)
    made = {key: e.vector(key, BLACK) for key in ("Ia", "Id", "Is")} | {key: e.number(key, 0.0) for key in "abc"}
    made |= BUILDERS[kind](e)
    return made if len(log.errors) == errors else None


def _point(e: Entry) -> dict:
    return {"type": "point", "position": e.vector("position")}


def _spot(e: Entry) -> dict:
    made = {"type": "spot", "position": e.vector("position"), "direction": e.vector("direction")}
    exponent = e.number("exponent", 0.0)
    if exponent > 0:
        e.log.warn(line(e.at("exponent"), exponent, "here the light falls to 0 at the edge of the cone"))
    return made | {"exponent": exponent} | _spread(e)


def _spread(e: Entry) -> dict:
    """Half of a spot light's angle, from whichever key tells it; none where the default serves."""
    written = {key: e.number(key, UNTOLD) for key in WIDTHS}
    said, *others = [key for key in WIDTHS if e.has(key)] or [None]
    for key in others:
        e.log.warn(f"{e.at(key)}: passed over; {said!r} says how wide the light is")
    if said is None:
        e.log.warn(f"{e.at('angle')}: is missing; 30 degrees from the axis to the edge are used")
        return {}
    convert, right = WIDTHS[said]
    angle = convert(written[said])
    if not 0.01 <= angle <= FULL_AS_WRITTEN:
        e.error(said, f"must be {right}")
    return {"angle": min(angle, FULL)}


def _area(e: Entry) -> dict:
    sides = {key: e.vector(key) for key in ("width", "height")}
    made = {"type": "rectangle", "position": e.vector("position"), **sides}
    samples = e.whole("numLights", 0)
    if e.has("numLights"):
        return made | {"samples": samples}
    return made if None in sides.values() else made | {"samples": _samples(e, *sides.values())}


def _samples(e: Entry, width: tuple[float, ...], height: tuple[float, ...]) -> int:
    """As many shadow samples as in the original, by the area; but at least one, and as many as we can."""
    wanted = DENSITY * hypot(*width) * hypot(*height)
    if not wanted < MOST + 1:
        e.log.warn(f"{e.at('numLights')}: the original took {wanted:.3g} samples of so large an area; {MOST} are taken")
        return MOST
    if wanted < 1:
        e.log.warn(
            f"{e.at('numLights')}: the original took 0 samples of so small an area, and divided by 0; 1 is taken"
        )
        return 1
    return int(wanted)


def _directional(e: Entry) -> dict:
    for key in "bc":
        if e.values.get(key):
            e.log.warn(line(e.at(key), e.values[key], "passed over; a directional light is infinitely far away"))
    made = {"type": "directional", "direction": e.vector("direction"), "b": 0.0, "c": 0.0}
    return made | {"intensity": e.number("intensity", 1.0)}


BUILDERS: dict[str, Callable[[Entry], dict]] = {
    "pointLight": _point,
    "spotLight": _spot,
    "areaLight": _area,
    "directionalLight": _directional,
}
