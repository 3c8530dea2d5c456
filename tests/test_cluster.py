"""Pictures by several workers: the same bits as of one process, whoever does what, and whoever is lost."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import PIL.ImageSequence
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_adaptive import with_settings
from test_animate import COUNT, keys
from test_animate import scene as animated
from test_motion_blur import moving
from test_same_bits import EACH, FILMS, SPP, at_once, made_of, same

import visray as vr
from visray.checkpoint import Checkpoint
from visray.cli.program import main
from visray.cluster import address, connecting, crew, folders, frames, local, part, refusal
from visray.cluster.merging import Canvas
from visray.cluster.part import Cutter, Pace, Part
from visray.cluster.scene_package import ScenePackage
from visray.cluster.worker import sample_blocks, tile
from visray.errors import CheckpointWarning, ClusterWarning, StoppedWarning, StructureWarning, UserError
from visray.moments import BLOCK
from visray.moving import moving as prepared_frame
from visray.output.frame_files import FrameWriter
from visray.output.lock import locked
from visray.pass_timer import PassTimer
from visray.passes import empty_film, exposed_once, spread_lanes
from visray.progress import Interrupts
from visray.scene.load import checked
from visray.setup import Prepared, prepare
from visray.study.cost.choices import default, varied_settings
from visray.study.cost.measuring import TURNS, Studio
from visray.study.cost.on_workers import measured_on

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SLOW = pytest.mark.slow


def cut(cutter: Cutter, rng: np.random.Generator) -> list[Part]:
    """All parts of a picture, of random sizes."""
    parts = []
    while not cutter.is_done:
        assert cutter.samples_left > 0
        parts.append(cutter.part(float(rng.lognormal(7, 2))))
    return parts


def arrays_of(made: Prepared, lanes: np.ndarray, p: Part) -> tuple:
    """What a worker sends back."""
    return tile(made, lanes, PassTimer()) if p.is_tile else sample_blocks(made, lanes, p, PassTimer())


# Without processes


@settings(max_examples=60, deadline=None)
@given(
    lanes=st.integers(1, 3000), spp=st.integers(1, 300), workers=st.integers(1, 40), least=st.sampled_from([16, 256]),
    seed=st.integers(0, 99),
)  # fmt: skip
def test_parts_cover_a_picture_once(lanes: int, spp: int, workers: int, least: int, seed: int) -> None:
    cutter = Cutter(lanes, spp, workers, least)
    times = np.zeros((cutter.blocks, lanes), int)
    parts = cut(cutter, np.random.default_rng(seed))
    for p in parts:
        times[p.first_block : p.end_block, p.lanes] += 1
        assert p.is_tile != cutter.by_blocks and (not p.is_tile or p.blocks == cutter.blocks)
    assert (times == 1).all() and [p.number for p in parts] == list(range(len(parts)))
    assert cutter.by_blocks == (spp > BLOCK and lanes < 4 * workers * least)


@EACH
@FILMS
@pytest.mark.parametrize("by_blocks", [False, True], ids=["tiles", "blocks"])
def test_parts_in_any_order_are_merged_to_the_same_bits(sampler: str, transparent: bool, by_blocks: bool) -> None:
    made, rng = made_of(sampler, transparent), np.random.default_rng(1)
    canvas, lanes = Canvas(empty_film(made), SPP), spread_lanes(len(made.order))
    cutter = Cutter(len(lanes), SPP, 9 if by_blocks else 1, 16)
    assert cutter.by_blocks == by_blocks
    parts = cut(cutter, rng)
    assert len(parts) > 3
    for i in rng.permutation(len(parts)):
        p = parts[i]
        canvas.add(p, arrays_of(made, lanes[p.lanes], p))
    assert not canvas.waiting and same(canvas.finished(), at_once(sampler, transparent))


def test_blocks_without_those_before_them_wait() -> None:
    """A picture that is stopped has no gaps in its samples."""
    made = made_of("sobol")
    lanes = spread_lanes(len(made.order))
    canvas, parts = Canvas(empty_film(made), SPP), [Part(i, 0, len(lanes), i, i + 1, False) for i in (0, 2)]
    for p in parts:
        canvas.add(p, sample_blocks(made, lanes, p, PassTimer()))
    assert (canvas.counts == BLOCK).all() and len(canvas.waiting) == 1
    few = replace(made.scene, settings=replace(made.scene.settings, spp=BLOCK))
    first = vr.render(few, layers=["RGB"], progress=False)["RGB"].reshape(-1, 3)
    assert np.array_equal(np.array(canvas.finished().mean, np.float32).T, first[made.order])


def test_a_task_is_as_long_as_the_measured_speed_says() -> None:
    pace = Pace(500)
    assert pace.next_samples(10**9, 2) == 500
    pace.add(1000, 0.01)
    assert pace.next_samples(10**9, 2) == pytest.approx(part.TARGET * 1e5)
    # Near the end parts are smaller, so that all workers have some, but not too small.
    assert pace.next_samples(400_000, 2) == pytest.approx(1e5)
    assert pace.next_samples(100, 2) == pytest.approx(part.LEAST * 1e5)


def test_a_package_has_all_files_of_a_scene(tmp_path: Path) -> None:
    """A texture, a mesh, its own data, and a table; with paths that are absolute, or the same name in two folders."""
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    buffer = {"buffers": [{"uri": "in/more.bin", "byteLength": 36}], "bufferViews": [{"buffer": 0, "byteLength": 36}]}
    gltf = buffer | {
        "asset": {"version": "2.0"},
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
    }
    for folder in ("a", "b", "a/in"):
        (tmp_path / folder).mkdir()
    (tmp_path / "a/in/more.bin").write_bytes(triangle.tobytes())
    (tmp_path / "a/t.gltf").write_text(json.dumps(gltf))
    (tmp_path / "b/rows.csv").write_text("lon,lat,n\n1,2,3\n")
    for folder, colour in (("a", 0.2), ("b", 0.7)):
        vr.Image({"RGB": np.full((2, 3, 3), colour, np.float32)}).write(tmp_path / folder / "t.png")
    scene = checked(
        vr.Scene(
            textures={name: vr.ImageTexture(file=str(tmp_path / name / "t.png")) for name in "ab"},
            materials={name: vr.Material(texture=name) for name in "ab"},
            lights={"key": vr.PointLight(position=(3, 6, 5))},
            objects={"t": vr.Mesh(file=str(tmp_path / "a/t.gltf")), "s": vr.Sphere(material="b")},
            data=vr.Data(layers={"rows": vr.DataLayer(source=str(tmp_path / "b/rows.csv"))}),
            film=vr.Film(width=12, height=9),
            camera=vr.Camera(),
        )
    )
    package = ScenePackage.of(scene)
    assert len(package.files) == 5 and package.bytes > sum(len(content) for _, content in package.files)
    folder = tmp_path / "worker"
    folder.mkdir()
    expected = vr.render(scene, progress=False)
    for file in ("a/in/more.bin", "a/t.gltf", "a/t.png", "b/t.png", "b/rows.csv"):
        (tmp_path / file).write_text("no more")
    found = vr.render(package.unpacked(folder), progress=False)
    assert all(found[name].tobytes() == expected[name].tobytes() for name in expected.layers)
    with pytest.raises(UserError, match=r"none\.png: cannot be read, No such file"):
        ScenePackage.of(
            vr.Scene(textures={"a": vr.ImageTexture(file=str(tmp_path / "none.png"))}, camera=vr.Camera(), lights={})
        )


def test_a_package_says_by_its_digest_what_is_in_it(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    scene = vr.Scene(data=vr.Data(layers={"rows": vr.DataLayer(source=str(path))}), camera=vr.Camera(), lights={})
    path.write_text("lon,lat,n\n1,2,3\n")
    first, again = ScenePackage.of(scene), ScenePackage.of(scene)
    assert first == again
    path.write_text("lon,lat,n\n1,2,4\n")
    assert ScenePackage.of(scene).digest != first.digest


def test_a_worker_of_another_version_is_refused() -> None:
    ours = refusal.versions()
    assert refusal.refused(refusal.facts(), ours) is None
    for name in ours:
        theirs = refusal.facts() | {name: "0.0.9"}
        right = f"has {name} 0.0.9, not {ours[name]}; install the same version there"
        assert refusal.refused(theirs, ours) == right
    assert refusal.refused(refusal.facts() | {"problem": "no LLVM"}, ours) == "no LLVM"


@pytest.mark.parametrize("given", ["", "tcp://", "tcp://host", "host:8786", "local:", "local:x", "local:1.5"])
def test_what_is_no_address_is_refused(given: str) -> None:
    with pytest.raises(UserError, match=r"^cluster = '.*': must be the address of a scheduler, such as tcp://"):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster=given)


@pytest.mark.parametrize("command", ["render", "animate", "cost"])
def test_an_address_is_checked_before_the_scene_is_read(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "none.json", "--cluster", "local:0"]) == 2
    assert capsys.readouterr().err.startswith("visray: cluster = 'local:0': the number of workers must be from 1 to ")


def test_waiting_for_workers_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bar is there while workers start, or while a scheduler is asked."""
    pytest.importorskip("distributed")
    shown = []

    class Seen(connecting.Bar):
        def __enter__(self) -> "Seen":
            shown.append((self.title, self.shown))
            return super().__enter__()

    def crew_of(*more: Any) -> None:
        raise UserError("no crew")

    monkeypatch.setattr(connecting, "Bar", Seen)
    monkeypatch.setattr(connecting, "_crew", crew_of)
    for where, progress in (("local:1", True), ("tcp://host:1", True), ("local:1", False)):
        with pytest.raises(UserError, match="no crew"):
            vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster=where, progress=progress)
    assert shown == [("starting 1 worker", True), ("connecting to tcp://host:1", True), ("starting 1 worker", False)]


