#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Fails unless each switched-off check of the static analysis has a number and a reason in docs/developer/static.md, and each number is needed.

usage: deviations.py [ROOT]

Reads .clang-tidy, ruff.toml and .cppcheck-suppressions, the options of the compilers, and the comments by which code silences a tool. cppcheck itself reports
entries of .cppcheck-suppressions that it does not need.
The last line is "N passed, N failed, N skipped". No tool does it: each tool knows its own comments (clang-tidy, `ruff --select RUF100`), none the page.
"""

import fnmatch
import os
import re
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PAGE = "docs/developer/static.md"
# The silenced tool, and the form of the comment or option. The group matches the switched-off checks, separated by commas.
SILENCERS = [
    ("compilers", r"(-Wno-[\w-]+|-fno-analyzer|no_sanitize\w*)"),
    ("compilers", r"[\"' ](-w)[\"' ]"),
    ("compilers", r"(IWHEEL_WERROR)\W+OFF"),
    ("compilers", r"#\s*pragma (?:GCC|clang) diagnostic \w+ \"(-W[\w-]+)\""),
    ("clang-tidy", r"NOLINT\w*\(([^)]*)\)"),
    ("clang-tidy", r"(NOLINT\w*)(?!\w*\()"),
    ("clang-format", r"clang-format (off)"),
    ("cppcheck", r"cppcheck-suppress(?!ions)[\w-]*[\s\[(]*(\w*)"),
    ("coverage", r"((?:GCOVR?|LCOV)_EXCL\w*)"),
    ("shellcheck", r"shellcheck disable=([\w,]+)"),
    ("ruff", r"# noqa: ?([\w,]+)"),
    ("ruff", r"# (?:ruff: )?(noqa)(?!: ?[A-Z])"),
    ("mypy", r"# type: (ignore[\w\[\],-]*)"),
]
# Files that contain only a list of switched-off checks: tool, and the form of a line with the check and, if it has one, the place.
LISTS = {
    ".clang-tidy": ("clang-tidy", r"^\s+-([a-z][\w.*-]+),?()"),
    "ruff.toml": ("ruff", r'^ +"([A-Z]+\d+)"()'),
    ".cppcheck-suppressions": ("cppcheck", r"^([^#:\n]+):?(.*)$"),
}
# Folders and files that are not searched: build results, and files that contain these words as data.
ELSEWHERE = {"build", ".git", ".venv", "__pycache__"}
THEMSELVES = {"scripts/deviations.py", "test/gates/test_seeded_faults.py"}
WORDS = {".md", ".scd", ".svg", ".json.gz"}


class Row(NamedTuple):
    number: str
    tool: str
    what: str
    where: str
    reason: str

    def covers(self, tool, what, file):
        return (self.tool, self.what) == (tool, what) and any(fnmatch.fnmatch(file, part) for part in self.where.split())


def rows_of(page):
    """Returns the table of deviations. An incomplete line ends the program."""
    found = []
    for line in Path(page).read_text().splitlines():
        if re.match(r"\| *D\d", line):
            fields = [field.strip() for field in line.strip().strip("|").split("|")]
            if len(fields) != len(Row._fields) or not all(fields):
                sys.exit(f'failed: {page}: not "| number | tool | what | where | reason |": {line}')
            found.append(Row(*(field.strip("`") for field in fields)))
    return found


def files_of(root):
    """Returns (name, text) of all files that may switch off a check of a tool."""
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if name not in ELSEWHERE)
        for name in sorted(names):
            path = Path(folder) / name
            file = str(path.relative_to(root))
            if path.suffix not in WORDS and file not in THEMSELVES and path.stat().st_size < 1 << 20:
                yield file, path.read_text(errors="replace")


def silenced(root):
    """Returns (tool, check, file, line) of all switched-off checks."""
    for file, text in files_of(root):
        if Path(file).name in LISTS:
            tool, pattern = LISTS[Path(file).name]
            yield from ((tool, what, where or file, number) for number, line in enumerate(text.splitlines(), 1) for what, where in re.findall(pattern, line))
            continue
        for tool, pattern in SILENCERS:
            for found in re.finditer(pattern, text):
                yield from ((tool, what.strip(), file, text.count("\n", 0, found.start()) + 1) for what in found[1].split(","))


def findings(root):
    rows = rows_of(root / PAGE)
    used = set()
    for tool, what, file, line in silenced(root):
        row = next((row for row in rows if row.covers(tool, what, file)), None)
        if row:
            used.add(row.number)
        else:
            yield f"{file}:{line}: {tool}: {what} is switched off there, without a number in {PAGE}"
    for before, row in zip([None, *rows], rows, strict=False):
        if before and int(row.number[1:]) <= int(before.number[1:]):
            yield f"{row.number} is after {before.number}: numbers increase, and none is used twice"
        if row.number not in used:
            yield f"{row.number} ({row.tool}: {row.what}): no longer needed: delete the row, and do not use its number again"


def main(arguments):
    if "--help" in arguments:
        print(__doc__)
        return 0
    root = Path(arguments[1]).resolve() if len(arguments) > 1 else ROOT
    found = list(findings(root))
    print(*(f"failed: {finding}" for finding in found), sep="\n", end="\n" if found else "")
    passed = len(rows_of(root / PAGE)) if not found else 0
    print(f"{passed} passed, {len(found)} failed, 0 skipped")
    return 1 if found or not passed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
