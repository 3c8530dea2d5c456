"""Controls of a scene: for each continuous value how a slider or a picker shows and changes it. Nothing here draws."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from visray.data.color_rule import ColorRule
from visray.lights.light import Light
from visray.live.fields import Field, Limits, field_at, limits, numbers_of
from visray.live.ranges import ENDLESS, Range, nice, range_around, range_of
from visray.output.curves import curve, linear
from visray.scene.scene import Scene

Kind = Literal["number", "angle", "color", "share", "vector", "direction", "range"]
Value = float | tuple[float, ...]
# Sections of a scene, and what one of their entries is called.
ENTRIES = {
    "textures": "texture",
    "materials": "material",
    "lights": "light",
    "geometries": "geometry",
    "objects": "object",
}
AXES = ("x", "y", "z")
# Fields that not every record with them reads.
UNREAD = ("center", "exponent", "b", "c")
# Fields that leave an effect out if they are 0.
FROM_ZERO = ("aperture", "kr", "kt", "ks", "a", "b", "c")
# Fields of data whose three numbers are a colour, as on a screen.
SRGB = ("color", "palette", "under", "over", "missing")


@dataclass(frozen=True)
class Control:
    """What changes one value of a scene.

    address: address of the value.
    kind: `number` and `angle` (in degrees) are one number. `color` is a colour, and `share` one whose parts are at most
        1. `vector` is two or three numbers, such as a place, and `direction` three that are not all 0. `range` is two
        numbers that rise, such as the domain of a palette.
    value: the value now.
    low, high: the ends of a slider; for several numbers the same for each.
    step: the steps of a slider.
    group: what has the value: "camera", "material", "light", "object", "data", ...
    owner: address of the entry that has the value, such as materials.red, or of the section.
    label: rest of the address, as in kd.
    hint: the address, with the unit.
    has_slider: whether there is a slider; else the number is typed.
    shown: the curve of a colour's numbers: "srgb" if they are those of a screen, "linear" for light.
    scale: the light of a white picker: 1, or the largest part of a colour beyond 1.
    center: of a `range` with a fixed middle, this; else None.
    rule: address and fields of the record that is assigned instead of the value, if the scene has no such record yet.
    title: name of the row of data that has the value; "" for others.
    track: name of the track of an animation that moves the value, so that nothing else can; "" if there is none.
    """

    address: str
    kind: Kind
    value: Value
    low: float
    high: float
    step: float
    group: str
    owner: str
    label: str
    hint: str
    has_slider: bool = True
    shown: Literal["linear", "srgb"] = "linear"
    scale: float = 1.0
    center: float | None = None
    rule: tuple[str, tuple[tuple[str, Any], ...]] | None = None
    title: str = ""
    track: str = ""

    def assignments(self, value: Value) -> dict[str, Value]:
        """What gives the scene this value: values by address."""
        value = self.centred(value)
        if self.rule is None:
            return {self.address: value}
        address, fields = self.rule
        return {address: {**dict(fields), self.address.rpartition(".")[2]: value}}

    def centred(self, value: Value) -> Value:
        """A value; of a range with a fixed middle the end that moved farther counts for both."""
        if self.center is None or type(value) is not tuple:
            return value
        moved = max(zip(value, self.value), key=lambda pair: abs(pair[0] - pair[1]))[0]
        half = abs(moved - self.center)
        return self.center - half, self.center + half

    def picked(self, rgb: tuple[int, int, int]) -> tuple[float, ...]:
        """The colour of a picker. rgb: its numbers, from 0 to 255. If these are the ones that the picker shows, it is
        the colour as it is: a colour that nobody touches keeps all its digits."""
        if tuple(rgb) == self.picker:
            return self.value
        shares = np.array(rgb, float) / 255
        light = shares if self.shown == "srgb" else linear(shares)
        return tuple(float(f"{x:.6g}") for x in self.scale * light)

    @property
    def picker(self) -> tuple[int, int, int]:
        """The colour as the numbers of a picker, from 0 to 255: those of sRGB."""
        shares = np.clip(np.array(self.value) / self.scale, 0, 1)
        shown = shares if self.shown == "srgb" else curve(shares, "srgb")
        return tuple(int(x) for x in np.rint(255 * shown))

    @property
    def parts(self) -> tuple["Control", ...]:
        """A control for each number of a vector, a direction or a colour; none for other kinds."""
        if type(self.value) is not tuple or self.kind == "range":
            return ()
        names = "rgb" if self.kind in ("color", "share") else AXES
        # Light may be brighter than the picker can show.
        high = nice(2 * self.scale) if self.kind == "color" else self.high
        return tuple(
            replace(
                self,
                address=f"{self.address}.{i}",
                kind="number",
                value=x,
                high=high,
                label=f"{self.label} {names[i]}",
                hint=self.hint.replace(self.address, f"{self.address}.{i}", 1),
            )
            for i, x in enumerate(self.value)
        )

    def with_value(self, value: Value) -> "Control":
        """The control of another value. Its slider is longer, if that is needed."""
        numbers = value if type(value) is tuple else (value,)
        scale = max(self.scale, *numbers) if self.kind == "color" else self.scale
        return replace(self, value=value, low=min(self.low, *numbers), high=max(self.high, *numbers), scale=scale)


def control(scene: Scene, address: str, extent: float) -> Control | None:
    """The control of the value at an address; None if there is no continuous value. extent: size of the scene, in
    world units."""
    found = field_at(scene, address)
    if found is None or not numbers_of(found.value):
        return None
    most = limits(found.annotation, found.value)
    kind, shown = kind_of(address, found, most), "linear"
    if kind == "color" and most.quantity is None:
        kind, shown = "share", getattr(found.owner, "encoding", "srgb")
    name = name_of(address)
    reach = range_of(f"color.{name}" if ".color." in address else name, numbers_of(found.value), most, extent)
    scale = max(1.0, *found.value) if kind == "color" else 1.0
    if kind in ("color", "share"):
        reach = Range(0.0, scale, 0.001)
    if name == "shininess":
        reach = Range(0.0, max(float(min(reach.high, _brightest(scene))), found.value), 1.0)
    if name == "priority":
        # Only the order of these numbers counts. Few are used, and mostly whole ones.
        reach = Range(most.least, most.most, 1.0, has_slider=False)
    if is_code(address):
        reach = reach._replace(has_slider=False)
    if kind == "direction":
        longest = max(1.0, *map(abs, found.value))
        reach = Range(-longest, longest, 0.01)
    if kind == "range":
        reach = range_around(found.value, "log" in (getattr(found.owner, key, None) for key in ("scale", "norm")))
    unit = most.unit
    if name in FROM_ZERO and not any(numbers_of(found.value)):
        unit = f"{unit}; from 0 it takes some seconds, because this effect is not in the kernel yet"
    return made(address, kind, found.value, reach, unit, shown=shown, scale=scale)


def is_code(address: str) -> bool:
    """Whether each new value at an address compiles a new kernel: the place of the clip of a polynomial, about which it
    is expanded, and its tolerance."""
    *_, last = parts = [part for part in address.split(".") if not part.isdigit()]
    return last == "tolerance" or parts[-2:] in (["clip", "center"], ["clip", "min"], ["clip", "max"])


def is_read(scene: Scene, address: str) -> bool:
    """Whether the scene reads the value at an address. Others may contain only what they do."""
    name = name_of(address)
    if name not in UNREAD or address.split(".")[0] not in ("data", "lights"):
        return True
    found = field_at(scene, address)
    if isinstance(found.owner, ColorRule):
        return {"center": "symmetric", "exponent": "power"}.get(name, found.owner.norm) == found.owner.norm
    return not (isinstance(found.owner, Light) and not found.owner.has_position and name in ("b", "c"))


def _brightest(scene: Scene) -> int:
    """The largest shininess that the kernel of a scene provides for (Features.shininess_bits)."""
    largest = max([m.shininess for m in scene.materials.values()], default=0)
    return 2 ** max(8, 4 * -(-int(largest).bit_length() // 4)) - 1


def made(address: str, kind: Kind, value: Value, reach: Range, unit: str = "", **more: Any) -> Control:
    """A control with the names that its address gives it. more: its other fields."""
    group, owner, label = placed(address)
    hint = f"{address}, {unit}" if unit else address
    return Control(address, kind, value, *reach[:3], group, owner, label, hint, has_slider=reach.has_slider, **more)


def name_of(address: str) -> str:
    """Name of the field that an address ends in, without the numbers of a list."""
    return next((part for part in reversed(address.split(".")) if not part.isdigit()), "")


def kind_of(address: str, found: Field, most: Limits) -> Kind:
    """The kind of control that a field needs."""
    name = name_of(address)
    if type(found.value) is float:
        return "angle" if most.unit.startswith("degrees") or name == "rotate" else "number"
    if "Rec. 709" in most.unit:
        return "share" if most.most <= 1 else "color"
    if most.unit.startswith("any length"):
        return "direction"
    if len(found.value) == 2:
        return "range" if name == "domain" else "vector"
    return "color" if name in SRGB else "vector"


def placed(address: str) -> tuple[str, str, str]:
    """(group, owner, label) of an address."""
    section, *rest = address.split(".")
    if section in ENTRIES:
        label = rest[2:] if rest[1:-1] == ["parameters"] else rest[1:]
        return ENTRIES[section], f"{section}.{rest[0]}", ".".join(label)
    if section in ("camera", "settings"):
        return section, section, ".".join(rest)
    if section != "data" or len(rest) < 2:
        return ("data", "data", ".".join(rest)) if section == "data" else ("scene", "scene", address)
    size = 1 if rest[0] in ("base", "legend") else 2
    return "data", ".".join([section, *rest[:size]]), ".".join(rest[size:])


def extent_of(scene: Scene) -> float:
    """Size of a scene, in world units: the distance from the camera to what it looks at, or the height that it sees."""
    distance = float(np.linalg.norm(np.subtract(scene.camera.target, scene.camera.origin)))
    return min(max(getattr(scene.camera, "height", distance), 1e-6), ENDLESS / 10)
