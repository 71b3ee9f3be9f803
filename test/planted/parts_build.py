# SPDX-License-Identifier: MIT
"""Unit tests with one file of what they test changed.

The default build tells how each file is compiled and each program linked. A change costs the compilation of that one file, as it is
compiled for the program that judges, and one link: the changed object stands before the libraries, or in the place of the program's
own. The tree and the build are never touched.
"""
import json
import re
import resource
import shlex
import signal
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
# What a test is to be asked beside its name.
ARGUMENTS = {"test_daemon": ["--quick", "--kills", "500"]}
CPU_S, TIMEOUT_S = 60, 1200  # Of tests that take less than a second; by the clock they may take long.


def output_of(words):
    return words[words.index("-o") + 1]


class Parts:
    """How the build in that folder compiles and links."""

    def __init__(self, build, work):
        self.build, self.work = Path(build).resolve(), Path(work)
        self.commands = {}  # {source: {object: (folder, words)}}
        for entry in json.loads((self.build / "compile_commands.json").read_text()):
            words, folder = shlex.split(entry["command"]), Path(entry["directory"])
            self.commands.setdefault(Path(entry["file"]), {})[folder / output_of(words)] = (folder, words)

    def link_of(self, program):
        """(the folder it is linked in, the words of the command)"""
        found = list(self.build.glob(f"*/*/CMakeFiles/{program}.dir/link.txt"))
        if len(found) != 1:
            raise RuntimeError(f"{self.build} has {len(found)} programs {program}: mend test/planted/parts_bugs.py, or build it")
        return found[0].parent.parent.parent, shlex.split(found[0].read_text())

    def compile(self, source, changed, inside, flags=("-O1",)):
        """(the object it replaces, the changed one, None or what the compiler said). `inside`: what the program is linked from by name."""
        commands = self.commands.get(source)
        if not commands:
            raise RuntimeError(f"{source} is not compiled in {self.build}")
        chosen = next((path for path in commands if path in inside), next(iter(commands)))
        folder, words = commands[chosen]
        out = changed.parent / f"{list(commands).index(chosen)}.o"
        if out.exists():
            return chosen, out, None
        kept = [word for word in words if not word.startswith("-W") and word not in (str(source), output_of(words), "-o", "-c", "-g", "-O2")]
        command = [*kept, *flags, "-w", "-iquote", str(source.parent), "-c", str(changed), "-o", str(out)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        return chosen, out, None if done.returncode == 0 else done.stderr

    def link(self, program, source, changed, out, flags=("-O1",), more=()):
        """None, or why that program cannot be had with the changed file."""
        folder, words = self.link_of(program)
        inside = {(folder / word) for word in words if word.endswith(".o")}
        chosen, changed_object, said = self.compile(source, changed, inside, flags)
        if said:
            return f"does not compile: {said}"
        words = [str(changed_object) if folder / word == chosen else word for word in words]
        words[words.index("-o") + 1] = str(out)
        if chosen not in inside:
            words.insert(1, str(changed_object))
        done = subprocess.run([*words, *more], cwd=folder, capture_output=True, text=True)
        return None if done.returncode == 0 else f"does not link: {done.stderr}"

    def change(self, name, file, text):
        """The changed file, in a folder of its own."""
        changed = self.work / "parts" / name / Path(file).name
        changed.parent.mkdir(parents=True, exist_ok=True)
        changed.write_text(text)
        return changed

    def judge(self, test, source=None, changed=None):
        """(what that test finds or None, None), or (None, why it cannot be told). Without a change: the program as it was built."""
        if changed is None:
            folder, words = self.link_of(test)
            return find_failure(folder / output_of(words), self.work), None
        program = changed.parent / test
        why = self.link(test, source, changed, program)
        return (None, why) if why else (find_failure(program, changed.parent), None)


def find_failure(program, folder):
    """The first test that fails, or how the program ended; None if it passed."""
    try:
        done = subprocess.run([str(program), *ARGUMENTS.get(program.name, [])], cwd=folder, capture_output=True, text=True, errors="replace",
                              stdin=subprocess.DEVNULL, timeout=TIMEOUT_S, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5)))
    except subprocess.TimeoutExpired:
        return "does not end"
    if done.returncode == -signal.SIGXCPU:
        return "does not end"
    if done.returncode == 0:
        return None
    found = re.search(r":(test_\w+):FAIL", done.stdout)
    if found:
        return found[1]
    found = re.search(r"^FAILED seed (\d+) .* rule (\d+): ", done.stdout, re.M)
    if found:
        return f"rule {found[2]} of seed {found[1]}"
    return f"ends by {signal.Signals(-done.returncode).name}" if done.returncode < 0 else f"ends with status {done.returncode}"
