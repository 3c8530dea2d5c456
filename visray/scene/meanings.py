"""Meanings of the fields of a scene, as the JSON Schema shows them."""

from visray.animation.animation import Animation
from visray.animation.ellipse import Ellipse, EllipseTrack
from visray.animation.keys import KeysTrack
from visray.animation.orbit import OrbitTrack
from visray.animation.path import PathTrack
from visray.animation.spin import SpinTrack
from visray.animation.track import TimedTrack
from visray.camera import Shutter, Viewpoint
from visray.data.base import AnyBase, FlatBase
from visray.data.color_rule import ColorRule
from visray.data.data_scene import Data
from visray.data.layer import DataLayer, RowEdit
from visray.data.legend import Legend
from visray.data.size_rule import SizeRule
from visray.environment_map import EnvironmentMap
from visray.filters import GaussianFilter, MitchellFilter, ReconstructionFilter
from visray.lights.light import AreaLight
from visray.materials import Material
from visray.modes import MODES
from visray.polynomials.catalogue import SURFACES
from visray.primitives.csg import Csg
from visray.primitives.instance import Instance
from visray.primitives.mesh import FitBox, Mesh
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Primitive
from visray.scene.film import Film
from visray.scene.scene import Occlusion, Scatter, Scene, Settings
from visray.textures import ImageTexture, Texture
from visray.transforms import Matrix, Rotate, Scale

