"""Names in exported files: identifiers of C, and names of joints in comments."""

from __future__ import annotations

import json
import re

from rps_pin.errors import InputError, shown

#: C99's keywords, and those of C++ that a header meets.
_KEYWORDS = frozenset(
    {
        *("auto", "bool", "break", "case", "catch", "char", "class", "const", "continue"),
        *("default", "delete", "do", "double", "else", "enum", "explicit", "extern", "false"),
        *("float", "for", "friend", "goto", "if", "inline", "int", "long", "mutable", "namespace"),
        *("new", "operator", "private", "protected", "public", "register", "restrict", "return"),
        *("short", "signed", "sizeof", "static", "struct", "switch", "template", "this", "throw"),
        *("true", "try", "typedef", "typename", "union", "unsigned", "using", "virtual", "void"),
        *("volatile", "while"),
    }
)
#: Headers of C99, which a file NAME.h would stand before.
_HEADERS = frozenset(
    {
        *("assert", "complex", "ctype", "errno", "fenv", "float", "inttypes", "iso646", "limits"),
        *("locale", "math", "setjmp", "signal", "stdarg", "stdbool", "stddef", "stdint", "stdio"),
        *("stdlib", "string", "tgmath", "time", "wchar", "wctype"),
    }
)
#: C99 promises that so many characters of a public name count.
_LONGEST = 31


def identifier(*names: str) -> str:
    """Return the first of some names that can begin the names of C, made one.

    Letters become small, and all but letters and digits of ASCII an underscore.

    Raises
    ------
    InputError
        If none can be: it would be empty, begin with a digit, be longer than 31 characters, or be
        a keyword or a header of C.
    """
    reasons = []
    for name in names:
        made = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        reason = _refused(made)
        if not reason:
            return made
        reasons.append(f"{shown(name)} {reason}")
    raise InputError(
        f"no name for files and functions of C: {'; '.join(dict.fromkeys(reasons))}. "
        "Give one of letters, digits and underscores that begins with a letter"
    )


def _refused(made: str) -> str:
    if not made:
        return "has no letter or digit of ASCII"
    if made[0].isdigit():
        return f"would be {made}, which begins with a digit"
    if len(made) > _LONGEST:
        return f"would have {len(made)} characters; C99 promises that {_LONGEST} count"
    if made in _KEYWORDS:
        return f"would be {made}, a keyword of C or C++"
    if made in _HEADERS:
        return f"would make a file {made}.h, which is one of C's own headers"
    return ""


def quoted(name: str) -> str:
    r"""Return a name for a comment of C or a table of Markdown, as a string of JSON.

    It is ASCII on one line, and can neither end a comment nor begin one: ``*``, ``?`` (of
    trigraphs), `````, ``|``, ``<`` and ``&`` are written as ``\u002a`` and so on.
    """
    text = json.dumps(name)
    return re.sub(r"[*?`|<&$]", lambda found: f"\\u{ord(found[0]):04x}", text)
