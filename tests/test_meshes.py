"""Mesh files and meshes, against closed forms and brute force."""

import base64
import json
import re
import struct
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from visray.geometry import gamma
from visray.meshes import gltf as gltf_module
from visray.meshes import gltf_nodes, polygons, reading
from visray.meshes.fit import fit_transform
from visray.meshes.normals import face_normals, smooth_normals
from visray.meshes.polygons import triangulated
from visray.meshes.reading import part, read
from visray.meshes.topology import oriented, topology
from visray.meshes.triangle_mesh import MeshError, TriangleMesh, from_arrays

TEAPOT = Path(__file__).resolve().parents[2] / "shared" / "seed-scenes" / "teapot2.obj"
CUBE = trimesh.creation.box((1, 2, 3))
BALL = trimesh.creation.icosphere(subdivisions=3)


def mesh_of(shape) -> TriangleMesh:
    return from_arrays(np.array(shape.vertices), np.array(shape.faces))


def written(folder: Path, name: str, text: str | bytes) -> str:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return str(path)


def same_triangles(mesh: TriangleMesh, other: TriangleMesh, digits: int = 12) -> bool:
    return np.allclose(mesh.vertices[mesh.faces], other.vertices[other.faces], rtol=0, atol=10.0**-digits)


@pytest.mark.parametrize(("shape", "volume"), [(CUBE, 6), (BALL, BALL.volume)])
def test_a_closed_mesh_has_its_volume(shape, volume):
    found = topology(mesh_of(shape))
    assert found.closed and not len(found.open_edges) and found.open_loops == found.inconsistent == 0
    assert found.volume == pytest.approx(volume, rel=1e-14)


@given(st.lists(st.tuples(*[st.integers(0, 6)] * 3), min_size=1, max_size=12))
def test_edges_are_those_of_a_count_in_a_dict(faces):
    points = np.random.default_rng(1).normal(size=(7, 3))
    faces = [face for face in faces if len(set(face)) == 3]
    if not faces:
        return
    found = topology(from_arrays(points, faces))
    runs = Counter((f[i], f[(i + 1) % 3]) for f in faces for i in range(3))
    total = {e: runs[e] + runs[e[::-1]] for e in runs}
    assert {tuple(e) for e in found.open_edges.tolist()} == {e for e in runs if total[e] == 1}
    assert found.inconsistent == sum(runs[e] == 2 and total[e] == 2 for e in runs)
    assert found.nonmanifold == len({frozenset(e) for e in runs if total[e] > 2})
    assert found.closed == all(runs[e] == 1 and total[e] == 2 for e in runs)


def test_smooth_normals_of_a_ball_are_radial_and_those_of_a_cube_are_of_its_faces():
    ball = mesh_of(BALL)
    normals, normal_of = smooth_normals(ball, 60)
    edge = np.linalg.norm(ball.vertices[ball.faces[:, 0]] - ball.vertices[ball.faces[:, 1]], axis=1).max()
    # The mean of the normals around a vertex misses the radius by the second order of the length of an edge.
    assert np.abs(normals[normal_of] - ball.vertices[ball.faces]).max() < edge**2 / 4
    cube = mesh_of(CUBE)
    normals, normal_of = smooth_normals(cube, 40)
    assert np.allclose(normals[normal_of], face_normals(cube)[:, None], atol=1e-15)
    assert len(smooth_normals(cube, 91)[0]) == 8


@given(arrays(np.float64, (5, 3), elements=st.floats(-1e9, 1e9)), st.floats(0, 180))
def test_smooth_normals_are_unit_vectors(points, crease):
    faces = [(0, 1, 2), (2, 1, 3), (0, 2, 3), (3, 1, 4), (2, 1, 4)]
    try:
        mesh = from_arrays(points, faces)
    except MeshError:
        return
    normals, normal_of = smooth_normals(mesh, crease)
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < gamma(8)
    assert normal_of.shape == mesh.faces.shape and normal_of.max() < len(normals)


