#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""gcc -fanalyzer on every file of core, ports, lib and app that BUILD_DIR compiles, as it is compiled there; any finding fails.

usage: analyzer_gate.py [--jobs N] [--root DIR] BUILD_DIR...

A file that passed is not looked at again until its text after preprocessing, its flags or gcc change.
"""
import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from file_by_file import ROOT, commands_of, look_at_all, tell, with_output

FOLDERS = ("core/", "port/", "lib/", "app/")


def look(name, command):
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(with_output(command, "-fanalyzer", "-Werror", "-c", "-o", f"{folder}/out.o"), capture_output=True, text=True, check=False)
    return "" if run.returncode == 0 and not run.stderr else run.stderr or f"{name}: gcc ended with {run.returncode}\n"


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1].split("\n\n")[0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("builds", type=Path, nargs="+")
    options = parser.parse_args()
    status = 0
    for build in options.builds:
        commands = commands_of(build, FOLDERS, options.root.resolve())
        compiler = commands[0][1][0] if commands else "gcc"
        tool = subprocess.run([compiler, "--version"], capture_output=True, check=True).stdout
        print(f"{build}:", end=" ")
        status |= tell(commands, look_at_all(commands, look, build / "analyzer-passed", tool, options.jobs))
    return status


if __name__ == "__main__":
    sys.exit(main())