@pytest.mark.parametrize("count", [0, -1, local.cores() + 1])
def test_a_wrong_number_of_workers_is_refused(count: int) -> None:
    with pytest.raises(UserError, match=rf"^cluster = 'local:{count}': the number of workers must be from 1 to \d+, "):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster=f"local:{count}")


@pytest.mark.parametrize("goal", [{"error": 0.1}, {"time": 1.0}])
def test_one_picture_to_a_goal_is_made_on_one_machine(goal: dict[str, float]) -> None:
    with pytest.raises(UserError, match=r"^cluster = 'local:1': .* is rendered on one machine; give spp, or leave"):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster="local:1", **goal)


def test_without_dask_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(address, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"^cluster = 'local:1': needs Dask, .*: pip install 'visray\[cluster\]'$"):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster="local:1")


@pytest.mark.parametrize("port", [0, 65536])
def test_a_port_that_no_machine_has_is_refused(port: int) -> None:
    with pytest.raises(UserError, match=rf"^cluster = 'tcp://host:{port}': the port must be from 1 to 65535"):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster=f"tcp://host:{port}")


@pytest.mark.parametrize(
    ("host", "is_right"),
    [("a..b", False), ("a" * 64, False), ("1.2.3", False), ("1.2.3.256", False), ("user@host", False), ("::1", False)]
    + [("-a", False), ("[1.2.3.4]", False), ("a/b", False), ("a.", True), ("h_1.x-2", True), ("[::1]", True)]
    + [("1.2.3.4", True), ("a" * 63, True), ("1a", True)],
)
def test_a_host_that_no_machine_is_called_is_refused(host: str, is_right: bool) -> None:
    given = f"tcp://{host}:8786"
    if is_right:
        address.check_address(given)
        return
    with pytest.raises(
        UserError, match=rf"^cluster = '.*': {re.escape(host)} is no name of a machine; write one as in"
    ):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster=given)


