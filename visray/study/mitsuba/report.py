"""The report of a check of a scene against Mitsuba."""

from dataclasses import asdict, dataclass, field, fields
from typing import Any

from visray.output.image import Image
from visray.tables import Table, styled

# Number of objects with one reason that the table lists as left out.
MOST_LEFT_OUT = 8


@dataclass(frozen=True)
class Tolerance:
    """A measured value, and the limit that it must not exceed.

    name: title of a group and of the value, separated by ": "
    unit: unit of value and limit, as text
    """

    name: str
    value: float
    limit: float
    unit: str

    @property
    def ok(self) -> bool:
        return self.value <= self.limit


@dataclass(frozen=True)
class RayDifferences:
    """Hits of the same rays by visray and by Mitsuba: counts, and the largest differences.

    rays: number of rays that both programs traced
    hits: rays that hit an object in visray
    near_edge: rays so near to an edge that rounding decides what they hit; the answers of both programs count as right
    tied: rays that hit two surfaces in the same place
    beyond: rays that hit a plane so far away that the squares for it in Mitsuba may not reach there
    hit_mismatches: of all other rays, those that hit something in one program only
    object_mismatches: of all other rays, those that hit different objects

    For rays that hit the same object:
    dt: largest |difference of t| / (|o| + t), with o relative to the camera
    angle: largest angle between normals (radians)
    uv: largest difference of u or v, without the uv_unresolved rays
    uv_unresolved: rays at seams, at poles, and very far away, where (u, v) are not certain
    dt_bound, angle_bound, uv_bound: largest quotient of the difference and the bound of its rounding error at the same
        ray; rounding does not explain a quotient above 1
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
        """The list of values that must not exceed their limits. title: name of the group."""
        bound = "of the rounding bound"
        return [
            Tolerance(f"{title}: hit mismatches", self.hit_mismatches, 0, "rays"),
            Tolerance(f"{title}: object mismatches", self.object_mismatches, 0, "rays"),
            Tolerance(f"{title}: distance", self.dt_bound, 1, bound),
            Tolerance(f"{title}: normal", self.angle_bound, 1, bound),
            Tolerance(f"{title}: uv", self.uv_bound, 1, bound),
            Tolerance(f"{title}: undecided", (self.near_edge + self.beyond) / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class ShadowDifferences:
    """Counts of shadow rays, from the points that pixels see to the lights that these points face.

    rays: number of shadow rays that both programs traced
    reached: rays that reach the light in visray
    near_edge: rays that rounding may move across a shadow's edge, and rays almost parallel to the surface
    mismatches: of all other rays, those that reach the light in one program only
    """

    rays: int
    reached: int
    near_edge: int
    mismatches: int

    def tolerances(self) -> list[Tolerance]:
        return [
            Tolerance("shadow rays: mismatches", self.mismatches, 0, "rays"),
            Tolerance("shadow rays: undecided", self.near_edge / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class ColouredShadowDifferences:
    """Transmittance of shadow rays through transparent objects.

    rays: number of shadow rays that hit any object, in visray or in Mitsuba
    near_edge: of these rays, those that rounding may move across an edge
    difference: largest difference of transmittance over all other rays
    bound: largest quotient of the difference and the bound of its rounding error
    """

    rays: int = 0
    near_edge: int = 0
    difference: float = 0.0
    bound: float = 0.0

    def tolerances(self) -> list[Tolerance]:
        return [
            Tolerance("coloured shadows: transmittance", self.bound, 1, "of the rounding bound"),
            Tolerance("coloured shadows: undecided", self.near_edge / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class AreaLightDifferences:
    """Shadow rays to a grid of points on each area light. Both programs use the same points.

    lights: number of area lights
    points: number of grid points on each light
    pixels: number of pixels; the shadow rays start at the points that these pixels see
    rays, reached, near_edge, mismatches: as in ShadowDifferences
    compared: number of pairs of a pixel and a light such that no ray between them is near an edge
    difference: mean over these pairs of |a - b|; a and b are the fractions of the light that are visible in visray and
        in Mitsuba
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
            Tolerance("area lights: undecided", self.near_edge / max(self.rays, 1), 0.5, "of the rays"),
        ]


@dataclass(frozen=True)
class MediaDifferences:
    """Media on both sides of transparent surfaces, along straight rays through the scene.

    rays: number of rays
    crossings: number of crossings with transparent surfaces
    compared: of these, those that are compared: no other surface is so near that rounding matters
    unordered: crossings at which it is not known which of two solids counts, because their volumes are too similar
    mismatches: of all compared crossings, those at which visray has another ratio of indices than the scene says, or
        hides a surface that counts, or the other way round
    """

    rays: int = 0
    crossings: int = 0
    compared: int = 0
    unordered: int = 0
    mismatches: int = 0

    def tolerances(self) -> list[Tolerance]:
        undecided = self.crossings - self.compared - self.unordered
        return [
            Tolerance("media: mismatches", self.mismatches, 0, "crossings"),
            Tolerance("media: undecided", undecided / max(self.crossings, 1), 0.5, "of the crossings"),
        ]


