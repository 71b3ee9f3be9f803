# SPDX-License-Identifier: MIT
"""The tables of pins in docs/user/stm32.md and board.md, and the addresses and names of the commands that flash, are those of the boards. The table of
the LED is that of lamp.h.

The compiler returns the pins (boards/BOARD/board.h, board_pins.h), the address of memory.ld. A wrong row is printed in its correct form.
"""

import re
import subprocess
import tempfile

import pytest
from images import ROOT, STM32

PAGE = ROOT / "docs/user/stm32.md"
STEPS, STEPS_BOARDS = ROOT / "docs/user/board.md", ("stm32f446", "stm32f103", "stm32g474")
LAMP = STM32 / "lamp.h"
PRESETS = {"stm32f103": "arm-m3", "stm32f407": "arm", "stm32f446": "arm", "stm32g474": "arm"}
PINS = {
    "e-stop": "BRD_ESTOP",
    "button": "BRD_BUTTON",
    "lamp": "BRD_LAMP",
    "CAN receive": "BRD_CAN_RX",
    "CAN transmit": "BRD_CAN_TX",
    "serial, from the chip": "BRD_UART_TX",
    "serial, to the chip": "BRD_UART_RX",
}
NUMBERS = {"core": "BRD_CORE_HZ / 1000000U", "apb1": "BRD_APB1_HZ / 1000000U", "lit": "BRD_LAMP_LIT"}


def facts(board, *options):
    """{name: number} of everything in PINS and NUMBERS."""
    values = {**PINS, **NUMBERS}
    program = '#include <stdint.h>\n#include <stdio.h>\n#include "board.h"\nint main(void) {\n'
    program += "".join(f'    printf("%u\\n", (unsigned)({value}));\n' for value in values.values()) + "}\n"
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            ["gcc", "-xc", "-", "-o", f"{folder}/probe", *options, f"-I{STM32}", f"-I{STM32 / 'boards' / board}"], input=program, text=True, check=True
        )
        printed = subprocess.run([f"{folder}/probe"], capture_output=True, text=True, check=True).stdout
    return dict(zip(values, map(int, printed.split()), strict=True))


def pin(number):
    return f"P{chr(ord('A') + number // 16)}{number % 16}"


def rows():
    known = {board: facts(board) for board in PRESETS}
    other = facts("stm32f103", "-DBRD_CAN_ON_PA11=1")
    for what in PINS:
        cells = [pin(known[board][what]) for board in PRESETS]
        if what == "lamp":
            cells = [f"{cell}, lit by {'a high' if known[board]['lit'] else 'a low'} level" for cell, board in zip(cells, PRESETS, strict=True)]
        if what.startswith("CAN"):
            cells = [cell if cell == pin(other[what]) else f"{cell}; {pin(other[what])} with `IWHEEL_CAN_PINS=PA11`" for cell in cells]
        yield f"| {what} | " + " | ".join(cells) + " |"
    yield "| core, APB1 | " + " | ".join(f"{known[board]['core']}, {known[board]['apb1']} MHz" for board in PRESETS) + " |"


def files(boards):
    for board in boards:
        preset = PRESETS[board]
        image = f"build/{preset}/port/stm32_stub/iwheel_{board}"
        address = re.search(r"flash.*ORIGIN = (0x[0-9A-F]+)", (STM32 / f"boards/{board}/memory.ld").read_text())[1]
        yield from (f"{image}.bin {address}\n", f"cmake --preset {preset}")


def commands():
    yield from files(PRESETS)
    for board, preset in PRESETS.items():
        image = f"build/{preset}/port/stm32_stub/iwheel_{board}"
        yield from (f"program {image}.elf verify", f"--download {image}.hex ")


def steps():
    """Beginnings of the rows of board.md, and its commands."""
    known = {board: facts(board) for board in STEPS_BOARDS}
    usb = dict.fromkeys(STEPS_BOARDS, " (in the USB plug)") | {"stm32f103": ""}
    for what in ("CAN receive", "CAN transmit", "e-stop", "serial, from the chip", "serial, to the chip"):
        yield f"| {what} | " + " | ".join(pin(known[board][what]) + (usb[board] if "serial" in what else "") for board in STEPS_BOARDS) + " | "
    yield from (f"| {lamp} | {state} | " for lamp, state in re.findall(r"^/// \| (\S.*?) +\| (\S.*?) +\|$", LAMP.read_text(), re.MULTILINE)[1:])
    yield from files(STEPS_BOARDS)


@pytest.mark.exact
def test_page_has_the_boards_pins_and_files():
    page = PAGE.read_text()
    assert [text for text in (*rows(), *commands()) if text not in page] == []


@pytest.mark.exact
def test_steps_have_the_boards_pins_files_and_lamp():
    page = STEPS.read_text()
    assert [text for text in steps() if text not in page] == []
