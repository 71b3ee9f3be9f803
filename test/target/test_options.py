# SPDX-License-Identifier: MIT
"""Clocks and crystals that allow exactly 1 Mbit/s at 62.5 % compile; for the others the message of the compiler names those that do.
=== Wrong build
options are refused with a reason. The code of docs/developer/porting.md compiles and runs.
"""

import re

import pytest
from images import CPUS, HERE, ROOT, STM32, configure, must, run

pytestmark = [pytest.mark.exact, pytest.mark.limit(3000)]
CLOCKS_THAT_CAN = (8, 16, 24, 32, 40, 48)
CLOCKS_OF_FDCAN = (8, 16, 24, 32, 40, 48, 64, 80, 120, 160)
CLOCKS_THAT_CANNOT = (1, 12, 20, 28, 30, 36, 42, 45, 50, 54)
CRYSTALS_THAT_CAN = {
    "stm32f103": (4, 6, 8, 12, 16),
    "stm32f407": (*range(4, 27), 12.5, 19.2),
    "stm32f446": (8, 12, 16, 24, 25, 26),
    "stm32g474": (4, 5, 8, 10, 12, 16, 20, 24, 25, 45, 48),
}
CRYSTALS_THAT_CANNOT = {
    "stm32f103": (3, 5, 7, 9, 10, 11, 13, 14, 15, 20, 25),
    "stm32f407": (3, 27, 11.0592, 14.7456, 24.576),
    "stm32f446": (2, 32),
    "stm32g474": (2, 6, 9, 26, 52),
}
REFUSALS = {  # Options, and the text that the message must contain.
    "-DIWHEEL_SETPOINT_TYPE=256 -DIWHEEL_CURRENT_ROLE=limit": "number from 0 to 255",
    "-DIWHEEL_SETPOINT_TYPE=one -DIWHEEL_CURRENT_ROLE=limit": "number from 0 to 255",
    "-DIWHEEL_SETPOINT_TYPE=1 -DIWHEEL_CURRENT_ROLE=torque": "must be limit or setpoint",
    "-DIWHEEL_SETPOINT_TYPE=1": "Set both",
    "-DIWHEEL_CURRENT_ROLE=limit": "Set both",
    "-DIWHEEL_SETPOINT_TYPE=1 -DIWHEEL_CURRENT_ROLE=limit": "Set IWHEEL_TRACK_MM too",
    "-DIWHEEL_GATEWAY=ON -DIWHEEL_TRACK_MM=199": "number from 200 to 1500",
    "-DIWHEEL_GATEWAY=ON -DIWHEEL_TRACK_MM=1501": "number from 200 to 1500",
    "-DIWHEEL_DEMO=ON": "IWHEEL_DEMO needs",
    "-DIWHEEL_CRYSTAL_HZ=25MHz": "must be a number of Hz, for instance 25000000",
    "-DIWHEEL_CAN_PINS=PD0": "it must be PB8 (receive PB8, transmit PB9) or PA11",
    "-DIWHEEL_GATEWAY=ON -DIWHEEL_BAUD=1M": "it must be a number from 115200 to 2000000",
    "-DIWHEEL_GATEWAY=ON -DIWHEEL_DEMO=ON -DIWHEEL_SETPOINT_TYPE=1 -DIWHEEL_CURRENT_ROLE=limit": "IWHEEL_GATEWAY or IWHEEL_DEMO, not both",
    "-DIWHEEL_BOARD=stm32f999": "must be one of: stm32f103;stm32f407;stm32f446;stm32g474",
    "-DIWHEEL_BOARD=stm32f407": "has no cortex-m3",
    "-DIWHEEL_SETPOINT_TYPE=1 -DIWHEEL_CURRENT_ROLE=setpoint -DIWHEEL_DEMO=ON": "IWHEEL_DEMO needs",
}
PAGE = re.findall(r"^```c\n(?:// (\w+\.[ch])\n)?(.*?)^```", (ROOT / "docs/developer/porting.md").read_text(), re.MULTILINE | re.DOTALL)


def compile_probe(clock_mhz, out, board="stm32f103"):
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{ROOT / 'core/include'}", f"-I{STM32}", f"-I{STM32 / 'boards' / board}"]
    return run(["gcc", *flags, f"-DBRD_APB1_HZ={clock_mhz}000000U", HERE / "timing_probe.c", ROOT / "core/src/bit_timing.c", "-o", out])


@pytest.mark.parametrize("mhz", CLOCKS_THAT_CAN)
def test_bus_clock_leads_to_the_exact_bit_rate(mhz, tmp_path):
    done = compile_probe(mhz, tmp_path / "probe")
    assert done.returncode == 0, done.stderr
    must([tmp_path / "probe"])


