"""What is said of meshes: wrong ones in scene files, notes about their files, and the list of `visray explain`."""

import itertools
import json
import os
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray.cli import main
from visray.mesh_report import MeshWarning, mesh_facts, mesh_notes
from visray.primitives import mesh as mesh_module

TETRAHEDRON = "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
OPEN = "OFF\n4 3 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n"
PLY = "ply\nformat binary_little_endian 1.0\nelement vertex 900000000\nproperty float x\nproperty float y\n"
PLY += "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
PACKED = {
    "asset": {"version": "2.0"},
    "extensionsRequired": ["KHR_draco_mesh_compression"],
    "meshes": [{"primitives": [{}]}],
}
ONE_GROUP = "3 open edges around 1 hole, the first from (0, 0, 0) to (0, 1, 0)"


def folder_of(tmp_path: Path) -> Path:
    (tmp_path / "closed.off").write_text(TETRAHEDRON)
    (tmp_path / "open.off").write_text(OPEN)
    return tmp_path


def said(tmp_path: Path, capsys: pytest.CaptureFixture, fields: dict, *command: str) -> tuple[int, list[str]]:
    """Exit code of a command on a scene with a mesh, and the lines of its notes and errors, without the path."""
    scene = tmp_path / "x.json"
    parts = {"textures": {"squares": {"type": "checker"}}, "materials": {"painted": {"texture": "squares"}}}
    parts["camera"] = {}
    parts["lights"] = {"key": {"type": "point", "position": [3, 4, 5]}}
    scene.write_text(json.dumps(parts | {"objects": {"m": {"type": "mesh", **fields}}}))
    code = main([command[0], str(scene), *command[1:]])
    lines = (
        capsys.readouterr()
        .err.replace(f"{scene}: ", "")
        .replace(f"{tmp_path}/", "")
        .replace(f'"{tmp_path}"', '"."')
        .splitlines()
    )
    return code, [line for line in lines if line.startswith("visray: ")]


