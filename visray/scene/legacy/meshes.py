"""Meshes of a VisRayTrace scene, as plain dicts of visray's fields."""

from dataclasses import dataclass

from visray.scene.legacy.entry import Entry
from visray.scene.legacy.resources import Resources
from visray.scene.messages import line


@dataclass(frozen=True)
class Meshes:
    """How the meshes of a scene are read.

    resources: finds the mesh files.
    compat: whether triangles are flat, as in VisRayTrace. Otherwise normals are smooth, as the authors of rounded
        shapes meant them.
    """

    resources: Resources
    compat: bool

    def fields(self, e: Entry) -> dict:
        """Fields of a mesh. `nBox`, the number of grid cells along each axis, only made VisRayTrace faster."""
        if e.text("objFileName") is None:
            e.log.error(f"{e.at('objFileName')}: the key is missing; it is the path of a mesh file")
            return {}
        e.number("nBox", 1.0)
        if e.has("nBox"):
            text = "changes only the speed of VisRayTrace; visray chooses by itself how rays find triangles"
            e.log.warn_once("nBox", line(e.at("nBox"), e.values["nBox"], text))
        if not self.compat:
            text = "edges that bend by at most 40 degrees look smooth; VisRayTrace and --compat draw flat triangles"
            e.log.warn_once("normals", f"{e.at('objFileName')}: {text}")
        file = self.resources.path(e, "objFileName", "mesh file")
        return {"type": "mesh", "file": file} | ({"normals": "face"} if self.compat else {})
