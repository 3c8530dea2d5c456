"""Keys of VisRayTrace files with all their spellings, and the words that some of the keys can have as values."""

# For each kind of JSON object: its keys, each with its other spellings.
OBJECT = {"name": (), "type": (), "material": (), "data": (), "animation": ()}
OBJECTS = {
    "sphere": OBJECT | {"center": (), "radius": ("radious",)},
    "plane": OBJECT | {"point": (), "normal": ()},
    "fittedplane": OBJECT | {"point": (), "normal": (), "pmin": (), "pmax": (), "puntoCentro": ()},
    "triangle": OBJECT | {"p1": ("v1", "a"), "p2": ("v2", "b"), "p3": ("v3", "c")},
    "cylinder": OBJECT | {"center": (), "radius": ("radious",), "h": ("height",), "axis": ()},
    "box": OBJECT | {"minPoint": ("punt_min",), "maxPoint": ("punt_max",)},
    "mesh": OBJECT | {"objFileName": (), "nBox": ()},
    "polynomial": OBJECT | {"monomis": ()},
}


def _single_spelling(keys: str) -> dict[str, tuple[str, ...]]:
    """Dict of keys that have no other spelling. `keys`: the keys, separated by spaces."""
    return dict.fromkeys(keys.split(), ())


BASES = ("fittedplane", "plane", "sphere")
EXTENT = _single_spelling("minPoint maxPoint")
PROPERTY = _single_spelling("name minValue maxValue minValueReal maxValueReal colorMap material data") | {
    "gyzmo": ("gizmo",)
}

MATERIAL = _single_spelling("type ka kd ks shininess opacity kt nut dmax id textureFile colorGradient")
MATERIALS = ("lambertian", "metal", "transparent", "materialtextura")

SCENE = _single_spelling("scene typeScene objects base Real Virtual numFrames") | {"properties": ("attributes",)}
# Beginnings of the value of typeScene. Files that came with VisRayTrace write VIRTUAL or ONLINE in place of
# VIRTUALWORLD. They also write the renderType VIRTUAL in place of ONLINE.
SCENES = ("VIRTUAL", "ONLINE", "REALDATA", "TEMPORAL")

SETUP = _single_spelling(
    "renderType output camera globalLight lights background MAXDEPTH colorTopBackground colorDownBackground numSamples "
    "shading shadows reflections refractions textures ambientOcclusion"
)
RENDERS = ("ONLINE", "IMAGE", "TEMPORAL", "VIRTUAL")
CAMERA = _single_spelling("lookFrom lookAt vup vfov aspectRatio pixelsX defocusBlur aperture")
BLUR = _single_spelling("enabled aperture")
OCCLUSION = _single_spelling("enabled raysGlobal raysLocal maxDistance")

LIGHT = _single_spelling("type Ia Id Is a b c")
LIGHTS = {
    "pointLight": LIGHT | _single_spelling("position"),
    "spotLight": LIGHT | _single_spelling("position direction angle theta cosineCutoff exponent"),
    "areaLight": LIGHT | _single_spelling("position width height numLights"),
    "directionalLight": LIGHT | _single_spelling("direction intensity"),
}

# visray's shading mode for each value of `shading`. A value with "Shadow" at its end means: with shadows.
MODELS = {
    "BlinnPhong": "blinn-phong",
    "Phong": "phong",
    "Cel": "toon",
    "Toon": "toon",
    "Normal": "normal",
    "Depth": "depth",
    "Color": "albedo",
}
SHADINGS = (*MODELS, *(f"{model}Shadow" for model in MODELS))
