#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures the core on Cortex-M and the STM32 images: writes docs/developer/sizes.md, or fails if the committed page has other sizes.

usage: sizes.py --update|--check M0PLUS_BUILD_DIR M3_BUILD_DIR M4_BUILD_DIR

A number may differ from the committed one by 2 % or 8 bytes, whichever is more. The linked code of each use must fit the limit in USES, and each image must
leave FREE bytes of its board. The images are those of the presets arm-m3 and arm, which listen, of the builds next to arm that end in -f446 and -g474, and of the builds next to these that end in -demo and
-gateway. Their stack: an interrupt can occur anywhere, and no interrupt interrupts another, so the worst handler and the registers that the CPU saves
are added to the main loop's deepest path; calls through the HAL go to each of its functions. For an image that is optimised as one program, the graph
is that of the linker's result and of the objects outside it.

Exit status 77 (skipped) if the committed table was made by another compiler. No tool does it: `size` and bloaty measure one file, not the part of a
library that is linked for a use; -fstack-usage of gcc reports frames, not paths.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from stack_usage import INDIRECT, Depth, add_runtime_calls, read_graph, short

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs/developer/sizes.md"
CPUS = {"Cortex-M0+": "cortex-m0plus", "Cortex-M3": "cortex-m3", "Cortex-M4": "cortex-m4"}
TYPES = ("iw_gateway_t", "iw_config_t", "iw_wheel_t", "iw_force_t", "iw_permit_t", "iw_setpoint_t", "iw_confirmation_t", "iw_envelope_t")
ROW = re.compile(r"^\| `?([^|`]+?)`? +\|(.*)\|$", re.MULTILINE)
CODEC = "iw_codec_decode iw_codec_encode_setpoint"
SETPOINT = "iw_setpoint_init iw_setpoint_demand iw_setpoint_command iw_setpoint_due iw_setpoint_next iw_setpoint_next_us"
FORCE = "iw_force_init iw_force_reopen iw_force_receive iw_force_receive_offset iw_force_validity iw_force_net_mN"
GATEWAY = (
    "iw_config_default iw_gateway_init iw_gateway_step iw_gateway_suspended iw_gateway_bus_facts iw_gateway_arm iw_gateway_drive "
    "iw_gateway_stop iw_gateway_estop iw_gateway_reset iw_gateway_disconnect iw_gateway_tare iw_gateway_state iw_gateway_arming"
)
KNOWN = "iw_gateway_set_assumption iw_gateway_restore_offset iw_config_stop_budget"
OBSERVATION = "iw_observation_init iw_observation_step"
# Uses of the core: headers, functions, and the largest size on a Cortex-M4.
USES = {
    "codec": ("codec.h", CODEC, 350),
    "codec, setpoints, force": ("codec.h force_offset.h private/setpoint.h", f"{CODEC} {SETPOINT} {FORCE}", 2900),
    "gateway": ("gateway.h", GATEWAY, 13200),
    "gateway, snapshot": ("gateway.h", f"{GATEWAY} iw_gateway_snapshot", None),
    "all": ("gateway.h observation.h", f"{GATEWAY} {KNOWN} iw_gateway_snapshot {OBSERVATION}", None),
}
SECTION = re.compile(r"^ \.(?:text|rodata)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+) \S*libiwheel_core\.a\((\w+)\.c\S*\)$", re.MULTILINE)
# Image, its build, and the ending of that build's name.
BOARDS = {
    "STM32F103": ("iwheel_stm32f103", 1, ""),
    "STM32F407": ("iwheel_stm32f407", 2, ""),
    "STM32F446": ("iwheel_stm32f446", 2, "-f446"),
    "STM32G474": ("iwheel_stm32g474", 2, "-g474"),
}
FREE = {"flash": 2800, "ram": 1000}  # Bytes that an image leaves for later changes.
BUS = ("send", "receive", "bus_state", "purge")
HANDLERS = ("brd_systick_handler", "brd_exti0_handler")
CAN_HANDLERS = {"bxcan": ("brd_can_transmit_handler", "brd_can_receive_handler", "brd_can_error_handler"), "fdcan": ("brd_can_handler",)}
# Only for the image gateway: names of the functions that northbound's refusals call through a table.
SERIAL_HANDLERS, THROUGH_TABLE = ("brd_serial_usart_handler", "brd_serial_receive_handler", "brd_serial_transmit_handler"), ":explain_"
SAVED_BY_CPU = 36  # Eight registers and four bytes to align them.