@pytest.mark.parametrize(
    ("fields", "text", "what"),
    [
        ({"file": "none.obj"}, None, 'file = "none.obj": there is no such file; check the path'),
        ({"file": "."}, None, 'file = ".": is a folder; give a file in it'),
        ({"file": "a.blend"}, b"BLENDER", 'file = "a.blend": is not known to be a mesh by its name; visray reads OBJ'),
        ({"file": "a.obj"}, b'{"a": 1}', 'file = "a.obj": is damaged or no OBJ file'),
        ({"file": "a.ply"}, b"\x89PNG\r\n\x1a\n", 'file = "a.ply": is no PLY file'),
        ({"file": "a.obj"}, b"", 'file = "a.obj": is empty; save the mesh anew'),
        ({"file": "a.obj"}, TRIANGLE, 'file = "a.obj": has no triangles'),
        ({"file": "a.obj"}, TRIANGLE.replace("v 1", "v nan") + "f 1 2 3", 'file = "a.obj": vertex 2 is not finite'),
        ({"file": "a.obj"}, TRIANGLE.replace("v 1", "v -inf") + "f 1 2 3", 'file = "a.obj": vertex 2 is not finite'),
        ({"file": "a.obj"}, TRIANGLE.replace("v 1", "v 1e300") + "f 1 2 3", 'file = "a.obj": vertex 2 has the coord'),
        ({"file": "a.obj"}, TRIANGLE + "f 1 2 7", 'file = "a.obj": line 4 names vertex 7; the file has 3'),
        ({"file": "a.obj"}, TRIANGLE + "f 1 2 2", 'file = "a.obj": no triangle has an area'),
        ({"file": "a.ply"}, PLY, "file = \"a.ply\": claims 900,000,000 rows of 'vertex', but only 0 bytes follow"),
        ({"file": "a.stl"}, bytes(80) + struct.pack("<I", 4 * 10**9), 'file = "a.stl": is damaged or no STL file'),
        (
            {"file": "a.glb"},
            struct.pack("<4sIIII", b"glTF", 2, 20, 0xFFFFFF00, 0x4E4F534A),
            'file = "a.glb": claims a part of 4,294,967,040 bytes, but 0 follow',
        ),
        ({"file": "a.gltf"}, json.dumps(PACKED), 'file = "a.gltf": needs the extension KHR_draco_mesh_compression'),
        ({"file": "open.off", "solid": True}, None, f"solid = true: the mesh is not closed: {ONE_GROUP}; mend it"),
        ({"file": "closed.off", "solid": "yes"}, None, 'solid = "yes": unknown value; one of auto, true, false'),
        ({"file": "closed.off", "part": "lid"}, None, "part = \"lid\": the file has no part 'lid'"),
        ({"file": "closed.off", "normals": "file"}, None, 'normals = "file": the file has no normals; use smooth or '),
        ({"file": "closed.off", "normals": "flat"}, None, 'normals = "flat": unknown value; one of face, smooth, file'),
        ({"file": "closed.off", "fit": 0}, None, "fit = 0: must be greater than 0"),
        ({"file": "closed.off", "crease": 200}, None, "crease = 200: must be at most 180"),
        ({"file": "closed.off", "material": "painted"}, None, "material = \"painted\": has the texture 'squares', and"),
        ({"file": "closed.off", "faces": [[0, 1, 2]]}, None, 'file = "closed.off": is given beside vertices or faces'),
        ({}, None, "file = null: is missing; give a file, or vertices and faces"),
        ({"faces": [[0, 1, 2]]}, None, "vertices = null: is missing; give vertices and faces"),
        ({"vertices": CORNERS}, None, "faces = null: is missing; give vertices and faces"),
        ({"vertices": CORNERS, "faces": [[0, 1, 3]]}, None, "faces = 1 x 3 numbers: face 0 names vertex 3; the vert"),
        ({"vertices": CORNERS, "faces": [[0, 1, -1]]}, None, "faces = [[0, 1, -1]]: must be a list of rows of 3 whole"),
        ({"vertices": [[0, 0], [1, 0], [0, 1]], "faces": [[0, 1, 2]]}, None, "vertices = [[0, 0], [1, 0], [0, 1]]: mu"),
        ({"vertices": CORNERS, "faces": [[0, 1, 2]], "part": "a"}, None, 'part = "a": only a file has parts; leave it'),
    ],
    ids=itertools.count(),
)
def test_a_wrong_mesh_gives_one_line_and_exit_code_2(tmp_path, capsys, fields, text, what):
    folder = folder_of(tmp_path)
    if text is not None:
        (folder / fields["file"]).write_bytes(text.encode() if isinstance(text, str) else text)
    code, lines = said(folder, capsys, fields, "explain")
    assert (code, len(lines)) == (2, 1)
    assert lines[0].startswith(f"visray: objects.m.{what}")


def test_a_pipe_in_place_of_a_mesh_is_refused(tmp_path, capsys):
    os.mkfifo(tmp_path / "a.obj")
    code, lines = said(tmp_path, capsys, {"file": "a.obj"}, "explain")
    assert (code, lines) == (2, ['visray: objects.m.file = "a.obj": is not a regular file; give a mesh file'])


def test_a_mesh_file_that_goes_bad_after_loading_is_an_error_in_one_line(tmp_path):
    file = folder_of(tmp_path) / "closed.off"
    scene = vr.Scene(objects={"m": vr.Mesh(file=str(file))}, camera=vr.Camera(), lights={})
    vr.explain(scene)
    file.write_text("OFF\n")
    with pytest.raises(vr.UserError, match=r"^objects\.m\.file = "):
        vr.render(scene, size=(4, 4), spp=1, progress=False)
    file.unlink()
    with pytest.raises(vr.UserError, match=r"there is no such file; check the path$"):
        vr.explain(scene)


