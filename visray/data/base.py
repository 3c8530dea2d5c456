"""The base of a data scene: the map, the plane or the globe on which data stand, and where a place on earth lies on it.

Longitudes and latitudes are in degrees, positive to the east and to the north.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union

import numpy as np
from pydantic import ConfigDict, Field

from visray.primitives.plane import Plane
from visray.primitives.primitive import Primitive
from visray.primitives.rectangle import Rectangle
from visray.primitives.sphere import Sphere
from visray.quantities import Length, Point, Real
from visray.records import record_kind
from visray.references import MaterialName
from visray.transforms import Scale, Transform, Translate, compose

DEGREE = np.pi / 180
# The largest latitude of a map in Mercator's projection; at it, a map of the whole earth is a little taller than wide.
MERCATOR_LIMIT = 85.06
# Largest deviation of a globe's transform from a similarity, relative to its scale: entries of a matrix in a file may
# have been rounded to 6 digits.
SIMILAR = 1 / 100_000


@dataclass(frozen=True)
class Ground:
    """Points of a base, with two directions at each, and their derivatives by longitude and latitude, per degree.

    point: in world units
    up, east: unit vectors, perpendicular to each other; `up` is the normal of the base, `east` lies in it

    Shapes: each (N, 3), float64.
    """

    point: np.ndarray
    up: np.ndarray
    east: np.ndarray
    point_lon: np.ndarray
    point_lat: np.ndarray
    up_lon: np.ndarray
    up_lat: np.ndarray
    east_lon: np.ndarray
    east_lat: np.ndarray


def on_earth(lon: Any, lat: Any) -> np.ndarray:
    """Whether the numbers can be a longitude, from -360 to 360, and a latitude, from -90 to 90. False for NaN.

    Shapes: (N), (N) -> (N).
    """
    return (np.abs(lon) <= 360) & (np.abs(lat) <= 90)


@dataclass(frozen=True, kw_only=True)
class AnyBase:
    """`material` is the name of the base's material, and `transform` the steps of its transform, in this order."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    material: MaterialName = "default"
    transform: tuple[Transform, ...] = ()

    def flaws(self) -> list[tuple[str, str]]:
        """A list of errors (field, message) that concern several fields or numbers together."""
        return []

    def linear(self) -> np.ndarray:
        """Linear part of the transform. Shape: (3, 3)."""
        matrix = compose(self.transform)
        return np.eye(3) if matrix is None else matrix[:, :3]

    def moved(self, point: list[np.ndarray], up: list[np.ndarray], east: list[np.ndarray]) -> Ground:
        """The ground after the transform. Each list: the value, and its derivatives by longitude and latitude."""
        matrix = compose(self.transform)
        if matrix is not None:
            linear, shift = matrix[:, :3], matrix[:, 3]
            point = [x @ linear.T for x in point]
            point[0] = point[0] + shift
            # A normal is multiplied by the transposed inverse. So it stays perpendicular to the base.
            up = _normalised([x @ np.linalg.inv(linear) for x in up])
            east = _normalised([x @ linear.T for x in east])
        (p, p_lon, p_lat), (u, u_lon, u_lat), (e, e_lon, e_lat) = point, up, east
        return Ground(p, u, e, p_lon, p_lat, u_lon, u_lat, e_lon, e_lat)


def _normalised(vectors: list[np.ndarray]) -> list[np.ndarray]:
    """Vectors with length 1, followed by their derivatives. vectors: the vectors, followed by their derivatives."""
    length = np.linalg.norm(vectors[0], axis=1, keepdims=True)
    unit = vectors[0] / length
    return [unit, *((d - unit * (unit * d).sum(axis=1, keepdims=True)) / length for d in vectors[1:])]


def _columns(*parts: Any) -> np.ndarray:
    """Vectors from their three components; a number stands for a column. Shape: (N, 3)."""
    return np.stack(np.broadcast_arrays(*parts), axis=1).astype(float)