def test_a_crease_splits_the_faces_around_a_vertex():
    # A roof of two slopes, each of two triangles: the ridge is a crease of 90 degrees.
    points = [(0, 0, 1), (1, 0, 1), (0, 1, 0), (1, 1, 0), (0, -1, 0), (1, -1, 0)]
    roof = from_arrays(points, [(0, 1, 3), (0, 3, 2), (0, 4, 5), (0, 5, 1)])
    for crease, ridge in ((89, [(0, 1, 1), (0, -1, 1)]), (90, [(0, 0, 1), (0, 0, 1)])):
        normals, normal_of = smooth_normals(roof, crease)
        found = [normals[normal_of[0, 1]], normals[normal_of[3, 2]]]
        assert np.allclose(found, [np.array(n) / np.linalg.norm(n) for n in ridge], atol=1e-15)


def shells() -> TriangleMesh:
    """A ball with a hollow inside, whose faces run the other way."""
    inner = np.array(BALL.faces)[:, ::-1] + len(BALL.vertices)
    return from_arrays(np.concatenate([BALL.vertices, BALL.vertices * 0.5]), np.concatenate([BALL.faces, inner]))


def test_orientation_turns_what_disagrees_and_leaves_hollows():
    hollow = shells()
    assert oriented(hollow) == (hollow, 0)
    inside_out, count = oriented(replace(hollow, faces=hollow.faces[:, ::-1]))
    assert count == len(hollow.faces) and topology(inside_out).volume == pytest.approx(topology(hollow).volume)
    faces = np.array(BALL.faces)
    wrong = np.random.default_rng(3).random(len(faces)) < 0.4
    faces[wrong] = faces[wrong][:, ::-1]
    mixed = replace(mesh_of(BALL), faces=faces, uvs=np.zeros((1, 2)), uv_of=np.zeros_like(faces))
    repaired, count = oriented(mixed)
    assert topology(mixed).inconsistent and not topology(mixed).closed
    assert topology(repaired).closed and topology(repaired).volume == pytest.approx(BALL.volume)
    assert count == wrong.sum() and repaired.uv_of.shape == faces.shape


def test_a_moebius_strip_is_left_alone():
    around = np.arange(8) * np.pi / 4
    rims = [np.stack([(2 + s * np.cos(around / 2)) * np.cos(around), (2 + s * np.cos(around / 2)) * np.sin(around),
                      s * np.sin(around / 2)], axis=1) for s in (-1, 1)]  # fmt: skip
    low = [*range(8), 8]
    high = [*range(8, 16), 0]
    strip = [f for i in range(8) for f in ((low[i], low[i + 1], high[i]), (high[i], low[i + 1], high[i + 1]))]
    mesh = from_arrays(np.concatenate(rims), strip)
    assert topology(mesh).inconsistent and oriented(mesh)[1] == 0


def test_open_edges_are_named():
    box = mesh_of(CUBE)
    found = topology(box.kept(np.arange(12) != 3))
    assert not found.closed and found.open_loops == 1
    assert {frozenset(e) for e in found.open_edges.tolist()} == {
        frozenset(int(box.faces[3, i]) for i in pair) for pair in ((0, 1), (1, 2), (2, 0))
    }


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_triangles_without_area_are_dropped_and_thin_ones_are_kept(size):
    a, b = np.array([0.1, 0.2, 0.3]) * size, np.array([0.7, 0.9, 0.4]) * size
    on_line, off_line = a + 0.3 * (b - a), a + 0.3 * (b - a) + [0, 0, 1e-13 * size]
    points = [a, b, on_line, off_line, [5 * size, 0, 0]]
    mesh = from_arrays(points, [(0, 1, 4), (0, 1, 2), (0, 1, 3), (0, 0, 4)])
    assert mesh.faces.tolist() == [[0, 1, 4], [0, 1, 3]] and mesh.notes == ("2 triangles without area were dropped",)


def square(corners: str, faces: str) -> str:
    return "".join(f"v {c} 0\n" for c in corners.split(",")) + faces + "\n"


def test_concave_polygons_are_cut_within_themselves(tmp_path):
    # An arrow: a fan around its first corner would cover what lies outside.
    for turn in range(4):
        corners = ["0 0", "2 -1", "0 3", "-2 -1"]
        arrow = read(written(tmp_path, f"{turn}.obj", square(",".join(corners[turn:] + corners[:turn]), "f 1 2 3 4")))
        areas = np.cross(*(arrow.vertices[arrow.faces[:, i]] - arrow.vertices[arrow.faces[:, 0]] for i in (1, 2)))
        assert (areas[:, 2] > 0).all() and areas[:, 2].sum() == 2 * 6


