# SPDX-License-Identifier: MIT
"""Judges one mutant: which test kills it, or which compiler proves that it is equivalent."""

import collections
import hashlib
import re
import subprocess
import threading
from typing import NamedTuple

from core_build import CORE, INCLUDE, ROOT, SLOW
from mutants import files, functions

KILLED, ENDLESS, SAME, LIVES, INVALID = "killed", "does not end", "same code", "lives", "does not compile"
# A compiler that makes the same object code of the mutant and of the core proves that both are the same program.
COMPILERS = (("gcc", "-O2"), ("gcc", "-O3"), ("gcc", "-Os"), ("clang", "-O2"))
SMALL = "-Os"  # This level omits parts of functions in headers (__OPTIMIZE_SIZE__), so it proves nothing about headers.
PROBE = "probe.c"
WHOLE_CORE = (("orders", "test_orders", lambda judges, core: judges.orders(core)), ("simulation", "test_sim", lambda judges, core: judges.sim(core, 1)))


class Verdict(NamedTuple):
    kind: str
    program: str = ""  # The test program that kills it.
    test: str = ""  # The failed test of that program; empty if the program crashed.


def digest(text):
    return hashlib.sha256(text.encode()).hexdigest()[:12]


INCLUDED = re.compile(r'^#include "([^"]+)"', re.M)


def implemented():
    """{header: the core's files that include it first, so the sources that implement it}"""
    found = collections.defaultdict(list)
    for path in sorted(CORE.glob("*.c")):
        header = INCLUDED.search(path.read_text())[1]
        found[CORE / header if (CORE / header).exists() else ROOT / "core/include" / header].append(path)
    return found


def reach(sources):
    """The core's files that these can call: those whose headers they include, recursively."""
    todo, seen, behind = list(sources), set(), implemented()
    while todo:
        path = todo.pop()
        if path not in seen and path.exists():
            seen.add(path)
            folders = [path.parent, CORE, *(ROOT / folder for folder in ("core/include", "app/sim/model/include", "test/sim", "test/support"))]
            todo += [folder / name for name in INCLUDED.findall(path.read_text()) for folder in folders]
            todo += behind[path]
    return {path.name for path in seen.intersection(files())}


class Judge:
    """Judges mutants and learns which test kills the mutants of which file."""

    def __init__(self, judges):
        self.judges, self.kills, self.lock = judges, collections.defaultdict(collections.Counter), threading.Lock()
        self.paths = {path.name: path for path in files()}
        self.sources = {name: path.read_text() for name, path in self.paths.items()}
        self.reach = {name: reach(sources) for name, sources in judges.programs.items()}
        self.optimised = {}

    def clean(self):
        """The failures of the judges with the unchanged core; with any of these the judges prove nothing."""
        found = self.judges.failing(self.judges.clean, sorted(self.judges.tests))
        wrong = [found[1] or f"unit_{found[0]} {found[2].how}"] if found else []
        return wrong + [output for _, _, kills in WHOLE_CORE if (output := kills(self.judges, self.judges.clean))]

    def order(self, mutant):
        """The order of the unit tests: programs that killed most mutants of the function first, those that sweep every value last."""
        kills, stem = self.kills[mutant.file, mutant.function], mutant.file.rpartition(".")[0]
        found = sorted(
            (name for name in self.judges.tests if mutant.file in self.reach[f"unit_{name}"]), key=lambda name: (-kills[name], stem not in name, name)
        )
        return [name for name in found if name not in SLOW], [name for name in found if name in SLOW]

    def objects_of(self, folder, file):
        """The object code of each optimising compiler; for a header, of each of its functions separately."""
        compilers = COMPILERS
        if file.endswith(".h"):
            compilers = [row for row in COMPILERS if SMALL not in row]
            names = ", ".join(f"(void (*)(void)){name}" for name in functions(self.paths[file]))
            (folder / PROBE).write_text(f'#include "{file}"\nvoid (*const probes[])(void) = {{{names}}};\n')
            file = PROBE
        for at, (compiler, level) in enumerate(compilers):
            out = folder / f"optimised{at}.o"
            subprocess.run([compiler, "-std=c99", "-ffreestanding", level, "-w", *INCLUDE, "-c", file, "-o", out.name], check=True, cwd=folder)
            yield subprocess.run(["objdump", "-s", "-r", out.name], capture_output=True, check=True, cwd=folder).stdout

    def same_code(self, folder, file):
        with self.lock:
            if file not in self.optimised:
                clean = self.judges.work / "clean_text" / file
                clean.mkdir(parents=True, exist_ok=True)
                (clean / file).write_text(self.sources[file])
                self.optimised[file] = list(self.objects_of(clean, file))
        return any(changed == clean for changed, clean in zip(self.objects_of(folder, file), self.optimised[file], strict=True))

    def killed(self, core, mutant, names):
        found = self.judges.failing(core, names)
        if not found:
            return None
        program, test, run = found
        with self.lock:
            self.kills[mutant.file, mutant.function][program] += 1
        return Verdict(ENDLESS if run.endless else KILLED, program, test or "")

    def changed_source(self, mutant):
        """The folder of the file with only this mutant."""
        folder = self.judges.work / "alone" / digest(f"{mutant.file}{mutant.begin}{mutant.text}{mutant.end}")
        folder.mkdir(parents=True)
        (folder / mutant.file).write_text(mutant.apply(self.sources[mutant.file]))
        return folder

    def judge(self, mutant, core):
        """Judges the mutant in `core`; `core` is None if the mutant does not compile."""
        if core is None:
            return Verdict(INVALID)
        quick, slow = self.order(mutant)
        verdict = self.killed(core, mutant, quick)
        if verdict is None and self.same_code(self.changed_source(mutant), mutant.file):
            verdict = Verdict(SAME)
        verdict = verdict or self.killed(core, mutant, slow)
        if verdict:
            return verdict
        return next(
            (Verdict(KILLED, means) for means, program, kills in WHOLE_CORE if mutant.file in self.reach[program] and kills(self.judges, core)), Verdict(LIVES)
        )
