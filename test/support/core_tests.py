# SPDX-License-Identifier: MIT
"""Finds the unit tests that can run on another machine: those that need only the core, Unity and test/support. Counts the tests in their output."""

import os
import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
UNIT, SUPPORT = ROOT / "test/unit", ROOT / "test/support"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wcast-qual", "-Werror"]
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def listed_tests():
    """{name: [sources]} of the lines iwheel_unit_test(name sources...) that consist of plain words after the variables of set() are replaced."""
    text = re.sub(r"foreach\(.*?endforeach\(\)", "", (UNIT / "CMakeLists.txt").read_text(), flags=re.DOTALL)
    for name, value in reversed(re.findall(r"set\((\w+) ([^)]*)\)", text)):  # A value may contain an earlier one.
        text = text.replace("${" + name + "}", value)
    return {name: [(UNIT / source).resolve() for source in sources.split()] for name, sources in re.findall(r"iwheel_unit_test\((\w+) ([^)$]*)\)", text)}


def needs_only_core(sources):
    """True if every file that is included, directly or indirectly, belongs to the core, Unity or test/support."""
    todo, seen = list(sources), set()
    while todo:
        path = todo.pop()
        if path in seen:
            continue
        seen.add(path)
        for name in INCLUDE.findall(path.read_text()):
            if name == "unity.h" or (ROOT / "core/include" / name).exists():
                continue
            found = next((folder / name for folder in (UNIT, SUPPORT) if (folder / name).exists()), None)
            if found is None:
                return False
            todo.append(found)
    return True


def core_tests():
    """{name: [sources]}"""
    return {name: [*sources, SUPPORT / "unit_main.c"] for name, sources in listed_tests().items() if needs_only_core(sources)}


def unity_folder():
    """Unity's sources, which the build has found."""
    folder = Path(os.environ["IWHEEL_BUILD"], "test/target/unity_folder").read_text()
    if not folder:
        raise unittest.SkipTest("Unity is installed as a package without sources: set its folder with -DIWHEEL_UNITY_DIR")
    return folder


def count_unity(done):
    """The number of passed tests. Raises if one failed."""
    summary = re.search(r"(\d+) Tests 0 Failures 0 Ignored", done.stdout)
    assert done.returncode == 0 and summary and int(summary[1]) > 0, (done.stdout + done.stderr)[-1500:]
    return int(summary[1])