def test_a_geometry_without_texture_coordinates_takes_no_texture(tmp_path):
    file = folder_of(tmp_path) / "closed.off"
    scene = vr.Scene(
        textures={"squares": vr.CheckerTexture()},
        materials={"painted": vr.Material(texture="squares")},
        geometries={"m": vr.Mesh(file=str(file))},
        objects={"one": vr.Instance(geometry="m"), "two": vr.Instance(geometry="m", material="painted")},
        camera=vr.Camera(),
        lights={},
    )
    with pytest.raises(vr.UserError, match=r"^objects\.two\.material = \"painted\": has the texture 'squares', and "):
        vr.explain(scene)
    plain = vr.Scene(
        geometries=scene.geometries, objects={"one": vr.Instance(geometry="m")}, camera=vr.Camera(), lights={}
    )
    assert [facts.address for facts in vr.explain(plain).meshes] == ["geometries.m"]
    file.unlink()
    with pytest.raises(vr.UserError, match=r"^geometries\.m\.file = .*: there is no such file; check the path$"):
        vr.explain(plain)


def test_lists_without_texture_coordinates_may_have_a_texture():
    """Each triangle then shows the lower left half of the texture, as an object of the type triangle does."""
    scene = vr.Scene(
        textures={"squares": vr.CheckerTexture()},
        materials={"painted": vr.Material(texture="squares")},
        objects={"m": vr.Mesh(vertices=CORNERS, faces=[[0, 1, 2]], material="painted")},
        camera=vr.Camera(),
        lights={},
    )
    assert vr.explain(scene)["textures"]


# Notes.


NOTED = "mtllib a.mtl\nusemtl red\n" + TRIANGLE + "v 0 0 1\nl 1 2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\nf 1 1 2\n"
NOTES = [
    "a.obj: its materials and textures are not used",
    "a.obj: its points, lines and curves (l) are not used",
    "a.obj: 1 triangle without area was dropped",
]


def test_what_a_file_loses_is_said_once(tmp_path, capsys):
    """Two objects of one file, two pictures: each note comes once."""
    (tmp_path / "a.obj").write_text(NOTED)
    options = "-o", str(tmp_path / "x.png"), "--size", "8x8", "--spp", "1"
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        code, lines = said(tmp_path, capsys, {"file": "a.obj"}, "render", *options)
        assert (code, lines) == (0, [f"visray: note: {note}" for note in NOTES])
    scene = vr.Scene(
        objects={name: vr.Mesh(file=str(tmp_path / "a.obj")) for name in "ab"}, camera=vr.Camera(), lights={}
    )
    assert mesh_notes(scene) == [f"{tmp_path}/{note}" for note in NOTES]


def test_turned_triangles_are_counted():
    points, faces = [*CORNERS, [0, 0, 1]], np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])

    def facts(faces):
        return mesh_facts(
            vr.Scene(objects={"m": vr.Mesh(vertices=points, faces=faces)}, camera=vr.Camera(), lights={})
        )[0]

    assert (facts(faces).closed, facts(faces).notes) == (True, ())
    assert facts(faces[:, ::-1]).notes == ("4 triangles were turned to face outwards",)
    mixed = np.concatenate([faces[:1, ::-1], faces[1:]])
    assert (facts(mixed).closed, facts(mixed).notes) == (True, ("1 triangle was turned to face outwards",))
    shape = vr.Mesh(vertices=points, faces=mixed).shape_of_file()
    assert shape.topology.volume == pytest.approx(1 / 6, rel=1e-15)
    holed = facts(np.concatenate([faces[:1, ::-1], faces[1:3]]))
    assert (holed.closed, holed.notes) == (False, ("1 triangle was turned to agree with its neighbours",))
    assert holed.edges.startswith("3 open edges around 1 hole, the first from (")


@pytest.mark.parametrize(("shift", "size", "far"), [(1e8, 1.0, False), (1e9, 1.0, True), (1e6, 1e-4, True)])
def test_a_mesh_far_from_the_origin_says_how_exact_its_points_are(shift, size, far):
    """Points are as exact as 2^-53 of their distance. That is said if it is more than 2^-24 of the mesh's size."""
    steps = vr.Scale(scale=(size,) * 3), vr.Translate(translate=(shift - size, 0.0, 0.0))
    scene = vr.Scene(
        objects={"m": vr.Mesh(vertices=CORNERS, faces=[[0, 1, 2]], transform=steps)}, camera=vr.Camera(), lights={}
    )
    notes = mesh_notes(scene)
    assert bool(notes) == far == (shift * 2.0**-53 > 2.0**-24 * size)
    if far:
        assert notes[0].startswith(
            f"objects.m: lies {shift:.3g} from the origin of the world, and is {size:.3g} wide; "
        )
        assert f"exact to {shift * 2.0**-53:.2g}, {shift * 2.0**-53 / size:.2g} of its size" in notes[0]


