#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The facts of the house that docs/architecture.md tells in a table: prints them, and fails where one passes its limit.

usage: house.py [BUILD_FOLDER...]

BUILD_FOLDERs hold a compile_commands.json (default: build/default, build/arm and build/arm-m3, those that there are). What they compile outside core/
and test/ is compiled once more, with the members of `iw_gateway_t` called otherwise: whoever names one does not compile.
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

ROOT = Path(__file__).resolve().parent.parent
HEADERS = ROOT / "core/include"
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
TELEMETRY = ("SPEED", "STATUS", "FORCE", "OFFSET", "POSE")
PRODUCTION = ("core", "lib", "port", "app")
# Libraries and programs: where each looks for headers of its own.
COMPONENTS = {"core": ("core/include", "core/src"), "lib/northbound/protocol": ("lib/northbound/protocol/include", "lib/northbound/protocol/src"), "lib/client": ("lib/client/include", "lib/client/src"),
              "port/linux": ("port/linux/include", "port/linux/src"), "port/stm32_stub": (), "app/board": (), "app/gateway": ("app/gateway",), "app/ctl": ("app/ctl",), "app/sim": ("app/sim",),
              "lib/begin": (), "lib/config": (), "lib/recording": (), "lib/inspect": (), "lib/sockets": ()}
OUTSIDE = ("lib", "port", "app", "examples", "zephyr")


def sources(*folders):
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.[ch]"))


def name(path):
    return str(path.relative_to(ROOT))


def files_of_a_message():
    """Production files that name every telemetry message: each new one touches them."""
    texts = {path: path.read_text() for path in sources(*PRODUCTION)}
    of = [{path for path, text in texts.items() if re.search(rf"\bIW_(CODEC|ID_LEFT|ID_RIGHT|DLC)_{kind}\b|\biw_codec_{kind.lower()}_t\b", text)}
          for kind in TELEMETRY]
    return sorted(name(path) for path in set.intersection(*of))


def public_headers():
    return sorted(path.name for path in (HEADERS / "iwheel").glob("*.h"))


def depth(path, folders, known):
    """Headers in these folders and beside it below this file, one in the other."""
    if path not in known:
        known[path] = 0  # Guards against circles.
        for included in INCLUDE.findall(path.read_text()):
            found = next((folder / included for folder in (path.parent, *folders) if (folder / included).is_file()), None)
            if found:
                known[path] = max(known[path], 1 + depth(found.resolve(), folders, known))
    return known[path]


def deepest(headers, component):
    """(levels, where) of the file with the most headers of its own library or program below it."""
    known, folders = {}, [ROOT / folder for folder in headers]
    return max(((depth(path.resolve(), folders, known), name(path)) for path in sources(component)), default=(0, component))


def private_includes():
    return sorted(f"{name(path)} includes {included}" for path in sources(*OUTSIDE) for included in INCLUDE.findall(path.read_text())
                  if "iwheel/private/" in included)


def members_renamed(folder):
    """A copy of the core's headers in which nobody outside knows what a member of `iw_gateway_t` is called."""
    subprocess.run(["cp", "-r", str(HEADERS / "iwheel"), folder], check=True)
    path = Path(folder) / "iwheel/gateway.h"
    head, body, tail = re.fullmatch(r"(.*typedef struct iw_gateway \{\n)(.*?)(\n\} iw_gateway_t;.*)", path.read_text(), re.DOTALL).groups()
    path.write_text(head + re.sub(r"(\w+)((?:\[\w+\])?;)", r"\1_of_the_core\2", body) + tail)


def compiled_anew(job):
    entry, folder = job
    command = [word for word in shlex.split(entry["command"]) if word not in ("ccache", "-c")]
    command[command.index("-o"):command.index("-o") + 2] = ["-fsyntax-only"]
    command = [word.replace(str(HEADERS), folder) for word in command]
    run = subprocess.run(command, cwd=entry["directory"], capture_output=True, text=True, check=False)
    return [line for line in run.stderr.splitlines() if "error:" in line]


