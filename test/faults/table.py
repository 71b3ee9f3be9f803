# SPDX-License-Identifier: MIT
"""The table of seeded faults: patches keyed by function, in the files *.faults of this folder.

    @@ FUNCTION | NAME | RULE | NOTICERS...
    -code of that function in the tree
    +code of that function with the fault

FUNCTION is a symbol of C (function, variable, table, macro) or of Python (function, Class.method), without its file: it is searched in the tree. Where
several files have that symbol and the same code, ` / WORD` after it chooses the file that has this word. The removed code must occur exactly once in it;
blanks and line ends between its tokens do not matter. Without a line of `+` the code is removed. A further `@@ FUNCTION` alone continues the fault with a
second patch in the same file. RULE is a rule of docs/developer/safety-case.md, or the name of a page in docs/user or docs/developer whose promise the fault
breaks. If FUNCTION is missing or no longer has the code, the patch applies where else the code occurs exactly once in the tree, and the fault is reported as
moved.

NOTICERS, each of which must notice the fault:
    unit, sim, orders        all unit tests of the core, the simulated hours, every order of events (at least two of the three)
    wp, wp:FUNCTION          the proof of that function (default: the function of the patch) fails
    eva                      Frama-C Eva raises an alarm
    fuzz:TARGET              the fuzz target finds it
    image:KIND.SCENARIO      a scenario of the emulated STM32F103 with the image KIND; BOARD/KIND for another board
    python:FILE              the tests of python/tests/FILE fail with a copy of the Python client
    anything else            a name of CTest, or a regular expression for one
"""

import ast
import collections
import functools
import re
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PLACES = ("core", "lib", "app", "port", "python/src")
CORE_MEANS = ("unit", "sim", "orders")
SYMBOLS = re.compile(
    r"^(?:__attribute__\(\(\w+\)\) )?[\w \*]*?\b(?P<function>\w+)\([^;{}]*\) \{$.*?^\}$|^#define (?P<macro>\w+)(?:[^\n]*\\\n)*[^\n]*$"
    r"|^static const struct \{[^{}]*\} (?P<table>\w+)\[.*?^\};$|^(?!typedef|return)[\w \*]+?\b(?P<object>\w+)(?:\[[^\]]*\])*(?: =[^;]*?)?;",
    re.M | re.S,
)


class Broken(Exception):
    """The fault cannot be applied or judged; the text has the reason."""


class Hunk(NamedTuple):
    function: str  # After a slash: a word of its file.
    was: str
    now: str


class Fault(NamedTuple):
    name: str
    rule: str
    by: tuple  # Noticers.
    hunks: list


class Applied(NamedTuple):
    file: str  # Relative to the tree.
    text: str  # Contents of the whole file, with the fault.
    moved: str  # Empty, or the missing function and the file that now has its code.


def code_pattern(code):
    """Matches these tokens with any blanks between them."""
    return re.compile(r"\s*".join(map(re.escape, re.findall(r"\w+|[^\w\s]", code))))


def symbols_of(path):
    """[(symbol, begin, end)] of a file."""
    text = path.read_text()
    if path.suffix != ".py":
        return [(match[match.lastgroup], *match.span()) for match in SYMBOLS.finditer(text)]
    starts, found = [0], []
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for outer in ast.walk(ast.parse(text)):
        prefix = f"{outer.name}." if isinstance(outer, ast.ClassDef) else ""
        for node in ast.iter_child_nodes(outer):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                found.append((prefix + node.name, starts[node.lineno - 1], starts[node.end_lineno]))
    return found


@functools.cache
def tree(root):
    """{symbol: [(path, begin, end)]} of the product."""
    found = collections.defaultdict(list)
    for path in sorted(path for place in PLACES for path in (root / place).rglob("*.*") if path.suffix in (".c", ".h", ".py")):
        for name, begin, end in symbols_of(path):
            found[name].append((path, begin, end))
    return dict(found)


def places(hunk, spans):
    """[(path, begin, end)] of the hunk's code within these spans."""
    pattern = code_pattern(hunk.was)
    return sorted({(path, *match.span()) for path, begin, end in spans for match in pattern.finditer(path.read_text(), begin, end)})


def locate(hunk, root=ROOT):
    """((path, begin, end), where it moved to, or "")."""
    function, _, word = hunk.function.partition(" / ")
    found = places(hunk, [span for span in tree(root).get(function, ()) if word in span[0].read_text()])
    if len(found) == 1:
        return found[0], ""
    moved = [] if found else places(hunk, [span for spans in tree(root).values() for span in spans if word in span[0].read_text()])
    if len(moved) != 1:
        raise Broken(f"{function} has the code {len(found)} times, not once" + ("" if found else f", and the tree {len(moved)} times") + f": {hunk.was}")
    return moved[0], f"{function} does not have the code; {moved[0][0].relative_to(root)} has it"


def apply(fault, root=ROOT):
    """The text of the file with the fault; raises Broken."""
    found = [(*locate(hunk, root), hunk.now) for hunk in fault.hunks]
    paths = {place[0] for place, _, _ in found}
    if len(paths) != 1:
        raise Broken(f"its patches are in {len(paths)} files")
    path = paths.pop()
    text = path.read_text()
    for (_, begin, end), _, now in sorted(found, reverse=True):
        text = text[:begin] + now + text[end:]
    return Applied(str(path.relative_to(root)), text, "; ".join(moved for _, moved, _ in found if moved))


def parse(text, name):
    """[Fault] of one file of the table."""
    faults = []
    for number, line in enumerate(text.splitlines(), 1):
        sign, rest = line[:1], line[1:]
        if line.startswith("@@ "):
            function, *fields = (field.strip() for field in line[3:].split(" | "))
            if fields:
                faults.append(Fault(fields[0], fields[1], tuple(fields[2].split()), []))
            faults[-1].hunks.append(Hunk(function, "", ""))
        elif sign in ("-", "+"):
            hunk = faults[-1].hunks[-1]
            old = hunk.was if sign == "-" else hunk.now
            joined = f"{old}\n{rest}" if old else rest
            faults[-1].hunks[-1] = hunk._replace(**{"was" if sign == "-" else "now": joined})
        elif line.strip() and sign != "#":
            raise Broken(f"{name}:{number}: neither @@, -, + nor #")
    return faults


@functools.cache
def load(folder=HERE):
    faults = [fault for path in sorted(folder.glob("*.faults")) for fault in parse(path.read_text(), path.name)]
    twice = [name for name, number in collections.Counter(fault.name for fault in faults).items() if number > 1]
    if twice:
        raise Broken(f"two faults have one name: {', '.join(twice)}")
    return faults


def by(means):
    """[(fault, the text after the colon of that noticer)] of the faults that this kind of noticer must notice."""
    return [(fault, noticer.partition(":")[2]) for fault in load() for noticer in fault.by if noticer.partition(":")[0] == means]


def named(name):
    return next(fault for fault in load() if fault.name == name)