@record_kind
@dataclass(frozen=True, kw_only=True)
class GlobeBase(AnyBase):
    """A globe: a sphere of `radius` about `center`. North is +y; longitude 0 is at +x, and 90 degrees east at -z.

    Textures have longitude 0 in their middle: u = 0.5 + longitude / 360, v = 0.5 + latitude / 180.
    """

    type: Literal["globe"] = "globe"
    center: Point = (0.0, 0.0, 0.0)
    radius: Length = 1.0

    def flaws(self) -> list[tuple[str, str]]:
        with np.errstate(all="ignore"):
            square = self.linear().T @ self.linear()
            scale = np.trace(square) / 3
            similar = np.abs(square - scale * np.eye(3)).max() <= SIMILAR * scale
        text = "stretches or shears the globe; take only rotations, translations and scales by one factor"
        return [] if similar else [("transform", text)]

    @property
    def size(self) -> float:
        """The diameter, after the transform."""
        return 2 * self.radius * float(np.cbrt(abs(np.linalg.det(self.linear()))))

    def object(self) -> Primitive:
        """The object that is rendered."""
        return Sphere(center=self.center, radius=self.radius, material=self.material, transform=self.transform)

    def inside(self, lon: Any, lat: Any) -> np.ndarray:
        """Whether places lie on the base. Shapes: (N), (N) -> (N)."""
        return on_earth(lon, lat)

    def joined(self, first: Any, last: Any) -> Any:
        """Whether a line between two longitudes stays on the base. Shapes: (N), (N) -> (N)."""
        return np.ones(np.shape(first), bool)

    def place(self, lon: Any, lat: Any) -> Ground:
        """The ground at places. Shapes: (N), (N). Domain: all finite numbers; at a pole, `east` is that of the
        meridian."""
        lon, lat = np.asarray(lon, float) * DEGREE, np.asarray(lat, float) * DEGREE
        (sin_lon, cos_lon), (sin_lat, cos_lat) = ((np.sin(x), np.cos(x)) for x in (lon, lat))
        east = _columns(-sin_lon, 0, -cos_lon)
        up = [
            _columns(cos_lat * cos_lon, sin_lat, -cos_lat * sin_lon),
            DEGREE * cos_lat[:, None] * east,
            DEGREE * _columns(-sin_lat * cos_lon, cos_lat, sin_lat * sin_lon),
        ]
        point = [self.radius * x for x in up]
        point[0] = point[0] + np.array(self.center)
        return self.moved(point, up, [east, DEGREE * _columns(-cos_lon, 0, sin_lon), np.zeros_like(east)])


Latitude = Annotated[Real, Field(ge=-90, le=90)]
Longitude = Annotated[Real, Field(ge=-360, le=360)]