def test_coordinates_of_single_precision_far_away_are_said(tmp_path):
    """Numbers near 5,000,000 lie 0.5 apart in single precision."""
    points = np.array(CORNERS) * 10.5 + [0, 5e6, 0]
    notes = mesh_notes(
        vr.Scene(
            objects={"m": vr.Mesh(vertices=points.astype(np.float32), faces=[[0, 1, 2]])}, camera=vr.Camera(), lights={}
        )
    )
    assert notes == [
        "objects.m: its coordinates have single precision: at 5.00001e+06 they lie 0.5 apart, and it is 10.5 wide; "
        "save it nearer to the origin"
    ]
    assert not mesh_notes(
        vr.Scene(objects={"m": vr.Mesh(vertices=points + 1e-3, faces=[[0, 1, 2]])}, camera=vr.Camera(), lights={})
    )


def test_explain_lists_meshes(tmp_path, capsys):
    (tmp_path / "a.obj").write_text(NOTED)
    (tmp_path / "open.off").write_text(OPEN)
    scene = tmp_path / "x.json"
    objects = {name: {"type": "mesh", "file": name} for name in ("a.obj", "open.off")}
    scene.write_text(
        json.dumps({"objects": {name.replace(".", " "): o for name, o in objects.items()}, "camera": {}, "lights": {}})
    )
    assert main(["explain", str(scene), "--json"]) == 0
    closed, holed = json.loads(capsys.readouterr().out)["meshes"]
    assert (closed["address"], closed["triangles"], closed["vertices"], closed["parts"]) == (
        "objects.a obj",
        4,
        4,
        ["a"],
    )
    assert closed["closed"] and closed["edges"] == "" and closed["notes"] == [note[7:] for note in NOTES]
    shape = vr.Mesh(file=str(tmp_path / "a.obj")).shape_of_file()
    # 4 vertices and at least as many normals of 3 doubles; 4 triangles of 3 vertices and 3 normals, and their parts.
    assert closed["bytes"] == shape.bytes == 24 * (4 + len(shape.normals)) + 4 * (12 + 12 + 4)
    assert not holed["closed"] and holed["edges"] == ONE_GROUP
    assert main(["explain", str(scene)]) == 0
    table = capsys.readouterr().out
    assert "triangles" in table and "closed" in table and "3 open edges" in table


def test_meshes_are_kept_in_the_cache_up_to_a_number_of_bytes(monkeypatch):
    monkeypatch.setattr(mesh_module, "_cache", {})
    meshes = [vr.Mesh(vertices=np.array(CORNERS) + k, faces=[[0, 1, 2]]) for k in range(40)]
    shapes = [mesh.shape_of_file() for mesh in meshes]
    assert all(mesh.shape_of_file() is shape for mesh, shape in zip(meshes, shapes))
    monkeypatch.setattr(mesh_module, "CACHE_BYTES", 3 * shapes[0].bytes)
    assert meshes[0].shape_of_file() is shapes[0]
    # What was used longest ago is dropped when a mesh is added.
    new = vr.Mesh(vertices=np.array(CORNERS) + 40, faces=[[0, 1, 2]]).shape_of_file()
    assert list(mesh_module._cache.values()) == [shapes[39], shapes[0], new]
    assert meshes[1].shape_of_file() is not shapes[1]


def test_a_note_is_a_warning_of_python(tmp_path):
    (tmp_path / "a.obj").write_text(NOTED)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        vr.prepare(vr.Scene(objects={"m": vr.Mesh(file=str(tmp_path / "a.obj"))}, camera=vr.Camera(), lights={}))
    assert [(w.category, str(w.message)) for w in caught] == [(MeshWarning, f"{tmp_path}/{note}") for note in NOTES]
