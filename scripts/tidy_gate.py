#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""clang-tidy on every file of core, port/linux, lib and app that BUILD_DIR (preset clang) compiles; any finding fails.

usage: tidy_gate.py BUILD_DIR [JOBS]

A file that passed is not looked at again until its text after preprocessing, its flags, .clang-tidy or clang-tidy change.
"""
import subprocess
import sys
from pathlib import Path

from file_by_file import ROOT, commands_of, look_at_all, tell

FOLDERS = ("core/src/", "port/linux/", "lib/", "app/")


def main(arguments):
    if len(arguments) not in (2, 3):
        sys.exit(__doc__)
    build = Path(arguments[1]).resolve()

    def look(name, _):
        """One file a call: version 14 reports false va_list errors from the second on."""
        run = subprocess.run(["clang-tidy", "--quiet", "-p", str(build), str(ROOT / name)], capture_output=True, text=True, check=False)
        if run.returncode == 0 and not run.stdout.strip():
            return ""
        return run.stdout or run.stderr or f"{name}: clang-tidy ended with {run.returncode}\n"

    tool = (ROOT / ".clang-tidy").read_bytes() + subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    commands = commands_of(build, FOLDERS)
    return tell(commands, look_at_all(commands, look, build / "tidy-passed", tool, int(arguments[2]) if len(arguments) == 3 else 2))


if __name__ == "__main__":
    sys.exit(main(sys.argv))
