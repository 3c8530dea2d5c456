"""Settings of the site: Sphinx reads the pages of docs/, which are written to be read on GitHub as well.

    python -m pip install '.[docs]'
    python -m sphinx -W -b html docs build/site      # then open build/site/index.html

Three things are made while the site is built (the page's text is changed before it is parsed): the menu, from the lists
of links in index.md; the entries of docs/api/, from docstrings (reference/docs_api.py); and links to folders of the
repository, which a site cannot show, become plain text. A link to another file of the repository downloads it. With -W,
a link that leads nowhere is an error.
"""

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent / "reference"))
import docs_api  # noqa: E402 - from the folder that the line above adds

import visray as vr  # noqa: E402 - likewise

project = "visray"
copyright = "the authors of visray; Apache-2.0"
release = vr.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = "visray"
html_show_sourcelink = False
html_copy_source = False
# Anchors of headings as GitHub makes them, down to ####.
myst_heading_anchors = 4
nitpicky = True
autodoc_typehints = "none"


def menu(text: str) -> str:
    """The lists of links of index.md as hidden menus: one for each heading of the second level."""
    parts = []
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        pages = re.findall(r"^- \[.*?\]\(([\w/-]+)\.md\)", section, re.MULTILINE)
        parts += [
            "",
            "```{toctree}",
            ":hidden:",
            f":caption: {section.splitlines()[0]}",
            "",
            *dict.fromkeys(pages),
            "```",
        ]
    return text + "\n".join(parts) + "\n"


def with_links_of_site(text: str, page: Path) -> str:
    """A page whose links to folders are plain text. Its links to Markdown files outside of docs/ download them."""

    def link_of_site(link: re.Match) -> str:
        target = page.parent / link[2]
        if target.is_dir():
            return link[1]
        outside = target.suffix == ".md" and not target.resolve().is_relative_to(DOCS)
        return f"[{link[1]}](path:{link[2]})" if outside else link[0]

    return re.sub(r"\[([^\]]*)\]\(([^)#\s]+)\)", link_of_site, text)


def changed(app: object, name: str, source: list[str]) -> None:
    """What is parsed in place of a page's text."""
    source[0] = with_links_of_site(source[0], DOCS / f"{name}.md")
    if name == "index":
        source[0] = menu(source[0])
    if name.startswith("api/"):
        source[0] += "\n" + docs_api.directives(name.removeprefix("api/"))


def docstring(app: object, what: str, name: str, value: object, options: object, lines: list[str]) -> None:
    """A docstring as reStructuredText, with the fields of a record."""
    lines[:] = docs_api.restructured("\n".join(lines).strip())
    if what == "data":  # has the docstring of its type
        lines[:] = [docs_api.escaped(docs_api.first_sentence(name.rpartition(".")[2]))]
    if what == "class":
        lines += docs_api.fields(value)


def bare_signature(
    app: object, what: str, name: str, value: object, options: object, signature: str, returned: str
) -> tuple[str, None] | None:
    """Parameters without their types: the docstring says what they are."""
    of_python = isinstance(value, type) and issubclass(value, Exception)
    return (docs_api.signature(value), None) if callable(value) and not of_python else None


def setup(app: object) -> None:
    app.connect("source-read", changed)
    app.connect("autodoc-process-docstring", docstring)
    app.connect("autodoc-process-signature", bare_signature)
