# SPDX-License-Identifier: MIT
"""Where a field of a structure is in the image's RAM, from the compiler and the linker."""

import functools
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
FIELDS = {
    "overruns": ("bus", "DRIVER", "overruns"),
    "lost": ("bus", "DRIVER", "lost"),
    "resets": ("bus", "DRIVER", "resets"),
    "bus_offs": ("bus", "DRIVER", "bus_offs"),
    "received": ("gateway", "iw_gateway_t", "counters.received"),
    "bad_format": ("gateway", "iw_gateway_t", "counters.bad_format"),
    "unknown": ("gateway", "iw_gateway_t", "counters.unknown"),
    "purges": ("gateway", "iw_gateway_t", "counters.purges"),
    "late_steps": ("gateway", "iw_gateway_t", "counters.late_steps"),
}


@functools.cache
def offsets(controller):
    """{name: offset in its structure}; every one is an uint32_t. `controller`: bxcan or fdcan."""
    probe = f'#define DRIVER brd_{controller}_t\n#include "{controller}.h"\n#include "iwheel/gateway.h"\n'
    probe += "".join(f"char offset_of_{name}[1 + offsetof({kind}, {field})];\n" for name, (_, kind, field) in FIELDS.items())
    command = ["arm-none-eabi-gcc", "-mcpu=cortex-m3", "-mthumb", "-S", "-xc", "-", "-o", "-"]
    command += [f"-I{ROOT / folder}" for folder in ("core/include", "port/stm32_stub", "port/stm32_stub/access")]
    run = subprocess.run(command, input=probe, capture_output=True, text=True, check=True)
    return {name: int(size) - 1 for name, size in re.findall(r"\.size\s+offset_of_(\w+), (\d+)", run.stdout)}


def addresses(elf):
    """{name: address} of the fields in this image."""
    run = subprocess.run(["arm-none-eabi-nm", str(elf)], capture_output=True, text=True, check=True)
    objects, controller = {}, "fdcan" if "stm32g4" in Path(elf).name else "bxcan"
    for line in run.stdout.splitlines():
        address, kind, name = line.rsplit(" ", 2)
        if kind in "bBdD":
            objects[name.split(".")[0]] = int(address, 16)
    return {name: objects[FIELDS[name][0]] + offset for name, offset in offsets(controller).items()}


def stack_area(elf):
    """(lowest, highest) address of the stack."""
    run = subprocess.run(["arm-none-eabi-nm", str(elf)], capture_output=True, text=True, check=True)
    found = dict(reversed(line.split()[0::2]) for line in run.stdout.splitlines() if " brd_link_" in line)
    return int(found["brd_link_stack_bottom"], 16), int(found["brd_link_stack_top"], 16)


def variable(elf, name):
    """(address, size) of a variable."""
    run = subprocess.run(["arm-none-eabi-nm", "-S", str(elf)], capture_output=True, text=True, check=True)
    return next(
        (int(address, 16), int(size, 16)) for address, size, kind, *found in map(str.split, run.stdout.splitlines()) if kind in "bBdD" and found == [name]
    )


def function(elf, name):
    """Its address."""
    run = subprocess.run(["arm-none-eabi-nm", str(elf)], capture_output=True, text=True, check=True)
    return next(int(line.split()[0], 16) & ~1 for line in run.stdout.splitlines() if line.split()[1:] in (["T", name], ["t", name]))
