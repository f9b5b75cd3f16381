"""Numbers and texts that readers, options and calls must take rightly or refuse in words."""

from __future__ import annotations

from random import Random

#: What is no decimal number in any of the formats, though Python, or a careless reader, takes it.
NO_NUMBERS = [
    *("1_000", "\u0661\u0662", "1\u00a0", "0x1F", "1,5", "1.2.3", "--1", "1e", "e5", "+", "1 2"),
    *("nan", "inf", "-inf", "NaN", "Infinity", "infinity", "1e400", "-1e400", "9" * 400, "\uff11"),
    *("1d5", "1f", "0b1", "1j", "1/2", "True", "None", "null", "%s", "$(1)", "one", "\u221e", "½"),
]
#: Numbers, most of which no robot has.
NUMBERS = [
    *("0", "-0", "-0.0", "1e-320", "5e-324", "1e-200", "1e-30", "1e-9", "-1e-9", "1e-3", "0.1"),
    *("1", "-1", "+1", ".5", "5.", "1e0", "1E1", "00012", "3.14159265358979", "-7", "1000", "1e6"),
    *("1e9", "1e16", "1e30", "-1e30", "1e154", "1e155", "1e200", "1e300", "1.7976931348623157e308"),
    *("4294967296", "-2147483649", "9223372036854775808", "1e308", "-1e308", "0.30000000000000004"),
]
TEXTS = [
    *("", " ", "a", "x" * 300, "\u00e4\u00f6", "\u202eabc", "a\u0301", "\U0001f916", "[bold]x[/]"),
    *("$x^2$", "<b>x</b>", "../../etc/passwd", "/dev/null", "/", ".", "a/b", "con", "~", "~root"),
    *(
        "a b",
        "a,b",
        "a=1",
        "=",
        "a=",
        "=1",
        "%n",
        "{0}",
        "{}",
        "None",
        "self",
        "__class__",
        "world",
    ),
    *("universe", "root_joint", "-1", "--help", "-", "0", "nan", "\u2028", "\ufeff", "a\tb", "\\"),
]
#: Of which XML and terminals have some, and YAML others.
CONTROLS = ["\x01", "\x07", "\x1b[31m", "\x7f", "\x85", "\r", "\n", "\t", "\0"]


def number(rng: Random) -> str:
    """Return a hostile number: one of the list, or a small change of a usual one."""
    if rng.random() < 0.3:
        return repr(rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, 12))
    if rng.random() < 0.3:
        return repr(round(rng.uniform(-2, 2), rng.randint(0, 6)))
    return rng.choice(NUMBERS)


def text(rng: Random) -> str:
    """Return a hostile text."""
    chosen = rng.choice(TEXTS)
    return chosen + rng.choice(CONTROLS) if rng.random() < 0.2 else chosen


def misspelt(word: str, rng: Random) -> str:
    """Return a word with one slip of the keyboard; words of one letter get a second."""
    at = rng.randrange(len(word))
    slips = [word + "s", word[:at] + word[at] + word[at:], word + word[-1]]
    if len(word) > 3:
        slips.append(word[:at] + word[at + 1 :])
        slips.append(word[: at - 1] + word[at] + word[at - 1] + word[at + 1 :] if at else word[1:])
    return rng.choice([slip for slip in slips if slip != word])


def with_bytes_changed(content: bytes, rng: Random) -> bytes:
    """Return a content with bytes flipped, dropped, doubled or put in, or its end cut off."""
    changed = bytearray(content)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(changed) + 1)
        kind = rng.randrange(6)
        if kind == 0 and at < len(changed):
            changed[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del changed[at : at + rng.randint(1, 20)]
        elif kind == 2:
            changed[at:at] = changed[at : at + rng.randint(1, 200)]
        elif kind == 3:
            changed[at:at] = rng.choice(TEXTS + CONTROLS + NO_NUMBERS).encode()
        elif kind == 4:
            changed[at:at] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 4)))
        elif rng.random() < 0.2:
            del changed[at:]
    return bytes(changed)
