#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""clang-tidy on every file of core, port/linux and app that BUILD_DIR (preset clang) compiles; any finding fails.

usage: tidy_gate.py BUILD_DIR [JOBS]

A file that passed is not looked at again until its text after preprocessing, its flags, .clang-tidy or clang-tidy change.
"""
import concurrent.futures
import hashlib
import json
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("core/src/", "port/linux/", "app/")


def commands_of(build):
    """[(file, compiler command)] of ours, each file once."""
    found = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        path = Path(entry["file"]).resolve()
        if path.is_relative_to(ROOT) and str(path.relative_to(ROOT)).startswith(FOLDERS):
            found[path] = shlex.split(entry["command"])
    return sorted(found.items())


def preprocessed(command):
    words, skip = [], False
    for word in command:
        if not skip and word not in ("-c", "-o"):
            words.append(word)
        skip = word == "-o"
    return subprocess.run([*words, "-E"], capture_output=True, check=True).stdout


def judge(path, command, build, passed, tool):
    """(name, what clang-tidy found, or nothing). One file a call: version 14 reports false va_list errors from the second on."""
    name = str(path.relative_to(ROOT))
    text = preprocessed(command) + path.read_bytes() + " ".join(command).encode() + tool
    stamp = passed / hashlib.sha256(text).hexdigest()
    if stamp.exists():
        return name, ""
    run = subprocess.run(["clang-tidy", "--quiet", "-p", str(build), str(path)], capture_output=True, text=True)
    if run.returncode == 0 and not run.stdout.strip():
        stamp.touch()
        return name, ""
    return name, run.stdout or run.stderr or f"clang-tidy ended with {run.returncode}"


def main(arguments):
    if len(arguments) not in (2, 3):
        sys.exit(__doc__)
    build = Path(arguments[1]).resolve()
    passed = build / "tidy-passed"
    passed.mkdir(exist_ok=True)
    tool = (ROOT / ".clang-tidy").read_bytes() + subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    commands = commands_of(build)
    if not commands:
        sys.exit(f"{build} compiles nothing of {', '.join(FOLDERS)}")
    with concurrent.futures.ThreadPoolExecutor(int(arguments[2]) if len(arguments) == 3 else 2) as pool:
        results = [*pool.map(lambda item: judge(*item, build, passed, tool), commands)]
    bad = [name for name, said in results if said]
    for _, said in results:
        print(said, end="")
    print(f"{len(results)} files, {len(bad)} with findings: {' '.join(bad)}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
