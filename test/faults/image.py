# SPDX-License-Identifier: MIT
"""The image of a board with one file changed, and one scenario of the emulated board."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from table import ROOT, Broken

TARGET, PORT, APPLICATION, SERVER = (ROOT / name for name in ("test/target", "port/stm32_stub", "app/board", "lib/northbound/server/src"))
CPUS = {"f1": "cortex-m3", "f4": "cortex-m4", "g4": "cortex-m4"}
OF_ANOTHER = {"pins_g4.c": "pins_f4.c", "serial_dma_g4.c": "serial_dma_f1.c"}  # A family has these files in common with another one.
IMAGE_FILES = (
    "bxcan.c",
    "bxcan_filters.c",
    "can_bxcan.c",
    "can_groups.c",
    "board_clock.c",
    "board_clock_f1.c",
    "cortex_m.c",
    "estop.c",
    "fault.c",
    "frame_ring.c",
    "lamp.c",
    "main.c",
    "marker.c",
    "pins_f1.c",
    "small.c",
    "startup.c",
    "watchdog.c",
)
ALONE_FILES = ("commander.c", "console.c", "report.c")
GATEWAY_FILES = (
    *(path.name for path in sorted(SERVER.glob("*.c"))),
    "board_answers.c",
    "boot.c",
    "configure.c",
    "confirm.c",
    "flash_f1.c",
    "host.c",
    "host_send.c",
    "board_records.c",
    "board_assumptions.c",
    "pending.c",
    "serial.c",
    "serial_dma_f1.c",
    "board_settings.c",
    "store.c",
    "board_events.c",
)


def run(command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)


def must(command):
    done = run(command)
    if done.returncode != 0:
        raise Broken(f"does not build: {done.stderr[-1500:]}")


def name_for(family, name):
    """The file of that family in the place of one of STM32F103."""
    name = name.replace("_f1.", f"_{family}.")
    name = OF_ANOTHER.get(name, name)
    return name.replace("bxcan", "fdcan") if family == "g4" else name


def judge(work, applied, folder, image, scenario):
    """The finding of the scenario, or None. `work`: the folder that test/target has built; `image`: KIND or BOARD/KIND."""
    work = Path(work).resolve()
    board, _, image = f"stm32f103/{image}".rpartition("/")
    board = board.rpartition("/")[2]
    family = board[5:7]
    shutil.copytree(PORT, folder)
    for place in (APPLICATION, SERVER):
        shutil.copytree(place, folder, dirs_exist_ok=True)
    base = next(place for place in (PORT, APPLICATION, SERVER) if (ROOT / applied.file).is_relative_to(place))
    (folder / (ROOT / applied.file).relative_to(base)).write_text(applied.text)
    flags = [
        "arm-none-eabi-gcc",
        f"-mcpu={CPUS[family]}",
        "-mthumb",
        "-mfloat-abi=soft",
        "-Os",
        "-std=gnu11",
        "-w",
        "-ffunction-sections",
        "-DNDEBUG",
        "-fdata-sections",
        "-fno-tree-loop-distribute-patterns",
        f"-I{folder}",
        f"-I{folder / 'access'}",
        f"-I{folder / 'boards' / board}",
        f"-I{ROOT / 'core/include'}",
        f"-I{ROOT / 'lib/northbound/protocol/include'}",
        f"-I{ROOT / 'lib/northbound/server/include'}",
        f"-DIWHEEL_SETPOINT_TYPE_IS_SET={'false' if image == 'listen' else 'true'}",
        "-DIWHEEL_SETPOINT_TYPE_VALUE=1",
        '-DIWHEEL_VERSION="0.0.0"',
        *(["-DBRD_FLASH_PAGE_WORDS=4096U"] if family == "f4" else []),
        "-DIWHEEL_TRACK_MM_VALUE=540",
        f"-DIWHEEL_CURRENT_ROLE_VALUE={'IW_ROLE_UNSET' if image == 'listen' else 'IW_ROLE_LIMIT'}",
    ]
    source = {"listen": "none"}.get(image, image)
    (folder / "images").mkdir()
    talk = GATEWAY_FILES if image == "gateway" else ALONE_FILES
    libraries = [work / board / name for name in ("lib/northbound/protocol/libiwheel_northbound.a", "core/libiwheel_core.a")]
    must(
        [
            *flags,
            *(folder / name_for(family, name) for name in (*IMAGE_FILES, *talk, f"commander_{source}.c")),
            *libraries,
            "--specs=nano.specs",
            "-nostartfiles",
            f"-L{folder}",
            f"-T{folder / 'boards' / board / 'memory.ld'}",
            "-Wl,--gc-sections",
            "-o",
            folder / f"images/{board}-{image}.elf",
        ]
    )
    done = run([sys.executable, TARGET / "emulate.py", work / "libmodel.so", folder / f"images/{board}-{image}.elf", scenario])
    found = re.search(r"FAIL: (.*)", done.stdout)
    if done.stdout != "ok\n" and not found:
        raise Broken(f"the scenario cannot be judged: {(done.stdout + done.stderr)[-1500:]}")
    return found and found[1]