@dataclass(frozen=True)
class PictureDifference:
    """The difference between visray's picture and Mitsuba's picture with a Blinn-Phong BSDF.

    pixels: number of pixels
    compared: number of pixels that are not near an edge
    rms: root mean square of the difference, divided by the root mean square of visray's picture
    most: largest |difference| of a channel
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
    """The result of a check.

    width, height: size of the compared picture (pixels)
    seed: seed of the random rays
    objects: number of compared objects
    left_out: by the name of an object that Mitsuba does not have, the reason
    notes: lines of text about what else is not compared
    examples: a line of text for each of the first mismatches
    pixels, random: differences of the rays through the pixels' centres, and of random rays
    shadows, tints, penumbras: differences of shadow rays, of coloured shadows, and of shadows of area lights
    media: differences of media, from a witness that knows the scene file only
    picture: difference of the pictures
    difference: image with the layers RGB (visray minus Mitsuba), visray, mitsuba, and compared (1 or 0)
    """

    width: int
    height: int
    seed: int
    objects: int
    left_out: dict[str, str]
    notes: tuple[str, ...]
    examples: tuple[str, ...]
    pixels: RayDifferences
    random: RayDifferences
    shadows: ShadowDifferences
    tints: ColouredShadowDifferences
    penumbras: AreaLightDifferences
    media: MediaDifferences
    picture: PictureDifference
    difference: Image = field(repr=False)

    @property
    def tolerances(self) -> list[Tolerance]:
        tolerances = self.pixels.tolerances("pixel centres") + self.shadows.tolerances()
        # Kinds of shadows that the scene does not have are not listed.
        tolerances += self.tints.tolerances() if self.tints.rays else []
        tolerances += self.penumbras.tolerances() if self.penumbras.rays else []
        tolerances += self.media.tolerances() if self.media.rays else []
        return tolerances + self.random.tolerances("random rays") + self.picture.tolerances()

    @property
    def passed(self) -> bool:
        return all(t.ok for t in self.tolerances)

    def as_json(self) -> dict[str, Any]:
        """The report as a dict for json.dumps, without the image."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "difference"}
        entries = {k: asdict(v) if hasattr(v, "__dataclass_fields__") else v for k, v in values.items()}
        entries |= {k: list(v) for k, v in entries.items() if isinstance(v, tuple)}
        tolerances = [asdict(t) | {"ok": t.ok} for t in self.tolerances]
        return {"passed": self.passed, "tolerances": tolerances} | entries

    def table(self) -> Table:
        """The report as a table for the terminal: each value beside its limit, then counts and notes."""
        title = f"{'passed' if self.passed else 'FAILED'}: {self.objects} objects against Mitsuba"
        table = Table("", "", "value", "limit", "", title=title)
        previous = ""
        for t in self.tolerances:
            rays, quantity = t.name.split(": ")
            verdict = styled("ok", "green") if t.ok else styled("FAILED", "red")
            title = "" if rays == previous else rays
            table.add_row(title, quantity, f"{t.value:.3g}", f"{t.limit:g} {t.unit}", verdict)
            previous = rays
        counts = Table(show_header=False, box=None)
        for name, text in self._counts():
            counts.add_row(name, text)
        page = Table.grid()
        page.add_row(table)
        page.add_row(counts)
        return page

    def _counts(self) -> list[tuple[str, str]]:
        """Counts and notes for the terminal: pairs of a title and a text."""
        lines = []
        for title, r in (("pixel centres", self.pixels), ("random rays", self.random)):
            not_compared = f"{r.near_edge} near an edge, {r.tied} where two surfaces coincide"
            if r.beyond:
                not_compared += f", {r.beyond} beyond Mitsuba's planes"
            lines.append((title, f"{r.rays} rays, {r.hits} hits; not compared: {not_compared}"))
            largest = f"distance {r.dt:.2g} of |o| + t, normal {r.angle:.2g} rad, uv {r.uv:.2g}"
            lines.append(("  largest differences", largest))
        s, p = self.shadows, self.picture
        lines.append(("shadow rays", f"{s.rays} rays, {s.reached} reach the light; {s.near_edge} near an edge"))
        c, a = self.tints, self.penumbras
        if c.rays:
            lines.append(("coloured shadows", f"{c.rays} rays that hit an object; {c.near_edge} near an edge"))
            lines.append(("  largest difference", f"{c.difference:.2g} of transmittance"))
        if a.rays:
            grid = f"{a.lights} lights with {a.points} points each, from {a.pixels} pixels"
            rays = f"{a.rays} rays, {a.reached} reach the light; {a.near_edge} near an edge"
            lines.append(("area lights", f"{grid}; {rays}"))
            penumbra = (
                f"the visible fraction of a light differs by {a.difference:.2g} on average, over {a.compared} pixels"
            )
            lines.append(("  penumbra", penumbra))
        if (m := self.media).rays:
            unordered = f"; {m.unordered} in solids of similar volumes" if m.unordered else ""
            text = f"{m.rays} rays, {m.crossings} crossings of transparent surfaces; {m.compared} compared{unordered}"
            lines.append(("media", text))
        size = f"{self.width} x {self.height} pixels"
        lines.append(("picture", f"{size}, {p.compared} compared; largest difference {p.most:.2g}"))
        lines += self._left_out_lines()
        return lines + [("note", text) for text in self.notes] + [("example", text) for text in self.examples]

    def _left_out_lines(self) -> list[tuple[str, str]]:
        """The objects that are left out, each with the reason; of many with one reason, such as rows of data, the first
        ones."""
        by_reason: dict[str, list[str]] = {}
        for name, reason in self.left_out.items():
            by_reason.setdefault(reason, []).append(name)
        lines = []
        for reason, names in by_reason.items():
            lines += [(f"left out: {name}", reason) for name in names[:MOST_LEFT_OUT]]
            if len(names) > MOST_LEFT_OUT:
                lines.append((f"left out: {len(names) - MOST_LEFT_OUT:,} more", f"{reason} (--json has all)"))
        return lines
