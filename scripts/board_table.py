#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Pins of the STM32 boards and the commands that flash them, written into docs/stm32.md, or compared with it.

usage: board_table.py --update|--check

The pins are asked of the compiler (boards/BOARD/board.h, board_pins.h), the address of memory.ld, the clocks of the board's header.
Exit status 77 (skipped) without a compiler. The sizes are in docs/sizes.md: scripts/sizes.py.
"""
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STM32 = ROOT / "port/stm32_stub"
PAGE = ROOT / "docs/stm32.md"
BEGIN, END = "<!-- scripts/board_table.py writes from here -->\n", "<!-- to here -->\n"
NAMES = {"stm32f103": "Blue Pill", "stm32f407": "STM32F4DISCOVERY", "stm32f446": "Nucleo-F446RE"}
PRESETS = {"stm32f103": "arm-m3", "stm32f407": "arm", "stm32f446": "arm"}
OPTIONS = {"stm32f446": " -DIWHEEL_BOARD=stm32f446 -DIWHEEL_CLOCK_INPUT=ON"} # What the board named above needs.
OPENOCD = {"stm32f103": "stm32f1x", "stm32f407": "stm32f4x", "stm32f446": "stm32f4x"}
CHIPS = {"stm32f103": "STM32F103C8", "stm32f407": "STM32F407VGTx", "stm32f446": "STM32F446RETx"}
PINS = {"e-stop": "BRD_ESTOP", "button": "BRD_BUTTON", "lamp": "BRD_LAMP", "CAN receive": "BRD_CAN_RX",
        "CAN transmit": "BRD_CAN_TX", "serial, from the chip": "BRD_UART_TX", "serial, to the chip": "BRD_UART_RX"}
NUMBERS = {"core": "BRD_CORE_HZ / 1000000U", "apb1": "BRD_APB1_HZ / 1000000U", "lit": "BRD_LAMP_LIT"}


def facts(board, *options):
    """{name: number} of everything in PINS and NUMBERS."""
    values = {**PINS, **NUMBERS}
    program = '#include <stdint.h>\n#include <stdio.h>\n#include "board.h"\nint main(void) {\n'
    program += "".join(f'    printf("%u\\n", (unsigned)({value}));\n' for value in values.values()) + "}\n"
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["gcc", "-xc", "-", "-o", f"{folder}/probe", *options, f"-I{STM32}", f"-I{STM32 / 'boards' / board}"], input=program,
                       text=True, check=True)
        told = subprocess.run([f"{folder}/probe"], capture_output=True, text=True, check=True).stdout
    return dict(zip(values, map(int, told.split()), strict=True))


def pin(number):
    return f"P{chr(ord('A') + number // 16)}{number % 16}"


def image(board):
    """Where the build puts it, without its ending."""
    return f"build/{PRESETS[board]}/port/stm32_stub/iwheel_{board}"


def address(board):
    return re.search(r"flash.*ORIGIN = (0x[0-9A-F]+)", (STM32 / f"boards/{board}/memory.ld").read_text())[1]


def pin_table():
    known = {board: facts(board) for board in NAMES}
    other = facts("stm32f103", "-DIW_BOARD_CAN_ON_PA11=1")
    yield "| | " + " | ".join(f"{board}, {name}" for board, name in NAMES.items()) + " |"
    yield "|---|" + "---|" * len(NAMES)
    for what in PINS:
        cells = [pin(known[board][what]) for board in NAMES]
        if what == "lamp":
            cells = [f"{cell}, lit by {'a high' if known[board]['lit'] else 'a low'} level" for cell, board in zip(cells, NAMES, strict=True)]
        if what.startswith("CAN"):
            cells = [f"{cell}; {pin(other[what])} with `IWHEEL_CAN_PINS=PA11`" for cell in cells]
        yield f"| {what} | " + " | ".join(cells) + " |"
    yield "| core, APB1 | " + " | ".join(f"{known[board]['core']}, {known[board]['apb1']} MHz" for board in NAMES) + " |"


def flash_lines(board):
    where = image(board)
    yield f"**{NAMES[board]}** ({board}):"
    yield ""
    yield f"    cmake --preset {PRESETS[board]}{OPTIONS.get(board, '')} && cmake --build --preset {PRESETS[board]}"
    yield f"    openocd -f interface/stlink.cfg -f target/{OPENOCD[board]}.cfg -c \"program {where}.elf verify reset exit\""
    yield f"    st-flash --reset write {where}.bin {address(board)}"
    yield f"    probe-rs download --chip {CHIPS[board]} {where}.elf && probe-rs reset --chip {CHIPS[board]}"
    yield f"    STM32_Programmer_CLI -c port=SWD --download {where}.hex -v -rst"
    yield ""


def render():
    lines = [*pin_table(), "", "Flash one of these ways (each line alone):", ""]
    for board in NAMES:
        lines += flash_lines(board)
    return "\n".join(lines)


def main(arguments):
    if len(arguments) != 2 or arguments[1] not in ("--update", "--check"):
        sys.exit(__doc__)
    if shutil.which("gcc") is None:
        print("skip: gcc is missing")
        return 77
    before, _, rest = PAGE.read_text().partition(BEGIN)
    _, found, after = rest.partition(END)
    if not found:
        sys.exit(f"{PAGE.relative_to(ROOT)}: the two lines around the table are missing: {BEGIN.strip()} and {END.strip()}")
    text = before + BEGIN + render() + END + after
    if arguments[1] == "--update":
        PAGE.write_text(text)
    elif text != PAGE.read_text():
        print("docs/stm32.md is not true of the boards any more: look at the reason, then scripts/board_table.py --update")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
