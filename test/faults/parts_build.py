# SPDX-License-Identifier: MIT
"""Builds unit tests with one changed file.

The default build shows how each file is compiled and each program linked. A change costs one compilation of that file, with the
options of the judging program, and one link: the changed object is linked before the libraries, or instead of the program's own
object. The tree and the build never change.
"""

import json
import os
import re
import shlex
import subprocess
import threading
from pathlib import Path

from core_build import UNMEASURED_S, Core, limit_s, play
from table import Broken

ROOT = Path(__file__).resolve().parent.parent.parent


def output_of(words):
    return words[words.index("-o") + 1]


class Parts:
    """How the build in that folder compiles and links."""

    def __init__(self, build, work):
        self.build, self.work = Path(build).resolve(), Path(work)
        self.as_it_is, self.lock = {}, threading.Lock()
        self.commands = {}  # {source: {object: (folder, words)}}
        for entry in json.loads((self.build / "compile_commands.json").read_text()):
            words, folder = shlex.split(entry["command"]), Path(entry["directory"])
            self.commands.setdefault(Path(entry["file"]), {})[folder / output_of(words)] = (folder, words)

    def link_of(self, program):
        """(the folder of the link command, the words of the command)"""
        found = list(self.build.glob(f"*/*/CMakeFiles/{program}.dir/link.txt"))
        if len(found) != 1:
            raise RuntimeError(f"{self.build} has {len(found)} programs {program}: build it")
        return found[0].parent.parent.parent, shlex.split(found[0].read_text())

    def compile(self, source, changed, inside, flags=("-O1",)):
        """(the object that is replaced, the changed object, None or the compiler's output). `inside`: the objects that the program names in its link."""
        commands = self.commands.get(source)
        if not commands:
            raise RuntimeError(f"{source} is not compiled in {self.build}")
        chosen = next((path for path in commands if path in inside), next(iter(commands)))
        folder, words = commands[chosen]
        out = changed.parent / f"{list(commands).index(chosen)}.o"
        if out.exists():
            return chosen, out, None
        options = [word for word in words if not word.startswith("-W") and word not in (str(source), output_of(words), "-o", "-c", "-g", "-O2")]
        command = [*options, *flags, "-w", "-iquote", str(source.parent), "-c", str(changed), "-o", str(out)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        return chosen, out, None if done.returncode == 0 else done.stderr

    def link(self, program, source, changed, out, flags=("-O1",)):
        """None, or why the program cannot be built with the changed file."""
        folder, words = self.link_of(program)
        place = {word: Path(os.path.normpath(folder / word)) for word in words if word.endswith(".o")}
        inside = set(place.values())
        chosen, changed_object, output = self.compile(source, changed, inside, flags)
        if output:
            return f"does not compile: {output}"
        words = [str(changed_object) if place.get(word) == chosen else word for word in words]
        words[words.index("-o") + 1] = str(out)
        if chosen not in inside:
            words.insert(1, str(changed_object))
        done = subprocess.run([*words, "-s"], cwd=folder, capture_output=True, text=True, check=False)
        return None if done.returncode == 0 else f"does not link: {done.stderr}"

    def change(self, name, file, text):
        """The changed file, in its own folder."""
        changed = self.work / "parts" / name / Path(file).name
        changed.parent.mkdir(parents=True, exist_ok=True)
        changed.write_text(text)
        return changed

    def unchanged(self, command):
        """The run of the unchanged program, made once."""
        with self.lock:
            if command not in self.as_it_is:
                self.as_it_is[command] = play(command, Core(self.work), UNMEASURED_S)
            return self.as_it_is[command]

    def judge(self, command, source=None, changed=None):
        """The finding of that program, or None. Without a change: of the program of the build. Raises Broken if the program cannot be built with the changed file."""
        command = tuple(command)
        unchanged = self.unchanged(command)
        if changed is None:
            found = re.search(r":test_\w+:FAIL.*", unchanged.output)  # With its message, because it is never expected.
            return f"{Path(command[0]).name}{found[0]}" if found else first_failure(unchanged)
        program = changed.parent / Path(command[0]).name
        why = self.link(program.name, source, changed, program)
        if why:
            raise Broken(why)
        return first_failure(play([program, *command[1:]], Core(changed.parent), limit_s(unchanged)))


def first_failure(run):
    """The first failed test, or how the program ended; None if it passed."""
    if run.status == 0 or run.endless:
        return run.how if run.endless else None
    found = re.search(r":(test_\w+):FAIL", run.output)
    if found:
        return found[1]
    found = re.search(r"^FAILED seed (\d+) .* rule (\d+): ", run.output, re.M)
    return f"rule {found[2]} of seed {found[1]}" if found else run.how
