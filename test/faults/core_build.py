# SPDX-License-Identifier: MIT
"""Copies of the core with one change each, and their judges: the unit tests, the simulation, all orders of events.

The core is a shared library here, so a change costs the compilation of one file: the judges are linked once and find the
changed library through LD_LIBRARY_PATH. The tree itself never changes.
"""

import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "test/support"))
from core_tests import core_tests

CORE = ROOT / "core/src"
INCLUDE = [f"-I{ROOT / path}" for path in ("core/include", "core/src", "app/sim/model/include", "test/sim", "test/support")]
WHICH = "which.c"
# Limit of a judge's processor time: TIMES its time with the unchanged core, plus MORE_S. A busy machine adds far less, so a judge
# that exceeds the limit is in an endless loop. Its children may use CHILD_S more.
TIMES, MORE_S, CHILD_S, UNMEASURED_S = 10, 1, 3, 600
WAIT_S = 3600  # Wall-clock limit: a program that waits forever uses no processor time.
OUTPUT_MAX = 64 << 20
GCC = ["ccache", "gcc"] if shutil.which("ccache") else ["gcc"]
# A change that reads or writes beyond an array ends the program.
BOUNDS = ("-fsanitize=bounds-strict,shift,signed-integer-overflow", "-fsanitize-undefined-trap-on-error")
# Uninitialised variables have the same value in every run.
PATTERN = ("-ftrivial-auto-var-init=pattern",)
# These signals are caused by the change under test; any other signal comes from outside and proves nothing.
CRASHES = {signal.SIGILL, signal.SIGTRAP, signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGABRT, signal.SIGPIPE}
NUMBER = "IWHEEL_MUTANT"
# The first failed test ends its program. The unit test of the board sends a million hostile lines for seconds, which `unit` judges: a smaller
# number must be enough to detect a change.
QUICKER = {"IWHEEL_FIRST_FAILURE": "1", "IWHEEL_HOSTILE_LINES": "60000"}
ENDLESS = {signal.SIGPROF, signal.SIGXCPU, signal.SIGXFSZ, signal.SIGALRM}
# Unit tests that sweep every value run last: most changes fail an earlier one.
SLOW = ("confirmation", "gateway_core_walk", "bit_timing", "codec_sweep", "envelope_scheduler")


class Run(NamedTuple):
    """How a judge ended."""

    status: int
    output: str
    cpu_s: float

    @property
    def endless(self):
        return -self.status in ENDLESS

    @property
    def how(self):
        """How it ended, without its output."""
        if self.endless:
            return "does not end"
        return f"ends by {signal.Signals(-self.status).name}" if self.status < 0 else f"ends with status {self.status}"


class Core(NamedTuple):
    """A changed core: the folder of its library, and the number of the enabled change in it (test/mutation/schemata.py)."""

    folder: Path
    number: int = 0
    has_judges: bool = False  # Its headers are changed, so judges that include them are built for it, into its folder.


def play(command, core, limit_s):
    """Runs a program with that core. Raises if another process ended it."""

    def limit():
        whole_s = math.ceil(limit_s) + CHILD_S
        resource.setrlimit(resource.RLIMIT_CPU, (whole_s, whole_s + 5))
        signal.setitimer(signal.ITIMER_PROF, limit_s)  # exec preserves it, fork does not: the limit above is for children.
        resource.setrlimit(resource.RLIMIT_FSIZE, (OUTPUT_MAX, OUTPUT_MAX))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.alarm(WAIT_S)  # exec preserves the alarm.

    with tempfile.TemporaryFile() as output:
        child = subprocess.Popen(
            [str(word) for word in command],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.DEVNULL,
            cwd=core.folder,
            env={**os.environ, "LD_LIBRARY_PATH": str(core.folder), NUMBER: str(core.number), **QUICKER},
            preexec_fn=limit,
        )
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        run = Run(child.returncode, output.read().decode(errors="replace"), usage.ru_utime + usage.ru_stime)
    if run.status < 0 and -run.status not in CRASHES | ENDLESS:
        raise RuntimeError(f"{command[0]} was ended by another process: {run.how}")
    return run


def limit_s(unchanged):
    """The limit in seconds of processor time, from the run with the unchanged core."""
    return TIMES * unchanged.cpu_s + MORE_S


def compile_file(source, out, *flags, gcc=("gcc",), include=tuple(INCLUDE)):
    """None, or the compiler's output."""
    done = subprocess.run([*gcc, "-std=gnu11", "-w", *flags, *include, "-c", source, "-o", out], capture_output=True, text=True, check=False)
    return None if done.returncode == 0 else done.stderr


