"""The story of a pixel as HTML. Everything in it that comes from a file is escaped."""

from typing import Any

import numpy as np

from visray.live.live import escaped
from visray.output.curves import LUMINANCE, curve
from visray.study.pixel.story import MOST_LIGHTS, MOST_SURFACES, Colour, LightStory, PixelStory, SurfaceStory, shown

INVITATION = "Click on the picture: what is there, and why it looks as it does."
# How a path comes to the surfaces after the first one.
WAYS = {
    "reflection": "mirrored in it",
    "total reflection": "mirrored in it from inside",
    "refraction": "seen through it",
    "passing": "behind a surface that counts for nothing",
    "scattering": "that lights it",
}
# Shares of the light below this are called dark.
DARK = 0.005
GREY = "opacity:0.65"


def invitation() -> str:
    """What is shown before the first click, as HTML."""
    return _box(f'<span style="{GREY}">{INVITATION}</span>')


def looking() -> str:
    """What is shown until the story is known, as HTML."""
    return _box(f'<span style="{GREY}">Looking at the pixel …</span>')


def story_page(story: PixelStory, notes: tuple[str, ...] = ()) -> str:
    """A story as HTML. notes: sentences about what else was done."""
    first, rest = story.surfaces[0], story.surfaces[1:MOST_SURFACES]
    parts = [_headline(first, story.colour)]
    if first.material is not None:
        parts += [_facts(first), _light(first)]
    parts += [_further(surface) for surface in rest]
    parts += [f"<p>{escaped(note)}</p>" for note in (*first.notes, *notes)]
    text = escaped_lines(str(story))
    pre = f'<pre style="white-space:pre-wrap;overflow-wrap:anywhere;font-size:0.85em">{text}</pre>'
    parts.append(f'<details><summary style="cursor:pointer;{GREY}">all numbers</summary>{pre}</details>')
    return _box("".join(parts))


def escaped_lines(text: str) -> str:
    """Lines of text as HTML."""
    return "\n".join(escaped(line) for line in text.splitlines())


def reason(light: LightStory) -> str:
    """Why light does not arrive, in words; "" if it arrives unhindered."""
    if light.cosine <= 0:
        return "it is behind the surface"
    if light.falloff is not None and not light.falloff:
        return "the point is outside its cone"
    if light.in_way:
        # "all" is said of several samples only.
        parts = [
            f"{address} is in the way" + (f" of {share:.0%}" if light.samples > 1 and share < 1 else "")
            for address, share in light.in_way.items()
        ]
        return ", ".join(parts)
    if not any(light.arrives):
        return "no light of it comes so far"
    return ""


def _headline(surface: SurfaceStory, colour: Colour) -> str:
    name = "the background" if surface.object is None else surface.object
    more = "" if surface.operand is None else f'<div style="{GREY}">its operand {escaped(surface.operand)}</div>'
    return (
        f'<div style="display:flex;align-items:center;gap:0.6em">{_swatch(colour, "1.6em")}'
        f'<b style="font-size:1.1em;overflow-wrap:anywhere">{escaped(name)}</b></div>{more}'
    )


def _facts(surface: SurfaceStory) -> str:
    material = surface.material
    rows = [
        ("distance", escaped(shown(surface.distance)) + (", seen from inside" if surface.inside else "")),
        ("point", escaped(shown(_rounded(surface.point)))),
        ("normal", escaped(shown(_rounded(surface.normal)))),
        ("material", escaped(material["address"].removeprefix("materials."))),
    ]
    if material["texture"]:
        rows.append(("texture", escaped(material["texture"].removeprefix("textures."))))
    rows.append(("kd", f"{_swatch(material['kd'])} {escaped(shown(material['kd']))}"))
    for field in ("ks", "kr", "kt", "emission"):
        if any(material[field]):
            rows.append((field, f"{_swatch(material[field])} {escaped(shown(material[field]))}"))
    cells = "".join(f'<tr><td style="{GREY};padding-right:0.9em">{k}</td><td>{v}</td></tr>' for k, v in rows)
    return f'<table style="margin:0.4em 0;border-spacing:0 0.1em">{cells}</table>'


def _rounded(numbers: tuple[float, ...]) -> tuple[float, ...]:
    """Numbers in which those that are tiny beside the largest are 0."""
    least = 1e-9 * max(map(abs, numbers))
    return tuple(x if abs(x) > least else 0.0 for x in numbers)


def _light(surface: SurfaceStory) -> str:
    """Where the light of a surface comes from."""
    if surface.unlit:
        return "<p>It shows its kd as it is, whatever light falls on it.</p>"
    sources: list[tuple[str, float, str]] = []
    for light in surface.lights[:MOST_LIGHTS]:
        sent = float(LUMINANCE @ np.add(light.diffuse, light.specular))
        sources.append((light.light, sent, reason(light)))
    if surface.ambient is not None and any(surface.ambient):
        sources.append(("ambient", float(LUMINANCE @ np.array(surface.ambient)), ""))
    if any(surface.material["emission"]):
        sources.append(("its emission", float(LUMINANCE @ np.array(surface.material["emission"])), ""))
    total = sum(sent for _, sent, _ in sources)
    if not sources:
        return "<p>No light falls on it.</p>"
    rows = "".join(_source(name, sent / total if total > 0 else 0.0, why) for name, sent, why in sources)
    left = len(surface.lights) - MOST_LIGHTS
    more = f'<div style="{GREY}">and {left} lights more</div>' if left > 0 else ""
    title = "Its own light comes from" if total > 0 else "No light arrives"
    scattered = f"<p>Light from other surfaces adds {escaped(shown(surface.scattered_light))}.</p>"
    return f"<div><b>{title}</b></div>{rows}{more}" + (scattered if surface.scattered else "")


def _source(name: str, share: float, why: str) -> str:
    dark = share < DARK
    value = "dark" if dark else f"{100 * share:.0f} %"
    bar = f'<div style="height:4px;width:{100 * share:.1f}%;background:#e8a200;border-radius:2px"></div>'
    cause = f'<div style="{GREY};font-size:0.92em;overflow-wrap:anywhere">{escaped(why)}</div>' if why else ""
    line = f'<div style="display:flex;justify-content:space-between;gap:0.6em"><span>{escaped(name)}</span>'
    return f'<div style="margin:0.3em 0">{line}<span>{value}</span></div>{bar}{cause}</div>'


def _further(surface: SurfaceStory) -> str:
    """A surface after the first one."""
    name = "the background" if surface.object is None else surface.object
    way = WAYS.get(surface.way, surface.way)
    return (
        f'<div style="margin:0.3em 0;display:flex;gap:0.5em;align-items:center">{_swatch(surface.adds)}'
        f'<span style="overflow-wrap:anywhere"><b>{escaped(name)}</b> {escaped(way)}</span></div>'
    )


def _swatch(colour: Any, size: str = "1em") -> str:
    """A square of a linear colour."""
    rgb = np.round(curve(np.clip(np.nan_to_num(np.array(colour, float)), 0, 1), "srgb") * 255).astype(int)
    look = (
        "display:inline-block;flex:none;vertical-align:-0.15em;border-radius:3px;border:1px solid rgba(128,128,128,0.5)"
    )
    return f'<span style="{look};width:{size};height:{size};background:rgb({rgb[0]},{rgb[1]},{rgb[2]})"></span>'


def _box(inner: str) -> str:
    return f'<div style="padding:0.3em 0.9em 0.5em;font-size:0.88em;line-height:1.45">{inner}</div>'
