# SPDX-License-Identifier: MIT
"""Sizes of the STM32 images, and the worst stack of core and images by call graph, as lines for docs/sizes.md.

The images are those of the presets arm-m3 and arm, which listen, of the build beside arm that ends in -f446, and of the builds beside
these that end in -demo and -gateway. An interrupt may come anywhere, and none interrupts another: the
worst handler and the registers that the CPU saves are on top of the main loop's deepest path. Calls through the HAL go to each of
its functions. Of an image that is optimised as one program, the graph is that of the linker's result and of the objects apart from it.
"""
import re
import subprocess
from pathlib import Path

from stack_usage import INDIRECT, Depth, add_runtime_calls, read_graph, short

# Image, which build it is in, and how that one's name goes on.
BOARDS = {"STM32F103": ("iwheel_stm32f103", 1, ""), "STM32F407": ("iwheel_stm32f407", 2, ""), "STM32F446": ("iwheel_stm32f446", 2, "-f446")}
HAL = ("brd_bxcan_send", "brd_bxcan_receive", "brd_bxcan_bus_state", "brd_bxcan_purge", "brd_estop_pressed")
HANDLERS = ("brd_systick_handler", "brd_exti0_handler", "brd_can_transmit_handler", "brd_can_receive_handler", "brd_can_error_handler")
# Of the image gateway alone; and how the functions are called that northbound's refusals reach through a table.
SERIAL_HANDLERS, THROUGH_TABLE = ("brd_serial_usart_handler", "brd_serial_receive_handler", "brd_serial_transmit_handler"), ":say_"
SAVED_BY_CPU = 36 # Eight registers and four bytes to align them.


def objects_of(build, *folders):
    return sorted(path for path in Path(build).rglob("*.c.o*") if path.suffix in (".o", ".obj")
                  and any(f"{folder}.dir" in path.parts for folder in folders))


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
    """All whose code is in the image: those that its map names, or of an archive that it names. Others are of an earlier configuration."""
    table = next(Path(build).rglob(f"{image}.map"))
    loaded = {(table.parent / name).resolve() for name in re.findall(r"^LOAD (\S+)$", table.read_text(), re.MULTILINE)}
    archives = {f"{path.stem.removeprefix('lib')}.dir" for path in loaded if path.suffix == ".a"}
    objects = objects_of(build, "iwheel_core", "iwheel_northbound", "iwheel_northbound_server", "iwheel_stm32_driver", image)
    merged = [path for path in loaded if path.name.startswith(f"{image}.elf.ltrans")]
    return [path for path in objects if (path.resolve() in loaded or archives.intersection(path.parts)) and not (merged and b".gnu.lto_" in path.read_bytes())] + merged


def image_stack(build, image):
    objects = linked_objects(build, image)
    known = read_graph(objects)[0]
    hal = [name for name in known if short(name) in HAL]
    serial = [name for name in SERIAL_HANDLERS if name in known]
    tabled = [name for name in known if THROUGH_TABLE in name and serial]
    _, depth = depth_of(objects, (*hal, *tabled))
    handlers = (*HANDLERS, *serial)
    missing = {*HAL, *HANDLERS} - {*map(short, hal), *known}
    if missing:
        raise SystemExit(f"not in the call graph of {image}: {', '.join(missing)}")
    total = depth.of("main")[0] + SAVED_BY_CPU + max(depth.of(name)[0] for name in handlers)
    if depth.cycles:
        raise SystemExit(f"recursion in {image}: {depth.cycles[0]}")
    return total


def stack_room(elf):
    """What the linker's script leaves for the stack."""
    run = subprocess.run(["arm-none-eabi-nm", str(elf)], capture_output=True, text=True, check=True)
    return next(int(line.split()[0], 16) for line in run.stdout.splitlines() if line.endswith(" brd_link_stack_size"))


def image_sizes(build, image):
    """(flash, RAM without stack, worst stack); the latter must fit."""
    elf, used = next(Path(build).rglob(f"{image}.elf")), image_stack(build, image)
    room = stack_room(elf)
    if used > room:
        raise SystemExit(f"{image} needs {used} B of stack, sections.ld has {room} B")
    run = subprocess.run(["arm-none-eabi-size", str(elf)], capture_output=True, text=True, check=True)
    text, data, bss = map(int, run.stdout.splitlines()[1].split()[:3])
    return text + data, data + bss - room, used


def lines(builds):
    """`builds`: those of Cortex-M0+, M3, M4."""
    rows = ["", "Worst stack of any of the core's functions in bytes, by call graph, without what the port's HAL functions need below it.", "",
            "|                 | Cortex-M0+ |  Cortex-M3 |  Cortex-M4 |", "|-----------------|-----------:|-----------:|-----------:|",
            "| stack of the core | " + " | ".join(f"{core_stack(build):>10}" for build in builds) + " |", "",
            "The images per board, in bytes: the one that listens, the one with the demonstration profile, and the one that a host drives. RAM is without the stack; the stack "
            "is the worst of main loop and interrupt, of the 1792 that sections.ld keeps for it; in emulation at least 256 of them stay unused.", "",
            "| image             |    flash   |     RAM    |    stack   |", "|-------------------|-----------:|-----------:|-----------:|"]
    for board, (image, which, more) in BOARDS.items():
        for kind in ("listen", "demo", "gateway"):
            build = str(builds[which]).rstrip("/") + more + {"listen": ""}.get(kind, f"-{kind}")
            rows.append(f"| {f'{board} {kind}':<17} | " + " | ".join(f"{number:>10}" for number in image_sizes(build, image)) + " |")
    return rows
