"""Operands: objects inside an object, as values of a scene (primitives/csg.py).

Operands are a list of objects, or objects by name. An operand can be of any kind, so the type of the field refers to
all kinds, and each kind has such a field. This module stands below all kinds; primitives/__init__.py gives it the type
of an object.
"""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Discriminator, GetCoreSchemaHandler, Tag
from pydantic_core import core_schema

from visray.quantities import Name


def _shape(given: Any) -> str | None:
    """Whether operands are given by name or as a list; None for a single object, which is neither."""
    if isinstance(given, dict) and isinstance(given.get("type"), str):
        return None
    return "names" if isinstance(given, dict) else "list"


@dataclass(frozen=True)
class OperandsRule:
    """The type of a field that holds operands, as an annotation that pydantic reads.

    optional: whether the value may be None.
    """

    optional: bool

    # The type of an object. It has no type annotation, because it belongs to the class.
    object_type = None

    def type(self) -> Any:
        """The type that the annotation stands for."""
        listed, named = tuple[self.object_type, ...], dict[Name, self.object_type]
        both = Annotated[Annotated[listed, Tag("list")] | Annotated[named, Tag("names")], Discriminator(_shape)]
        return both | None if self.optional else both

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return handler.generate_schema(self.type())


Operands = Annotated[Any, OperandsRule(False)]
OptionalOperands = Annotated[Any, OperandsRule(True)]


# Names of the fields that hold operands.
ROLES = ("of", "cut")


def named_operands(operands: Any) -> dict[str, Any]:
    """Operands by the last part of their addresses: their name, or their number in the list. None has none."""
    if operands is None:
        return {}
    return dict(operands) if isinstance(operands, dict) else {str(i): x for i, x in enumerate(operands)}


def like_operands(named: dict[str, Any], operands: Any) -> Any:
    """Operands by the last part of their addresses in the form that others have: by name, or as a list or tuple."""
    return named if isinstance(operands, dict) else type(operands)(named.values())
