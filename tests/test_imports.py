"""Imports go down only, and the doors are the only doors."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "visray"
# From the ground up; a module imports only what stands on a lower line, or before it on its own line.
FLOORS = """
clock errors warn memory identity_cache named_files drjit_import terminal hints arguments version pass_timer leftovers
work_threads
scene.garbage scene.comments scene.other_files scene.source
llvm
output.curves
colors
quantities pytree operands record_text references records
ray geometry transforms fresnel absorption
accel.sah accel.morton accel.hierarchy accel.blocks accel.bvh accel.row_tests accel.tree_rays accel.walk_stack
accel.bvh_step accel.bvh_walk
meshes.triangle_mesh meshes.topology meshes.normals meshes.fit meshes.polygons meshes.assembly
meshes.text meshes.obj meshes.ply meshes.stl meshes.off
meshes.gltf_accessors meshes.gltf_nodes meshes.gltf meshes.reading meshes
warp
polynomials.error polynomials.expression polynomials.constants polynomials.simplify polynomials.literals
polynomials.sympy_constants polynomials.functions polynomials.reader polynomials.grammar polynomials.monomials
polynomials.modular polynomials.expansion polynomials.symbolic polynomials.sympy_factors polynomials.relations
polynomials.factorization polynomials.program
polynomials.volume
polynomials.known_surface polynomials.known_cubics polynomials.known_quartics polynomials.known_higher
polynomials.catalogue
polynomials.term_text polynomials.one_sign
polynomials.everyday_characters polynomials.everyday_latex polynomials.everyday_tokens polynomials.everyday_checks
polynomials.everyday_clearing polynomials.everyday
polynomials
roots.number_types roots.isolation roots.refinement roots.chord roots.crossing roots.signed_distance roots
textures environment_map materials modes filter_places filters
lights.light lights.point lights.directional lights.spot lights.rectangle lights.disk lights.sphere
lights camera fitting
number_table
primitives.primitive primitives.flat primitives.convex primitives.revolved
primitives.plane primitives.rectangle primitives.disk primitives.triangle
primitives.sphere primitives.ellipsoid primitives.box primitives.cylinder primitives.cone primitives.capsule
primitives.mesh_triangle primitives.mesh_line primitives.mesh_search primitives.solid_search primitives.mesh_point
primitives.mesh_passage primitives.mesh_buffers primitives.mesh_body primitives.mesh
primitives.instance
primitives.clips
primitives.algebraic primitives.polynomial primitives.polynomial_solid primitives.torus
primitives.csg_operands primitives.csg_form primitives.csg_bounds primitives.csg_clusters
primitives.csg_objects primitives.csg_table
primitives.csg_state primitives.csg_balls primitives.csg_leaves primitives.csg_walk primitives.csg_body
primitives.csg_copies primitives.csg primitives.csg_resolved primitives.csg_bodies primitives
data.column data.color_value data.vision data.palette_note data.palette
data.norm data.resolved_colors data.color_rule data.size_rule
data.base data.fitted_base data.fit data.land data.basemap data.legend
data.numerals data.table data.encoding data.dialect data.cells data.column_names data.csv_file data.values data.labelled
data.interchange data.geojson data.geojson_text data.frames
data.dates data.moments data.date_column
data.reading data.positions data.name_column data.describe data.row_names
data.number_column data.source data.gizmos
data.time_column data.series data.timeline
data.layer data.layer_time data.row_edits data.layer_table data.outlines data.rows data.touching
data.shown_rows data.standing data.timed_layer data.timed_rows data.resolve
data.shown_date data.data_scene data.all_objects
animation.track animation.interpolation animation.rotations animation.curves animation.between
animation.key_values animation.paths animation.keys animation.orbit animation.spin animation.path animation.ellipse
animation.kinds animation.animation animation.frames animation
scene.film scene.naming scene.building scene.summary scene.scene
data.row_balls shape_bounds things blocking surroundings fitted_scene
scene
animation.moment
data_report mesh_report clip_report filter_report constant_report csg_report track_report
polynomials.sign_region polynomials.formula_facts
feature_rules features material_report glass_report tables progress differentiable
output.files output.layers output.exr_header output.silence output.exr output.rounding output.overlay output.png
output.system_viewer
output.image output.preview output.lock
output.movie_mp4 output.movie_spool output.movie_gif output.movie_webp output.movie output.sequence
output.up_to_date output.frame_files output.movie_of_images
output
projection
legend.labels legend.parts legend.fonts legend.boxes legend.keys legend.placing legend.layout legend.drawing
legend.ticks legend.bars legend.content legend.covering legend.layer legend data_picture
images
data.row_table columns gizmo_bodies data_columns written_out
pack address_index repack nesting overlap_report batches sampling moments picture_identity array_file film
checkpoint
accel.sheet_arithmetic accel.cell_views accel.footprints accel.triangle_footprints accel.cell_pairs accel.cells
accel.policy accel.bvh_rows accel.culling accel.lists accel.parallel_lists accel.screening
accel.ray_segment accel.origin accel.tint accel.traversal
accel.intersect accel
prepared_lights visible_lights needed_materials
ray_families
kernel_scene
background
interaction
direct light_loop occlusion
shading
media indirect
integrator light_probe
jacobian wavefront
environment_report setup motion_blur passes attached_picture
surface_motion motion_vectors moving frame_checks
dark
adaptive depth_report
cluster.quiet cluster.folders cluster.local cluster.address cluster.scene_package cluster.kept_scenes cluster.refusal
cluster.part cluster.worker
cluster.merging cluster.asking cluster.crew cluster.scheduler cluster.connecting cluster.picture cluster.frames cluster
certificate provenance made_layers picture_layers sampled_layers animation_report explaining renderer
frame_maker animating
edges
gradients differences
traced_picture torch_picture jax_picture picture_function
study
surface_picture.jet surface_picture.field surface_picture.points surface_picture.whereabouts
surface_picture.viewing surface_picture.look surface_picture.names surface_picture.like surface_picture.reading
surface_picture.clip surface_picture.picture surface_picture.scene surface_picture.recipe
surface_picture.known_report surface_picture.captions surface_picture.sheet
surface_picture
starter
live.fields live.ranges live.controls live.data_controls live.looks live.search live.tabs
live
cli.scene_files cli.words cli.quantities cli.wrong_words
cli.stuck cli.keeping cli.moment cli.candidates cli.options cli.picture_options cli.showing
cli.standard_output cli.picture_report cli.rendering cli.frame_report cli.resuming
cli.animating cli.studies cli.new cli.completing cli.files cli.describing cli.data cli.view cli.surface cli.surfaces
cli.commands cli.program cli
public
__init__ __main__
""".split()  # noqa: SIM905 - floors are read as lines


def modules() -> dict[str, Path]:
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)] = path
    return found


MODULES = modules()


def imported(path: Path) -> set[str]:
    """The modules of visray that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {a.name.removeprefix("visray.") for a in node.names if a.name.split(".")[0] == "visray"}
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "visray":
            base = node.module.removeprefix("visray").lstrip(".")
            for a in node.names:
                deeper = f"{base}.{a.name}".lstrip(".")
                found.add(deeper if deeper in MODULES else base or "__init__")
    return found


