# SPDX-License-Identifier: MIT
"""Row 21 on SocketCAN: a full bus. Rows 19 and 20 are those of test/system (alike.py)."""

import threading
import time

from catalogue import kernel_test


class Sender(threading.Thread):
    """Frames (id, data) of another process than the gateway, every `every` seconds, until stopped.

    They are sent with the recorder's socket, so that the recorder distinguishes them from the gateway's.
    """

    def __init__(self, bus, frames, every):
        super().__init__(daemon=True)
        self.bus, self.list, self.every = bus, frames, every
        self.quit, self.count, self.full = threading.Event(), 0, 0
        self.start()

    def run(self):
        due = time.monotonic()
        while not self.quit.is_set():
            for can_id, data in self.list:
                try:
                    self.bus.send(can_id, data)
                    self.count += 1
                except OSError:
                    self.full += 1
            due += self.every
            self.quit.wait(max(0, due - time.monotonic()))

    def stop(self):
        self.quit.set()
        self.join(3)


def babble(t, ids, every, seconds=3.0):
    rig, client, stream = t.driving()
    sender = Sender(rig.bus, [(can_id, bytes(8)) for can_id in ids], every)
    cpu, begin = rig.gateway.cpu_seconds(), time.monotonic()
    time.sleep(seconds)
    percent = 100 * (rig.gateway.cpu_seconds() - cpu) / (time.monotonic() - begin)
    sender.stop()
    refusal = stream.stop()
    t.check(refusal is None, f"the owner was refused: {refusal}")
    t.check(client.request("status")["state"] == "armed", "it drives on")
    t.figure(f"{sender.count / seconds:.0f} foreign frames/s, {percent:.0f} % CPU")
    t.stop_for(client, 0.6)
    t.judge(rig)


@kernel_test("8000 frames/s of unknown ids: invariant 4 holds", "bus", 21, pace=1)
def row21_full_bus(t):
    babble(t, (0x600, 0x601, 0x602, 0x603, 0x604, 0x605, 0x606, 0x607), 0.001)


@kernel_test("2000 frames/s of low ids: invariant 4 holds where frames are not held up", "bus", 21, pace=1)
def row21_low_ids(t):
    babble(t, (1, 2), 0.001)


@kernel_test("a flood of unknown ids in real time", "realtime", 21)
def row21_real_time(t):
    babble(t, (0x600, 0x601, 0x602, 0x603), 0.002)
