"""What is wrong with the words of a command line, in one line: the word, what is wrong, what would be right."""

from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from cyclopts import App, CycloptsError
from cyclopts.exceptions import (
    CoercionError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from visray.cli.scene_files import is_scene, missing
from visray.cli.words import is_assignment
from visray.hints import similar

# What a value of each type is, in words.
NUMBERS = {int: "a whole number", float: "a number", Path: "a file"}
TABLES = (".csv", ".tsv", ".txt", ".geojson")


def explained(error: CycloptsError, app: App) -> str:
    """The line for an error. app: all commands."""
    command = " ".join(("visray", *(error.command_chain or ())))
    match error:
        case UnknownCommandError():
            return _unknown_command(error.unused_tokens[0], app)
        case UnknownOptionError():
            word = error.token.keyword or error.token.value
            if word == "-":
                return "-: a scene is read from no pipe; write it to a file first, such as scene.json"
            names = [name for argument in error.argument_collection if argument.parse for name in argument.names]
            near = similar(word, names)
            return f"{word}: there is no such option; {_or(near)}{command} --help lists all"
        case MissingArgumentError():
            return _missing(error, command)
        case CoercionError() if error.msg is None and error.token is not None:
            return _wrong_value(error, command)
        case RepeatArgumentError():
            return f"{error.token.keyword}: is given twice; leave one out"
        case UnusedCliTokensError():
            return _unused(error.unused_tokens[0], command)
    return f"{' '.join(str(error).split())} (see {command} --help)"


def _or(near: list[str]) -> str:
    """A suggestion before another hint, if there is one."""
    return f"did you mean {near[0]}? " if near else ""


def _unknown_command(word: str, app: App) -> str:
    """The line for a word in place of a command."""
    path = Path(word)
    if is_scene(path):
        return f"{word}: is a scene, and no command; visray render {word} makes its picture"
    if path.suffix.lower() in TABLES and path.is_file():
        return f"{word}: is a table, and no command; visray data {word} makes its picture"
    if path.suffix.lower() == ".py" and path.is_file():
        return f"{word}: is a Python program, and no command; run it: python {word}"
    commands = [name for name in app if not name.startswith("-")]
    near = get_close_matches(word, commands, 1)
    return f"{word}: there is no such command; {_or([f'visray {name}' for name in near])}visray --help lists all"


def _missing(error: MissingArgumentError, command: str) -> str:
    """The line for a missing value."""
    name = error.keyword or error.argument.name
    if name == "SCENE":
        return f"{command}: the scene is missing; {missing(command)}"
    if name.startswith("-"):
        return f"{name}: its value is missing; {command} --help says what it takes"
    return f"{command}: {name} is missing; {command} --help says what it is"


def _wrong_value(error: CoercionError, command: str) -> str:
    """The line for a value that is no number, or none of some words."""
    where, value = error.token.keyword or command, error.token.value
    kinds = [kind for kind in _members(error.target_type) if kind is not type(None)]
    words = [word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)]
    if words:
        return f"{where} = {value}: must be one of {', '.join(words)}"
    wanted = " or ".join(NUMBERS.get(kind, str(kind)) for kind in kinds)
    return f"{where} = {value}: must be {wanted}"


def _members(kind: Any) -> tuple[Any, ...]:
    """The types of a union; a single type alone."""
    return (kind,) if get_origin(kind) is Literal else get_args(kind) or (kind,)


def _unused(word: str, command: str) -> str:
    """The line for a word that no option takes."""
    if is_assignment(word):
        return f"{word}: stands alone; write --set {word}"
    return f"{word}: is one word too many; {command} --help says what it takes"