# What other programs send to who connects: nothing, a text, a small number as Dask's readers take it, or an end.
OTHERS = [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n" * 4, b"\x10" + bytes(200), None]


@contextmanager
def other_program(says: bytes | None) -> Iterator[int]:
    """A program that is no scheduler, and its port."""
    accepted = []

    def serve() -> None:
        with suppress(OSError):
            while True:
                accepted.append(listening.accept()[0])
                accepted[-1].sendall(says) if says is not None else accepted[-1].close()

    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=serve, daemon=True).start()
        yield listening.getsockname()[1]
        listening.shutdown(socket.SHUT_RDWR)
    for connection in accepted:
        connection.close()


@pytest.mark.parametrize("says", OTHERS, ids=["silence", "text", "bytes", "end"])
def test_what_answers_as_no_scheduler_is_refused(says: bytes | None, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    # Dask tries again if a connection ends before it is used.
    reason = "is no Dask scheduler, or one for tls://" if says else "(is no Dask scheduler|no scheduler answers)"
    if says == b"":
        monkeypatch.setattr(connecting, "ANSWER", 0.3)
        reason = "no scheduler answers within 0.3 s; start one"
    with (
        other_program(says) as port,
        pytest.raises(UserError, match=rf"^cluster = 'tcp://127.0.0.1:{port}': {reason}"),
    ):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster=f"tcp://127.0.0.1:{port}", progress=False)


