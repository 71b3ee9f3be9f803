#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Computes the worst stack of every entry point of the core, or of another library of this tree, from gcc's call graph. Fails on recursion, variable stack, or a
stack over the limit.

usage: stack_usage.py BUILD_DIR LIMIT_BYTES [LIBRARY]
       stack_usage.py --frames BUILD_DIR LIMIT_BYTES FOLDER...

BUILD_DIR was configured with cmake/arm-none-eabi.cmake. The graph does not contain the functions of the compiler's run-time library: they are found
through the relocations, and count with a fixed size, like mem*. Calls through the HAL are not followed: a port adds its own stack.

--frames: no frame of a function in these folders may exceed the limit. BUILD_DIR is any build with compile_commands.json; each source is compiled
once more, without output. No tool does it: -Wstack-usage of gcc judges one function; avstack (Perl) and puncover (PyPI) add up, but know neither the
run-time library nor the results of the linker's optimisation, and do not fail.
"""

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

NODE = re.compile(r'node: { title: "([^"]+)" label: "[^"]*?(?:(\d+) bytes \(([a-z,]+)\))?"')
EDGE = re.compile(r'edge: { sourcename: "([^"]+)" targetname: "([^"]+)"')
INDIRECT = "__indirect_call"
LIBC, RUNTIME = 24, 64  # Measured in newlib-nano: memmove 16; in libgcc: __aeabi_uldivmod 56. Rounded up.


def read_graph(objects):
    """({function: bytes}, {function: {callees}}, [findings])"""
    size, calls, findings = {}, {}, []
    for path in objects:
        for line in path.with_suffix(".ci").read_text().splitlines():
            node, edge = NODE.match(line), EDGE.match(line)
            if node and node[2] is not None:
                size[node[1]] = int(node[2])
                if node[3] != "static":
                    findings.append(f"{node[1]}: stack is {node[3]}, must be static")
            elif edge:
                calls.setdefault(edge[1], set()).add(edge[2])
    return size, calls, findings


def add_runtime_calls(objects, size, calls):
    """Adds the calls of libgcc, which gcc emits after it has written the graph. Each function has its own section."""
    for path in objects:
        section = None
        relocations = subprocess.run(["arm-none-eabi-readelf", "-rW", str(path)], capture_output=True, text=True, check=True)
        for line in relocations.stdout.splitlines():
            header = re.match(r"Relocation section '\.rel\.text\.([^']+)'", line)
            if header or line.startswith("Relocation section"):
                section = header[1] if header else None
            called = re.search(r"\s(__aeabi_\w+|__gnu_\w+)$", line)
            if section and called:
                for name in size:  # The linker's object has another name in its graph.
                    if name == section or name.endswith((f"{path.stem}:{section}", f"{path.stem.removesuffix('.ltrans')}.o:{section}")):
                        calls.setdefault(name, set()).add(called[1])


def own_stack(size, name):
    """Returns the bytes of one function alone."""
    if name in size:
        return size[name]
    return 0 if name == INDIRECT else LIBC if name.startswith(("mem", "str")) else RUNTIME


class Depth:
    """Computes the deepest path below each function."""

    def __init__(self, size, calls):
        self.size, self.calls, self.known, self.open, self.cycles = size, calls, {}, [], []

    def of(self, name):
        """Returns (bytes, path) from this function down."""
        if name in self.open:
            self.cycles.append([*self.open[self.open.index(name) :], name])
            return 0, [name]
        if name not in self.known:
            self.open.append(name)
            below = max((self.of(callee) for callee in sorted(self.calls.get(name, ()))), default=(0, []))
            self.open.pop()
            self.known[name] = (own_stack(self.size, name) + below[0], [name] + below[1])
        return self.known[name]


def short(name):
    return name.rsplit(":", 1)[-1]


def frames_of(entry, work):
    """Returns [(bytes, "file:function", kind of the size)] of the source of one entry of compile_commands.json."""
    words = [word for word in shlex.split(entry["command"]) if Path(word).name != "ccache"]
    out = work / entry["file"].replace("/", "_")
    words[words.index("-o") + 1] = f"{out}.o"
    subprocess.run([*words, "-fstack-usage"], cwd=entry["directory"], check=True)
    rows = [line.split("\t") for line in out.with_suffix(out.suffix + ".su").read_text().splitlines()]
    return [(int(size), f"{Path(entry['file']).name}:{where.rsplit(':', 1)[-1]}", how) for where, size, how in rows]


def frames(build, limit, folders):
    entries = {}  # A source that several programs compile counts once.
    for entry in json.loads((Path(build) / "compile_commands.json").read_text()):
        if any(Path(folder).resolve() in Path(entry["file"]).parents for folder in folders):
            entries[entry["file"]] = entry
    if not entries:
        sys.exit(f"{build} compiles no file of {' '.join(folders)}: configure it first")
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(os.cpu_count()) as pool:
        found = sorted((row for rows in pool.map(lambda entry: frames_of(entry, Path(work)), entries.values()) for row in rows), reverse=True)
    findings = [f"{name}: {size} B on the stack, {limit} B allowed; put large objects elsewhere" for size, name, _ in found if size > limit]
    findings += [f"{name}: its stack is {how}, must have a bound" for _, name, how in found if how == "dynamic"]
    for finding in findings:
        print(finding)
    print(f"largest frame of {len(found)} functions in {len(entries)} sources: {found[0][0]} B, {found[0][1]} (limit {limit} B)")
    return 1 if findings else 0


def main(arguments):
    if len(arguments) > 4 and arguments[1] == "--frames":
        return frames(arguments[2], int(arguments[3]), arguments[4:])
    if len(arguments) not in (3, 4):
        sys.exit(__doc__)
    limit = int(arguments[2])
    library = arguments[3] if len(arguments) == 4 else "iwheel_core"
    objects = sorted(path for path in Path(arguments[1]).rglob("*.c.o*") if f"{library}.dir" in path.parts)
    objects = [path for path in objects if path.suffix in (".o", ".obj")]
    if not objects:
        sys.exit(f"no objects of {library} in {arguments[1]}: build a preset of the arm family first")
    size, calls, findings = read_graph(objects)
    add_runtime_calls(objects, size, calls)
    depth = Depth(size, calls)
    worst = sorted(((depth.of(name), name) for name in size if ":" not in name), reverse=True)
    findings += [f"recursion: {' -> '.join(map(short, cycle))}" for cycle in depth.cycles]
    for (used, path), _ in worst[:5]:
        print(f"{used:4d} B  {' -> '.join(f'{short(step)} {own_stack(size, step)}' for step in path)}")
    findings += [f"{name}: {used} B of stack, {limit} B allowed" for (used, _), name in worst if used > limit]
    for finding in findings:
        print(finding)
    print(f"worst of {len(worst)} entry points: {worst[0][0][0]} B (limit {limit} B)")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
