#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Sizes of the core on Cortex-M and of the STM32 images: writes docs/sizes.md, or fails if the committed one is not true any more.

usage: size_table.py --update|--check M0PLUS_BUILD_DIR M3_BUILD_DIR M4_BUILD_DIR

A number may differ from the committed one by 2 % or 8 bytes, whichever is more. The core on Cortex-M4 must fit TEXT_LIMIT.
Exit status 77 (skipped) if the committed table was made by another compiler.
"""
import re
import subprocess
import sys
from pathlib import Path

import board_sizes

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs" / "sizes.md"
CPUS = ("Cortex-M0+", "Cortex-M3", "Cortex-M4")
TEXT_GOAL = 6 * 1024  # What the design asks for, and what the core does not reach yet: told, not gated.
# No step back from where it is. From 12 800 B: what is left in a controller is taken back when zeros end, arming and force are judged by the
# ledger here and not in the daemon, and what a cause does is a table.
TEXT_LIMIT = 26 * 512 + 128
TYPES = ("iw_gateway_t", "iw_config_t", "iw_wheel_t", "iw_force_t", "iw_permit_t", "iw_setpoint_t", "iw_confirmation_t", "iw_envelope_t")
ROW = re.compile(r"^\| `?([^|`]+?)`? +\|(.*)\|$", re.MULTILINE)


def compiler():
    run = subprocess.run(["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True, check=True)
    return run.stdout.strip()


def text_sizes(build):
    """{module: bytes of code and constants} of the core in this build."""
    library = next(Path(build).rglob("libiwheel_core.a"))
    run = subprocess.run(["arm-none-eabi-size", str(library)], capture_output=True, text=True, check=True)
    sizes = {}
    for line in run.stdout.splitlines()[1:]:
        fields = line.split()
        sizes[fields[5].split(".")[0]] = int(fields[0]) + int(fields[1])
    return sizes


def type_sizes():
    """{type: bytes} on a 32-bit ARM, asked of the compiler through the sizes of arrays."""
    probe = '#include "iwheel/gateway.h"\n' + "".join(f"char size_of_{name}[sizeof({name})];\n" for name in TYPES)
    command = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-I", str(ROOT / "core/include"), "-S", "-xc", "-", "-o", "-"]
    run = subprocess.run(command, input=probe, capture_output=True, text=True, check=True)
    return {name: int(size) for name, size in re.findall(r"\.size\s+size_of_(\w+), (\d+)", run.stdout)}


def render(builds):
    columns = [text_sizes(build) for build in builds]
    modules = sorted(columns[0], key=lambda name: (-columns[2][name], name))
    rows = [(name, [column[name] for column in columns]) for name in modules]
    rows.append(("all of the core", [sum(column.values()) for column in columns]))
    kinds = sorted(type_sizes().items(), key=lambda item: -item[1])
    lines = ["# Sizes", "",
             f"Made by `scripts/size_table.py --update` with arm-none-eabi-gcc {compiler()} -Os; `./check` compares.", "",
             "Code and constants in bytes, whole modules: a linker leaves out what is not called. The core has no data and no bss.", "",
             "| module          | " + " | ".join(f"{cpu:>10}" for cpu in CPUS) + " |",
             "|-----------------|" + "|".join("-----------:" for _ in CPUS) + "|"]
    lines += [f"| {name:<15} | " + " | ".join(f"{value:>10}" for value in values) + " |" for name, values in rows]
    lines += ["", "RAM in bytes: `iw_gateway_t` holds everything, once per pair of wheels; the others are its parts.", "",
              "| type              |     RAM    |", "|-------------------|-----------:|"]
    lines += [f"| {f'`{name}`':<17} | {size:>10} |" for name, size in kinds]
    lines += board_sizes.lines(builds)
    return "\n".join(lines) + "\n", rows[-1][1][2]


def numbers(text):
    return {name: [int(cell) for cell in cells.split("|")] for name, cells in ROW.findall(text) if re.fullmatch(r"[\d |]+", cells)}


def differences(old, new):
    for name in sorted(old.keys() | new.keys()):
        if name not in old or name not in new:
            yield f"{name}: only in the {'committed' if name in old else 'new'} table"
            continue
        for committed, actual in zip(old[name], new[name]):
            if abs(committed - actual) > max(0.02 * committed, 8):
                yield f"{name}: {actual} B, committed {committed} B"


def main(arguments):
    if len(arguments) != 5 or arguments[1] not in ("--update", "--check"):
        sys.exit(__doc__)
    text, total = render(arguments[2:])
    findings = [f"core on Cortex-M4: {total} B, allowed {TEXT_LIMIT} B"] if total > TEXT_LIMIT else []
    if arguments[1] == "--update":
        TABLE.parent.mkdir(exist_ok=True)
        TABLE.write_text(text)
    else:
        committed = TABLE.read_text() if TABLE.exists() else ""
        if committed and f"arm-none-eabi-gcc {compiler()} " not in committed:
            print(f"skip: {TABLE.relative_to(ROOT)} was made by another compiler than {compiler()}")
            print(*findings, sep="\n")
            return 1 if findings else 77
        if not committed:
            findings.append(f"{TABLE.relative_to(ROOT)} is missing: ./check --update-sizes writes it")
        changed = [*differences(numbers(committed), numbers(text))] if committed else []
        findings += changed
        if changed:
            findings.append("the sizes changed: look at the reason, then ./check --update-sizes and commit docs/sizes.md")
    print(*findings, sep="\n")
    print(f"core on Cortex-M4: {total} B of code (limit {TEXT_LIMIT} B, goal {TEXT_GOAL} B)")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
