# SPDX-License-Identifier: MIT
"""The lists of mutants that no test can detect, and the names of mutants in them."""

import collections

from mutants import mutants


def read_reasons(path):
    """{key: reason} of such a list."""
    lines = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return {key.strip(): reason.strip() for key, _, reason in (line.rpartition(" | ") for line in lines)}


def settle(named, found):
    """Updates entries whose file or function has been renamed, if their lines occur only once."""
    by_lines = collections.defaultdict(list)
    for key in found:
        by_lines[key.split(" | ", 2)[2]].append(key)
    for key in [key for key in named if key not in found]:
        now = by_lines[key.split(" | ", 2)[2]]
        if len(now) == 1 and now[0] not in named:
            named[now[0]] = named.pop(key)


def keyed(path, found=None):
    """{key: mutant} of a file, named without line numbers; the second of two equal names ends with (2)."""
    source, seen, named = path.read_text(), collections.Counter(), {}
    for mutant in mutants(path) if found is None else found:
        key = mutant.key(source)
        seen[key] += 1
        named[key if seen[key] == 1 else f"{key} ({seen[key]})"] = mutant
    return named