@dataclass(frozen=True, kw_only=True)
class FlatBase(AnyBase):
    """A map in the plane y = `center`.y, with its middle at `center`. East is +x, and north is -z.

    extent: longitude of the west edge, longitude of the east edge, latitude of the south edge, latitude of the north
        edge. A map across the date line has an east edge beyond 180, such as (100, 260, -50, 50).
    width: size from west to east, in world units.
    depth: size from south to north; None for that with which shapes in the middle of the map are not distorted.
    projection: `equirectangular`: equal steps of latitude are equally far apart. `mercator`: angles are true.
    outside: whether data beyond the extent are `left out`, or `shown` beyond the edges of the map.

    Textures fill the map: u is 0 at its west edge and 1 at its east edge, v is 0 in the south and 1 in the north.
    """

    center: Point = (0.0, 0.0, 0.0)
    extent: tuple[Longitude, Longitude, Latitude, Latitude] = (-180.0, 180.0, -90.0, 90.0)
    width: Length = 10.0
    depth: Length | None = None
    projection: Literal["equirectangular", "mercator"] = "equirectangular"
    outside: Literal["left out", "shown"] = "left out"

    def flaws(self) -> list[tuple[str, str]]:
        west, east, south, north = self.extent
        if not west < east:
            text = "must be west, east, south, north with west < east; across the date line add 360 to the east edge"
            return [("extent", text)]
        if east - west > 360:
            return [("extent", "must not be wider than 360 degrees from west to east")]
        if not south < north:
            return [("extent", "must be west, east, south, north with south < north")]
        if self.projection == "mercator" and max(-south, north) > MERCATOR_LIMIT:
            limits = f"latitudes from -{MERCATOR_LIMIT} to {MERCATOR_LIMIT}"
            return [("extent", f"Mercator's projection has no poles; take {limits}, or equirectangular")]
        return []

    @property
    def size(self) -> float:
        """The width, after the transform."""
        return self.width * float(np.linalg.norm(self.linear()[:, 0]))

    @property
    def true_depth(self) -> float:
        """Size from south to north before the transform, in world units: `depth`, or what it is by default."""
        west, east, south, north = self.extent
        if self.depth is not None:
            return self.depth
        low, high = self.northing(np.array([south, north]))[0]
        # At latitude b, a degree of longitude is cos(b) times as long as a degree of latitude.
        squeeze = 1 if self.projection == "mercator" else np.cos(0.5 * (south + north) * DEGREE)
        return float(self.width * (high - low) / ((east - west) * squeeze))

    def inside(self, lon: Any, lat: Any) -> np.ndarray:
        """Whether places are shown: those on the map, or all on earth (`outside`). Longitudes may differ from those of
        the extent by 360. Shapes: (N), (N) -> (N)."""
        if self.outside == "shown":
            return on_earth(lon, lat)
        west, east, south, north = self.extent
        lat, wrapped = np.asarray(lat, float), self._wrapped(lon)
        return on_earth(lon, lat) & (wrapped >= west) & (wrapped <= east) & (lat >= south) & (lat <= north)

    def joined(self, first: Any, last: Any) -> Any:
        """Whether a line between two longitudes stays on the base, and does not cross its edge from side to side.
        Shapes: (N), (N) -> (N)."""
        return np.abs((self._wrapped(last) - self._wrapped(first)) - (last - first)) < 180

    def place(self, lon: Any, lat: Any) -> Ground:
        """The ground at places. Places beyond the extent lie beyond the edges of the map. Shapes: (N), (N). Domain:
        finite longitudes, latitudes from -90 to 90."""
        west, east, south, north = self.extent
        lon, lat = self._wrapped(lon), np.asarray(lat, float)
        low, high = self.northing(np.array([south, north]))[0]
        northing, slope = self.northing(lat)
        x_step, z_step = self.width / (east - west), -self.true_depth / (high - low)
        x, y, z = self.center
        point = _columns(x + x_step * (lon - 0.5 * (west + east)), y, z + z_step * (northing - 0.5 * (low + high)))
        nothing = np.zeros_like(point)
        steps = [np.broadcast_to([x_step, 0, 0], point.shape), _columns(0 * slope, 0, z_step * slope)]
        up, right = (np.broadcast_to(np.array(v, float), point.shape) for v in ((0, 1, 0), (1, 0, 0)))
        return self.moved([point, *steps], [up, nothing, nothing], [right, nothing, nothing])

    def northing(self, lat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far north latitudes lie in the projection, in degrees of longitude at the equator, and the derivative by
        latitude.

        Source: Snyder, Map Projections - A Working Manual, 1987, pages 41 and 91.
        """
        if self.projection == "equirectangular":
            return lat, np.ones_like(lat)
        return np.arcsinh(np.tan(lat * DEGREE)) / DEGREE, 1 / np.cos(lat * DEGREE)

    def _wrapped(self, lon: Any) -> np.ndarray:
        """Longitudes beyond the extent, plus or minus 360 if this is nearer to the map."""
        west, east, _, _ = self.extent
        lon = np.asarray(lon, float)
        turns = np.round((lon - 0.5 * (west + east)) / 360)
        with np.errstate(invalid="ignore"):
            return np.where((lon >= west) & (lon <= east), lon, lon - 360 * turns)


@record_kind
@dataclass(frozen=True, kw_only=True)
class MapBase(FlatBase):
    """A rectangle with a map."""

    type: Literal["map"] = "map"

    def object(self) -> Primitive:
        """The object that is rendered."""
        sides = {"width": (self.width, 0.0, 0.0), "height": (0.0, 0.0, -self.true_depth)}
        return Rectangle(center=self.center, **sides, material=self.material, transform=self.transform)


@record_kind
@dataclass(frozen=True, kw_only=True)
class PlaneBase(FlatBase):
    """An infinite plane. The map is a part of it, and its texture goes on beyond the map's edges as its `wrap` says."""

    type: Literal["plane"] = "plane"

    def object(self) -> Primitive:
        """The object that is rendered."""
        x, y, z = self.center
        depth = self.true_depth
        # u and v of a plane are distances from the origin before the transform. Here this is the south-west corner.
        steps = (
            Scale(scale=(self.width, 1.0, depth)),
            Translate(translate=(x - 0.5 * self.width, y, z + 0.5 * depth)),
        )
        return Plane(material=self.material, transform=(*steps, *self.transform))


KINDS = (GlobeBase, MapBase, PlaneBase)
Base = Annotated[Union[KINDS], Field(discriminator="type")]
