# SPDX-License-Identifier: MIT
"""A person at a terminal: reads what a program writes on a pty, and types when asked."""

import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import time

SERVICE_NICE = -10


def sit_down():
    """The terminal is this process's own; and what drives wheels does not wait for the rest of this machine."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, SERVICE_NICE)


class Operator:
    """Starts a program on a terminal of its own. `expect` waits for a text after all that was expected before."""

    def __init__(self, command, environment, columns=80, rows=24):
        self.parent, child = pty.openpty()
        fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self.process = subprocess.Popen(command, stdin=child, stdout=child, stderr=child, env=environment, start_new_session=True, preexec_fn=sit_down)
        os.close(child)
        self.text, self.raw = "", b""
        self.seen = 0

    def pump(self, seconds):
        """Reads what is there; False, after that time, once the program's end of the terminal is closed."""
        if not select.select([self.parent], [], [], seconds)[0]:
            return True
        try:
            data = os.read(self.parent, 65536)
        except OSError:
            time.sleep(seconds)  # Callers that continue must wait: in virtual time no time passes while they compute.
            return False
        self.raw += data
        self.text += data.decode(errors="replace").replace("\r\n", "\n")
        return bool(data)

    def expect(self, text, seconds=20.0):
        """Returns the output between the previous text and `text`; raises if `text` does not arrive."""
        end = time.monotonic() + seconds
        words = re.compile(re.escape(text).replace(r"\ ", r"[ \n]"))  # A paragraph may be broken anywhere.
        while True:
            found = words.search(self.text, self.seen)
            if found:
                before = self.text[self.seen : found.start()]
                self.seen = found.end()
                return before
            if not self.pump(0.05) or time.monotonic() > end:
                raise AssertionError(f"{text!r} did not come; after the last text came:\n{self.text[self.seen :]}\n--- all of it:\n{self.text[-3000:]}")

    def resize(self, columns, rows):
        fcntl.ioctl(self.parent, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def type(self, text):
        os.write(self.parent, text.encode())

    def answer(self, question, line):
        """Waits for the question and its default in brackets, then types the line."""
        before = self.expect(question)
        self.expect("] ")
        time.sleep(0.02)
        self.type(line + "\n")
        return before

    def wait(self, seconds=10.0):
        end = time.monotonic() + seconds
        while self.process.poll() is None and time.monotonic() < end:
            self.pump(0.05)
        while self.pump(0.05) and select.select([self.parent], [], [], 0.05)[0]:
            pass
        return self.process.poll()

    def close(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait(5)
        if self.parent >= 0:
            os.close(self.parent)
        self.parent = -1
