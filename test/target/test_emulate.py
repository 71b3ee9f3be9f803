# SPDX-License-Identifier: MIT
"""The output of app/demo/emulate, which needs no board: the first line, the wheels, the e-stop; and the serial port in both directions."""

import functools
import os
import re
import subprocess

import pytest
from images import ROOT, WORK

pytest.importorskip("unicorn", reason="the Python package unicorn is missing in .venv (scripts/python_packages .venv requirements/check.txt)")
pytestmark = [pytest.mark.exact, pytest.mark.limit(3000)]
SHOWN = (
    "uart  iwheel ",
    "clock 64 MHz from a crystal of 8000 kHz",
    "uart  armed; bus active; e-stop released",
    r"\d+ setpoints",
    "uart  latched by estop_line; bus active; e-stop pressed",
    "left without power",
    "unknown: 'nonsense'",
)


def emulate(board, *options):
    """With its own terminal and input."""
    command = [ROOT / "app/demo/emulate", "--build", WORK / f"emulate-{board}", board, *options]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@functools.cache
def screen():
    return emulate("stm32f103").communicate("wait 1.5\nestop\nwait 0.4\nleft off\nnonsense\nwait 1\nquit\n", timeout=3000)[0]


@pytest.mark.together("screen")
@pytest.mark.parametrize("text", SHOWN)
def test_screen_shows(text):
    assert re.search(text, screen())


def test_second_program_on_serial_port_receives_answers():
    process = emulate("stm32f407", "--image", "listen")
    name = re.search(r"/dev/\S+(?=;)", process.stdout.readline())
    terminal = os.open(name[0], os.O_RDWR | os.O_NOCTTY)
    received, again = os.read(terminal, 1), b""
    while not received.endswith(b"listening; bus active; e-stop released\r\n"):
        received += os.read(terminal, 4096)
    os.write(terminal, b"?")
    while again.count(b"\r\n") < 2:
        again += os.read(terminal, 4096)
    process.communicate("quit\n", timeout=3000)
    os.close(terminal)
    first = received.split(b"\r\n")[0]
    assert first.startswith(b"iwheel ") and again.startswith(first) and process.returncode == 0, (received, again)
