#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Fails unless a portable library has no mutable data, no functions of libc except mem*, and no floating point.

usage: purity.py [--strings] [--on BASE] LIBRARY SOURCE_DIR

LIBRARY is compiled for an ARM without an FPU, where every floating point operation is a call. With --strings it may also use a few functions of
str*, with --on those of another portable library. No tool does it: `nm` lists the symbols without a judgement, and gcc has no warning for mutable
data.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

MUTABLE = set("bBdDCsSgGvV")
LIBC = {"memcpy", "memset", "memmove", "memcmp"}
STRINGS = {"strlen", "strcmp", "strchr"}
# Integer helpers of the compiler's run-time library: division, multiplication and shifts of 64 bits, switch tables.
RUNTIME = re.compile(
    r"__aeabi_(u?idiv(mod)?|u?ldivmod|lmul|ll?s[lr]|lasr|u?lcmp|mem(cpy|set|move|clr)[48]?|idiv0|ldiv0)$"
    r"|__gnu_thumb1_case_\w+$|__clzsi2$|__ctzsi2$|__popcountsi2$"
)
HEADERS = {"stdbool.h", "stddef.h", "stdint.h", "limits.h", "string.h"}
COMMENT = re.compile(r"//.*|/\*.*?\*/|\"[^\"\n]*\"", re.DOTALL)


def symbols_of(library):
    """Returns [(object file, kind as nm prints it, name)]."""
    run = subprocess.run(["arm-none-eabi-nm", "-A", library], capture_output=True, text=True, check=True)
    rows = [re.match(r"(?:.*:)?([^:]+):(?:[0-9a-f]+)?\s+(\w) (\S+)$", line) for line in run.stdout.splitlines() if line]
    return [row.groups() for row in rows if row]


def symbol_findings(library, allowed):
    symbols = symbols_of(library)
    defined = {name for _, kind, name in symbols if kind != "U"}
    if not defined:
        yield f"{library} holds no symbols"
    for unit, kind, name in symbols:
        if kind in MUTABLE:
            yield f"{unit}: {name}: mutable data (kind {kind} of nm)"
        if kind == "U" and name not in defined and name not in allowed and not RUNTIME.match(name):
            yield f"{unit}: {name}: undefined, and neither allowed ({', '.join(sorted(allowed & (LIBC | STRINGS)))}) nor an integer helper of the compiler"


def source_findings(folder):
    files = sorted(path for path in Path(folder).rglob("*.[ch]"))
    if not files:
        yield f"{folder} holds no sources"
    for path in files:
        code = COMMENT.sub(" ", path.read_text())
        for header in re.findall(r"#\s*include\s*<([^>]+)>", code):
            if header not in HEADERS:
                yield f"{path}: <{header}> is not freestanding"
        for word in re.findall(r"\b(?:float|double|malloc|calloc|realloc|free)\b", code):
            yield f"{path}: {word}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strings", action="store_true")
    parser.add_argument("--on", metavar="BASE")
    parser.add_argument("library")
    parser.add_argument("source_dir")
    options = parser.parse_args()
    allowed = LIBC | (STRINGS if options.strings else set())
    if options.on:
        allowed |= {name for _, kind, name in symbols_of(options.on) if kind == "T"}
    findings = [*symbol_findings(options.library, allowed), *source_findings(options.source_dir)]
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
