# SPDX-License-Identifier: MIT
"""One simulated GPIO chip with two lines, by configfs, and a reader of edges, by the kernel's own interface."""

import fcntl
import os
import select
import struct

ROOT = "/sys/kernel/config/gpio-sim"
GET_LINE_REQUEST = struct.Struct("=64I32sQI5x15x240xIII16xi")  # struct gpio_v2_line_request
GET_LINE = (3 << 30) | (GET_LINE_REQUEST.size << 16) | (0xB4 << 8) | 0x07
INPUT, RISING, FALLING = 1 << 2, 1 << 4, 1 << 5
EVENT = struct.Struct("=QI36x")  # struct gpio_v2_line_event


def write(path, text):
    """With only three system calls, because presses are timed."""
    file = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    try:
        os.write(file, text.encode())
    finally:
        os.close(file)


def read(path):
    with open(path, encoding="ascii") as file:
        return file.read().strip()


class GpioChip:
    """The line `name` at OFFSET, `second` at SECOND, one without a name at WITNESS. `pull` is the effect of contact and resistor on a line."""

    OFFSET, SECOND, WITNESS, LINES = 4, 5, 3, 8

    def __init__(self, folder, name, second=None):
        self.folder = os.path.join(ROOT, folder)
        os.mkdir(self.folder)
        os.mkdir(f"{self.folder}/bank")
        write(f"{self.folder}/bank/num_lines", str(self.LINES))
        self.named = {self.OFFSET: name, **({self.SECOND: second} if second else {})}
        for offset, line in self.named.items():
            os.mkdir(f"{self.folder}/bank/line{offset}")
            write(f"{self.folder}/bank/line{offset}/name", line)
        self.appear()

    def appear(self):
        write(f"{self.folder}/live", "1")
        self.chip = read(f"{self.folder}/bank/chip_name")
        self.attributes = f"/sys/devices/platform/{read(f'{self.folder}/dev_name')}/{self.chip}"

    def vanish(self):
        write(f"{self.folder}/live", "0")

    def is_there(self):
        return read(f"{self.folder}/live") == "1"

    def pull(self, high, offset=OFFSET):
        write(f"{self.attributes}/sim_gpio{offset}/pull", "pull-up" if high else "pull-down")

    def level(self, offset=OFFSET):
        return read(f"{self.attributes}/sim_gpio{offset}/value") == "1"

    def remove(self):
        if self.is_there():
            self.vanish()
        for offset in self.named:
            os.rmdir(f"{self.folder}/bank/line{offset}")
        os.rmdir(f"{self.folder}/bank")
        os.rmdir(self.folder)


class Edges:
    """Holds a line and reads its edges with the kernel's stamps."""

    def __init__(self, chip, offset, flags=RISING | FALLING):
        request = GET_LINE_REQUEST.pack(offset, *[0] * 63, b"test", INPUT | flags, 0, 1, 0, 0, 0)
        device = os.open(f"/dev/{chip}", os.O_RDWR | os.O_CLOEXEC)
        answer = fcntl.ioctl(device, GET_LINE, request)
        os.close(device)
        self.line = GET_LINE_REQUEST.unpack(answer)[-1]

    def next(self, seconds):
        """(t_us, rising) of the next edge; None if none comes."""
        if not select.select([self.line], [], [], seconds)[0]:
            return None
        nanoseconds, kind = EVENT.unpack(os.read(self.line, EVENT.size))
        return nanoseconds // 1000, kind == 1

    def close(self):
        if self.line is not None:
            os.close(self.line)
            self.line = None