def uses_of_parts(builds):
    entries = {}
    for build in builds:
        for entry in json.loads((build / "compile_commands.json").read_text()):
            file = os.path.relpath(entry["file"], ROOT)
            if file.startswith(tuple(f"{folder}/" for folder in OUTSIDE)) and file.endswith(".c"):
                entries.setdefault(file, entry)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as pool:
        members_renamed(folder)
        found = [line for lines in pool.map(compiled_anew, ((entry, folder) for entry in entries.values())) for line in lines]
    return len(entries), found


def arrows(program):
    """Ways of one folder of a program into another, by includes: {(from, to)}, the folders ("." is the program's own), and headers
    that are not included by their folder."""
    files = {path.relative_to(program) for path in program.rglob("*.[ch]")}
    names = {path.name: path for path in files}
    used, bare = set(), []
    for path in files:
        for included in INCLUDE.findall((program / path).read_text()):
            if path.parent / included in files:
                there = path.parent / included
            elif Path(included) in files:
                there = Path(included)
            else:
                bare += [f"{name(program / path)} includes {included} without its folder"] if included in names and "/" not in included else []
                continue
            if there.parent != path.parent:
                used.add((str(path.parent), str(there.parent)))
    return used, sorted({str(path.parent) for path in files}), bare


def needing_each_other(used):
    """Folders that can be reached from themselves."""
    ways = set(used)
    for middle in {way[0] for way in used}:
        ways |= {(a, d) for a, b in ways for c, d in ways if b == middle == c}
    return sorted({a for a, b in ways if a == b})


def fact_of_arrows(program, limit):
    """Prints how many of the possible arrows a program has; what is wrong with them."""
    used, folders, bare = arrows(ROOT / program)
    possible = len(folders) * (len(folders) - 1) // 2
    circle = needing_each_other(used)
    percent = 100 * len(used) / possible
    print(f"arrows between the folders of {program}, its own among them: {len(used)} of {possible} pairs ({percent:.1f} %, limit {limit} %)")
    return [*bare, *([f"{program}: these need each other: {', '.join(circle)}"] if circle else []),
            *([f"{len(used)} arrows between the folders of {program}"] if percent > limit else [])]


def main(arguments):
    builds = [Path(argument).resolve() for argument in arguments] or [ROOT / "build" / build for build in ("default", "arm", "arm-m3")]
    builds = [build for build in builds if (build / "compile_commands.json").is_file()]
    message, headers, private = files_of_a_message(), public_headers(), private_includes()
    levels = {component: deepest(headers, component) for component, headers in COMPONENTS.items()}
    deep = max((fact, component) for component, fact in levels.items() if component != "core")[0]
    compiled, parts = uses_of_parts(builds)
    daemon = [line for path in sources("app/gateway") for line in path.read_text().splitlines() if "gw_daemon_t" in line]
    print(f"files that name every telemetry message: {len(message)} (limit 8): {', '.join(message)}")
    print(f"public headers of the core: {len(headers)} (limit 11): {', '.join(headers)}")
    print(f"include depth of the core: {levels['core'][0]} (limit 4), at {levels['core'][1]}; of any other library or program: {deep[0]} (limit 5), at {deep[1]}")
    print(f"private headers included outside the core: {len(private)} (limit 0)")
    print(f"parts of iw_gateway_t named outside the core: {len(parts)} in {compiled} files compiled (limit 0)")
    print(f"lines of app/gateway that name gw_daemon_t, the whole of it: {len(daemon)} (limit 60)")
    findings = [*private, *parts, *fact_of_arrows("app/gateway", 42), *fact_of_arrows("app/ctl", 40)]
    findings += [f"{len(daemon)} lines name gw_daemon_t"] if len(daemon) > 60 else []
    findings += [f"{len(message)} files name every message"] if len(message) > 8 else []
    findings += [f"{len(headers)} public headers"] if len(headers) > 11 else []
    findings += [f"{where} includes {count} levels deep" for component, (count, where) in levels.items() if count > (4 if component == "core" else 5)]
    findings += ["nothing was compiled: cmake --preset default first"] if compiled == 0 else []
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