@given(st.lists(st.floats(0.1, 10), min_size=5, max_size=12))
def test_polygons_around_a_point_keep_their_area(radii):
    angles = np.arange(len(radii)) * 2 * np.pi / len(radii)
    corners = np.stack([np.cos(angles) * radii, np.sin(angles) * radii, 0 * angles], axis=1)
    triangles, _ = triangulated(corners, np.arange(len(radii)), np.array([len(radii)]))
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a)[:, 2]
    assert len(triangles) == len(radii) - 2 and sorted({*triangles.flat}) == list(range(len(radii)))
    # No triangle runs backwards by more than the rounding of its products, which are below 400.
    assert (areas > -400 * gamma(4)).all()
    assert areas.sum() == pytest.approx(np.cross(corners, np.roll(corners, -1, axis=0))[:, 2].sum(), rel=1e-12)


@pytest.mark.parametrize("turn", range(5))
def test_corners_on_one_line_leave_a_solid_closed(tmp_path, turn):
    # A cube, turned so that rounding matters, with one more corner in the middle of an edge between two faces.
    axes, _ = np.linalg.qr(np.random.default_rng(turn).normal(size=(3, 3)))
    axes *= np.sign(np.linalg.det(axes))
    grid = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)] + [(0, 0, 0.5)])
    faces = [(0, 8, 1, 3, 2), (0, 4, 5, 1, 8), (4, 6, 7, 5), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [np.roll(face, turn) + 1 for face in faces]
    text = "".join("v {} {} {}\n".format(*p) for p in grid @ axes.T)
    text += "".join(f"f {' '.join(map(str, face))}\n" for face in faces)
    found = topology(read(written(tmp_path, "a.obj", text)))
    assert found.closed and found.volume == pytest.approx(1, rel=1e-14)


def test_a_concave_polygon_has_a_largest_size(tmp_path, monkeypatch):
    monkeypatch.setattr(polygons, "MOST_CORNERS", 4)
    outline = square("2 -1,0 3,-2 -1,-1 -0.9,0 0", "f 1 2 3 4 5")
    assert "a concave face of 5 corners; visray cuts up to 4" in refusal(written(tmp_path, "a.obj", outline))


def test_polygons_of_points_on_a_line_and_crossing_ones_end(tmp_path):
    bow = square("0 0,1 1,1 0,0 1,2 5", "f 1 2 3 4 5")
    assert len(read(written(tmp_path, "bow.obj", bow)).faces)


CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
OBJ = "o base\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\ng lid\nv 0 0 1\nf -1 -5//  2/ 3\n"


def test_obj_reads_polygons_relative_indices_and_parts(tmp_path):
    mesh = read(written(tmp_path, "a.obj", "\ufeff" + OBJ.replace("\n", "\r\n")))
    assert mesh.parts == ("base", "base/lid") and mesh.part_of.tolist() == [0, 0, 1, 1]
    assert len(part(mesh, "base/lid").vertices) == 4
    assert mesh.vertices[mesh.faces[2]].tolist() == [[0, 0, 1], [0, 0, 0], [1, 0, 0]]


def test_vertices_at_equal_positions_are_merged(tmp_path):
    text = (
        "".join(f"v {x} {y} 0\n" for x, y in ("00", "10", "01", "10", "11", "01"))
        + "v -0 0 0\nv 5 5 5\nf 1 2 3\nf 4 5 6\n"
    )
    mesh = read(written(tmp_path, "a.obj", text + "f 7 3 5\n"))
    assert len(mesh.vertices) == 4 and mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2], [0, 2, 3]]


def test_obj_keeps_normals_and_uvs_per_corner(tmp_path):
    text = CORNERS + "vn 0 0 2\nvn 0 0 0\nvt 0.5 0.25\nvt 1\nf 1/1/1 2/2 3//2\nf 1 3/2/1 2\nf 3//1 2//1 1//1\n"
    mesh = read(written(tmp_path, "a.obj", text))
    assert mesh.uvs[mesh.uv_of[0]].tolist() == [[0.5, 0.25], [1, 0], [0, 0]]
    assert mesh.normals[mesh.normal_of[0]].tolist() == [[0, 0, 1]] * 3
    assert mesh.normals[mesh.normal_of[1]].tolist() == [[0, 0, -1], [0, 0, 1], [0, 0, -1]]
    assert any("4 corners" in note for note in mesh.notes)


