"""Records that users make in Python: their fields are checked and normalised where they are made.

A record is a frozen dataclass whose fields have types that pydantic reads, such as Sphere or Material. `record_kind`
gives its class an `__init__` that checks the fields which are given, by these types: a wrong value raises a UserError
at the line that makes the record. NumPy's numbers and arrays, and lists, become tuples of Python's numbers.

What pydantic makes itself is checked by pydantic. What kernels make holds Dr.Jit arrays, or None in their place
(quantities.record), and is not checked.

A field that refers to an entry of a scene by its name, such as `Sphere.material`, may hold the entry itself. A scene
that is made of such records gives the entries names (scene/naming.py).
"""

from collections.abc import Callable, Collection
from dataclasses import MISSING, InitVar, dataclass, fields
from functools import cache, wraps
from typing import Annotated, Any

import drjit as dr
import numpy as np
from pydantic import PlainValidator, TypeAdapter, ValidationError, WrapValidator
from typing_extensions import TypedDict

from visray.errors import FieldError, UserError
from visray.hints import hint
from visray.operands import OperandsRule
from visray.record_text import record_text
from visray.references import contains_entries, is_entry, reference_of

# Types of values that are no Dr.Jit arrays. Others are looked at one by one.
PLAIN = frozenset((float, int, str, bool, tuple, list, dict, type(None), np.ndarray))

# Most numbers of a value that is looked at one by one, such as a point.
LONGEST_POINT = 4


class Words:
    """The words for errors. They are made above all kinds, by scene/messages.py, which sets `lines`.

    lines: function of a kind, pydantic's error and the values by name. It returns a list of messages.
    """

    lines: Callable[[type, ValidationError, dict], list[str]]


def record_kind(kind: type) -> type:
    """Decorator of a dataclass: its `__init__` checks and normalises what it is given, and its repr shows the fields
    that differ from their defaults."""
    facts: _Facts | None = None

    @wraps(kind.__init__)
    def __init__(self: Any, *args: Any, **given: Any) -> None:
        nonlocal facts
        if facts is None:
            facts = _facts(kind)
        if args:
            given = _by_name(kind, args, given)
        if PLAIN.issuperset(map(type, given.values())) and not any(map(_has_truths, given.values())):
            try:
                given = facts.validate(given)
            except ValidationError:
                given = _mended(kind, given)
        elif not any(map(dr.is_array_v, given.values())):
            given = _mended(kind, given)
        if facts.required and not facts.required <= given.keys():
            raise TypeError(f"{kind.__name__}() needs {_listed(facts.required - given.keys(), facts.names)}")
        # As the dataclass's own __init__ does, which takes longer, since the fields of a frozen dataclass are set by a
        # function.
        own = self.__dict__
        own.update(facts.defaults)
        for name, made in facts.made.items():
            own[name] = made()
        if facts.has_more:
            inputs = {name: given.pop(name, None) for name in facts.inputs}
            own.update(given)
            try:
                self.__post_init__(**inputs)
            except FieldError as error:
                raise FieldError(
                    f"{kind.__name__}: {error} (dataclasses.replace gives both, vr.replaced does not)"
                ) from None
        else:
            own.update(given)
        if facts.checks_itself and (flaws := self.flaws_of_values()):
            raise UserError(*(f"{kind.__name__}: {name}: {flaw}" for name, flaw in flaws))

    kind.__init__ = __init__
    kind.__repr__ = record_text
    return kind


def altered(record: Any, changes: dict[str, Any]) -> Any:
    """A copy of a record, or of a scene, with other values in some fields, which are not checked: they have names in
    place of entries already."""
    made = object.__new__(type(record))
    made.__dict__.update({name: getattr(record, name) for name in _field_names(type(record))} | changes)
    if hasattr(made, "__post_init__"):
        made.__post_init__(**dict.fromkeys(_inputs(type(record))))
    return made


@cache
def _field_names(kind: type) -> tuple[str, ...]:
    """Names of the fields of a kind."""
    return tuple(f.name for f in fields(kind))


@dataclass(frozen=True)
class _Facts:
    """What is known of a kind.

    names: names of all fields and inputs. by_place: those that are given by place. required: those without a default.
    inputs: names of what is given, but not kept (dataclasses.InitVar), such as a material's color; the method
        __post_init__ gets it
    defaults: values of all fields, in order; None for those without a default. made: functions that make the defaults
        of fields which have a new one each time.
    has_more: whether the kind has a method __post_init__
    checks_itself: whether the kind has a method flaws_of_values: names of fields, and what is wrong with their values
        together
    validate: function that returns the checked values of a dict of values
    with_entries: the same, for values among which there may be entries in place of their names
    """

    names: tuple[str, ...]
    by_place: tuple[str, ...]
    inputs: tuple[str, ...]
    required: frozenset[str]
    defaults: dict[str, Any]
    made: dict[str, Callable[[], Any]]
    has_more: bool
    checks_itself: bool
    validate: Callable[[dict], dict]
    with_entries: Callable[[dict], dict]


@cache
def _inputs(kind: type) -> dict[str, Any]:
    """What the constructor of a kind is given, but does not keep, by name, with its types."""
    return {name: f.type.type for name, f in kind.__dataclass_fields__.items() if isinstance(f.type, InitVar)}