def test_a_configuration_of_tls_that_does_not_fit_is_refused() -> None:
    dask, name = pytest.importorskip("dask"), "distributed.comm"
    pytest.importorskip("distributed")
    with pytest.raises(UserError, match=r"^cluster = 'tls://host:8786': needs certificates; give Dask their files as"):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster="tls://host:8786", progress=False)
    with (
        dask.config.set({f"{name}.tls.ca-file": "/none", f"{name}.tls.client.cert": "/none"}),
        pytest.raises(UserError, match=r"^cluster = 'tls://host:8786': Dask's configuration of TLS cannot be used, "),
    ):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster="tls://host:8786", progress=False)
    with (
        dask.config.set({f"{name}.require-encryption": True}),
        pytest.raises(UserError, match=r"^cluster = 'tcp://host:8786': Dask's configuration asks for encryption; use"),
    ):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster="tcp://host:8786", progress=False)


def test_a_folder_that_a_killed_process_left_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not those of living processes, or of processes elsewhere, which hold their locks."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    program = (
        "import os, signal, time\nfrom visray.cluster.folders import working_folder\nwith working_folder() as folder:\n"
        "    (folder / 'a').mkdir()\n    print(folder, flush=True)\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    path = os.pathsep.join([str(SCENES.parent), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"TMPDIR": str(tmp_path), "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    left = Path(done.stdout.strip())
    elsewhere = left.with_name(left.name + "x")
    assert (left / "a").is_dir() and left.parent == tmp_path
    with folders.working_folder() as own:
        assert list(tmp_path.iterdir()) == [own]
        elsewhere.mkdir()
        with locked(elsewhere / folders.HELD):
            folders.remove_left_behind()
        assert sorted(tmp_path.iterdir()) == sorted([own, elsewhere])
        folders.remove_left_behind()
        assert list(tmp_path.iterdir()) == [own]
    assert not list(tmp_path.iterdir())


# With processes


@pytest.fixture
def workers() -> Iterator[Any]:
    """A scheduler with two workers, as on other machines; and its processes."""
    pytest.importorskip("distributed")
    with connecting.quiet(), local.local_cluster(2) as (cluster, found), connecting._client(cluster, "") as client:
        client.wait_for_workers(2, timeout=60)
        found.client, found.address = client, cluster.scheduler_address
        yield found


def equal(one: vr.Image, other: vr.Image) -> bool:
    """Whether two pictures have the same layers, bit for bit."""
    return one.layers.keys() == other.layers.keys() and all(
        one[name].tobytes() == other[name].tobytes() for name in one.layers
    )


