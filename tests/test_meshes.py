"""Mesh files and meshes, against closed forms and brute force."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from visray.meshes.fit import fit_transform
from visray.meshes.normals import face_normals, smooth_normals
from visray.meshes.reading import part, read
from visray.meshes.topology import topology
from visray.meshes.triangle_mesh import MeshError, TriangleMesh, from_arrays

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


OBJ = "o base\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\ng lid\nv 0 0 1\nf -1 -5//  2/ 3\n"


def test_obj_reads_polygons_relative_indices_and_parts(tmp_path):
    mesh = read(written(tmp_path, "a.obj", OBJ))
    assert mesh.parts == ("base", "base/lid") and mesh.part_of.tolist() == [0, 0, 1, 1]
    assert len(part(mesh, "base/lid").vertices) == 4
    assert mesh.vertices[mesh.faces[2]].tolist() == [[0, 0, 1], [0, 0, 0], [1, 0, 0]]


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_gives_back_what_was_written(tmp_path, encoding):
    path = tmp_path / "ball.ply"
    BALL.export(path, encoding=encoding)
    assert same_triangles(read(str(path)), mesh_of(BALL), 6)


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