@cache
def _facts(kind: type) -> _Facts:
    """What is known of a kind. It is found when a record of the kind is made, because the types of operands are not
    known before (operands.py)."""
    declared, inputs = [f for f in fields(kind) if f.init], _inputs(kind)
    return _Facts(
        (*inputs, *(f.name for f in declared)),
        tuple(f.name for f in declared if not f.kw_only),
        tuple(inputs),
        frozenset(f.name for f in declared if f.default is MISSING and f.default_factory is MISSING),
        {f.name: None if f.default is MISSING else f.default for f in declared},
        {f.name: f.default_factory for f in declared if f.default_factory is not MISSING},
        hasattr(kind, "__post_init__"),
        hasattr(kind, "flaws_of_values"),
        _validator({f.name: _without_operands(f.type) for f in declared} | inputs),
        _validator({f.name: _given(f.type) for f in declared} | inputs),
    )


def _validator(types: dict[str, Any]) -> Callable[[dict], dict]:
    """A function that returns the checked values of a dict of values. types: types of the values by name."""
    values = TypedDict("values", types, total=False)
    values.__pydantic_config__ = {"extra": "forbid"}
    return TypeAdapter(values).validator.validate_python


def _without_operands(annotation: Any) -> Any:
    """The type of a field, but for operands only that of what contains them."""
    is_operands = any(isinstance(m, OperandsRule) for m in getattr(annotation, "__metadata__", ()))
    return Annotated[Any, PlainValidator(_operands)] if is_operands else annotation


def _given(annotation: Any) -> Any:
    """The type of the values that a field may be given, for its type in a scene."""
    section = reference_of(annotation)

    def named_or_entry(value: Any, validate: Callable) -> Any:
        # Records that have entries were checked when they were made.
        if is_entry(value, section) or contains_entries(value):
            return tuple(value) if isinstance(value, list) else value
        return validate(value)

    return Annotated[_without_operands(annotation), WrapValidator(named_or_entry)]


def _operands(value: Any) -> Any:
    """Operands as a tuple, or as a dict by name. They are records, which were checked when they were made; dicts in
    their place are checked with the scene."""
    if isinstance(value, list):
        return tuple(value)
    if value is None or isinstance(value, (tuple, dict)):
        return value
    raise ValueError("must be a list of objects, or objects by name")


def _listed(some: Collection[str], names: tuple[str, ...]) -> str:
    """Some names in their order, as words."""
    return " and ".join(name for name in names if name in some)


def _by_name(kind: type, args: tuple, given: dict[str, Any]) -> dict[str, Any]:
    """All values by name. args: those that are given by place. given: those that are given by name."""
    names = _facts(kind).by_place
    if len(args) > len(names):
        plural = "s" * (len(names) > 1)
        places = f"{len(names)} value{plural} by place ({', '.join(names)})" if names else "no values by place"
        more = "; a point or a colour is one value, as in (0, 1, 0)" if all(np.ndim(x) == 0 for x in args) else ""
        raise TypeError(f"{kind.__name__}() takes {places}, not {len(args)}{more}")
    placed = dict(zip(names, args))
    if twice := placed.keys() & given.keys():
        raise TypeError(f"{kind.__name__}(): {min(twice)} is given twice, by place and by name")
    return placed | given


def _mended(kind: type, given: dict[str, Any]) -> dict[str, Any]:
    """The checked values of fields that are not plainly right: with entries in place of names, or with numbers of other
    libraries. Raises UserError if one is wrong, and TypeError for a field that the kind does not have."""
    facts = _facts(kind)
    for name in given:
        if name not in facts.names:
            raise TypeError(f"{kind.__name__}() has no {name!r}; {_unknown(kind, name)}")
    for name, value in given.items():
        if isinstance(value, (set, frozenset)):
            raise UserError(f"{kind.__name__}: {name} = {value!r}: a set has no order; write a list or a tuple")
    # pydantic takes NumPy's truth values for numbers.
    truths = {name for name, value in given.items() if isinstance(value, np.bool_) or _has_truths(value)}
    given = {name: _python(value) if name in truths else value for name, value in given.items()}
    try:
        return facts.with_entries(given)
    except ValidationError as error:
        wrong = {e["loc"][0] for e in error.errors(include_url=False, include_input=False)}
    given = {name: _python(value) if name in wrong else value for name, value in given.items()}
    try:
        return facts.with_entries(given)
    except ValidationError as error:
        raise UserError(*Words.lines(kind, error, given)) from None


def _has_truths(value: Any) -> bool:
    """Whether a short list or tuple has truth values of NumPy."""
    return type(value) in (tuple, list) and len(value) <= LONGEST_POINT and np.bool_ in map(type, value)


def _python(value: Any) -> Any:
    """The value with Python's numbers in place of those of NumPy and of other libraries of arrays."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return tuple(map(_python, value))
    return {key: _python(part) for key, part in value.items()} if isinstance(value, dict) else value


def _unknown(kind: type, name: str) -> str:
    """What is right instead of a field that a kind does not have."""
    names = _facts(kind).names
    if instead := getattr(kind, "MISPLACED", {}).get(name):
        return instead
    if name in ("translate", "scale", "rotate", "matrix") and "transform" in names:
        return f"write transform=[vr.{name.title()}(...)]"
    return hint(name, names, "'")