def floor(name: str) -> int:
    """The floor of a module: its own, or that of its package."""
    while name not in FLOORS:
        name, _, last = name.rpartition(".")
        assert name, f"{last} has no floor"
    return FLOORS.index(name)


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_go_down(name):
    for other in imported(MODULES[name]):
        # Inside a package without floors of its own (scene, study) the order is that of test_no_cycles.
        same = other.split(".")[0] == name.split(".")[0] and floor(other) == floor(name)
        assert floor(other) < floor(name) or same, f"{name} imports {other}, which stands above it"


def test_no_cycles():
    graph = {name: imported(path) & set(MODULES) for name, path in MODULES.items()}
    done: set[str] = set()
    while left := set(graph) - done:
        free = {n for n in left if graph[n] <= done | {n}}
        assert free, f"a cycle runs through {sorted(left)}"
        done |= free


def outside(path: Path) -> set[str]:
    """The packages outside visray that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {a.name.split(".")[0] for a in node.names}
        if isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize(
    ("library", "rooms"),
    [
        ("mitsuba", ("study.mitsuba.",)),
        ("cyclopts", ("cli",)),
        ("OpenEXR", ("output.", "study.")),
        ("sympy", ("polynomials.",)),
        ("mpmath", ("polynomials.",)),
        ("trimesh", ("meshes.",)),
        ("flip_evaluator", ("study.cost.errors",)),
        ("rich", ("tables", "progress")),
        ("textual_image", ("output.preview",)),
        ("distributed", ("cluster.",)),
        ("dask", ("cluster.",)),
    ],
)
def test_doors(library, rooms):
    users = {name for name, path in MODULES.items() if library in outside(path)}
    assert users and all(name.startswith(rooms) for name in users)


def test_only_quantities_names_a_backend():
    names = {name for name, path in MODULES.items() if "drjit.llvm.ad" in path.read_text()}
    assert names == {"quantities"}


def test_scenes_know_no_kernel_and_output_knows_no_scene():
    for name, path in MODULES.items():
        tops = {other.split(".")[0] for other in imported(path)}
        if name == "scene" or name.startswith("scene."):
            assert not tops & {"ray", "accel", "shading", "integrator", "renderer", "pack", "output"}, name
        if name.startswith("output"):
            assert not tops & {"scene", "ray", "primitives", "pack", "accel"}, name