def scene_of(name: str, width: int, height: int, spp: int) -> vr.Scene:
    scene = vr.load(SCENES / name)
    return with_settings(replace(scene, film=vr.Film(width=width, height=height)), spp=spp)


@SLOW
def test_tiles_and_blocks_have_the_bits_of_one_process(workers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene with textures from files; the second picture is too small for tiles. Then its settings change."""
    names = []
    submit = crew.Crew.submit
    monkeypatch.setattr(crew.Crew, "submit", lambda self, *task: (names.append(task[1]), submit(self, *task)))
    for width, height, spp, kind in ((60, 40, 21, "tile"), (10, 9, 53, "samples"), (60, 40, 5, "tile")):
        scene = scene_of("earth-with-stars.json", width, height, spp)
        found = vr.render(scene, cluster=workers.address, progress=False)
        assert equal(found, vr.render(scene, progress=False))
        assert found.metadata["scene_hash"] == scene.hash() and found.metadata["spp"] == spp
        assert len(names) > 2 and all(name.startswith(f"visray-{kind}-") for name in names)
        assert len(set(names)) == len(names)
        names.clear()
    assert not workers.client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))


@SLOW
def test_motion_blur_and_a_checkpoint_on_workers(workers: Any, tmp_path: Path) -> None:
    """Whoever began a picture, the workers go on with it."""
    scene = with_settings(moving(), spp=21)
    expected = vr.render(scene, at=0.5, progress=False)
    found = vr.render(scene, at=0.5, cluster=workers.address, progress=False)
    assert equal(found, expected) and found.metadata["scene_hash"] == expected.metadata["scene_hash"]
    assert not equal(vr.render(vr.at(scene, 0.5), spp=21, progress=False), expected)
    scene, path = scene_of("box.json", 40, 30, 30), tmp_path / "a.checkpoint"
    made = prepare(scene)
    with Checkpoint(path) as checkpoint:
        checkpoint.keep(exposed_once(made, empty_film(made), np.arange(1200) % 31), now=True)
    options = {"checkpoint": path, "resume": True, "cluster": workers.address}
    assert equal(vr.render(scene, progress=False, **options), vr.render(scene, progress=False)) and not path.exists()
    prepared = prepared_frame(vr.prepare(vr.at(moving(), 0.5)), moving(), 0.5)
    with pytest.raises(UserError, match=r"^cluster = .*: takes no prepared frame with motion blur; give its scene"):
        vr.render(prepared, cluster=workers.address, progress=False)


@SLOW
def test_a_study_on_workers_has_the_pictures_of_one_process(workers: Any) -> None:
    scene = scene_of("box.json", 24, 18, 4)
    by_name = {s.name: s for s in varied_settings(scene)}
    choices = [default(scene, list(by_name.values())), *by_name["precision"].few, *by_name["samples, sobol"].few[:2]]
    with connecting.connected(workers.address) as crew:
        here, there = (
            Studio(scene, list(range(16)), Interrupts(), elsewhere=elsewhere)
            for elsewhere in (None, partial(measured_on, crew))
        )
        pairs = [(studio, studio.prepared(choices)) for studio in (here, there)]
        assert [studio.measure(measured) for studio, measured in pairs] == [16, 16]
    for one, other in zip(pairs[0][1], pairs[1][1]):
        assert one.pictures.tobytes() == other.pictures.tobytes() and one.pictures.any()
        assert len(other.times) == TURNS and min(other.times) > 0


@SLOW
def test_what_a_killed_worker_had_is_done_by_the_other(workers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of("box.json", 60, 40, 20)
    expected, add = vr.render(scene, progress=False), Canvas.add

    def killing(self: Canvas, *more: Any) -> None:
        if not self.counts.any():
            assert all(workers.client.processing().values())
            workers.processes[0].send_signal(signal.SIGKILL)
            workers.processes[0].wait()
        add(self, *more)

    monkeypatch.setattr(Canvas, "add", killing)
    assert equal(vr.render(scene, cluster=workers.address, progress=False), expected)
    assert [process.poll() for process in workers.processes] == [-signal.SIGKILL, None]


@SLOW
def test_frames_have_the_bits_of_one_process_though_a_worker_is_killed(workers: Any) -> None:
    """With motion blur and motion vectors. One frame needs another kernel."""
    tracks = {"x": keys("objects.ball.center.0", -1.0, 1.0), "kr": keys("materials.red.kr.0", 0.0, 0.0, 0.5)}
    moved = animated(**tracks)
    moved = replace(moved, camera=replace(moved.camera, shutter=vr.Shutter(moments=3)))
    with pytest.warns(StructureWarning, match="^frame 3: "):
        expected = list(vr.animate(moved, progress=False))
    found = []
    with warnings.catch_warnings():
        # Which frames a worker has must not be seen.
        warnings.simplefilter("error", StructureWarning)
        for image in vr.animate(moved, progress=False, cluster=workers.address):
            if not found:
                workers.processes[1].kill()
            found.append(image)
    assert len(found) == COUNT == len(expected)
    for one, other in zip(expected, found):
        assert equal(one, other) and "forward" in one.layers
        assert all(one.metadata[key] == other.metadata[key] for key in ("frame", "time", "scene_hash", "spp"))
    assert len({image["RGB"].tobytes() for image in found}) == COUNT


@SLOW
def test_the_command_writes_the_same_files(workers: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ball.json").write_text(vr.dump(animated()))
    for folder, more in (("one", []), ("many", ["--cluster", workers.address])):
        Path(folder).mkdir()
        options = ["-o", f"{folder}/a.###.png", "-o", f"{folder}/a.gif", "--error", "20%", "--quiet", *more]
        assert main(["animate", "ball.json", *options]) == 0
    names = sorted(path.name for path in Path("one").iterdir())
    assert len(names) == COUNT + 1
    for name in names:
        assert pixels(Path("one") / name) == pixels(Path("many") / name)


def pixels(path: Path) -> bytes:
    """The pixels of a picture or of all frames of a movie: what is in a file but for the seconds that it took."""
    with PIL.Image.open(path) as image:
        return b"".join(frame.convert("RGB").tobytes() for frame in PIL.ImageSequence.Iterator(image))


@SLOW
def test_with_all_workers_killed_a_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    started, processes = local._started, []
    monkeypatch.setattr(local, "_started", lambda *more: processes.append(started(*more)) or processes[-1])
    monkeypatch.setattr(crew, "AHEAD", 0)
    monkeypatch.setattr(Canvas, "add", lambda *more: [process.kill() for process in processes])
    with pytest.raises(UserError, match=r"^cluster = 'local:1': all workers have ended: signal SIGKILL$"):
        vr.render(scene_of("box.json", 60, 40, 20), cluster="local:1", progress=False)


@SLOW
def test_a_worker_that_is_unfit_is_refused_by_name(workers: Any) -> None:
    """One of another version, at the start; then one that cannot write the files, in the middle; then none is left."""
    scene = scene_of("earth.json", 20, 15, 4)
    expected = vr.render(scene, progress=False)
    first, second = sorted(workers.client.nthreads())

    def older(version: str) -> None:
        from visray.cluster import refusal

        refusal.__version__ = version

    def without_folder(dask_worker: Any) -> None:
        dask_worker.local_directory = "/none"

    run = workers.client.run
    run(lambda: older("0.0.9"), workers=[first])
    line = rf"^cluster = '{workers.address}': worker {first} on \S+: has visray 0.0.9, not {vr.__version__}; install "
    with pytest.warns(ClusterWarning, match=line + "the same version there; the others do its work$"):
        assert equal(vr.render(scene, cluster=workers.address, progress=False), expected)
    run(lambda: older(vr.__version__), workers=[first])
    run(without_folder, workers=[second])
    scene = with_settings(scene, spp=5)
    line = (
        rf"^cluster = .*: worker {second} \(local-\d\): cannot write the scene's files, .*none.*: No such file or dir"
    )
    with pytest.warns(ClusterWarning, match=line):
        assert equal(vr.render(scene, cluster=workers.address, progress=False), vr.render(scene, progress=False))
    run(without_folder, workers=[first])
    with (
        pytest.warns(ClusterWarning, match="cannot write"),
        pytest.raises(UserError, match=r"cannot write the scene's files, .*; no other worker is left$"),
    ):
        vr.render(with_settings(scene, spp=6), cluster=workers.address, progress=False)


@SLOW
def test_ctrl_c_keeps_what_is_done_and_frees_the_workers(workers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, add = scene_of("box.json", 60, 40, 20), Canvas.add
    monkeypatch.setattr(crew, "AHEAD", 0)
    monkeypatch.setattr(Canvas, "add", lambda *more: (add(*more), signal.raise_signal(signal.SIGINT)))
    with pytest.warns(StoppedWarning, match=r"^stopped when [\d,]+ of 2,400 pixels had a sample"):
        image = vr.render(scene, cluster=workers.address, progress=False)
    assert image.metadata["interrupted"] and image.metadata["spp"] == 0
    seen, whole = image["A"] > 0, vr.render(scene, progress=False)
    assert 0 < seen.sum() < 2400 and np.array_equal(image["RGB"][seen], whole["RGB"][seen])
    assert not workers.client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))
    monkeypatch.undo()
    assert equal(vr.render(scene, cluster=workers.address, progress=False), whole)


@SLOW
def test_a_scheduler_that_does_not_answer_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(connecting, "ANSWER", 0.3)
    line = r"^cluster = 'tcp://127.0.0.1:9': no scheduler answers within 0.3 s; start one with: dask scheduler$"
    with pytest.raises(UserError, match=line):
        vr.render(vr.Scene(camera=vr.Camera(), lights={}), cluster="tcp://127.0.0.1:9", progress=False)


@SLOW
def test_the_terminal_shows_nothing_of_dask(tmp_path: Path) -> None:
    """Nor are processes or files left behind; the script has no guard against being imported once more."""
    pytest.importorskip("distributed")
    script = tmp_path / "script.py"
    script.write_text(
        f"import visray as vr\nimage = vr.render({str(SCENES / 'box.json')!r}, size=(40, 30), spp=4, cluster='local:2',"
        " progress=False)\nimage.write('box.png')\nprint(image.metadata['spp'])\n"
    )
    folder = tmp_path / "temporary"
    folder.mkdir()
    path = os.pathsep.join([str(SCENES.parent), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"TMPDIR": str(folder), "PYTHONPATH": path}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "4\n", "")
    assert not list(folder.iterdir())


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen]]:
    """A scheduler in a process of its own, with two workers: its address, and the process."""
    pytest.importorskip("distributed")
    found = tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "dask", "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", found]
    with ExitStack() as stack:
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen([*command, "--host", "127.0.0.1"], **silent)
        stack.callback(process.wait)
        stack.callback(process.kill)
        while not found.exists():
            assert process.poll() is None
            time.sleep(0.1)
        address = json.loads(found.read_text())["address"]
        folder = tmp_path / "workers"
        folder.mkdir()
        workers = local.LocalWorkers([], folder)
        stack.callback(workers.end)
        workers.processes += [local._started(address, number, folder) for number in range(2)]
        yield address, process


@SLOW
def test_without_the_scheduler_a_picture_is_kept(
    scheduler: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, add, path = scene_of("box.json", 60, 40, 20), Canvas.add, tmp_path / "a.checkpoint"
    monkeypatch.setattr(crew, "AHEAD", 0)
    monkeypatch.setattr(Canvas, "add", lambda *more: (add(*more), scheduler[1].kill(), scheduler[1].wait()))
    with (
        pytest.warns(CheckpointWarning, match="keeps the samples; --resume goes on with them$"),
        pytest.raises(UserError, match=rf"^cluster = '{scheduler[0]}': the scheduler is gone$"),
    ):
        vr.render(scene, cluster=scheduler[0], checkpoint=path, progress=False)
    monkeypatch.undo()
    found = vr.render(scene, checkpoint=path, resume=True, progress=False)
    assert equal(found, vr.render(scene, progress=False))


@SLOW
def test_without_the_scheduler_frames_are_kept(
    scheduler: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ball.json").write_text(vr.dump(animated()))
    write = FrameWriter.write
    monkeypatch.setattr(FrameWriter, "write", lambda *more: (write(*more), scheduler[1].kill(), scheduler[1].wait()))
    monkeypatch.setattr(frames, "AHEAD", 1)
    monkeypatch.setattr(crew, "AHEAD", 0)
    assert main(["animate", "ball.json", "-o", "a.###.png", "-o", "a.gif", "--cluster", scheduler[0]]) == 2
    said = capsys.readouterr().err
    assert said.endswith(f"visray: cluster = '{scheduler[0]}': the scheduler is gone\n") and "--resume renders" in said
    names = sorted(path.name for path in tmp_path.glob("a.*.png"))
    assert 0 < len(names) < COUNT
    with PIL.Image.open("a.gif") as movie:
        assert movie.n_frames == len(names)


@SLOW
def test_a_worker_that_does_not_answer_is_refused(workers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connecting, "WORKERS", 4.0)
    scene = scene_of("box.json", 20, 15, 4)
    workers.processes[0].send_signal(signal.SIGSTOP)
    try:
        with pytest.warns(ClusterWarning, match=r": does not answer within 4 s; the others do its work$"):
            found = vr.render(scene, cluster=workers.address, progress=False)
    finally:
        workers.processes[0].send_signal(signal.SIGCONT)
    assert equal(found, vr.render(scene, progress=False))


@SLOW
def test_what_a_stopped_worker_had_is_done_when_the_scheduler_gives_it_up(monkeypatch: pytest.MonkeyPatch) -> None:
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    scene = scene_of("box.json", 60, 40, 20)
    expected, add, started, stopped = vr.render(scene, progress=False), Canvas.add, local._started, []
    monkeypatch.setattr(local, "_started", lambda *more: stopped.append(started(*more)) or stopped[-1])

    def stopping(self: Canvas, *more: Any) -> None:
        if not self.counts.any():
            stopped[0].send_signal(signal.SIGSTOP)
        add(self, *more)

    monkeypatch.setattr(Canvas, "add", stopping)
    with dask.config.set({"distributed.scheduler.worker-ttl": "1s"}):
        assert equal(vr.render(scene, cluster="local:2", progress=False), expected)


@SLOW
def test_two_clients_at_once_have_their_own_pictures(workers: Any, tmp_path: Path) -> None:
    path = os.pathsep.join([str(SCENES.parent), os.environ.get("PYTHONPATH", "")])
    sizes = {"box.json": (60, 40, 20), "earth.json": (50, 30, 40)}
    clients = []
    for name, (width, height, spp) in sizes.items():
        options = ["--size", f"{width}x{height}", "--spp", str(spp), "--cluster", workers.address, "--quiet"]
        command = [sys.executable, "-m", "visray", "render", SCENES / name, "-o", tmp_path / f"{name}.exr", *options]
        clients.append(subprocess.Popen(command, env=os.environ | {"PYTHONPATH": path}, cwd=tmp_path))
    assert [client.wait() for client in clients] == [0, 0]
    for name, size in sizes.items():
        expected = tmp_path / f"{name}-expected.exr"
        vr.render(scene_of(name, *size), progress=False).write(expected)
        found, one = vr.Image.read(tmp_path / f"{name}.exr"), vr.Image.read(expected)
        assert equal(found, one)
