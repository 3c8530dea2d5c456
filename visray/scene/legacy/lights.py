"""Lights of a VisRayTrace setup, as plain dicts of visray's fields."""

from collections.abc import Callable
from math import acos, degrees, hypot, nan
from typing import Any

from visray.scene.legacy.entry import BLACK, Entry, Log
from visray.scene.legacy.keys import LIGHTS
from visray.scene.messages import line

# Shadow samples of an area light per unit of area in VisRayTrace, and the most samples that a light of visray has.
SAMPLES_PER_AREA, MOST_SAMPLES = 5, 2**16
# Keys that give half of a spot light's cone angle: the conversion of each to degrees, and its range.
HALF_ANGLES: dict[str, tuple[Callable[[float], float], str]] = {
    "angle": (degrees, "from 0.000175 to pi; it is half of the cone's angle, in radians (in degrees it is theta)"),
    "theta": (float, "from 0.01 to 180; it is half of the cone's angle, in degrees"),
    "cosineCutoff": (
        lambda cosine: degrees(acos(cosine)) if -1 <= cosine <= 1 else nan,
        "from -1 to below 1; it is the cosine of half of the cone's angle",
    ),
}
# A value that is valid for each key of HALF_ANGLES. It replaces a value that was already reported as an error.
PLACEHOLDER = 0.5
# Half angle of a cone that contains all directions, in degrees: exactly, and as written with pi rounded up to 3.1416.
FULL, FULL_AS_WRITTEN = 180.0, degrees(3.1416)


def lights(raw: list[Any], log: Log) -> dict[str, dict]:
    """Dict of the lights by name. Lights have no names in the file; here they are "light 1", "light 2", and so on."""
    by_name = {}
    for i, entry in enumerate(raw):
        if not isinstance(entry, dict):
            log.error(line(f"lights.{i}", entry, "must be an object {...}"))
            continue
        light = _light(entry, f"lights.{i}", log)
        if light:
            by_name[f"light {i + 1}"] = light
    return by_name


def _light(entry: dict, address: str, log: Log) -> dict | None:
    """Fields of a light. If something in it is wrong, None with an error in the log."""
    typed = Entry({"type": entry["type"]} if "type" in entry else {}, address, {"type": ()}, log)
    kind = typed.choice("type", LIGHTS)
    if not typed.has("type"):
        log.warn(f"{address}: has no type; a pointLight is used, as in VisRayTrace")
        kind = "pointLight"
    if kind is None:
        return None
    if kind == "pointLight" and "width" in entry and "height" in entry:
        log.warn(f"{address}: has a width and a height, which belong to an areaLight; it is a pointLight without them")
        entry = {k: v for k, v in entry.items() if k not in ("width", "height")}
    e = Entry(entry, address, LIGHTS[kind], log)
    errors_before = len(log.errors)
    light = {key: e.vector(key, BLACK) for key in ("Ia", "Id", "Is")} | {key: e.number(key, 0.0) for key in "abc"}
    light |= FIELDS[kind](e)
    return light if len(log.errors) == errors_before else None


def _point(e: Entry) -> dict:
    """Fields of a point light."""
    return {"type": "point", "position": e.vector("position")}


def _spot(e: Entry) -> dict:
    """Fields of a spot light."""
    light = {"type": "spot", "position": e.vector("position"), "direction": e.vector("direction")}
    exponent = e.number("exponent", 0.0)
    if exponent > 0:
        e.log.warn(line(e.at("exponent"), exponent, "in visray the light falls to 0 at the edge of the cone"))
    return light | {"exponent": exponent} | _half_angle(e)


def _half_angle(e: Entry) -> dict:
    """Dict with the field `angle`: half of a spot light's cone angle, from the first key of HALF_ANGLES that the file
    has. {} if the file has none of these keys."""
    values = {key: e.number(key, PLACEHOLDER) for key in HALF_ANGLES}
    used, *ignored = [key for key in HALF_ANGLES if e.has(key)] or [None]
    for key in ignored:
        e.log.warn(f"{e.at(key)}: ignored; {used!r} says how wide the light is")
    if used is None:
        e.log.warn(f"{e.at('angle')}: is missing; 30 degrees from the axis to the edge are used")
        return {}
    in_degrees, valid_range = HALF_ANGLES[used]
    angle = in_degrees(values[used])
    if not 0.01 <= angle <= FULL_AS_WRITTEN:
        e.error(used, f"must be {valid_range}")
    return {"angle": min(angle, FULL)}


def _area(e: Entry) -> dict:
    """Fields of an area light."""
    sides = {key: e.vector(key) for key in ("width", "height")}
    light = {"type": "rectangle", "position": e.vector("position"), **sides}
    samples = e.integer("numLights", 0)
    if e.has("numLights"):
        return light | {"samples": samples}
    return light if None in sides.values() else light | {"samples": _samples(e, *sides.values())}


def _samples(e: Entry, width: tuple[float, ...], height: tuple[float, ...]) -> int:
    """Number of shadow samples: proportional to the area as in VisRayTrace, at least 1 and at most MOST_SAMPLES.

    width, height: sides of the light, as vectors.
    """
    samples = SAMPLES_PER_AREA * hypot(*width) * hypot(*height)
    if not samples < MOST_SAMPLES + 1:
        e.log.warn(
            f"{e.at('numLights')}: VisRayTrace took {samples:.3g} samples of so large an area; {MOST_SAMPLES} are taken"
        )
        return MOST_SAMPLES
    if samples < 1:
        e.log.warn(f"{e.at('numLights')}: VisRayTrace took 0 samples of so small an area, and divided by 0; 1 is taken")
        return 1
    return int(samples)


def _directional(e: Entry) -> dict:
    """Fields of a directional light."""
    for key in "bc":
        if e.values.get(key):
            e.log.warn(line(e.at(key), e.values[key], "ignored; a directional light is infinitely far away"))
    light = {"type": "directional", "direction": e.vector("direction"), "b": 0.0, "c": 0.0}
    return light | {"intensity": e.number("intensity", 1.0)}


# For each type of light, the function that reads its own fields. Other fields are the same in all types.
FIELDS: dict[str, Callable[[Entry], dict]] = {
    "pointLight": _point,
    "spotLight": _spot,
    "areaLight": _area,
    "directionalLight": _directional,
}
