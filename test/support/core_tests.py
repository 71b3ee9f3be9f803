# SPDX-License-Identifier: MIT
"""Which unit tests can run on another machine: those that need nothing but the core, Unity and test/support."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
UNIT, SUPPORT = ROOT / "test/unit", ROOT / "test/support"
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def listed_tests():
    """{name: [sources]} of the lines iwheel_unit_test(name sources...) whose words are plain, after set() is put in."""
    text = re.sub(r"foreach\(.*?endforeach\(\)", "", (UNIT / "CMakeLists.txt").read_text(), flags=re.DOTALL)
    for name, value in re.findall(r"set\((\w+) ([^)]*)\)", text):
        text = text.replace("${" + name + "}", value)
    return {name: [(UNIT / source).resolve() for source in sources.split()] for name, sources in re.findall(r"iwheel_unit_test\((\w+) ([^)$]*)\)", text)}


def needs_only_core(sources):
    """True if everything that is included, directly or not, belongs to the core, Unity or the tests' support."""
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
    return {name: sources for name, sources in listed_tests().items() if needs_only_core(sources)}