def gltf(nodes: list, points=((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)), mode=5, **changes) -> dict:
    """A glTF file of one primitive: a strip or fan of four corners, with texture coordinates in bytes."""
    data = np.array(points, "<f4").tobytes() + bytes([0, 0, 255, 0, 0, 255, 255, 255])
    views = [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 8}]
    position = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
    uv = {"bufferView": 1, "componentType": 5121, "count": 4, "type": "VEC2", "normalized": True}
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "mode": mode, "material": 0}
    tree = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": nodes, "materials": [{}]}
    tree |= {"meshes": [{"name": "quad", "primitives": [primitive]}], "accessors": [position, uv], "bufferViews": views}
    return tree | {"buffers": [{"uri": uri, "byteLength": len(data)}]} | changes


def test_gltf_places_nodes_turns_mirrored_ones_and_flips_v(tmp_path):
    nodes = [{"children": [1, 2]}, {"mesh": 0, "translation": [0, 0, 5], "rotation": [0, 0, 1, 1], "scale": [2, 1, 1]},
             {"mesh": 0, "name": "mirrored", "matrix": np.diag([-1, 1, 1, 1]).reshape(-1).tolist()}]  # fmt: skip
    mesh = read(written(tmp_path, "a.gltf", json.dumps(gltf(nodes))))
    assert mesh.parts == ("quad", "mirrored") and mesh.part_of.tolist() == [0, 0, 1, 1]
    assert mesh.notes == ("its materials and textures are not used",)
    # A quarter turn about z takes (1, 0, 0), twice as long, to (0, 2, 0).
    assert np.allclose(mesh.vertices[mesh.faces[0]], [[0, 0, 5], [0, 2, 5], [-1, 0, 5]], atol=1e-15)
    assert (face_normals(mesh) == [0, 0, 1]).all()
    corner = mesh.vertices[mesh.faces] == [-1, 1, 0]
    assert mesh.uvs[mesh.uv_of[corner.all(axis=2)]].tolist() == [[1, 0]]
    fan = read(written(tmp_path, "b.gltf", json.dumps(gltf([{"mesh": 0}], mode=6))))
    assert fan.vertices[fan.faces].tolist()[1] == [[0, 1, 0], [1, 1, 0], [0, 0, 0]]


def test_gltf_reads_data_beside_it_and_notices_when_that_changes(tmp_path):
    tree = gltf([{"mesh": 0}])
    data = base64.b64decode(tree["buffers"][0]["uri"].partition(",")[2])
    tree["buffers"][0]["uri"] = "own%20data.bin"
    path = written(tmp_path, "a.gltf", json.dumps(tree))
    with pytest.raises(MeshError, match="is not there"):
        read(path)
    written(tmp_path, "own data.bin", data)
    assert read(path).vertices.max() == 1
    written(tmp_path, "own data.bin", data.replace(struct.pack("<f", 1), struct.pack("<f", 3)) + b"\0")
    assert read(path).vertices.max() == 3


@pytest.mark.parametrize(("suffix", "options"), [
    ("obj", {}), ("ply", {"encoding": "ascii"}), ("ply", {}), ("stl", {}), ("stl_ascii", {}), ("off", {}), ("glb", {}),
])  # fmt: skip
def test_all_formats_give_what_trimesh_reads(tmp_path, suffix, options):
    path = tmp_path / f"ball.{suffix.removesuffix('_ascii')}"
    BALL.export(path, file_type=suffix, **options)
    mesh, witness = read(str(path)), trimesh.load_mesh(path, process=False)
    # trimesh rounds the numbers of a PLY text to single precision.
    found = mesh.vertices.astype(np.float32 if options else np.float64)[mesh.faces]
    assert (found == np.array(witness.vertices)[np.array(witness.faces)]).all()
    assert topology(mesh).closed and len(mesh.vertices) == len(BALL.vertices)


