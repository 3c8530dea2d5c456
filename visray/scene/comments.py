"""Comments in JSON texts: // to the end of a line, and /* */. A comma after the last entry is allowed too.

Both are replaced by spaces, so that all else keeps its line and its column.
"""

import re

from visray.errors import UserError

# A text in quotes, a comment, or a comma after the last entry. A text ends with its line, so that a quote that is
# missing hides no comment below.
_PART = re.compile(r'"(?:[^"\\\n]|\\.)*"?|//[^\n]*|/\*.*?\*/|/\*', re.DOTALL)
_COMMA = re.compile(r'"(?:[^"\\\n]|\\.)*"?|(?<=[^\s,:\[{])(\s*),(?=\s*[\]}])')


def has_comments(text: str) -> bool:
    """Whether a JSON text has comments. Domain: it is JSON but for them."""
    return any(part[0].startswith("/") for part in _PART.finditer(text))


def without_comments(text: str, name: str) -> str:
    """A JSON text with spaces in place of comments and of commas after a last entry.

    name: what errors call the text, such as the file's path.
    """

    def blank(part: re.Match) -> str:
        if part[0] == "/*":
            line = text.count("\n", 0, part.start()) + 1
            raise UserError(f"{name}: line {line}: the comment that begins here has no end; write */ behind it")
        return part[0] if part[0].startswith('"') else re.sub(r"[^\n]", " ", part[0])

    plain = _PART.sub(blank, text)
    return _COMMA.sub(lambda part: part[0] if part[0].startswith('"') else part[1] + " ", plain)
