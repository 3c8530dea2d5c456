"""The site: its reference has all public names, its menu all pages, and docstrings become what Sphinx reads."""

import inspect
import sys
from pathlib import Path

import pytest

import visray as vr

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "reference"), str(ROOT / "docs")]
import conf  # noqa: E402 - from a folder that the line above adds
import docs_api  # noqa: E402 - likewise
import docs_gallery  # noqa: E402 - likewise


def test_each_public_name_is_on_one_page_of_the_reference():
    names = [name for page in docs_api.TITLES for name in docs_api.names_of(page)]
    assert sorted([*names, "__version__"]) == sorted(vr.__all__)
    assert {path.stem for path in docs_api.PAGES.glob("*.md")} == set(docs_api.TITLES)


@pytest.mark.parametrize("page", docs_api.TITLES)
def test_a_page_of_the_reference_is_what_the_docstrings_say(page):
    written = (docs_api.PAGES / f"{page}.md").read_text()
    assert written == docs_api.markdown(page), "run: python reference/docs_api.py"


@pytest.mark.parametrize("page", docs_api.TITLES)
def test_the_site_has_an_entry_for_each_name(page):
    entries = docs_api.directives(page)
    for name in docs_api.names_of(page):
        assert entries.count(f":: visray.{name}\n") == 1


@pytest.mark.parametrize("name", [n for n in vr.__all__ if isinstance(getattr(vr, n), type)])
def test_a_record_has_its_fields_with_their_meanings(name):
    """Each field that the JSON Schema explains."""
    kind = getattr(vr, name)
    told = {field: text for field, text in docs_api.meanings().get(name, {}).items() if text and field != "type"}
    text = "\n".join(docs_api.fields(kind))
    assert all(f"* ``{field}``: " in text for field in told if field in kind.__dataclass_fields__)


def test_the_menu_has_the_pages_of_each_list():
    text = "# x\n\nSee [d](d.md).\n\n## One\n\n- [a](a.md): x\n- [b](api/b.md)\n\n## Two\n\n- [c](c.md)\n"
    assert conf.menu(text).removeprefix(text).split("```") == [
        "\n",
        "{toctree}\n:hidden:\n:caption: One\n\na\napi/b\n",
        "\n\n",
        "{toctree}\n:hidden:\n:caption: Two\n\nc\n",
        "\n",
    ]


def test_links_to_folders_are_text_and_links_to_other_files_stay():
    page = ROOT / "docs" / "x.md"
    text = (
        "[scenes](../scenes), [one](../scenes/sphere.json), [new](../CHANGELOG.md), [csg](csg.md#x), [web](https://a.b)"
    )
    told = "scenes, [one](../scenes/sphere.json), [new](path:../CHANGELOG.md), [csg](csg.md#x), [web](https://a.b)"
    assert conf.with_links_of_site(text, page) == told


def test_a_docstring_becomes_restructured_text():
    full = "w" * docs_api.FULL
    docstring = f"Of `a` and *b_.\n\nx, y: {full}\ngoes on.\nz: last.\nNew.\n\n    code_a = 1\n\nwith x:\n    y\n\nEnd."
    assert docs_api.restructured(docstring) == [
        r"Of ``a`` and \*b\_.", "",
        "", f"* **x, y**: {full}", "  goes on.", "", "* **z**: last.", "", "New.", "",
        "::", "", "        code_a = 1", "", "::", "", "    with x:", "        y", "", "End.", "",
    ]  # fmt: skip


def test_a_signature_has_no_types():
    signature = docs_api.signature(vr.Sphere)
    assert "radius=1.0" in signature and "type=" not in signature and ": " not in signature
    assert docs_api.signature(vr.value) == f"({', '.join(inspect.signature(vr.value).parameters)})"


def test_the_gallery_shows_every_scene_with_its_picture():
    assert set(docs_gallery.lines()) == docs_gallery.names(), "give each scene its line in reference/docs_gallery.py"
    assert docs_gallery.PAGE.read_text() == docs_gallery.markdown(), "run: python reference/docs_gallery.py"
    assert {path.stem for path in docs_gallery.PICTURES.glob("*.png")} == docs_gallery.names()


def test_a_scene_is_in_one_group_of_the_gallery():
    assert sum(len(group) for group in docs_gallery.SCENES.values()) == len(docs_gallery.lines())


@pytest.mark.parametrize("name, legend, size", [("earth", False, (240, 240)), ("heart", False, (320, 200))])
def test_a_picture_of_the_gallery_has_the_shape_of_the_film(name, legend, size):
    assert docs_gallery.size_of(name, legend) == size