def linked(library, cpu, headers, functions):
    """Returns {module: bytes} of the linked code."""
    with tempfile.TemporaryDirectory() as folder:
        source, memory_map = Path(folder) / "use.c", Path(folder) / "map"
        source.write_text(
            "".join(f'#include "iwheel/{header}"\n' for header in headers.split())
            + "void *volatile sink;\nvoid use(void) {\n"
            + "".join(f"    sink = (void *){function};\n" for function in functions.split())
            + "}\n"
        )
        subprocess.run(
            [
                "arm-none-eabi-gcc",
                f"-mcpu={CPUS[cpu]}",
                "-mthumb",
                "-mfloat-abi=soft",
                "-Os",
                f"-I{ROOT / 'core/include'}",
                "-nostartfiles",
                "-specs=nosys.specs",
                f"-Wl,--gc-sections,-e,use,-Map={memory_map}",
                source,
                library,
                "-o",
                Path(folder) / "used",
            ],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        text = memory_map.read_text().split("Linker script and memory map", 1)[1]
    sizes = {}
    for size, module in SECTION.findall(re.sub(r"\n (\.\S+)\n +0x", r"\n \1 0x", text)):
        sizes[module] = sizes.get(module, 0) + int(size, 16)
    return {module: size for module, size in sizes.items() if size > 0}


def uses(builds):
    """Returns [(use, [bytes on each CPU])], [findings], and the share of each module in the gateway on a Cortex-M4."""
    rows, findings, shares = [], [], {}
    for use, (headers, functions, limit) in USES.items():
        sizes = [linked(next(Path(build).rglob("libiwheel_core.a")), cpu, headers, functions) for build, cpu in zip(builds, CPUS, strict=False)]
        rows.append((use, [sum(size.values()) for size in sizes]))
        if limit is not None and rows[-1][1][-1] > limit:
            findings.append(f"{use} on Cortex-M4: {rows[-1][1][-1]} B are linked, allowed {limit} B")
        if "observation" in sizes[-1] and use != "all":
            findings.append(f"{use}: observation is linked, although nothing calls it")
        shares = sizes[-1] if use == "gateway" else shares
    return rows, findings, shares


def objects_of(build, *folders):
    return sorted(path for path in Path(build).rglob("*.c.o*") if path.suffix in (".o", ".obj") and any(f"{folder}.dir" in path.parts for folder in folders))


def depth_of(objects, indirect=()):
    size, calls, findings = read_graph(objects)
    add_runtime_calls(objects, size, calls)
    calls[INDIRECT] = set(indirect)
    if findings:
        raise SystemExit("\n".join(findings))
    return size, Depth(size, calls)


def core_stack(build):
    size, depth = depth_of(objects_of(build, "iwheel_core"))
    return max(depth.of(name)[0] for name in size)


def linked_objects(build, image):
    """Returns the objects in the image: those in its map, or in an archive of its map. Other objects are from an earlier configuration."""
    table = next(Path(build).rglob(f"{image}.map"))
    loaded = {(table.parent / name).resolve() for name in re.findall(r"^LOAD (\S+)$", table.read_text(), re.MULTILINE)}
    archives = {f"{path.stem.removeprefix('lib')}.dir" for path in loaded if path.suffix == ".a"}
    objects = objects_of(build, "iwheel_core", "iwheel_northbound", "iwheel_northbound_server", "iwheel_stm32_driver", image)
    merged = [path for path in loaded if path.name.startswith(f"{image}.elf.ltrans")]
    return [
        path for path in objects if (path.resolve() in loaded or archives.intersection(path.parts)) and not (merged and b".gnu.lto_" in path.read_bytes())
    ] + merged


def image_stack(build, image):
    objects = linked_objects(build, image)
    known = read_graph(objects)[0]
    controller = "fdcan" if "stm32g4" in image else "bxcan"
    bus = (*(f"brd_{controller}_{name}" for name in BUS), "brd_estop_pressed")
    hal = [name for name in known if short(name) in bus]
    serial = [name for name in SERIAL_HANDLERS if name in known]
    tabled = [name for name in known if THROUGH_TABLE in name and serial]
    _, depth = depth_of(objects, (*hal, *tabled))
    handlers = (*HANDLERS, *CAN_HANDLERS[controller], *serial)
    missing = {*bus, *handlers} - {*map(short, hal), *known}
    if missing:
        raise SystemExit(f"not in the call graph of {image}: {', '.join(missing)}")
    total = depth.of("main")[0] + SAVED_BY_CPU + max(depth.of(name)[0] for name in handlers)
    if depth.cycles:
        raise SystemExit(f"recursion in {image}: {depth.cycles[0]}")
    return total


def stack_room(elf):
    """Returns the size of the stack in the linker's script."""
    run = subprocess.run(["arm-none-eabi-nm", str(elf)], capture_output=True, text=True, check=True)
    return next(int(line.split()[0], 16) for line in run.stdout.splitlines() if line.endswith(" brd_link_stack_size"))


def image_sizes(build, image):
    """Returns (flash, RAM without stack, worst stack). Fails if the stack does not fit."""
    elf, used = next(Path(build).rglob(f"{image}.elf")), image_stack(build, image)
    space = stack_room(elf)
    if used > space:
        raise SystemExit(f"{image} needs {used} B of stack, sections.ld has {space} B")
    run = subprocess.run(["arm-none-eabi-size", str(elf)], capture_output=True, text=True, check=True)
    text, data, bss = map(int, run.stdout.splitlines()[1].split()[:3])
    return text + data, data + bss - space, used


def stacks_and_images(builds):
    """`builds`: those of Cortex-M0+, M3, M4."""
    rows = [
        "",
        "Worst stack of the core's functions in bytes, by call graph, without the stack of the port's HAL functions.",
        "",
        "|                 | Cortex-M0+ |  Cortex-M3 |  Cortex-M4 |",
        "|-----------------|-----------:|-----------:|-----------:|",
        "| stack of the core | " + " | ".join(f"{core_stack(build):>10}" for build in builds) + " |",
        "",
        "Images per board, in bytes: listen only, demonstration profile, gateway for a host. RAM is without the stack. The stack is the worst of "
        "main loop and interrupt; sections.ld reserves 1792 bytes, of which at least 256 stay unused in emulation.",
        "",
        "| image             |    flash   |     RAM    |    stack   |",
        "|-------------------|-----------:|-----------:|-----------:|",
    ]
    for board, (image, which, more) in BOARDS.items():
        for kind in ("listen", "demo", "gateway"):
            build = str(builds[which]).rstrip("/") + more + {"listen": ""}.get(kind, f"-{kind}")
            rows.append(f"| {f'{board} {kind}':<17} | " + " | ".join(f"{number:>10}" for number in image_sizes(build, image)) + " |")
    return rows


def compiler():
    run = subprocess.run(["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True, check=True)
    return run.stdout.strip()


def type_sizes():
    """Returns {type: bytes} on a 32-bit ARM; the compiler reports them as sizes of arrays."""
    probe = '#include "iwheel/gateway.h"\n' + "".join(f"char size_of_{name}[sizeof({name})];\n" for name in TYPES)
    command = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-I", str(ROOT / "core/include"), "-S", "-xc", "-", "-o", "-"]
    run = subprocess.run(command, input=probe, capture_output=True, text=True, check=True)
    return {name: int(size) for name, size in re.findall(r"\.size\s+size_of_(\w+), (\d+)", run.stdout)}


def render(builds):
    rows, findings, shares = uses(builds)
    modules = sorted(shares.items(), key=lambda item: (-item[1], item[0]))
    kinds = sorted(type_sizes().items(), key=lambda item: -item[1])
    lines = [
        "# Sizes",
        "",
        f"Made by `scripts/sizes.py --update` with arm-none-eabi-gcc {compiler()} -Os; `./check` compares.",
        "",
        "Code and constants in bytes that are linked for each use, without functions that are not called (`-ffunction-sections`, `--gc-sections`).",
        "The core has no data and no bss.",
        "",
        "| use                     | " + " | ".join(f"{cpu:>10}" for cpu in CPUS) + " |",
        "|-------------------------|" + "|".join("-----------:" for _ in CPUS) + "|",
    ]
    lines += [f"| {name:<23} | " + " | ".join(f"{value:>10}" for value in values) + " |" for name, values in rows]
    lines += ["", "Bytes of the gateway by module, on Cortex-M4:", "", "| module       |   bytes |", "|--------------|--------:|"]
    lines += [f"| {name:<12} | {size:>7} |" for name, size in modules]
    lines += [
        "",
        "RAM in bytes: `iw_gateway_t` has the whole state of a pair of wheels; the other types are its parts.",
        "",
        "| type              |     RAM    |",
        "|-------------------|-----------:|",
    ]
    lines += [f"| {f'`{name}`':<17} | {size:>10} |" for name, size in kinds]
    lines += stacks_and_images(builds)
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


def crowded(table):
    """The images that leave less than FREE of the memory in their board's memory.ld. `table`: {"BOARD KIND": [flash, RAM without stack, ...]}."""
    stub = ROOT / "port/stm32_stub"
    stack = int(re.search(r"brd_link_stack_size = (\d+);", (stub / "sections.ld").read_text())[1])
    for name in (name for name in table if name.split()[0] in BOARDS):
        memory = re.findall(r"(flash|ram) +\(\w+\) *:.*LENGTH = (\d+)K", (stub / "boards" / name.split()[0].lower() / "memory.ld").read_text())
        for (kind, size), used in zip(memory, (table[name][0], table[name][1] + stack), strict=True):
            free = int(size) * 1024 - used
            if free < FREE[kind]:
                yield f"{name}: {free} B of {kind} are free, demanded {FREE[kind]} B"


def main(arguments):
    if len(arguments) != 5 or arguments[1] not in ("--update", "--check"):
        sys.exit(__doc__)
    text, total, findings = render(arguments[2:])
    findings += crowded(numbers(text))
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
            findings.append("the sizes changed: find the reason, then ./check --update-sizes and commit docs/developer/sizes.md")
    print(*findings, sep="\n")
    print(f"gateway on Cortex-M4: {total} B of code are linked, allowed {USES['gateway'][2]} B")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
