# SPDX-License-Identifier: MIT
"""What is known of the core's mutants: kept in campaign.json, told in docs/mutation.md.

A verdict holds as long as the function is what it was (its text without comments, and what it uses of its file) and the
test that saw the mutant is what it was. So a change of either brings up the mutants that must be judged anew, and no others.
"""
import collections
import json
import re
from pathlib import Path

from core_build import ROOT
from judging import ENDLESS, INVALID, KILLED, LIVES, SAME, WHOLE_CORE, Verdict, digest
from mutants import files as core_files
from mutants import functions, mutants

HERE = Path(__file__).resolve().parent
CAMPAIGN, EQUIVALENT, PAGE = HERE / "campaign.json", HERE / "equivalent.txt", ROOT / "docs/mutation.md"
SIGNS = {SAME: "=", LIVES: "!", INVALID: "-"}
UNKNOWN = "?"
# That part of the page is written by `around`.
AROUND_TITLE = "\n## Around the core\n"
MEANS = [means for means, _, _ in WHOLE_CORE]


def read_reasons(path):
    """{key: reason} of a list of what no test can see."""
    lines = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return {key.strip(): reason.strip() for key, _, reason in (line.rpartition(" | ") for line in lines)}


def settle(named, mutants):
    """Of a list of what no test can see, the entries whose file or function has another name now follow it, if their lines occur once."""
    by_lines = collections.defaultdict(list)
    for key in mutants:
        by_lines[key.split(" | ", 2)[2]].append(key)
    for key in [key for key in named if key not in mutants]:
        found = by_lines[key.split(" | ", 2)[2]]
        if len(found) == 1 and found[0] not in named:
            named[found[0]] = named.pop(key)


def plain(text):
    """Without comments and layout."""
    return " ".join(re.sub(r"//.*?$|/\*.*?\*/", "", text, flags=re.M | re.S).split())


def file_scope(source):
    """{name: text} of a file's own macros and tables."""
    found = {match[1]: match[0] for match in re.finditer(r"^#define (\w+)(?:.*\\\n)*.*$", source, re.M)}
    return found | {match[1]: match[0] for match in re.finditer(r"^static const [^;=(]*?\b(\w+)[^;=(]* = .*?;$", source, re.M | re.S)}


def essences(path):
    """{function: digest of what it does}"""
    around, found = file_scope(path.read_text()), {}
    for name, text in functions(path).items():
        parts, todo = {}, [text]
        while todo:
            for word in re.findall(r"\w+", todo.pop()):
                if word in around and word not in parts:
                    parts[word] = around[word]
                    todo.append(around[word])
        found[name] = digest(plain(text + "".join(part for _, part in sorted(parts.items()))))
    return found


def keyed(path):
    """{key: mutant}: named without line numbers; of mutants that look the same, the second is (2)."""
    source, seen, found = path.read_text(), collections.Counter(), {}
    for mutant in mutants(path):
        key = mutant.key(source)
        seen[key] += 1
        found[key if seen[key] == 1 else f"{key} ({seen[key]})"] = mutant
    return found


class Tests:
    """What the unit tests say, as far as it decides whether a verdict still holds."""

    def __init__(self, programs):
        self.programs, self.texts = programs, {}
        for program, sources in programs.items():
            self.texts[program] = {name: text for path in sources for name, text in functions(path).items()}
            self.texts[program][""] = "".join(path.read_text() for path in sources if path.name.startswith("test_"))

    def digest(self, program, test):
        if program not in self.programs:
            return "" # All of the core runs there; whoever weakens that is met by the sample.
        text = self.texts[program].get(test)
        return text and digest(plain(text))