class Judges:
    """The judges, built in `work`, and the unchanged core next to them."""

    def __init__(self, work, unity, jobs):
        self.work, self.jobs = Path(work), jobs
        self.clean = Core(self.work / "clean")
        self.clean.folder.mkdir(parents=True, exist_ok=True)
        self.unity, self.objects, self.as_it_is, self.lock = unity, {}, {}, threading.Lock()
        self.tests = core_tests()
        sim = sorted((ROOT / "test/sim").glob("*.c"))
        programs = {f"unit_{name}": [*map(Path, sources), Path(unity) / "unity.c"] for name, sources in self.tests.items()}
        programs["test_sim"] = [*(path for path in sim if path.name != "hashes.c"), *sorted((ROOT / "app/sim/model/src").glob("*.c"))]
        programs["test_orders"] = [*sorted((ROOT / "test/orders").glob("*.c")), *(path for path in sim if path.name.startswith("oracle"))]
        self.programs = programs
        others = sorted({path for sources in programs.values() for path in sources})
        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(self.compile_core, sorted(CORE.glob("*.c"))))
            objects = dict(zip(others, pool.map(self.compile_other, others), strict=True))
            self.link(self.clean.folder, {})
            list(pool.map(lambda name: self.build(name, [objects[path] for path in programs[name]]), programs))

    def compile_core(self, source):
        self.objects[source.name] = self.clean.folder / (source.stem + ".o")
        output = compile_file(source, self.objects[source.name], "-O1", "-fPIC", gcc=GCC)
        if output:
            raise RuntimeError(output)

    def compile_other(self, source, folder=None, flags=("-O2",), include=tuple(INCLUDE)):
        out = (folder or self.work) / f"{source.parent.name}_{source.stem}.o"
        output = compile_file(source, out, *flags, *PATTERN, f"-I{self.unity}", "-DUNITY_SUPPORT_64", gcc=GCC, include=include)
        if output:
            raise RuntimeError(output)
        return out

    def build(self, name, objects, folder=None):
        """Links the judge of that name: in `folder` with the library there, otherwise with the unchanged core."""
        subprocess.run(["gcc", *objects, f"-L{folder or self.clean.folder}", "-liwheel", "-o", (folder or self.work) / name], check=True)

    def link(self, folder, replaced):
        objects = sorted((self.objects | replaced).values())
        subprocess.run(["ld", "-shared", *objects, "-o", folder / "libiwheel.so"], check=True)

    def change(self, name, file, text):
        """(a core in which `file` has that text, None), or (None, the compiler's output)."""
        folder = self.work / "changed" / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        (folder / file).write_text(text)
        output = compile_file(folder / file, folder / "changed.o", "-O0", "-fPIC", *BOUNDS, *PATTERN)
        if output and "error:" not in output:
            raise RuntimeError(output)
        if output:
            return None, output
        self.link(folder, {file: folder / "changed.o"})
        return Core(folder), None

    def change_headers(self, name, texts, which):
        """As `change`, but for headers of the core, {path: text}; `which` is an additional source of the library."""
        folder = self.work / "changed" / name
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(ROOT / "core", folder / "core")
        for path, text in texts.items():
            (folder / path.relative_to(ROOT)).write_text(text)
        (folder / WHICH).write_text(which)
        (folder / "all.c").write_text("".join(f'#include "{path.name}"\n' for path in texts))
        folders = {folder / path.relative_to(ROOT).parent for path in texts}
        output = compile_file(folder / "all.c", folder / "all.o", include=[*(f"-I{path}" for path in folders), *self.include(folder)])
        if output:
            return None, output
        replaced = {}
        for source in [*sorted((folder / "core/src").glob("*.c")), folder / WHICH]:
            replaced[source.name] = folder / f"{source.stem}.o"
            output = compile_file(source, replaced[source.name], "-O1", "-fPIC", *BOUNDS, *PATTERN, include=self.include(folder))
            if output:
                raise RuntimeError(output)
        self.link(folder, replaced)
        return Core(folder, has_judges=True), None

    @staticmethod
    def include(folder):
        """The include options for changed headers of the core."""
        return [word.replace(f"-I{ROOT}/core/", f"-I{folder}/core/") for word in INCLUDE]

    def judge_of(self, core, program):
        """The path of the judge; with changed headers it is built at its first use. The caller holds the lock."""
        folder = core.folder if core.has_judges else self.work
        if not (folder / program).exists():
            objects = [self.compile_other(path, folder, ("-O1", *BOUNDS), self.include(folder)) for path in self.programs[program]]
            self.build(program, objects, folder)
        return folder / program

    def unchanged(self, command, core):
        """The run with the unchanged core, made once. The caller holds the lock."""
        if command not in self.as_it_is:
            clean = core._replace(number=0) if core.has_judges else self.clean
            done = play(command, clean, UNMEASURED_S)
            if done.status != 0 and core.has_judges:
                raise RuntimeError(f"{command[0].name}, built with changed headers of which none is enabled, {done.how}")
            self.as_it_is[command] = done
        return self.as_it_is[command]

    def run(self, core, program, *arguments):
        with self.lock:
            command = (self.judge_of(core, program), *arguments)
            unchanged = self.unchanged(command, core)
        return unchanged if core == self.clean else play(command, core, limit_s(unchanged))

    def failing(self, core, names):
        """(the first of these programs that fails, its first failing test, how it ended), or None."""
        for name in names:
            done = self.run(core, f"unit_{name}")
            if done.status != 0:
                found = re.search(r":(test_\w+):FAIL", done.output)
                return name, None if done.endless or not found else found[1], done
        return None

    def unit(self, core, first=()):
        """The first failed unit test, or None. `first`: names to begin with."""
        found = self.failing(core, sorted(self.tests, key=lambda name: (name in SLOW, not any(part in name for part in first), name)))
        return found and (found[1] or f"unit_{found[0]} {found[2].how}")

    def sim(self, core, hours=5):
        """The finding of the swarm, or None."""
        done = self.run(core, "test_sim", "--quick", "--hours", hours)
        if done.status == 0:
            return None
        found = re.search(r"^FAILED seed (\d+) at .*?, rule (\d+): (.*)$", done.output, re.M)
        return f"rule {found[2]}, seed {found[1]}: {found[3]}" if found else done.how

    def orders(self, core, length=3):
        """The finding of the enumeration of all orders, or None."""
        done = self.run(core, "test_orders", "--length", length)
        if done.status == 0:
            return None
        rule = re.search(r"^rule (\d+) at .*?: (.*)$", done.output, re.M)
        small = re.search(r"^made small: --sequence (.*)$", done.output, re.M)
        return f"rule {rule[1]}, {small[1]}: {rule[2]}" if rule and small else done.how


def find_unity(build):
    """Unity's folder that CMake found; None if it is installed without sources."""
    path = Path(build) / "test/target/unity_folder"
    return path.read_text().strip() or None if path.exists() else None
