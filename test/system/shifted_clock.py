# SPDX-License-Identifier: MIT
"""A socket of a gateway whose clock is another one, as that of a board: it passes all lines on and shifts each `t_us` in them."""

import re
import socket
import threading


class ShiftedClock(threading.Thread):
    """`ahead_us`: the gateway's clock at `path` is ahead of the clock of the gateway at `gateway` by this time."""

    def __init__(self, path, gateway, ahead_us):
        super().__init__(daemon=True)
        self.gateway, self.ahead_us, self.server = gateway, ahead_us, socket.socket(socket.AF_UNIX)
        self.server.bind(path)
        self.server.listen(16)
        self.start()

    def run(self):
        while True:
            near, _ = self.server.accept()
            far = socket.socket(socket.AF_UNIX)
            far.connect(self.gateway)
            for pair in ((far, near, self.ahead_us), (near, far, -self.ahead_us)):
                threading.Thread(target=self.pass_on, args=pair, daemon=True).start()

    @staticmethod
    def pass_on(source, sink, shift_us):
        try:
            for line in source.makefile("rb"):
                sink.sendall(re.sub(rb'"t_us":(\d+)', lambda match: b'"t_us":%d' % (int(match[1]) + shift_us), line))
            sink.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # The other side has ended.
