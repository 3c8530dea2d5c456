"""Messages about texts that are no scene: each says what to write, and none is about another place."""

import json
import os
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from unchecked import unchecked

import visray as vr
from visray.errors import UserError
from visray.scene import messages
from visray.scene.source import DEEPEST, neighbour, parse, wrong_texts


def refused(folder: Path, text: str) -> list[str]:
    """The errors of a file with this text, without the file's name."""
    path = folder / "scene.json"
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        vr.load(path)
    return [line.removeprefix(f"{path}: ") for line in caught.value.lines]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('{"a": [1,\n , \n ]}', "line 1, column 10: is not JSON: there are two commas; leave one out"),
        ('{"a": 1,\n , "b": 2}', "line 1, column 9: is not JSON: there are two commas; leave one out"),
        ('{"a": 1\n "b": 2}', "line 1, column 8: is not JSON: a comma is missing here, or a bracket"),
        ('{"a": [1, 2\n', "line 1, column 12: is not JSON: the file ends too early"),
        ('{\n  # size\n}', "line 2, column 3: is not JSON: a comment begins with //, not with #"),
        ('{\n  /* size\n}', "line 2: the comment that begins here has no end; write */ behind it"),
        ('{ // size\n "a": .5}', "line 2, column 7: is not JSON: a number begins with a digit, as in 0.5"),
        ("// nothing\n", "the file holds only comments; it must hold at least {}"),
        ('{"a" 1}', "line 1, column 6: is not JSON: expecting ':' delimiter"),
    ],
)  # fmt: skip
def test_a_fault_is_blamed_on_its_own_place(tmp_path, text, line):
    assert refused(tmp_path, text) == [line]


@pytest.mark.parametrize("depth", [DEEPEST + 1, 300, 600, 985, 5000])
@pytest.mark.parametrize(("begin", "end"), ["[]", ('{"a":', "}"), ('[{"\\"}": 1}, ', "]")])
def test_deep_nesting_is_one_line(tmp_path, depth, begin, end):
    line = "is nested deeper than 210 objects and lists; no scene needs that"
    assert refused(tmp_path, begin * depth + "1" + end * depth) == [line]


@given(st.recursive(st.text('[]{}\\"a,'), lambda inner: st.lists(inner) | st.dictionaries(st.text('[{"'), inner)))
def test_depth_is_that_of_objects_and_lists(value):
    """Brackets in texts count for nothing, wherever they are."""

    def depth(part):
        parts = part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
        return 1 + max(map(depth, parts), default=0) if isinstance(part, (dict, list)) else 0

    for around, fits in ((DEEPEST - depth(value), True), (DEEPEST - depth(value) + 1, False)):
        text = "[" * around + json.dumps(value) + "]" * around
        if fits:
            parse(text, "text")
        else:
            with pytest.raises(UserError, match="nested deeper"):
                parse(text, "text")


HALF = "a\ud800b"


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ({"objects": {HALF: {"type": "sphere"}}, "camera": {}, "lights": {}}, r'objects."a\ud800b"'),
        ({HALF: 1}, r'"a\ud800b"'),
        (
            {"objects": {"ball": {"type": "sphere", "material": HALF}}, "camera": {}, "lights": {}},
            r'objects.ball.material."a\ud800b"',
        ),
        ({"textures": {"t": {"type": "image", "file": HALF}}}, r'textures.t.file."a\ud800b"'),
        ({"ambient": [{HALF: 1}]}, r'ambient.0."a\ud800b"'),
    ],
)
def test_half_a_character_is_refused(tmp_path, content, line):
    assert refused(tmp_path, json.dumps(content)) == [line + r": \ud800 is half a character; write the whole one"]


def test_half_a_character_in_a_scene_from_python_is_refused():
    scene = vr.Scene(
        objects={HALF: unchecked(vr.Sphere, material=HALF)},
        materials={HALF: vr.Material()},
        camera=vr.Camera(),
        lights={},
    )
    with pytest.raises(UserError) as caught:
        vr.explain(scene)
    assert len(caught.value.lines) == 3 and all(r"\ud800 is half a character" in x for x in caught.value.lines)
    with pytest.raises(UserError, match=r"^Sphere: material.*half a character"):
        vr.Sphere(material=HALF)


def test_whole_characters_are_none_of_that(tmp_path):
    assert wrong_texts({"é 😀": ["😀", 1, None, {"x": (True,)}]}) == []
    (tmp_path / "a.json").write_text(r'{"objects": {"\ud83d\ude00": {"type": "sphere"}}, "camera": {}, "lights": {}}')
    assert list(vr.load(tmp_path / "a.json").objects) == ["😀"]


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of folders are those of Unix")
def test_a_folder_that_may_not_be_listed_gives_no_hint(tmp_path, monkeypatch):
    folder = tmp_path / "closed"
    folder.mkdir()
    (folder / "scene.json").write_text("{}")
    assert "scene.json" in neighbour(folder / "scen.json")
    folder.chmod(0o311)
    if os.access(folder, os.R_OK):  # an administrator may list it anyway

        def refuse(path):
            raise PermissionError(13, "Permission denied", str(path))

        monkeypatch.setattr(Path, "iterdir", refuse)
    with pytest.raises(UserError, match=r"scen\.json: no such file$"):
        vr.load(folder / "scen.json")


def test_a_list_of_objects_is_no_scene_of_the_original(tmp_path):
    line = refused(tmp_path, '{"objects": [{"type": "sphere"}]}')
    right = 'must be an object {...} that holds entries by name, such as {"NAME": {...}}'
    assert line == [f'objects = [{{"type": "sphere"}}]: {right}']


def test_a_thousand_errors_are_as_many_as_a_user_reads(tmp_path):
    """Each of them is a search for a similar name among a thousand, and a list of them."""
    objects = {f"ball {i}": {"type": "sphere", "material": f"material {i}"} for i in range(1000)}
    materials = {f"stuff {i}": {} for i in range(1000)}
    lines = refused(tmp_path, json.dumps({"objects": objects, "materials": materials, "camera": {}, "lights": {}}))
    assert len(lines) == messages.MOST + 1 and max(map(len, lines)) < 2000
    assert lines[-1] == f"there are more than {messages.MOST} errors; correct these first"
    assert "stuff 59, and 941 more" in lines[0] and "stuff 60" not in lines[0]
    wrong = {f"ball {i}": {"type": "sphere", "radus": 1} for i in range(1000)}
    assert len(refused(tmp_path, json.dumps({"objects": wrong, "camera": {}, "lights": {}}))) == messages.MOST + 1


def test_a_similar_name_is_found_among_very_many():
    choices = [f"{letter}{i}" for letter in "abcdefghij" for i in range(1000)]
    assert messages.hint("J7", choices).startswith('did you mean "j7"?')
    assert messages.hint("b0x", choices).startswith('did you mean "b0"?')


@pytest.mark.parametrize("text", ["kummer", "x^2 + y^2 = 1", "x² + 1.5", "Barth sextic"])
def test_a_formula_in_place_of_a_file_is_led_to_surfaces(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError) as error:
        vr.load(text)
    assert str(error.value) == (
        f'{text}: no such file; if it is a formula or a known surface: visray surface "{text}", '
        f'in Python vr.surface_scene("{text}")'
    )


@pytest.mark.parametrize("text", ["a=1/x.json", "gone.json", "pictures/xyz"])
def test_other_files_that_are_missing_are_not(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=r"no such file$"):
        vr.load(text)
