"""The keys of original VisRayTrace files with all their spellings, and their enumerations."""

# For every kind of JSON object: its keys, and after each the other spellings of the same key.
OBJECT = {"name": (), "type": (), "material": (), "data": ()}
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


def _plain(keys: str) -> dict[str, tuple[str, ...]]:
    """Keys that have one spelling each."""
    return dict.fromkeys(keys.split(), ())


MATERIAL = _plain("type ka kd ks shininess opacity kt nut dmax id textureFile colorGradient")
MATERIALS = ("lambertian", "metal", "transparent", "materialtextura")

SCENE = _plain("scene typeScene objects base Real Virtual") | {"properties": ("attributes",)}
# How a typeScene begins. Shipped files say VIRTUAL or ONLINE for VIRTUALWORLD, and VIRTUAL for the renderType ONLINE.
SCENES = ("VIRTUAL", "ONLINE", "REALDATA", "TEMPORAL")

SETUP = _plain(
    "renderType output camera globalLight lights background MAXDEPTH colorTopBackground colorDownBackground numSamples "
    "shading shadows reflections refractions textures ambientOcclusion"
)
RENDERS = ("ONLINE", "IMAGE", "TEMPORAL", "VIRTUAL")
CAMERA = _plain("lookFrom lookAt vup vfov aspectRatio pixelsX defocusBlur aperture")
BLUR = _plain("enabled aperture")
OCCLUSION = _plain("enabled raysGlobal raysLocal maxDistance")

LIGHT = _plain("type Ia Id Is a b c")
LIGHTS = {
    "pointLight": LIGHT | _plain("position"),
    "spotLight": LIGHT | _plain("position direction angle theta cosineCutoff exponent"),
    "areaLight": LIGHT | _plain("position width height numLights"),
    "directionalLight": LIGHT | _plain("direction intensity"),
}

# What the models of shading are called here. With "Shadow" at the end they have shadows.
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
