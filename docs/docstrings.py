"""Sphinx extension for the docstrings: indented blocks are formulas, bars absolute values."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from pydantic import BaseModel
from sphinx import addnodes
from sphinx.application import Sphinx

from rps_pin.rps.parameters import RPSParameters


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the steps before napoleon parses a docstring (priority 500), and after."""
    app.connect("autodoc-process-docstring", default_of_field, priority=300)
    app.connect("autodoc-process-docstring", formulas, priority=400)
    app.connect("autodoc-process-docstring", whole_sentences, priority=600)
    app.connect("autodoc-process-docstring", several_names, priority=600)
    app.connect("autodoc-process-signature", short_signature)
    app.connect("doctree-read", exact_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def default_of_field(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Add the default of a robot's parameter to its docstring."""
    owner, _, field = name.rpartition(".")
    info = RPSParameters.model_fields.get(field)
    if owner.endswith(RPSParameters.__name__) and info and not info.is_required():
        lines[:] = [f"{' '.join(lines).strip()}; {info.default} if left out", ""]


def short_signature(
    app: Sphinx,
    what: str,
    name: str,
    obj: Any,
    options: object,
    signature: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Shorten the signature of a pydantic model, and print type aliases by name."""
    if what == "class" and issubclass(obj, BaseModel):
        return "(**fields)", None
    alias = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")  # how autodoc prints one inside a tuple
    plain = [text and alias.sub(r"\1", text) for text in (signature, returned)]
    return plain[0], plain[1]


def formulas(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Make indented blocks literal, and escape bars."""
    kept: list[str] = []
    block = -1  # how far the block is indented; -1 outside of one
    text = 0  # how far the last line of text was
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if line.strip():
            if indent < block:
                block = -1
            if block < 0 and kept and not kept[-1].strip() and indent >= text + 4:
                kept += [" " * text + "::", ""]
                block = indent
            if block < 0:
                text = indent
        kept.append(line if block >= 0 else line.replace("|", r"\|"))
    lines[:] = kept


def whole_sentences(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Restore an attribute's text "Name: text", which napoleon parses as a type."""
    kinds = [number for number, line in enumerate(lines) if line.startswith(":type: ")]
    if what in ("attribute", "property", "data") and kinds:
        which = lines[kinds[0]].removeprefix(":type: ")
        lines[:] = [f"{which}: {lines[0]}", *lines[1 : kinds[0]]]


def several_names(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Keep attributes that share a description in one field.

    Sphinx takes all but the last of the words "a, b, c" for a type; a zero-width space is no blank.
    """
    for number, line in enumerate(lines):
        field = re.match(r":(ivar|vartype) (\w+(?:, \w+)+):", line)
        if field:
            lines[number] = line.replace(
                field[2], field[2].replace(", ", ",\N{ZERO WIDTH SPACE}"), 1
            )


def exact_names(app: Sphinx, doctree: nodes.document) -> None:
    """Resolve names in fields exactly, not as suffixes of other names; call attributes so."""
    for reference in doctree.findall(addnodes.pending_xref):
        reference.attributes.pop("refspecific", None)
    for field in doctree.findall(nodes.field_name):
        if field.astext() == "Variables":
            field[:] = [nodes.Text("Attributes")]
