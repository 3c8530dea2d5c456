"""The hash of a scene covers the contents of its files, so frames and checkpoints of others are noticed."""

import json
from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_animate import COUNT, file, reported, scene  # noqa: F401 - a fixture
from test_checkpoint import Crash, always, crash  # noqa: F401 - fixtures
from test_meshes import gltf

import visray as vr
from visray import named_files
from visray.cluster.scene_package import ScenePackage
from visray.output import png

OFF = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 {}\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


def paint(path: Path, shade: int) -> None:
    """Writes a texture of one shade of grey."""
    png.write_png(path, png.encode(np.full((4, 4, 3), shade, np.uint8), {}, True))


@pytest.fixture
def textured(tmp_path: Path) -> Any:
    """The animated scene with a texture."""
    paint(tmp_path / "t.png", 90)
    one = scene()
    red = replace(one.materials["red"], texture="t")
    texture = vr.ImageTexture(file=str(tmp_path / "t.png"))
    return replace(one, textures={"t": texture}, materials={"red": red})


def gltf_files(folder: Path) -> Path:
    """A glTF file with its data beside it, own.bin."""
    tree = gltf([{"mesh": 0}])
    data = b64decode(tree["buffers"][0]["uri"].partition(",")[2])
    (folder / "own.bin").write_bytes(data)
    tree["buffers"][0]["uri"] = "own.bin"
    (folder / "a.gltf").write_text(json.dumps(tree))
    return folder / "a.gltf"


def test_the_hash_covers_the_contents_of_files_and_not_their_folder(textured: vr.Scene, tmp_path: Path) -> None:
    (tmp_path / "a.off").write_text(OFF.format(1))
    mesh = vr.Mesh(file=str(tmp_path / "a.off"))
    one = replace(textured, objects=textured.objects | {"mesh": mesh, "data": vr.Mesh(file=str(gltf_files(tmp_path)))})
    hashes = [one.hash(), one.hash()]
    assert hashes[0] == hashes[1]
    own = bytearray((tmp_path / "own.bin").read_bytes())
    own[:4] = np.float32(0.25).tobytes()
    for change in (
        lambda: paint(tmp_path / "t.png", 91),
        lambda: (tmp_path / "a.off").write_text(OFF.format(2)),
        lambda: (tmp_path / "own.bin").write_bytes(own),
    ):
        change()
        hashes.append(one.hash())
    assert len(set(hashes)) == 4
    # The same files elsewhere, as workers of a cluster have them.
    assert ScenePackage.of(one).unpacked(tmp_path / "worker").hash() == hashes[-1]
    (tmp_path / "t.png").unlink()
    assert one.hash() != hashes[-1]


def test_files_that_do_not_change_are_read_once(textured: vr.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    first, read = textured.hash(), []
    monkeypatch.setattr(named_files.hashlib, "file_digest", lambda *given: read.append(given))
    assert textured.hash() == first and not read


def test_frames_of_another_texture_are_made_again(
    textured: vr.Scene, file: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    file.write_text(vr.dump(textured, file.parent))
    words = file, "-o", "a.####.png", "--resume"
    assert reported(capsys, *words)["rendered"] == COUNT and reported(capsys, *words)["rendered"] == 0
    paint(Path("t.png"), 200)
    report = reported(capsys, *words)
    assert report["rendered"] == COUNT
    assert report["notes"] == [f"a.####.png: {COUNT} finished frames made again: {COUNT} of another scene"]


def test_a_checkpoint_of_another_texture_is_refused(
    textured: vr.Scene, tmp_path: Path, always: None, crash: Any  # noqa: F811
) -> None:  # fmt: skip
    still, path = vr.at(textured, 0.0), tmp_path / "a.checkpoint"
    crash(1)
    with pytest.raises(Crash):
        vr.render(still, progress=False, checkpoint=path)
    paint(tmp_path / "t.png", 200)
    with pytest.raises(vr.UserError, match=r"a\.checkpoint: is of another scene; ask for what it was begun with"):
        vr.render(still, progress=False, checkpoint=path, resume=True)