def test_ply_reads_quads_and_triangles_mixed_and_big_endian(tmp_path):
    head = "ply\nformat {}\nelement vertex 5\nproperty float x\nproperty double y\nproperty short z\n"
    head += "property float s\nproperty float t\nelement face 3\nproperty uchar flag\n"
    head += "property list uchar int vertex_indices\n"
    head += "end_header\n"
    points = [(0, 0, 0, 0, 0), (1, 0, 0, 1, 0), (1, 1, 0, 1, 1), (0, 1, 0, 0, 1), (2, 2, 3, 0, 0)]
    faces = [(0, 1, 2, 3), (1, 4, 2), (0, 1, 2, 3)]
    text = "".join(" ".join(map(str, p)) + "\n" for p in points) + "".join(
        f"7 {len(f)} {' '.join(map(str, f))}\n" for f in faces
    )
    found = [read(written(tmp_path, "text.ply", head.format("ascii 1.0") + text))]
    for name, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        data = b"".join(struct.pack(order + "fdhff", *p) for p in points)
        data += b"".join(struct.pack(f"{order}BB{len(f)}i", 7, len(f), *f) for f in faces)
        found.append(read(written(tmp_path, f"{name}.ply", head.format(f"{name} 1.0").encode() + data)))
    for mesh in found:
        assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 2], [0, 1, 2], [0, 2, 3]]
        assert mesh.uvs[mesh.uv_of[0]].tolist() == [[0, 0], [1, 0], [1, 1]]


def test_off_reads_normals_uvs_and_colours(tmp_path):
    text = "STNOFF3 1 0\n# a comment\n0 0 0 0 0 1 .1 .2\n1 0 0 0 0 1 .3 .4\n0 1 0 0 0 1 .5 .6\n3 0 1 2 0.5 0.5 0.5\n"
    mesh = read(written(tmp_path, "a.off", text))
    assert mesh.uvs[mesh.uv_of].tolist() == [[[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]]
    assert (mesh.normals == [0, 0, 1]).all()


FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 {}\nendloop\nendfacet\n"


def test_solids_of_a_text_are_parts(tmp_path):
    text = f"solid one two\n{FACET.format(0)}endsolid\nSOLID\n{FACET.format(1)}endsolid x\n"
    with pytest.raises(MeshError, match="line 10 begins with 'SOLID'"):
        read(written(tmp_path, "a.stl", text))
    mesh = read(written(tmp_path, "b.stl", text.replace("SOLID", "solid")))
    assert mesh.parts == ("one two", "b") and part(mesh, "b").vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 1]]


def test_an_unknown_part_is_told_the_nearest(tmp_path):
    mesh = read(written(tmp_path, "a.obj", OBJ))
    with pytest.raises(MeshError, match="no part 'lit'; the nearest is 'base/lid'") as error:
        part(mesh, "lit")
    assert error.value.field == "part"
    assert len(part(mesh, "base").faces) == 4


