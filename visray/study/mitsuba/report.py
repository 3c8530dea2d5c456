"""What a check of a scene against Mitsuba found."""

from dataclasses import asdict, dataclass, field, fields
from typing import Any

from rich.markup import escape
from rich.table import Table

from visray.output.image import Image


@dataclass(frozen=True)
class Tolerance:
    """A measured value, and the limit it must not exceed."""

    name: str
    value: float
    limit: float
    unit: str

    @property
    def ok(self) -> bool:
        return self.value <= self.limit


@dataclass(frozen=True)
class Crossings:
    """The same rays through both.

    rays: sent. hits: of them by visray. near_edge: within the rounding of an edge, so that either answer is right.
    tied: two surfaces in the same place. beyond: hits of a plane beyond its twin. hit_mismatches, object_mismatches: of
    all other rays.

    For rays that hit the same object: dt, the largest |dt| over the sum of |o| and t, with o from the camera; angle,
    the largest between the normals (radians); uv, the largest difference of u or v, without the uv_unresolved rays, at
    seams, poles and very far away. dt_bound, angle_bound and uv_bound are the largest shares of what rounding may make
    them at a ray: what is above 1 is no rounding.
    """

    rays: int
    hits: int
    near_edge: int
    tied: int
    beyond: int
    hit_mismatches: int
    object_mismatches: int
    uv_unresolved: int
    dt: float
    dt_bound: float
    angle: float
    angle_bound: float
    uv: float
    uv_bound: float

    def tolerances(self, title: str) -> list[Tolerance]:
        bound = "of the rounding bound"
        return [
            Tolerance(f"{title}: hit mismatches", self.hit_mismatches, 0, "rays"),
            Tolerance(f"{title}: object mismatches", self.object_mismatches, 0, "rays"),
            Tolerance(f"{title}: distance", self.dt_bound, 1, bound),
            Tolerance(f"{title}: normal", self.angle_bound, 1, bound),
            Tolerance(f"{title}: uv", self.uv_bound, 1, bound),
            Tolerance(f"{title}: not decided", (self.near_edge + self.beyond) / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class Shadows:
    """Rays between what the pixels see and the lights it faces.

    near_edge: within the rounding of a shadow's edge or of grazing light. mismatches: of all other rays.
    """

    rays: int
    reached: int
    near_edge: int
    mismatches: int

    def tolerances(self) -> list[Tolerance]:
        return [
            Tolerance("shadow rays: mismatches", self.mismatches, 0, "rays"),
            Tolerance("shadow rays: not decided", self.near_edge / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class Tints:
    """The same rays where transparent objects let light through: the share of it that arrives, a colour.

    rays: those that meet any object, by visray or by Mitsuba. near_edge: of them, within the rounding of an edge.
    difference: the largest of all others; bound: the largest share of what rounding may make it.
    """

    rays: int = 0
    near_edge: int = 0
    difference: float = 0.0
    bound: float = 0.0

    def tolerances(self) -> list[Tolerance]:
        return [
            Tolerance("coloured shadows: share", self.bound, 1, "of the rounding bound"),
            Tolerance("coloured shadows: not decided", self.near_edge / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class Penumbras:
    """Rays between what the pixels see and points all over each area light, the same points for both.

    lights: how many; points: of each; pixels: from which rays were sent. near_edge and mismatches: as of Shadows.
    difference: of the fraction of points that a pixel sees, the mean over pixels of which no ray is near an edge.
    """

    lights: int = 0
    points: int = 0
    pixels: int = 0
    rays: int = 0
    reached: int = 0
    near_edge: int = 0
    mismatches: int = 0
    compared: int = 0
    difference: float = 0.0

    def tolerances(self) -> list[Tolerance]:
        return [
            Tolerance("area lights: mismatches", self.mismatches, 0, "rays"),
            Tolerance("area lights: penumbra", self.difference, 0, "of the points, mean"),
            Tolerance("area lights: not decided", self.near_edge / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class Pictures:
    """visray's picture less that of a Blinn-Phong BSDF in Mitsuba, over the pixels that are near no edge.

    rms: root of the mean squared difference, over that of the picture. most: the largest difference of a channel.
    """

    pixels: int
    compared: int
    rms: float
    most: float

    LIMIT = 1e-3

    def tolerances(self) -> list[Tolerance]:
        return [Tolerance("picture: difference", self.rms, self.LIMIT, "of its RMS")]


@dataclass(frozen=True)
class Report:
    """The outcome of a check. `difference` holds RGB = visray - Mitsuba, both pictures, and which pixels count."""

    width: int
    height: int
    seed: int
    objects: int
    left_out: dict[str, str]
    notes: tuple[str, ...]
    examples: tuple[str, ...]
    pixels: Crossings
    random: Crossings
    shadows: Shadows
    tints: Tints
    penumbras: Penumbras
    picture: Pictures
    difference: Image = field(repr=False)

    @property
    def tolerances(self) -> list[Tolerance]:
        found = self.pixels.tolerances("pixel centres") + self.shadows.tolerances()
        # Of what a scene has not nothing is said.
        found += self.tints.tolerances() if self.tints.rays else []
        found += self.penumbras.tolerances() if self.penumbras.rays else []
        return found + self.random.tolerances("random rays") + self.picture.tolerances()

    @property
    def passed(self) -> bool:
        return all(t.ok for t in self.tolerances)

    def as_json(self) -> dict[str, Any]:
        """The report as json.dumps takes it, without the picture."""
        parts = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "difference"}
        plain = {k: asdict(v) if hasattr(v, "__dataclass_fields__") else v for k, v in parts.items()}
        plain |= {k: list(v) for k, v in plain.items() if isinstance(v, tuple)}
        judged = [asdict(t) | {"ok": t.ok} for t in self.tolerances]
        return {"passed": self.passed, "tolerances": judged} | plain

    def table(self) -> Table:
        """The report for the terminal: each value beside its limit, then what was counted."""
        title = f"{'passed' if self.passed else 'FAILED'}: {self.objects} objects against Mitsuba"
        table = Table("", "", "value", "limit", "", title=title)
        before = ""
        for t in self.tolerances:
            rays, what = t.name.split(": ")
            verdict = "[green]ok[/]" if t.ok else "[red]FAILED[/]"
            table.add_row("" if rays == before else rays, what, f"{t.value:.3g}", f"{t.limit:g} {t.unit}", verdict)
            before = rays
        facts = Table(show_header=False, box=None)
        for name, text in self._counted():
            facts.add_row(escape(name), escape(text))
        whole = Table.grid()
        whole.add_row(table)
        whole.add_row(facts)
        return whole

    def _counted(self) -> list[tuple[str, str]]:
        rows = []
        for title, c in (("pixel centres", self.pixels), ("random rays", self.random)):
            spared = f"{c.near_edge} near an edge, {c.tied} tied, {c.beyond} beyond"
            rows.append((title, f"{c.rays} rays, {c.hits} hits; {spared}"))
            rows.append(("  largest", f"|dt| {c.dt:.2g} of |o| + t, normal {c.angle:.2g} rad, uv {c.uv:.2g}"))
        s, p = self.shadows, self.picture
        rows.append(("shadow rays", f"{s.rays} rays, {s.reached} reach the light; {s.near_edge} near an edge"))
        t, a = self.tints, self.penumbras
        if t.rays:
            rows.append(("coloured shadows", f"{t.rays} rays with something between; {t.near_edge} near an edge"))
            rows.append(("  largest", f"difference of the share {t.difference:.2g}"))
        if a.rays:
            of = f"{a.lights} with {a.points} points each, from {a.pixels} pixels"
            rows.append(
                ("area lights", f"{of}; {a.rays} rays, {a.reached} reach the light; {a.near_edge} near an edge")
            )
            rows.append(("  penumbra", f"of {a.compared} pixels the fraction of points differs by {a.difference:.2g}"))
        size = f"{self.width} x {self.height} pixels"
        rows.append(("picture", f"{size}, {p.compared} compared; largest difference {p.most:.2g}"))
        rows += [(f"left out: {name}", why) for name, why in self.left_out.items()]
        return rows + [("note", text) for text in self.notes] + [("example", text) for text in self.examples]
