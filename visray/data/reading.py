"""Reads tables from files."""

import os
import stat
from pathlib import Path

from visray import memory
from visray.data.csv_file import read_csv
from visray.data.frames import table_of
from visray.data.geojson import is_geojson
from visray.data.table import LISTED, Table, shown
from visray.errors import UserError
from visray.scene.source import neighbour
from visray.scene.source import read as read_source
from visray.terminal import printable

# Bytes of memory that a byte of JSON takes while it is read.
JSON_BYTES = 16
# Keys of scenes whose values are objects. The columns of a table are lists.
OF_SCENES = ("camera", "film", "settings", "lights", "materials", "textures", "geometries", "objects", "data")


def read_json(path: Path) -> Table:
    """The table of a JSON file: GeoJSON, a list of records, or a dict of columns. Raises a UserError that names the
    file, and the address in it."""
    need, free = path.stat().st_size * JSON_BYTES, memory.free()
    if free is not None and need > free.size:
        what = f"takes about {need / 2**30:.1f} GiB while it is read, and {free}"
        raise UserError(f"{path}: {what}; leave out features or properties, or save it as CSV")
    source = read_source(path)
    if source.repeated:
        more = f", and {len(source.repeated) - LISTED} more" if len(source.repeated) > LISTED else ""
        listed = ", ".join(source.repeated[:LISTED])
        raise UserError(printable(f"{path}: keys are written twice: {listed}{more}; keep one of each"))
    raw = source.raw
    kind = raw.get("type") if isinstance(raw, dict) else None
    if kind == "Topology":
        raise UserError(f"{path}: is TopoJSON, not GeoJSON; convert it: topo2geo LAYER=NEW.geojson < OLD.json")
    if isinstance(raw, dict) and ("typeScene" in raw or any(isinstance(raw.get(x), dict) for x in OF_SCENES)):
        raise UserError(printable(f"{path}: is a scene, not a table; visray render {path} makes its picture"))
    if path.suffix.lower() == ".geojson" and not is_geojson(raw):
        what = "type is missing" if kind is None else f"type = {shown(str(kind))}"
        raise UserError(printable(f"{path}: {what}: must be FeatureCollection, Feature, or the type of a geometry"))
    return table_of(raw, str(path))


READERS = {".csv": read_csv, ".tsv": read_csv, ".tab": read_csv, ".txt": read_csv}
READERS |= {".geojson": read_json, ".json": read_json}


def read_table(path: str | os.PathLike[str]) -> Table:
    """The table of a file. Raises a UserError of one line, which begins with the path."""
    path = Path(path)
    try:
        return _read(path)
    except UserError as error:
        more = f"; errors like this: {len(error.lines):,}" if len(error.lines) > 1 else ""
        raise UserError(printable(error.lines[0] + more)) from None
    except FileNotFoundError:
        near = neighbour(path, READERS) or "; check the path"
        raise UserError(printable(f"{path}: there is no such file{near}")) from None
    except MemoryError:
        raise UserError(printable(f"{path}: does not fit into memory; leave out columns or rows")) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UserError(printable(f"{path}: cannot be read ({reason}); check the path")) from None


def _read(path: Path) -> Table:
    """The table of a file."""
    status = os.stat(path)
    if stat.S_ISDIR(status.st_mode):
        raise UserError(f"{path}: is a folder; give a file in it")
    # A pipe must not be opened: that would wait for a writer.
    if not stat.S_ISREG(status.st_mode):
        raise UserError(f"{path}: is not a regular file; give a table file")
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise UserError(f"{path}: is not known to be a table by its name; visray reads {', '.join(READERS)}")
    return read(path)
