"""The pages of docs/api/: the public names of visray in groups, and their docstrings as the site shows them.

    python reference/docs_api.py         # writes docs/api/*.md; needed when a public name or its first line changes

On GitHub, a page shows its names, each with the first sentence of its docstring. The site (docs/conf.py) adds the
signatures, the whole docstrings, and the fields of records with their meanings in the JSON Schema.
"""

import functools
import inspect
import re
from pathlib import Path
from typing import Any

import visray as vr
from visray import lights, primitives
from visray.scene.write import schema

PAGES = Path(__file__).resolve().parents[1] / "docs" / "api"
# From the name of each page to its title, and what its names are for.
TITLES = {
    "functions": ("Functions", "What you call: load or make a scene, change it, render it, ask about it."),
    "scene": ("Scene, camera, materials, textures", "The records that a scene is made of, but for objects and lights."),
    "primitives": ("Objects", "The kinds of objects. Each is a class; give its fields by name."),
    "lights": ("Lights", "The kinds of lights. Each is a class; give its fields by name."),
    "animation": ("Animation", "What moves in a scene: an animation has tracks, and each track moves one value."),
    "data": ("Data", "Tables as parts of a scene: maps, globes, layers of rows, and legends."),
    "results": ("Results and errors", "What the functions return and raise."),
}
# Classes whose methods and properties are shown. Those of the others are for visray itself.
WITH_METHODS = {"Image", "Prepared"}
HINT = "In Python, `help(vr.NAME)` shows the rest. On the site, it is below."
# A line of a docstring that is at least as long has its next words in the next line.
FULL = 85
SCENE_MODULES = (
    "scene",
    "camera",
    "materials",
    "textures",
    "transforms",
    "primitives.clips",
    "environment_map",
    "filters",
)


def page_of(name: str) -> str:
    """The page of a public name."""
    value = getattr(vr, name)
    if name in primitives.__all__ or name in lights.__all__:
        return "primitives" if name in primitives.__all__ else "lights"
    if not isinstance(value, type):
        return "functions"
    module = value.__module__.removeprefix("visray.")
    for page, parts in {"scene": SCENE_MODULES, "animation": ("animation",), "data": ("data",)}.items():
        if any(module == part or module.startswith(f"{part}.") for part in parts):
            return page
    return "results"


def names_of(page: str) -> list[str]:
    """The public names of a page, in the order of the alphabet."""
    return sorted((n for n in vr.__all__ if not n.startswith("_") and page_of(n) == page), key=str.lower)


def first_sentence(name: str) -> str:
    """What a public name is, in one sentence."""
    value = getattr(vr, name)
    if not (isinstance(value, type) or callable(value)):
        return "The known surfaces by name, as `visray surfaces` lists them."
    return re.split(r"(?<=\.)\s", " ".join(inspect.getdoc(value).split("\n\n")[0].split()))[0]


def markdown(page: str) -> str:
    """The text of a page."""
    title, purpose = TITLES[page]
    rows = [f"| `vr.{name}` | {first_sentence(name).replace('|', chr(92) + '|')} |" for name in names_of(page)]
    return "\n".join([f"# {title}", "", purpose, HINT, "", "| name | what it is |", "|---|---|", *rows, ""])


def directives(page: str) -> str:
    """What the site adds to a page: an entry for each name, from its docstring."""
    parts = []
    for name in names_of(page):
        value = getattr(vr, name)
        kind = "class" if isinstance(value, type) else "function" if callable(value) else "data"
        lines = [f"## {name}", "", "```{eval-rst}", f".. auto{kind}:: visray.{name}"]
        lines += ["   :members:"] * (name in WITH_METHODS) + ["   :no-value:"] * (kind == "data") + ["```", ""]
        parts.append("\n".join(lines))
    return "\n".join(parts)


def restructured(docstring: str) -> list[str]:
    """A docstring of visray as lines of reStructuredText. Lines that begin with a name and a colon become a list. The
    lines after one of them belong to it if they are indented, or if the line before is full."""
    lines: list[str] = []
    for paragraph in docstring.split("\n\n"):
        written = paragraph.splitlines()
        block = len(written) > 1 and written[0].endswith(":") and written[1].startswith("    ")
        if block or all(line.startswith("    ") for line in written):
            lines += ["::", "", *(f"    {line}" for line in written), ""]
            continue
        indent, before = "", ""
        for line in written:
            if lines and (item := re.match(r"(\w+(?:, \w+)*): (.*)", line)):
                lines += ["", f"* **{escaped(item[1])}**: {escaped(item[2])}"]
                indent = "  "
            else:
                if indent and not line.startswith(" ") and len(before) < FULL:
                    lines.append("")
                    indent = ""
                lines.append(indent + escaped(line.strip()))
            before = line
        lines.append("")
    return lines


def escaped(text: str) -> str:
    """Plain text, with code between backticks, as reStructuredText."""
    parts = text.split("`")
    return "".join(f"``{p}``" if i % 2 else re.sub(r"([\\*_|])", r"\\\1", p) for i, p in enumerate(parts))


@functools.cache
def meanings() -> dict[str, dict[str, str]]:
    """For each record of the JSON Schema, its fields with their meanings."""
    whole = schema()
    records = whole["$defs"] | {"Scene": whole}
    return {
        name: {field: part.get("description", "") for field, part in record.get("properties", {}).items()}
        for name, record in records.items()
    }


def fields(kind: type) -> list[str]:
    """The fields of a record with their meanings, as lines of reStructuredText. A default is in the signature."""
    if not kind.__module__.startswith("visray.") or not hasattr(kind, "__dataclass_fields__"):
        return []
    told = meanings().get(kind.__name__, {})
    return ["", *(f"* ``{name}``: {escaped(told[name])}" for name in kind.__dataclass_fields__ if told.get(name)), ""]


def signature(value: Any) -> str:
    """The parameters of a function or class, with their defaults and without their types."""
    found = inspect.signature(value)
    bare = [p.replace(annotation=p.empty) for p in found.parameters.values() if p.name not in ("self", "type")]
    return str(found.replace(parameters=bare, return_annotation=found.empty))


def main() -> None:
    for page in TITLES:
        (PAGES / f"{page}.md").write_text(markdown(page))


if __name__ == "__main__":
    main()
