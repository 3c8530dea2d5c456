"""Scene files with comments and with commas after a last entry: what is read, and where errors are."""

import json
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st

import visray as vr
from visray.cli import main
from visray.errors import UserError
from visray.scene.comments import has_comments, without_comments
from visray.scene.source import parse, read

COMMENTS = ("// all\n", "/* one\n two */", "//\n", "/**/", "/* // */", '// "a"\n')
TEXTS = st.text('[]{}",:/*\\a\n ')
VALUES = st.recursive(TEXTS | st.integers() | st.booleans(), lambda x: st.lists(x) | st.dictionaries(TEXTS, x))


def commented(value, draw) -> str:
    """JSON text of a value, with comments and with commas after last entries."""
    gap = lambda: draw(st.sampled_from(("", " ", "\n", *COMMENTS)))  # noqa: E731 - a name for a row
    if isinstance(value, dict | list) and value:
        if isinstance(value, dict):
            parts = [f"{gap()}{json.dumps(k)}{gap()}:{gap()}{commented(v, draw)}" for k, v in value.items()]
        else:
            parts = [commented(v, draw) for v in value]
        last = draw(st.sampled_from(("", ",")))
        opening, closing = "{}" if isinstance(value, dict) else "[]"
        return gap() + opening + ",".join(parts) + last + gap() + closing + gap()
    return gap() + json.dumps(value) + gap()


@given(st.data())
def test_comments_and_last_commas_change_nothing(data):
    """Texts with comments between all tokens, and with quotes, slashes and brackets in strings."""
    value = data.draw(VALUES)
    text = commented(value, data.draw)
    assert parse(text, "scene", comments=True).raw == value
    plain = without_comments(text, "scene")
    assert len(plain) == len(text) and plain.count("\n") == text.count("\n")


@given(VALUES)
def test_texts_without_comments_stay_as_they_are(value):
    text = json.dumps(value)
    assert without_comments(text, "scene") == text and not has_comments(text)


@pytest.mark.parametrize("text", ["[,]", "{,}", "[1,,]", "[1, ,]", '{"a":,}', "[/**/,]", "[1,/**/,]", "1,", ","])
def test_a_comma_without_an_entry_is_refused(text):
    with pytest.raises(UserError, match="is not JSON"):
        parse(text, "scene", comments=True)


def test_a_scene_with_comments_is_read_and_its_errors_have_their_lines(tmp_path):
    file = tmp_path / "ball.json"
    file.write_text('{\n // a ball\n "objects": {"ball": {"type": "sphere", "radius": 2, /* big */}},\n}\n')
    assert vr.load(file).objects["ball"].radius == 2
    file.write_text('{\n // a ball, see http://x\n "objects": {"ball": {"type": "sphere" "radius": 2}}}\n')
    with pytest.raises(UserError, match="line 3, column 40: is not JSON"):
        vr.load(file)


def test_a_key_that_is_written_twice_is_found_under_comments(tmp_path):
    file = tmp_path / "ball.json"
    file.write_text('{"film": {"width": 4, /* or */ "width": 5}}')
    assert read(file).repeated == ("film.width",)


def test_what_is_written_is_plain_json(tmp_path):
    file = tmp_path / "ball.json"
    file.write_text('{// one\n "objects": {"ball": {"type": "sphere", "radius": 2,}}}')
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        text = vr.dump(vr.load(file), like=file)
    assert json.loads(text)["objects"]["ball"]["radius"] == 2


def test_the_value_of_an_option_has_no_comments():
    with pytest.raises(UserError, match="a value has no comments"):
        parse("[1, // 2\n 3]", "materials.red.kd")


def test_a_note_says_that_comments_are_replaced(tmp_path, capsys):
    file = tmp_path / "ball.json"
    file.write_text('{// one\n "objects": {"ball": {"type": "sphere", "radius": 2,}}}')
    assert main(["import", str(file), "-o", str(file)]) == 0
    assert "had comments, and what is written is plain JSON without them" in capsys.readouterr().err
    assert main(["import", str(file), "-o", str(file)]) == 0
    assert capsys.readouterr().err == ""
