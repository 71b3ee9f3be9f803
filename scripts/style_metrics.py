#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures functions and files, and fails where a limit of the house style is passed. Needs lizard (PyPI).

usage: style_metrics.py [ROOT]
"""
import re
import statistics
import sys
from pathlib import Path

import lizard

# group: (folders, longest function, median function, complexity)
GROUPS = {
    "core": (("core/src",), 60, 15, 10),
    "northbound": (("northbound/src",), 60, 15, 10),
    "ports and apps": (("port", "app", "client"), 80, 25, 15),
}
FILE_LINES = 400
TEST_FILE_LINES = 600  # Tables of cases may be longer than code.
PARAMETERS = 5
SPDX = "SPDX-License-Identifier: MIT"
UNFINISHED = re.compile(r"\b(TODO|FIXME|XXX)\b")


def sources(root, folders):
    return sorted(path for folder in folders for path in (root / folder).rglob("*.[ch]"))


def function_findings(path, functions, limits):
    _, longest, _, complexity = limits
    for function in functions:
        where = f"{path}:{function.start_line}: {function.name}"
        if function.length > longest:
            yield f"{where}: {function.length} lines, at most {longest}"
        if function.cyclomatic_complexity > complexity:
            yield f"{where}: complexity {function.cyclomatic_complexity}, at most {complexity}"
        if len(function.parameters) > PARAMETERS:
            yield f"{where}: {len(function.parameters)} parameters, at most {PARAMETERS}"


def file_findings(path, name, longest=FILE_LINES):
    lines = path.read_text().splitlines()
    if len(lines) > longest:
        yield f"{name}: {len(lines)} lines, at most {longest}"
    if not lines or SPDX not in lines[0]:
        yield f"{name}:1: the first line must be // {SPDX}"
    for number, line in enumerate(lines, 1):
        if UNFINISHED.search(line):
            yield f"{name}:{number}: unfinished: {line.strip()}"


def comment_share(paths):
    """Percent of non-empty lines that are comments, over all files together."""
    lines = [line.strip() for path in paths for line in path.read_text().splitlines() if line.strip()]
    comments = sum(line.startswith(("//", "/*")) or "///<" in line for line in lines)
    return 100 * comments / max(len(lines), 1)


def main(arguments):
    root = Path(arguments[1] if len(arguments) > 1 else ".").resolve()
    findings = []
    for group, limits in GROUPS.items():
        paths = sources(root, limits[0])
        lengths, complexities = [], []
        for path in paths:
            functions = lizard.analyze_file(str(path)).function_list
            lengths += [function.length for function in functions]
            complexities += [function.cyclomatic_complexity for function in functions]
            findings += function_findings(path.relative_to(root), functions, limits)
            findings += file_findings(path, path.relative_to(root))
        if not lengths:
            sys.exit(f"{group}: no function found in {', '.join(limits[0])}")
        if statistics.median(lengths) > limits[2]:
            findings.append(f"{group}: the median function has {statistics.median(lengths)} lines, at most {limits[2]}")
        sizes = [len(path.read_text().splitlines()) for path in paths]
        print(f"{group}: {len(lengths)} functions in {len(paths)} files; lines: median {statistics.median(lengths):g}, "
              f"max {max(lengths)}; complexity: median {statistics.median(complexities):g}, max {max(complexities)}; "
              f"file lines: median {statistics.median(sizes):g}, max {max(sizes)}; "
              f"comments {comment_share(paths):.0f} %")
    headers = sources(root, ("core/include", "northbound/include"))
    for path in headers:
        findings += file_findings(path, path.relative_to(root))
    for path in sources(root, ("test",)):
        findings += file_findings(path, path.relative_to(root), TEST_FILE_LINES)
    print(f"public headers: comments {comment_share(headers):.0f} %")
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
