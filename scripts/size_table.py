#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Sizes of the core on Cortex-M and of the STM32 images: writes docs/sizes.md, or fails if the committed one is not true any more.

usage: size_table.py --update|--check M0PLUS_BUILD_DIR M3_BUILD_DIR M4_BUILD_DIR

A number may differ from the committed one by 2 % or 8 bytes, whichever is more. What is linked must fit the limits of linked_sizes.py.
Exit status 77 (skipped) if the committed table was made by another compiler.
"""
import re
import subprocess
import sys
from pathlib import Path

import board_sizes
import linked_sizes

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs" / "sizes.md"
CPUS = ("Cortex-M0+", "Cortex-M3", "Cortex-M4")
TEXT_GOAL = 6 * 1024  # What the design asks for, and what the core does not reach yet: told, not gated.
TYPES = ("iw_gateway_t", "iw_config_t", "iw_wheel_t", "iw_force_t", "iw_permit_t", "iw_setpoint_t", "iw_confirmation_t", "iw_envelope_t")
ROW = re.compile(r"^\| `?([^|`]+?)`? +\|(.*)\|$", re.MULTILINE)


def compiler():
    run = subprocess.run(["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True, check=True)
    return run.stdout.strip()


def type_sizes():
    """{type: bytes} on a 32-bit ARM, asked of the compiler through the sizes of arrays."""
    probe = '#include "iwheel/gateway.h"\n' + "".join(f"char size_of_{name}[sizeof({name})];\n" for name in TYPES)
    command = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-I", str(ROOT / "core/include"), "-S", "-xc", "-", "-o", "-"]
    run = subprocess.run(command, input=probe, capture_output=True, text=True, check=True)
    return {name: int(size) for name, size in re.findall(r"\.size\s+size_of_(\w+), (\d+)", run.stdout)}


def render(builds):
    rows, findings, shares = linked_sizes.table(builds)
    modules = sorted(shares.items(), key=lambda item: (-item[1], item[0]))
    kinds = sorted(type_sizes().items(), key=lambda item: -item[1])
    lines = ["# Sizes", "",
             f"Made by `scripts/size_table.py --update` with arm-none-eabi-gcc {compiler()} -Os; `./check` compares.", "",
             "Code and constants in bytes of what is linked for each use, without what is not called (`-ffunction-sections`, `--gc-sections`). The",
             "core has no data and no bss.", "",
             "| what is used            | " + " | ".join(f"{cpu:>10}" for cpu in CPUS) + " |",
             "|-------------------------|" + "|".join("-----------:" for _ in CPUS) + "|"]
    lines += [f"| {name:<23} | " + " | ".join(f"{value:>10}" for value in values) + " |" for name, values in rows]
    lines += ["", "Where the bytes of the gateway are, on Cortex-M4:", "", "| module       |   bytes |", "|--------------|--------:|"]
    lines += [f"| {name:<12} | {size:>7} |" for name, size in modules]
    lines += ["", "RAM in bytes: `iw_gateway_t` holds everything, once per pair of wheels; the others are its parts.", "",
              "| type              |     RAM    |", "|-------------------|-----------:|"]
    lines += [f"| {f'`{name}`':<17} | {size:>10} |" for name, size in kinds]
    lines += board_sizes.lines(builds)
    return "\n".join(lines) + "\n", dict(rows)["gateway"][2], findings


def numbers(text):
    return {name: [int(cell) for cell in cells.split("|")] for name, cells in ROW.findall(text) if re.fullmatch(r"[\d |]+", cells)}


def differences(old, new):
    for name in sorted(old.keys() | new.keys()):
        if name not in old or name not in new:
            yield f"{name}: only in the {'committed' if name in old else 'new'} table"
            continue
        for committed, actual in zip(old[name], new[name], strict=True):
            if abs(committed - actual) > max(0.02 * committed, 8):
                yield f"{name}: {actual} B, committed {committed} B"


def main(arguments):
    if len(arguments) != 5 or arguments[1] not in ("--update", "--check"):
        sys.exit(__doc__)
    text, total, findings = render(arguments[2:])
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
    print(f"gateway on Cortex-M4: {total} B of code are linked (goal {TEXT_GOAL} B)")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
