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
PRODUCTION = ("core", "northbound", "client", "port", "app")
OUTSIDE = ("northbound", "client", "port", "app", "examples", "zephyr", "bridge")


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
    """Headers of ours below this file, one in the other."""
    if path not in known:
        known[path] = 0  # Guards against circles.
        for included in INCLUDE.findall(path.read_text()):
            found = next((folder / included for folder in (path.parent, *folders) if (folder / included).is_file()), None)
            if found:
                known[path] = max(known[path], 1 + depth(found.resolve(), folders, known))
    return known[path]


def include_depth():
    """(levels, where) of the deepest file of the core."""
    known = {}
    return max((depth(path, (HEADERS, ROOT / "core/src"), known), name(path)) for path in sources("core"))


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
    run = subprocess.run(command, cwd=entry["directory"], capture_output=True, text=True)
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


def arrows(folder):
    """(used, possible) ways of one subfolder into another, by includes."""
    subfolders = sorted(path.name for path in folder.iterdir() if path.is_dir())
    used = set()
    for path in folder.rglob("*.[ch]"):
        here = path.relative_to(folder).parts[0]
        for included in INCLUDE.findall(path.read_text()):
            there = next((sub for sub in subfolders if (folder / sub / Path(included).name).is_file() and not (path.parent / included).is_file()), None)
            if here in subfolders and there and there != here:
                used.add((here, there))
    return len(used), len(subfolders) * (len(subfolders) - 1)


def main(arguments):
    builds = [Path(argument).resolve() for argument in arguments] or [ROOT / "build" / build for build in ("default", "arm", "arm-m3")]
    builds = [build for build in builds if (build / "compile_commands.json").is_file()]
    message, headers, private = files_of_a_message(), public_headers(), private_includes()
    levels, where = include_depth()
    compiled, parts = uses_of_parts(builds)
    daemon = [path for path in sources("app/gateway") if "gw_daemon_t" in path.read_text()]
    places = sum(path.read_text().count("gw_daemon_t") for path in daemon)
    used, possible = arrows(ROOT / "app/gateway")
    print(f"files that name every telemetry message: {len(message)} (limit 8): {', '.join(message)}")
    print(f"public headers of the core: {len(headers)} (limit 10): {', '.join(headers)}")
    print(f"include depth of the core: {levels} (limit 4), at {where}")
    print(f"private headers included outside the core: {len(private)} (limit 0)")
    print(f"parts of iw_gateway_t named outside the core: {len(parts)} in {compiled} files compiled (limit 0)")
    print(f"places that take gw_daemon_t: {places} in {len(daemon)} files")
    print(f"arrows between the folders of app/gateway: {used} of {possible} ({100 * used // possible} %)")
    findings = [*private, *parts]
    findings += [f"{len(message)} files name every message"] if len(message) > 8 else []
    findings += [f"{len(headers)} public headers"] if len(headers) > 10 else []
    findings += [f"{where} includes {levels} levels deep"] if levels > 4 else []
    findings += ["nothing was compiled: cmake --preset default first"] if compiled == 0 else []
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
