"""Names of the columns of a text file: each column has one, and all are different."""

from visray.data.table import LISTED, shown


def column_names(written: list[str] | None, width: int) -> tuple[list[str], list[str]]:
    """Names of the columns, all different, and sentences about those that are not as they are written."""
    if written is None:
        return [f"column {i + 1}" for i in range(width)], []
    names, notes = [" ".join(name.split()) for name in written], []
    while len(names) > 1 and not names[-1]:
        names.pop()
    if unnamed := [i for i, name in enumerate(names) if not name]:
        names = [name or f"column {i + 1}" for i, name in enumerate(names)]
        notes.append(f"columns without a name: {', '.join(names[i] for i in unnamed[:LISTED])}")
    for name in dict.fromkeys(n for n in names if names.count(n) > 1):
        places = [i for i, n in enumerate(names) if n == name]
        taken = set(names)
        for i in places:
            number = next(k for k in range(1, len(names) + 2) if f"{name} ({k})" not in taken)
            names[i] = f"{name} ({number})"
            taken.add(names[i])
        notes.append(f"the column {shown(name)} is there {len(places)} times: {', '.join(names[i] for i in places)}")
    return names, notes
