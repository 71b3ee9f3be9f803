# SPDX-License-Identifier: MIT
"""Copies of the core with one change each, and what judges them: the unit tests, the simulation, all orders of events.

The core is a shared library here, so that a change costs the compilation of one file: the judges are linked once and find
the changed library through LD_LIBRARY_PATH. The tree itself is never touched.
"""
import os
import re
import resource
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "test/support"))
from core_tests import core_tests

CORE = ROOT / "core/src"
INCLUDE = [f"-I{ROOT / path}" for path in ("core/include", "core/src", "app/sim/model/include", "test/sim", "test/support")]
# Seconds of processor time, not of the clock: a busy machine must not look like an endless loop.
CPU_LIMIT_S = {"unit": 2, "slow": 8, "sim": 30, "orders": 20}
GCC = ["ccache", "gcc"] if shutil.which("ccache") else ["gcc"]
# A change that reads or writes beyond an array must not pass unseen: it ends the program.
BOUNDS = ("-fsanitize=bounds-strict,shift,signed-integer-overflow", "-fsanitize-undefined-trap-on-error")
# Unit tests that sweep every value come last: most changes are caught long before them.
SLOW = ("outbox", "gateway_core_walk", "bit_timing", "proto_sweep", "gate_scheduler")


def limit_cpu(seconds):
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def compile_file(source, out, *flags, gcc=("gcc",)):
    """None, or what the compiler said."""
    done = subprocess.run([*gcc, "-std=gnu11", "-w", *flags, *INCLUDE, "-c", source, "-o", out], capture_output=True, text=True)
    return None if done.returncode == 0 else done.stderr


class Judges:
    """The judges, built in `work`, and the unchanged core beside them."""

    def __init__(self, work, unity, jobs):
        self.work, self.jobs = Path(work), jobs
        self.folder = self.work / "clean"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.objects = {}
        self.tests = core_tests()
        sim = sorted((ROOT / "test/sim").glob("*.c"))
        programs = {f"unit_{name}": [*map(Path, sources), Path(unity) / "unity.c"] for name, sources in self.tests.items()}
        programs["test_sim"] = [*(path for path in sim if path.name != "hashes.c"), *sorted((ROOT / "app/sim/model/src").glob("*.c"))]
        programs["test_orders"] = [*sorted((ROOT / "test/orders").glob("*.c")), *(path for path in sim if path.name.startswith("oracle"))]
        others = sorted({path for sources in programs.values() for path in sources})
        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(self.compile_core, sorted(CORE.glob("*.c"))))
            objects = dict(zip(others, pool.map(lambda path: self.compile_other(path, unity), others)))
            self.link(self.folder, {})
            list(pool.map(lambda name: self.build(name, [objects[path] for path in programs[name]]), programs))

    def compile_core(self, source):
        self.objects[source.name] = self.folder / (source.stem + ".o")
        said = compile_file(source, self.objects[source.name], "-O1", "-fPIC", gcc=GCC)
        if said:
            raise RuntimeError(said)

    def compile_other(self, source, unity):
        out = self.work / f"{source.parent.name}_{source.stem}.o"
        said = compile_file(source, out, "-O2", f"-I{unity}", "-DUNITY_SUPPORT_64", gcc=GCC)
        if said:
            raise RuntimeError(said)
        return out

    def build(self, name, objects):
        subprocess.run(["gcc", *objects, f"-L{self.folder}", "-liwheel", "-o", self.work / name], check=True)

    def link(self, folder, replaced):
        objects = [replaced.get(name, path) for name, path in sorted(self.objects.items())]
        subprocess.run(["ld", "-shared", *objects, "-o", folder / "libiwheel.so"], check=True)

    def change(self, name, file, text):
        """The folder of a core in which `file` has that text; None if it does not compile."""
        folder = self.work / "changed" / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        (folder / file).write_text(text)
        if compile_file(folder / file, folder / "changed.o", "-O0", "-fPIC", *BOUNDS):
            shutil.rmtree(folder)
            return None
        self.link(folder, {file: folder / "changed.o"})
        return folder

    def run(self, folder, kind, *command):
        environment = {**os.environ, "LD_LIBRARY_PATH": str(folder)}
        return subprocess.run([str(word) for word in command], capture_output=True, text=True, errors="replace", cwd=folder,
                              env=environment, stdin=subprocess.DEVNULL, preexec_fn=lambda: limit_cpu(CPU_LIMIT_S[kind]))

    def failing(self, folder, names):
        """(the first of these programs that fails, its first failing test), or None."""
        for name in names:
            done = self.run(folder, "slow" if name in SLOW else "unit", self.work / f"unit_{name}")
            if done.returncode != 0:
                found = re.search(r":(test_\w+):FAIL", done.stdout)
                return name, found[1] if found else f"unit_{name} ends with status {done.returncode}"
        return None

    def unit(self, folder, first=()):
        """The first unit test that fails, or None. `first`: what to begin with."""
        found = self.failing(folder, sorted(self.tests, key=lambda name: (name in SLOW, not any(part in name for part in first), name)))
        return found and found[1]

    def sim(self, folder, hours=4):
        """What the swarm finds, or None."""
        done = self.run(folder, "sim", self.work / "test_sim", "--quick", "--hours", hours)
        if done.returncode == 0:
            return None
        found = re.search(r"^FAILED seed (\d+) at .*?, rule (\d+): (.*)$", done.stdout, re.M)
        return f"rule {found[2]}, seed {found[1]}: {found[3]}" if found else f"ends with status {done.returncode}"

    def orders(self, folder, length=3):
        """What the enumeration of all orders finds, or None."""
        done = self.run(folder, "orders", self.work / "test_orders", "--length", length)
        if done.returncode == 0:
            return None
        rule = re.search(r"^rule (\d+) at .*?: (.*)$", done.stdout, re.M)
        small = re.search(r"^made small: --sequence (.*)$", done.stdout, re.M)
        return f"rule {rule[1]}, {small[1]}: {rule[2]}" if rule and small else f"ends with status {done.returncode}"


def find_unity(build):
    """Unity's folder, as CMake found it; None if it is installed without sources."""
    path = Path(build) / "test/target/unity_folder"
    return path.read_text().strip() or None if path.exists() else None
