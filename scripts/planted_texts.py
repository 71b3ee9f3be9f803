#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Stands each text that a planted bug replaces still in its file? Whoever changes such a line learns it here, in a second, and not from a step that
takes minutes.

usage: planted_texts.py [ROOT]

The lists: test/planted (bugs.py, parts_bugs.py), test/wp/run, test/target/planted_bugs.py, test/fuzz/run and planted_faults.py. Where the bug is
one place, the text must stand there once; where the list says "wherever it stands", once at least.
"""
import importlib.machinery
import importlib.util
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(HERE / folder) for folder in ("scripts", "test/planted", "test/target", "test/fuzz")]
import planted_bugs
import planted_faults
from bugs import BUGS, find_code
from parts_bugs import PARTS


def program(path):
    """What a program without an ending defines."""
    loader = importlib.machinery.SourceFileLoader(path.replace("/", "_"), str(HERE / path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def exactly(text, words):
    return text.count(words) == 1


def somewhere(text, words):
    return words in text


def as_code(text, words):
    return len(find_code(text, words)) == 1


def of_gates():
    """(file, text, how) of what is planted in the tree itself."""
    for gate, _, _, fault, _ in planted_faults.CASES:
        if gate in (planted_faults.northbound, planted_faults.house, planted_faults.memory) and fault and fault[0]:
            yield fault[0], fault[1], somewhere
        elif gate is planted_faults.eva_core:
            file, text, _ = fault.split(" | ")
            yield f"core/src/{file}", text, exactly


def texts():
    """(the list, file, text, how it must stand there) of them all."""
    yield from (("test/planted/bugs.py", f"core/src/{bug.file}", bug.before, as_code) for bug in BUGS)
    yield from (("test/wp/run", f"core/src/{bug.file}", bug.before, as_code) for bug in program("test/wp/run").OWN)
    yield from (("test/planted/parts_bugs.py", bug.file, bug.before, as_code) for bug in PARTS)
    yield from (("test/target/planted_bugs.py", f"port/stm32_stub/{row[0]}", row[1], somewhere)
                for row in [*planted_bugs.DRIVER.values(), *planted_bugs.IMAGE.values()])
    fuzz = program("test/fuzz/run")
    yield from (("test/fuzz/run", f"{fuzz.library_of(target)}/src/{file}", before, exactly) for file, before, _, target in fuzz.PLANTED)
    yield from (("scripts/planted_faults.py", *row) for row in of_gates())


def main():
    root, wrong, number = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE, 0, 0
    for where, file, words, stands in texts():
        number += 1
        if not (root / file).is_file() or not stands((root / file).read_text(), words):
            wrong += 1
            print(f"failed: {file} has changed: what {where} replaces there does not stand there" + ("" if stands is somewhere else " exactly once") + f"; mend {where}: {words!r}")
    print(f"{number} texts of planted bugs, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
