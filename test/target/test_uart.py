# SPDX-License-Identifier: MIT
"""The image's UART code on QEMU's STM32F405, whose USART2 is on a pseudo terminal: arm/uart.c lists the tested parts.

Proves, on a model of the chip that is not ours: base and offsets of the registers, the bits that switch transmitter and receiver on, status
flags and data register in both directions, and the order in which serial.c sends what is written and what is lent. Does not: the DMA's
channels, the pause on the line and line errors, which that model has not, nor the baud rate, which it accepts without using it.
"""

import os
import random
import re
import select
import shutil
import subprocess
import time
import tty

import pytest
from images import ROOT, STM32, must

PATIENCE_S = 300  # It may get little of the processor.
CPU = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=soft", "-O2", "-std=gnu11", "-ffunction-sections", "-fno-tree-loop-distribute-patterns"]
FOLDERS = [f"-I{folder}" for folder in (ROOT / "core/include", STM32, STM32 / "boards/stm32f407")]
SOURCES = [*(ROOT / "test/target/arm" / name for name in ("uart.c", "semihost.c")), *(STM32 / name for name in ("serial.c", "console.c", "cortex_m.c"))]
LINKED = ["--specs=rdimon.specs", "-nostartfiles", "-Wl,--gc-sections", f"-T{ROOT / 'test/target/arm/semihost.ld'}"]
QEMU = "qemu-system-arm -M netduinoplus2 -nographic -monitor none -serial null -serial pty -S -qmp stdio -semihosting-config enable=on,target=native -kernel"


class Line:
    """The pseudo terminal."""

    def __init__(self, path):
        self.terminal, self.heard = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), b""
        tty.setraw(self.terminal)

    def say(self, text):
        os.write(self.terminal, text)

    def receive(self, wanted):
        """True if exactly this text arrives next; false if another text arrives, or the machine has ended."""
        end = time.monotonic() + PATIENCE_S
        while len(self.heard) < len(wanted) and time.monotonic() < end:
            if select.select([self.terminal], [], [], 0.1)[0]:
                read = os.read(self.terminal, 65536)
                if not read:
                    break
                self.heard += read
        said, self.heard = self.heard[: len(wanted)], self.heard[len(wanted) :]
        return said == wanted


@pytest.mark.exact
@pytest.mark.limit(3000)
@pytest.mark.skipif(shutil.which("qemu-system-arm") is None, reason="qemu-system-arm is missing (scripts/install_tools check brings it)")
def test_uart(tmp_path, record_property):
    record_property("tests", 4)
    must(["arm-none-eabi-gcc", *CPU, "-Wall", "-Wextra", "-Werror", *FOLDERS, *LINKED, *SOURCES, "-o", tmp_path / "uart.elf"])
    command, chance = [*QEMU.split(), tmp_path / "uart.elf"], random.Random(1)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as machine:
        try:
            line = Line(next(found[1] for found in (re.search(r"(/dev/pts/\d+)", line) for line in machine.stdout) if found))
            machine.stdin.write('{"execute":"qmp_capabilities"}\n{"execute":"cont"}\n')
            machine.stdin.flush()
            assert line.receive(b"console 115200\n"), "console.c: what is written comes out of USART2"
            line.say(b"x")
            assert line.receive(b"serial\n"), "console.c: a character that is typed is noticed; serial.c restarts and sends"
            texts = [bytes(chance.choice(b"0123456789abcdef*{}") for _ in range(length)) + b"\n" for length in (1, 40, 127, 500, 511, 3, 512, 380)]
            for text in texts * 3:
                line.say(text)
                assert line.receive(text + text), "serial.c: every line comes back, from the ring and from a lent buffer, several times round both rings"
            line.say(b"end\n")
            assert line.receive(b"end\nend\n"), "serial.c: idle when all is on the wire"
            line.say(b"\n")
            assert machine.wait(PATIENCE_S) == 0, "serial.c: no error was seen"
        finally:
            machine.kill()
