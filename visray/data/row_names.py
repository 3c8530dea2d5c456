"""Names of rows that are written in a layer."""

from typing import Annotated, Any

from pydantic import BeforeValidator


def _listed(given: Any) -> Any:
    """A list, an array or a column of a data frame as texts; other values as they are."""
    given = given.tolist() if hasattr(given, "tolist") else given
    if not isinstance(given, (list, tuple)):
        return given
    return tuple("" if text is None or text != text else str(text) for text in given)


# Names of rows that are written in a layer.
RowNames = Annotated[tuple[str, ...], BeforeValidator(_listed)]