# Meanings of the fields whose values are no numbers of a kernel. A number of a kernel has its unit instead
# (quantities.Quantity).
MEANINGS: dict[type, dict[str, str]] = {
    Scene: {
        "camera": "where you look from, and where to; perspective if it has no type; null: one is fitted that shows "
        "all that is bounded",
        "background": "light of rays that hit nothing: a colour, a gradient, or an environment map",
        "textures": "textures by name",
        "materials": "materials by name",
        "lights": "lights by name; {}: none; null: a key light and a fill light are fitted",
        "geometries": "shapes by name that objects of the type instance show, each many times; they have no material",
        "objects": "objects by name",
        "data": "real data: a map or a globe, and layers of rows of tables, each row shown by a gizmo",
        "animation": "what moves, as functions of time, or null",
    },
    Viewpoint: {"shutter": "when the camera's shutter is open, for motion blur; null: for an instant"},
    Shutter: {
        "open": "when it opens, as a share of the time from one frame to the next, from -1 to 1",
        "close": "when it closes, as a share of the time from one frame to the next, from -1 to 1; after open",
        "moments": "number of moments that samples are spread over, from 1 to 1024",
    },
    Film: {
        "width": "pixels, > 0",
        "height": "pixels, > 0",
        "transparent": "whether the background is left out; layer A is then the coverage",
        "filter": "how light near a pixel's centre counts in the pixel: the name of a filter, or its fields",
        "region": "the part of the picture that is rendered: left, top, right and bottom edge in pixels; null: all",
        "scale": "multiplies width and height, from above 0 to 1000",
    },
    ReconstructionFilter: {"radius": "pixels from the pixel's centre, from 0.1 to 16"},
    GaussianFilter: {"sigma": "standard deviation in pixels, from 0.05 to 16"},
    MitchellFilter: {"b": "how much is blurred, from 0 to 1", "c": "how much is sharpened, from 0 to 1"},
    Settings: {
        "spp": "samples per pixel, > 0",
        "seed": "a whole number from 0 to 4294967295; another seed gives other noise",
        "precision": "precision of shading; geometry is always double",
        "sampler": "how the samples of a pixel are placed",
        "shading": "; ".join(f"{mode.name}: {mode.meaning}" for mode in MODES),
        "shadows": "whether objects cast shadows",
        "depth": "largest number of reflections and refractions in a row, from 0 (none at all) to 1000",
        "misses": "colour of a reflected, refracted or scattered ray that hits nothing",
        "local": "weight of a transparent surface's own colour: 1 - kt (weighted) or 1 (full)",
        "area": "where the light of an area light comes from: its samples, or its centre",
        "accelerator": "how rays find objects; the picture is bit for bit the same with each",
    },
    Occlusion: {
        "sky": "number of rays per point that measure how much of the sky is visible, from 0 to 65536",
        "near": "number of rays per point that measure how near other surfaces are, from 0 to 65536",
        "hemisphere": "distribution of the rays: cosine, or box as in the original VisRayTrace",
        "light": "what sky rays that hit nothing bring: the scene's ambient, or the background",
    },
    Scatter: {
        "rays": "number of rays from each point that the camera sees, from 0 to 65536",
        "depth": "largest number of bounces, from 0 to 1000",
    },
    Material: {
        "priority": "where transparent solids overlap, the one with the higher priority counts; of equal ones, the "
        "smaller solid",
        "texture": "the name of one of the scene's textures, or null",
        "color": "kd as people pick colours, in its place: a name, #rrggbb, three numbers from 0 to 255, or one from 0 "
        "to 1 for grey in linear light",
        "textured": "what the texture colours: it replaces kd and multiplies ka, or it only replaces kd",
        "colored": "the fields that a palette colour of a data layer changes: it replaces kd and multiplies the others",
        "absorption": "light that runs a length d inside the solid is multiplied by exp(-absorption d); per world "
        "unit, each from 0 to 1e9",
        "fresnel": "how kr and kt depend on the angle. none: not at all; dielectric: as at glass and water of the "
        "ior; metal: kr grows to 1 at grazing angles",
        "emission": "light that the surface itself sends out: it is seen, and lights nothing",
        "shading": "lit, or unlit: the surface shows kd or its texture as it is, whatever light falls on it",
        "back": "the name of the material of the side that the normal points away from, or null: the same one",
    },
    EnvironmentMap: {
        "file": "path of the picture, relative to the scene file: EXR, HDR, PNG or JPEG, twice as wide as high",
    },
    Texture: {
        "scale": "repetitions of the texture per unit of u and of v, each from -1e6 to 1e6",
        "offset": "added to u and v after they are multiplied by scale; each from -1e6 to 1e6",
    },
    ImageTexture: {
        "file": "path of the image, relative to the scene file",
        "filter": "nearest: the colour of one pixel; bilinear: a blend of four",
        "wrap": "how the image continues beyond its edges; a pair is for u and for v",
        "encoding": "encoding of the numbers in the file; auto means srgb for PNG and JPEG, and linear for EXR and HDR",
    },
    AreaLight: {
        "samples": "light samples per shaded point, from 1 to 65536",
        "visible": "whether the shape of the light is seen, in the colour Id times intensity",
    },
    Primitive: {
        "material": "the name of one of the scene's materials, or default",
        "transform": "transformation steps; the first one is applied first",
        "cut": "solids that are taken away from the object, which move with it: a list of objects, or objects by name",
        "cut_material": "the name of the material of faces that are made by cutting; default: that of the object",
    },
    Csg: {
        "op": "union: all points of any operand; merge: the same, and transparent solids become one; intersection: the "
        "points of all operands; difference: the points of the first operand that are in no other one",
        "of": "the operands, at least two, each an object of any type: a list, or objects by name; a plane is the "
        "half-space that its normal points away from",
        "ends": "capped: a solid; open: only the surface of the first operand, with holes where it is cut",
    },
    Polynomial: {
        "expression": 'f, as in "x^2 + y^2 - z^2 - a", made of x, y, z, numbers, parameters, sqrt(number), pi and '
        "phi (the golden ratio)",
        "monomis": 'the terms of f, as in ["0.9x2", "-3y2", "-1"]',
        "surface": f"the name of a known surface: {', '.join(SURFACES)}",
        "parameters": "values of the parameters by name: those in the expression, or those of the known surface",
        "clip": "ball or box that bounds the surface; default: that of the known surface, or a ball of radius 5",
        "ends": "open: the surface has an edge at the clip; capped: the surface is that of a solid, the points of the "
        "clip with f < 0",
        "tolerance": "largest error of a crossing, from 0 to 1, as a share of half the length of the ray in the clip",
    },
    Mesh: {
        "file": "path of the mesh file (OBJ, PLY, STL, glTF, GLB or OFF), relative to the scene file",
        "part": "the name of a part of the file; default: all parts",
        "vertices": "the vertices, if there is no file: x, y and z of each, in world units",
        "faces": "the triangles, if there is no file: three numbers of vertices each, counted from 0",
        "normals": "face: flat triangles; smooth: averaged over edges that bend by at most `crease` degrees; file: "
        "those of the file",
        "crease": "degrees, from 0 to 180",
        "fit": "longest side of the bounding box, which is then centred at the origin, or a box to fit into",
        "solid": "auto: a mesh without open edges is a solid; true: open edges are an error; false: never a solid",
    },
    FitBox: {},
    Instance: {"geometry": "the name of one of the scene's geometries"},
    Scale: {"scale": "one factor, or one for each axis; not 0"},
    Rotate: {"rotate": "degrees"},
    Matrix: {"matrix": "the upper three rows of a 4 x 4 matrix"},
    Data: {
        "base": "what the data stand on: a globe, a map, or a plane with a map",
        "layers": "layers of data, by name",
        "legend": "what is written over the picture, or null",
        "date": "the moment that layers with a time show: a date such as 2020-06-15, or a number; null: the first one",
    },
    AnyBase: {"material": "the name of one of the scene's materials, or default", "transform": "transformation steps"},
    FlatBase: {
        "extent": "longitude of the west and the east edge, latitude of the south and the north edge, in degrees",
        "depth": "size from south to north in world units; null: what distorts nothing in the middle of the map",
        "outside": "whether places beyond the edges of the map are shown, or left out and counted",
        "projection": "equirectangular: equal steps of latitude are equally far apart; mercator: angles are true",
    },
    DataLayer: {
        "source": "path of a CSV or GeoJSON file, relative to the scene file, or columns by name",
        "lon": "column with longitudes in degrees, or these; null: the column with a usual name",
        "lat": "column with latitudes in degrees, or these; null: the column with a usual name",
        "value": "column, or numbers, for sizes and colours where these are not given",
        "name": "column with the names of the rows, for labels; null: the column with a usual name, if there is one",
        "gizmo": "the shape that shows a row",
        "geometry": "for the gizmo geometry: the name of one of the scene's geometries",
        "height": "size along the base's normal: world units, a column, or a rule",
        "radius": "half the width: world units, a column, or a rule",
        "color": "a column, a rule, or one colour in sRGB; null: the material's own",
        "material": "the name of one of the scene's materials, or default",
        "sunk": "share of the gizmo's height that is below the base, from 0 to 1",
        "lift": "height of the gizmo's foot above the base, in world units; null: 0, or a little for disks",
        "rows": "numbers that replace those of the source, by the number of the row, counted from 0",
        "time": "column with the date of each row, or its moment as a number; rows of one name are then one place",
        "between": "numbers between two dates: interpolated, or held, which is the last known one",
    },
    RowEdit: {
        "lon": "longitude in degrees",
        "lat": "latitude in degrees",
        "height": "in units of the data",
        "radius": "in units of the data",
        "color": "in units of the data",
    },
    SizeRule: {
        "column": "the column with the values",
        "scale": "what is proportional to sizes: the value, its root, or its logarithm",
        "domain": "values that have the sizes of the range; null: from 0 (log: the smallest one) to the largest",
        "range": "sizes in world units; null: from the size of the base",
        "negative": "down: negative values hang down; refuse: they are errors",
    },
    ColorRule: {
        "column": "the column with the values",
        "palette": "name of a palette, a list of colours, or a list of [position, colour]",
        "reversed": "whether the palette is turned around",
        "norm": "how values become places on the palette",
        "domain": "values at the ends of the palette; null: the range of the data",
        "center": "value in the middle of the palette, for the norm symmetric",
        "exponent": "exponent of the norm power",
        "bands": "number of steps of colour, or their edges",
        "under": "colour of values below the domain; null: that of the palette's beginning",
        "over": "colour of values above the domain; null: that of the palette's end",
        "missing": "colour of missing values",
        "lookup": "smooth: colours are blended; table: the nearest lower one of 256, as in the original VisRayTrace",
        "encoding": "encoding of the palette's numbers",
    },
    Legend: {
        "title": "text at the top",
        "subtitle": "text below the title",
        "source": "text at the bottom: where the data come from",
        "places": "names of rows that are written in the picture: none, all, or a list",
        "points": "further places that are named: longitude and latitude by name",
        "date": "whether the date of data with a time is shown, or its format, such as %d %B %Y",
        "bars": "whether colours have keys",
        "sizes": "whether sizes have keys",
        "labels": "texts in place of the names of columns",
        "units": "units of columns",
        "no_data": "text for missing values",
        "position": "side of the picture on which the keys are",
        "theme": "that of the picture: text is dark on a light one; auto looks at the picture",
        "size": "size of the text, relative to the usual one, from 0.5 to 4",
        "font": "family of fonts, or null",
    },
    Animation: {
        "duration": "seconds, > 0",
        "fps": "frames per second, > 0",
        "tracks": "tracks by name; a track without a type has the type keys",
    },
    TimedTrack: {
        "begin": "seconds at which the track begins",
        "end": "seconds at which the track is complete; null: the end of the animation",
    },
    KeysTrack: {
        "address": "the address of what moves, such as objects.ball.center",
        "times": "seconds, increasing, at least two",
        "values": "one value for each time: a number, a list of numbers, a step of a transform, or a list of steps",
        "interpolation": "linear; smooth: a monotone cubic; step: the value of the key before",
    },
    OrbitTrack: {
        "turns": "number of turns; negative: the other way round",
        "axis": "axis through the camera's target; null: the camera's up",
    },
    SpinTrack: {
        "of": "the address of what turns: an object, a geometry, an operand, or data.base",
        "center": "a point of the axis, in world units; null: the centre of the bounding box, about which it turns in "
        "place",
        "turns": "number of turns; negative: the other way round",
    },
    PathTrack: {
        "address": "the address of the point that moves, such as camera.origin",
        "points": "points of the path, at least two, in world units",
        "closed": "whether the path goes from the last point back to the first one",
        "interpolation": "linear: straight lines; smooth: a centripetal Catmull-Rom curve",
    },
    Ellipse: {
        "radii": "radii in x and in z, in world units",
        "period": "seconds of one turn, not 0; clockwise when seen from above, negative: the other way round",
        "phase": "degrees at the time 0; 0 is the direction of x, 90 that of z",
    },
    EllipseTrack: {
        "address": "the address of the point that moves, such as objects.moon.center",
        "center": "centre of the ellipse; null: the point that the scene has at the address",
        "around": "a second ellipse, which is added, or null",
    },
}