@pytest.mark.parametrize("mhz", CLOCKS_OF_FDCAN)
def test_clock_of_fdcan_gives_the_bus_exactly(mhz, tmp_path):
    done = compile_probe(mhz, tmp_path / "probe", "stm32g474")
    assert done.returncode == 0, done.stderr
    must([tmp_path / "probe"])


@pytest.mark.parametrize("mhz", CLOCKS_THAT_CANNOT)
def test_bus_clock_does_not_compile_and_the_message_helps(mhz, tmp_path):
    done = compile_probe(mhz, tmp_path / "probe")
    assert done.returncode != 0 and "multiple of 8 MHz (8, 16, 24, 32, 40 or 48 MHz can" in done.stderr


def check_source(board, source, *options):
    """Checks a file of the board with the compiler, without output."""
    flags = [f"-mcpu={CPUS[board]}", "-mthumb", "-std=c11", "-fsyntax-only", *options]
    folders = [ROOT / "core/include", STM32, STM32 / "access", STM32 / "boards" / board]
    return run(["arm-none-eabi-gcc", *flags, *(f"-I{folder}" for folder in folders), STM32 / source])


def clock_tree(board, mhz):
    warnings = ["-Wall", "-Wextra", "-Werror", "-include", "bit_rate.h"]
    return check_source(board, f"board_clock_{board[5:7]}.c", *warnings, f"-DBRD_CRYSTAL_HZ={round(mhz * 10**6)}U")


@pytest.mark.parametrize(("board", "mhz"), [(board, mhz) for board, several in CRYSTALS_THAT_CAN.items() for mhz in several])
def test_crystal_compiles(board, mhz):
    done = clock_tree(board, mhz)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("board", "mhz"), [(board, mhz) for board, several in CRYSTALS_THAT_CANNOT.items() for mhz in several])
def test_crystal_without_exact_bus_rate_does_not_compile(board, mhz):
    done = clock_tree(board, mhz)
    assert done.returncode != 0 and "this crystal cannot produce the bit rate exactly" in done.stderr


@pytest.mark.parametrize(("board", "mhz"), [("stm32f103", 36), ("stm32f407", 42), ("stm32f446", 45), ("stm32g474", 170)])
def test_image_does_not_compile_with_the_usual_bus_clock(board, mhz):
    options = {"SETPOINT_TYPE_VALUE": "0", "SETPOINT_TYPE_IS_SET": "false", "CURRENT_ROLE_VALUE": "IW_ROLE_UNSET", "TRACK_MM_VALUE": "0"}
    source = "can_fdcan.c" if board == "stm32g474" else "can_bxcan.c"
    done = check_source(board, source, f"-DBRD_APB1_HZ={mhz}000000U", *(f"-DIWHEEL_{name}={value}" for name, value in options.items()))
    assert done.returncode != 0 and f"{mhz}" in done.stderr and "multiple of 8 MHz" in done.stderr


@pytest.mark.parametrize(("board", "warned"), [("stm32f103", True), ("stm32f407", True), ("stm32f446", False), ("stm32g474", False)])
def test_whose_pins_are_the_usb_sockets_is_warned(board, warned, tmp_path):
    done = configure(tmp_path, CPUS[board], [f"-DIWHEEL_BOARD={board}", "-DIWHEEL_CAN_PINS=PA11"])
    assert done.returncode == 0 and ("PA11 and PA12 are the USB socket's" in " ".join(done.stderr.split())) == warned, done.stderr


@pytest.mark.parametrize("options", [*REFUSALS])
def test_refused(options, tmp_path):
    done = configure(tmp_path, "cortex-m3", options.split())
    assert done.returncode != 0 and REFUSALS[options] in " ".join(done.stderr.split()), done.stderr


@pytest.fixture
def port(tmp_path):
    """The compilation of a port for a fictitious controller, whose author has read only docs/developer/porting.md."""
    for name, text in PAGE:
        (tmp_path / (name or "without_a_name.c")).write_text(text)
    return ["gcc", "-Wall", "-Wextra", "-Wpedantic", "-Wmissing-prototypes", "-Werror", f"-I{ROOT / 'core/include'}", f"-I{tmp_path}"]


@pytest.mark.parametrize("name", [name or "without_a_name.c" for name, _ in PAGE])
def test_file_of_the_page_is_complete(port, name, tmp_path):
    must([*port, "-std=c99", "-fsyntax-only", "-xc", tmp_path / name])


def test_code_of_the_page_drives_a_fictitious_controller(port, tmp_path):
    must([*port, "-std=c11", HERE / "fictitious_port.c", *tmp_path.glob("*.c"), *(ROOT / "core/src").glob("*.c"), "-o", tmp_path / "port"])
    must([tmp_path / "port"])