TRIANGLE_PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
TRIANGLE_PLY += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
GLB = struct.pack("<4sIIII", b"glTF", 2, 28, 8, 0x4E4F534A)
BAD = [
    ("empty.obj", "", "is empty"),
    ("x.png", "x", "not known to be a mesh by its name; visray reads OBJ, PLY, STL, OFF, GLTF, GLB"),
    ("picture.obj", b"\x89PNG\r\n\0\0", "is not a text"),
    ("page.obj", "<html>\n", "line 1 begins with '<html>'"),
    ("points.obj", CORNERS, "has no triangles"),
    ("nan.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", "vertex 2 is not finite"),
    ("inf.obj", "v 0 0 0\nv 1 1e999 0\nv 0 1 0\nf 1 2 3\n", "vertex 2 is not finite"),
    ("far.obj", "v 0 0 0\nv 1 1e12 0\nv 0 1 0\nf 1 2 3\n", "vertex 2 has the coordinate 1e\\+12"),
    ("range.obj", CORNERS + "# c\nf 1 2 4\n", "line 5 names vertex 4; the file has 3"),
    ("zero.obj", CORNERS + "f 0 1 2\n", "line 4 names vertex 0"),
    ("before.obj", CORNERS + "f -1 -2 -4\n", "line 4 names vertex -4"),
    ("uv.obj", CORNERS + "vt 0 0\nf 1/1 2/2 3/1\n", "line 5 names texture coordinate 2; the file has 1"),
    ("none.obj", CORNERS + "f\n", "line 4 has a face of 0 corners"),
    ("two.obj", CORNERS + "f 1 2\n", "line 4 has a face of 2 corners"),
    ("word.obj", CORNERS + "f 1 2 x3\n", "line 4 has 'x3' where a whole number"),
    ("half.obj", CORNERS + "f 1 2 3.5\n", "line 4 has '3.5' where a whole number"),
    ("slash.obj", CORNERS + "f 1/2/3/4 2 3\n", "line 4 has '1/2/3/4'"),
    ("short.obj", "v 0 0\n" + CORNERS + "f 2 3 4\n", "line 1 has 2 numbers after v, not 3"),
    ("joined.obj", CORNERS + "f 1 \\\n2 3\nf 1 2 q\n", "line 6 has 'q'"),
    ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no triangle has an area"),
    ("no.ply", "hello", "is no PLY file"),
    ("claim.ply", TRIANGLE_PLY.format("binary_little_endian", 10**9, 10**9), "claims 1,000,000,000 rows of 'vertex'"),
    ("claim.ply", TRIANGLE_PLY.format("ascii", 10**9, 10**9), "claims 1,000,000,000 rows of 'vertex'"),
    ("faces.ply", TRIANGLE_PLY.format("binary_little_endian", 0, 10**9) + "\x03", "rows of 'face'"),
    ("none.ply", TRIANGLE_PLY.format("ascii", 0, 0), "has no triangles"),
    ("row.ply", TRIANGLE_PLY.format("ascii", 3, 1) + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "line 11 has 2 numbers"),
    ("face.ply", TRIANGLE_PLY.format("ascii", 3, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "line 13 has 3 numbers"),
    ("range.ply", TRIANGLE_PLY.format("ascii", 3, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "face 0 names vertex 3"),
    ("cut.ply", TRIANGLE_PLY.format("ascii", 3, 1) + "0 0 0\n1 0 0\n", "only 2 lines follow"),
    ("negative.ply", TRIANGLE_PLY.format("ascii", 3, 1) + "0 0 0\n1 0 0\n0 1 0\n-3 0 1 3\n", "line 13"),
    ("property.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty quad x\nend_header\n", "line 4 of its header"),
    ("cloud.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nend_header\n1\n", "it has no faces"),
    ("short.stl", b"abc", "is no STL file"),
    ("claim.stl", b"\0" * 80 + struct.pack("<I", 2 * 10**8) + b"\0" * 50, "claims 200,000,000 triangles"),
    ("none.stl", b"\0" * 84, "has no triangles"),
    ("nan.stl", b"\0" * 80 + struct.pack("<I12fH", 1, *[float("nan")] * 12, 0), "vertex 0 is not finite"),
    ("cut.stl", f"solid\n{FACET.format(0)}", "it is cut off"),
    ("torn.stl", f"solid\n{FACET.format(0)[:55]}\nendsolid\n", "cut off"),
    ("lost.stl", f"solid\n{FACET.format(0).replace('vertex 1 0 0', '')}endsolid\n", "line 7 begins with 'endloop'"),
    ("word.stl", f"solid\n{FACET.format('two')}endsolid\n", "line 6 has 'two'"),
    ("no.off", "3 1 0\n", "is no OFF file"),
    ("four.off", "4OFF\n3 1 0\n", "is no OFF file"),
    ("binary.off", "OFF BINARY\n", "binary OFF"),
    ("claim.off", "OFF\n1000000000 1000000000 0\n0 0 0\n", "claims 1,000,000,000 vertices"),
    ("cut.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "only 3 lines follow"),
    ("row.off", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "line 4 has 2 numbers"),
    ("face.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n", "line 6 has 4 numbers; it must have at least 5"),
    ("range.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n", "face 0 names vertex -2"),
    ("no.glb", b"\x1f\x8b\x08zip", "is no glTF file"),
    ("cut.glb", GLB[:8] + struct.pack("<I", 2**31), "claims 2,147,483,648 bytes and has 12"),
    ("part.glb", GLB[:12] + struct.pack("<II", 2**30, 0x4E4F534A) + b"{}      ", "a part of 1,073,741,824 bytes"),
    ("old.glb", GLB + b"{}      ", "no glTF file of version 2"),
    ("deep.gltf", '{"a":' * 10**5, "JSON cannot be read"),
]  # fmt: skip
ONE = [{"mesh": 0}]
ROW = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
BAD_GLTF = [
    ({"accessors": [ROW | {"count": 10**10}]}, "claims 10,000,000,000 rows|too many triangles"),
    ({"accessors": [ROW | {"count": 10**6}]}, "claims 1,000,000 rows"),
    ({"accessors": [{k: v for k, v in ROW.items() if k != "bufferView"}]}, "has no data for its accessors"),
    ({"accessors": [ROW | {"sparse": {"count": 10**9}}]}, "sparsely"),
    ({"accessors": [ROW | {"count": -1}]}, "must be a whole number"),
    ({"accessors": [ROW | {"count": 4.5}]}, "must be a whole number"),
    ({"accessors": [ROW | {"type": "VEC9"}]}, "not a table of type VEC3"),
    ({"accessors": [ROW | {"bufferView": 7}]}, r"names bufferViews\[7\]"),
    ({"accessors": None}, r"names accessors\[0\]"),
    ({"bufferViews": [{"buffer": 0, "byteLength": 10**12}]}, "claims 1,000,000,000,000 bytes in a buffer of 56"),
    ({"bufferViews": [{"buffer": 0, "byteLength": 48, "byteStride": 1}]}, "claims 4 rows"),
    ({"buffers": [{"uri": "../secret.bin", "byteLength": 56}]}, "lies outside its folder"),
    ({"buffers": [{"uri": "/etc/hostname", "byteLength": 56}]}, "lies outside its folder"),
    ({"buffers": [{"uri": "http://example.org/a.bin", "byteLength": 56}]}, "is not there|outside its folder"),
    ({"buffers": [{"uri": "data:;base64,&&&", "byteLength": 56}]}, "not in base64"),
    ({"buffers": [{"byteLength": 10**10}]}, "has no data for its buffers"),
    ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression"),
    ({"extensionsRequired": ["EXT_meshopt_compression"]}, "EXT_meshopt_compression"),
    ({"nodes": [{"children": [0]}]}, "stands in several places"),
    ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "rotation"),
    ({"nodes": [{"mesh": 0, "matrix": [1, 2]}]}, "matrix of a node is not 16 numbers"),
    ({"nodes": [{"mesh": 0, "scale": [1e300, 1, 1]}]}, "has the coordinate"),
    ({"nodes": [{}]}, "has no triangles"),
    ({"scenes": [{"nodes": [5]}]}, r"names nodes\[5\]"),
    ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]}, "has no triangles"),
    ({"meshes": [{"primitives": [{"attributes": {}}]}]}, "names accessors"),
    ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}]}, "SCALAR of whole numbers"),
]  # fmt: skip


