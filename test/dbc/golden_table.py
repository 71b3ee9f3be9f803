#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Prints the golden vectors of test/support/golden_vectors.h as the table of docs/developer/protocol.md.

golden_table.py --check    exit 1 if the document's table is not that of the header
golden_table.py --update   rewrite the document's table
"""

import pathlib
import re
import sys
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]
HEADER = ROOT / "test/support/golden_vectors.h"
DOCUMENT = ROOT / "docs/developer/protocol.md"
BEGIN = "<!-- golden vectors: begin (test/dbc/golden_table.py --update) -->\n"
END = "<!-- golden vectors: end -->\n"

ROW = re.compile(
    r'\{"([^"]+)",\s*\{\.id = (\d+)U, \.dlc = (\d+)U, \.data = \{([^}]*)\}\},\s*'
    r"\{IW_CODEC_(\w+), IW_(\w+), \{\.\w+ = \{([^}]*)\}\}\}\}"
)


class Vector(NamedTuple):
    """One row: `values` are (name of the field in the C struct, value), in the order of the frame's bytes."""

    name: str
    can_id: int
    data: bytes
    values: list


def read_vectors():
    """All rows of the header. Raises ValueError if a row is not in the form that ROW reads."""
    text = HEADER.read_text(encoding="utf-8")
    vectors = []
    for name, can_id, dlc, data, _kind, _side, fields in ROW.findall(text):
        octets = bytes(int(octet, 16) for octet in data.split(","))
        if len(octets) != int(dlc):
            raise ValueError(f"{HEADER.name}: '{name}' has length {dlc} and {len(octets)} bytes")
        values = []
        for field in fields.split(", "):
            key, value = field.split(" = ")
            values.append((key[1:], -(2**31) if value == "INT32_MIN" else int(value)))
        vectors.append(Vector(name, int(can_id), octets, values))
    rows = text.count("{IW_CODEC_")
    if len(vectors) != rows:
        raise ValueError(f"{HEADER.name}: {rows} rows, but only {len(vectors)} in the form that golden_table.py reads")
    return vectors


def table():
    lines = ["| what | id | bytes | values |", "|---|---|---|---|"]
    for vector in read_vectors():
        values = " · ".join(f"{key} {value}" for key, value in vector.values)
        lines.append(f"| {vector.name} | {vector.can_id} (0x{vector.can_id:03X}) | `{vector.data.hex(' ').upper()}` | {values} |")
    return "\n".join(lines) + "\n"


def split_document():
    text = DOCUMENT.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise ValueError(f"{DOCUMENT.name}: the lines that enclose the golden table are missing; restore\n{BEGIN}{END}")
    head, rest = text.split(BEGIN)
    old, tail = rest.split(END)
    return head, old, tail


def is_current():
    return split_document()[1] == table()


def main():
    if sys.argv[1:] == ["--update"]:
        head, _old, tail = split_document()
        DOCUMENT.write_text(head + BEGIN + table() + END + tail, encoding="utf-8")
    elif sys.argv[1:] == ["--check"]:
        if not is_current():
            sys.exit("docs/developer/protocol.md: the golden table is not that of golden_vectors.h; run test/dbc/golden_table.py --update")
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
