# SPDX-License-Identifier: MIT
"""One simulated GPIO chip with one line, by configfs."""

import os

ROOT = "/sys/kernel/config/gpio-sim"


def write(path, text):
    with open(path, "w", encoding="ascii") as file:
        file.write(text)


def read(path):
    with open(path, encoding="ascii") as file:
        return file.read().strip()


class GpioChip:
    """The line `line_name`, offset 4 of 8. `pull` is what the contact and its resistor do to it."""

    OFFSET = 4

    def __init__(self, name, line_name):
        self.folder = os.path.join(ROOT, name)
        self.line_name = line_name
        os.mkdir(self.folder)
        os.mkdir(f"{self.folder}/bank")
        write(f"{self.folder}/bank/num_lines", "8")
        os.mkdir(f"{self.folder}/bank/line{self.OFFSET}")
        write(f"{self.folder}/bank/line{self.OFFSET}/name", line_name)
        self.appear()

    def appear(self):
        write(f"{self.folder}/live", "1")
        self.chip = read(f"{self.folder}/bank/chip_name")
        self.attributes = f"/sys/devices/platform/{read(f'{self.folder}/dev_name')}/{self.chip}/sim_gpio{self.OFFSET}"

    def vanish(self):
        write(f"{self.folder}/live", "0")

    def pull(self, high):
        write(f"{self.attributes}/pull", "pull-up" if high else "pull-down")

    def level(self):
        return read(f"{self.attributes}/value") == "1"

    def remove(self):
        try:
            self.vanish()
        except OSError:
            pass  # not live any more
        os.rmdir(f"{self.folder}/bank/line{self.OFFSET}")
        os.rmdir(f"{self.folder}/bank")
        os.rmdir(self.folder)