def refusal(path: str) -> str:
    """The only line of the error for a bad file."""
    with pytest.raises(MeshError) as error:
        read(path)
    text = str(error.value)
    assert error.value.field == "file" and "\n" not in text and "Error" not in text, text
    return text


@pytest.mark.parametrize(("name", "content", "says"), BAD, ids=[f"{name}-{i}" for i, (name, *_) in enumerate(BAD)])
def test_bad_files_are_refused_in_a_line(tmp_path, name, content, says):
    path = tmp_path / name
    path.write_bytes(content.encode("latin-1") if isinstance(content, str) else content)
    assert re.search(says, refusal(str(path)))


@pytest.mark.parametrize(("changes", "says"), BAD_GLTF)
def test_bad_gltf_files_are_refused_in_a_line(tmp_path, changes, says):
    folder = tmp_path / "inner"
    folder.mkdir()
    written(tmp_path, "secret.bin", b"\0" * 56)
    path = written(folder, "a.gltf", json.dumps(gltf(ONE) | changes))
    assert re.search(says, refusal(path))


def test_a_small_file_cannot_name_a_large_mesh(tmp_path, monkeypatch):
    path = written(tmp_path, "a.gltf", json.dumps(gltf([{"children": [1, 2, 3]}, *[{"mesh": 0}] * 3])))
    monkeypatch.setattr(gltf_module, "MOST_TRIANGLES", 5)
    assert "too many triangles; visray reads up to 5" in refusal(path)
    monkeypatch.setattr(gltf_nodes, "MOST_PRIMITIVES", 2)
    assert "too many pieces; visray reads up to 2" in refusal(path)


