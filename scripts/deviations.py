#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Has everything that is switched off of the static analysis its number and its reason in docs/developer/static.md, and is each still needed?

usage: deviations.py [ROOT]

Looks at .clang-tidy, ruff.toml and .cppcheck-suppressions, at what compilers are told, and at the comments by which code silences a tool. Whether cppcheck still needs what
.cppcheck-suppressions accepts, cppcheck tells itself.
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
# The tool that is silenced, and how: the groups are what of it, several parted by commas.
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
# Files that are nothing but a list of what is switched off: tool, and a line of it: what, and where if it says so.
LISTS = {
    ".clang-tidy": ("clang-tidy", r"^\s+-([a-z][\w.*-]+),?()"),
    "ruff.toml": ("ruff", r'^ +"([A-Z]+\d+)"()'),
    ".cppcheck-suppressions": ("cppcheck", r"^([^#:\n]+):?(.*)$"),
}
# Where nothing is looked for: what is built, and where these words stand for themselves.
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
    """The table of deviations; a line of it that is not complete ends the program."""
    found = []
    for line in Path(page).read_text().splitlines():
        if re.match(r"\| *D\d", line):
            fields = [field.strip() for field in line.strip().strip("|").split("|")]
            if len(fields) != len(Row._fields) or not all(fields):
                sys.exit(f'failed: {page}: not "| number | tool | what | where | reason |": {line}')
            found.append(Row(*(field.strip("`") for field in fields)))
    return found


def files_of(root):
    """(name, text) of whatever may silence a tool."""
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if name not in ELSEWHERE)
        for name in sorted(names):
            path = Path(folder) / name
            file = str(path.relative_to(root))
            if path.suffix not in WORDS and file not in THEMSELVES and path.stat().st_size < 1 << 20:
                yield file, path.read_text(errors="replace")


def silenced(root):
    """(tool, what, file, line) of everything that is switched off."""
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
            yield f"{row.number} stands behind {before.number}: numbers rise, and none is given twice"
        if row.number not in used:
            yield f"{row.number} ({row.tool}: {row.what}): nothing needs it any more: delete the row, and give its number to nobody"


def main(arguments):
    root = Path(arguments[1]).resolve() if len(arguments) > 1 else ROOT
    found = list(findings(root))
    print(*(f"failed: {finding}" for finding in found), sep="\n", end="\n" if found else "")
    passed = len(rows_of(root / PAGE)) if not found else 0
    print(f"{passed} passed, {len(found)} failed, 0 skipped")
    return 1 if found or not passed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