class Record:
    """The core's mutants by their keys, and the verdicts on them that hold."""

    def __init__(self, programs, files, named):
        self.named = named
        self.tests, self.mutants, self.verdicts, self.before, self.texts = Tests(programs), {}, {}, {}, {}
        stored = json.loads(CAMPAIGN.read_text()) if CAMPAIGN.exists() else {}
        self.compilers = stored.get("compilers", [])
        for path in core_files():
            found = keyed(path)
            self.texts.update({(path.name, name): text for name, text in essences(path).items()})
            self.mutants.update(found)
        settle(named, self.mutants)
        self.files = files or sorted({mutant.file for mutant in self.mutants.values()})
        self.load(stored)

    def by_function(self):
        found = collections.defaultdict(list)
        for key, mutant in self.mutants.items():
            found[mutant.file, mutant.function].append(key)
        return found

    def load(self, stored):
        tests = stored.get("tests", [])
        for (file, name), keys in self.by_function().items():
            entry = stored.get("functions", {}).get(f"{file}:{name}", {})
            words = entry.get("seen", "").split()
            if entry.get("text") != self.texts[file, name] or len(words) != len(keys):
                continue
            for key, word in zip(keys, words, strict=True):
                if word != UNKNOWN:
                    self.before[key], holds = self.read(word, tests)
                    if holds and (self.before[key].kind != LIVES or key in self.named):
                        self.verdicts[key] = self.before[key]

    def read(self, word, tests):
        """(the verdict that the word stands for, whether it still holds)"""
        for kind, sign in SIGNS.items():
            if word == sign:
                return Verdict(kind), True
        program, test, text = tests[int(word.strip("~"))]
        return Verdict(ENDLESS if word.endswith("~") else KILLED, program, test), text == self.tests.digest(program, test)

    def save(self, compilers):
        tests = sorted({(verdict.program, verdict.test) for verdict in self.verdicts.values() if verdict.program})
        rows = []
        for (file, name), keys in self.by_function().items():
            if any(key in self.verdicts for key in keys):
                words = " ".join(self.word(self.verdicts.get(key), tests) for key in keys)
                rows.append(f'  "{file}:{name}": {json.dumps({"text": self.texts[file, name], "seen": words})}')
        told = ",\n".join("  " + json.dumps([program, test, self.tests.digest(program, test)]) for program, test in tests)
        CAMPAIGN.write_text(f'{{\n "compilers": {json.dumps(compilers)},\n "tests": [\n{told}\n ],\n "functions": {{\n' + ",\n".join(rows) + "\n }\n}\n")

    @staticmethod
    def word(verdict, tests):
        if verdict is None:
            return UNKNOWN
        if not verdict.program:
            return SIGNS[verdict.kind]
        return f"{tests.index((verdict.program, verdict.test))}{'~' if verdict.kind == ENDLESS else ''}"

    def place_for_a_test(self, key):
        """The file of the unit tests that see most of the function's other mutants."""
        mutant = self.mutants[key]
        for where in (lambda other: (other.file, other.function) == (mutant.file, mutant.function), lambda other: other.file == mutant.file):
            programs = collections.Counter(verdict.program for other, verdict in self.verdicts.items()
                                           if where(self.mutants[other]) and verdict.program in self.tests.programs)
            if programs:
                return f"test/unit/test_{programs.most_common(1)[0][0]}.c"
        return "test/unit"


def cell(verdict, named):
    """The column of the page's table."""
    if verdict.kind == KILLED:
        return verdict.program if verdict.program in MEANS else "unit tests"
    return {ENDLESS: "endless", SAME: "same code", INVALID: None, LIVES: "equivalent" if named else "alive"}[verdict.kind]


HEAD = """# Mutants of the core

Written by `test/mutation/run --full --update`. Each operator, constant, condition, call, returned value and statement of the core is changed, one at
a time, and somebody must see it: a unit test (of those that need only the core), else every order of three events, else an hour of simulation. What an
optimising compiler (gcc -O2, -O3, -Os, clang -O2) makes the same object of is the same program: there is nothing to see. A mutant counts as *endless* if a
test that ends with the core as it is uses more than ten times its processor time and three seconds more.

`./check mutation` judges every mutant of a function that has changed since, or that was seen by a test that has changed since, and a sample of 130 of the others, each
day another; it fails if one lives that [equivalent.txt](../test/mutation/equivalent.txt) does not name. Functions that stand in headers (reading and writing of frames) are
changed in whoever includes them, in the tests too; of these gcc -Os, which leaves parts of them out, proves nothing.
"""
COLUMNS = ["unit tests", *MEANS, "endless", "same code", "equivalent", "alive"]


def table(title, rows):
    lines = [f"| {title} | mutants | {' | '.join(COLUMNS)} |", "|---|" + "---:|" * (len(COLUMNS) + 1)]
    for name, row in [*sorted(rows.items()), ("**all**", sum(rows.values(), collections.Counter()))]:
        lines.append(f"| {name} | {sum(row.values())} | {' | '.join(str(row[column]) for column in COLUMNS)} |")
    return [*lines, ""]


def write_page(record, named):
    files, kinds, reasons, alive = collections.defaultdict(collections.Counter), collections.defaultdict(collections.Counter), collections.defaultdict(list), []
    for key, verdict in record.verdicts.items():
        column = cell(verdict, key in named)
        if column:
            files[record.mutants[key].file][column] += 1
            kinds[record.mutants[key].kind][column] += 1
        if column == "equivalent":
            reasons[named[key]].append(key)
        elif column == "alive":
            alive.append(key)
    missing = sorted({mutant.function for key, mutant in record.mutants.items() if key not in record.verdicts})
    lines = [HEAD, *table("file", files), *table("what is changed", kinds)]
    lines += [f"Not judged yet: {', '.join(missing)}", ""] if missing else []
    lines += ["## Equivalent, and why", ""]
    for reason, keys in sorted(reasons.items()):
        lines += [f"- {reason}", *(f"  - `{' | '.join(key.split(' | ')[:2])}`: `{key.split(' | ', 3)[-1]}`" for key in sorted(keys))]
    if alive:
        lines += ["", "## Alive", "", *(f"- `{key}`" for key in sorted(alive))]
    _, title, around = PAGE.read_text().partition(AROUND_TITLE)
    PAGE.write_text("\n".join(lines) + "\n" + title + around)