def test_files_that_are_none_are_refused(tmp_path, monkeypatch):
    assert "no such file" in refusal(str(tmp_path / "missing.obj"))
    (tmp_path / "folder.obj").mkdir()
    assert "is a folder" in refusal(str(tmp_path / "folder.obj"))
    assert "is not a regular file" in refusal("/dev/null")
    monkeypatch.setattr(reading, "MOST_BYTES", 10)
    assert "visray reads mesh files of up to 10" in refusal(written(tmp_path, "a.obj", OBJ))


def test_damaged_files_are_read_or_refused_in_a_line(tmp_path):
    random = np.random.default_rng(5)
    small = trimesh.creation.icosahedron()
    for suffix in ("obj", "ply", "stl", "stl_ascii", "off", "glb", "gltf_text"):
        if suffix == "gltf_text":
            good = json.dumps(gltf(ONE)).encode()
        else:
            good = small.export(file_type=suffix)
            good = good.encode() if isinstance(good, str) else good
        for _ in range(60):
            bad = bytearray(good[: random.integers(1, len(good) + 1)])
            for place in random.integers(0, len(bad), random.integers(0, 4)):
                bad[place] = random.integers(0, 256)
            path = written(tmp_path, f"a.{suffix.split('_')[0]}", bytes(bad))
            try:
                mesh = read(path)
            except MeshError:
                refusal(path)
            else:
                assert np.isfinite(mesh.vertices).all() and mesh.faces.max() < len(mesh.vertices)


def test_a_file_is_read_once_and_again_when_it_changes(tmp_path, monkeypatch):
    path = written(tmp_path, "a.obj", OBJ)
    mesh = read(path)
    assert read(path) is mesh
    assert len(read(written(tmp_path, "a.obj", OBJ + "f 1 2 5\n")).faces) == len(mesh.faces) + 1
    monkeypatch.setattr(reading, "CACHE_BYTES", 1)
    read(written(tmp_path, "b.obj", OBJ))
    assert len(reading._cache) == 1


def test_arrays_cannot_be_changed_and_are_not_those_of_the_caller():
    points, faces = np.eye(3), np.array([[0, 1, 2]], np.uint32)
    mesh = from_arrays(points, faces)
    points[0], faces[0] = 7, 0
    assert mesh.vertices.tolist() == np.eye(3).tolist() and mesh.faces.tolist() == [[0, 1, 2]]
    for array in (mesh.vertices, mesh.faces, mesh.part_of):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


@pytest.mark.skipif(not TEAPOT.exists(), reason="the original's files are not here")
def test_the_originals_teapot():
    mesh = read(str(TEAPOT))
    assert len(mesh.faces) == 6320 and mesh.notes == ("its materials and textures are not used",)
    found = topology(mesh)
    assert found.inconsistent == found.nonmanifold == 0 and found.open_loops == 6


@pytest.mark.parametrize(
    ("vertices", "faces", "field", "says"),
    [
        ([[0, 0, 0], [1, 0, float("nan")], [0, 1, 0]], [[0, 1, 2]], "vertices", "vertex 1 is not finite"),
        ([[0, 0, 0], [1, 0, 1e10], [0, 1, 0]], [[0, 1, 2]], "vertices", "vertex 1 has the coordinate 1e+10"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "faces", "face 0 names vertex 3"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "faces", "no triangle has an area"),
        ([[0, 0, 0]], [[0, 0]], "faces", "rows of three numbers"),
        ([], [[0, 1, 2]], "vertices", "rows of three numbers"),
    ],
)
def test_bad_arrays_are_named(vertices, faces, field, says):
    with pytest.raises(MeshError, match=says.replace("+", r"\+")) as error:
        from_arrays(vertices, faces)
    assert error.value.field == field and "\n" not in str(error.value)


def test_fit_puts_the_box_where_it_is_asked():
    scale, shift = fit_transform(mesh_of(CUBE), 6.0)
    assert scale == 2 and shift.tolist() == [0, 0, 0]
    scale, shift = fit_transform(mesh_of(CUBE), ((0, 0, 0), (1, 1, 1)))
    assert scale == pytest.approx(1 / 3) and np.allclose(shift, 0.5)
