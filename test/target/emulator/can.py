# SPDX-License-Identifier: MIT
"""A bus at 1 Mbit/s with arbitration, acknowledgements and errors; the chip's controller on it; two wheels."""

import ctypes
import functools
import math
from dataclasses import dataclass, field
from random import Random

from .chip import MS, US

BIT_NS, NEVER_NS = US, 1 << 60
SENT, LOST, NO_ACKNOWLEDGEMENT, BIT_ERROR = range(4)
LEFT, RIGHT = 266, 298


class RawFrame(ctypes.Structure):
    _fields_ = [("id", ctypes.c_uint32), ("extended", ctypes.c_uint8), ("remote", ctypes.c_uint8), ("dlc", ctypes.c_uint8), ("data", ctypes.c_uint8 * 8)]


def load_model(path):
    """The models of both controllers, which have the same functions."""
    library = ctypes.CDLL(str(path))
    pointer, number, frame = ctypes.c_void_p, ctypes.c_uint32, ctypes.POINTER(RawFrame)
    for name, result, arguments in (
        ("create", pointer, [number]),
        ("reset", None, [pointer, number]),
        ("read", number, [pointer, number]),
        ("write", None, [pointer, number, number]),
        ("is_on", ctypes.c_bool, [pointer]),
        ("recessive", None, [pointer, number]),
        ("dominant", None, [pointer]),
        ("hold", None, [pointer, number, ctypes.c_bool]),
        ("offer", ctypes.c_int, [pointer, frame]),
        ("begin", None, [pointer, ctypes.c_int]),
        ("slow_aborts", None, [pointer, number]),
        ("end", None, [pointer, ctypes.c_int, ctypes.c_int]),
        ("receive", ctypes.c_bool, [pointer, frame]),
        ("receive_error", None, [pointer]),
        ("lines", number, [pointer]),
        ("violation", ctypes.c_char_p, [pointer]),
        ("overruns", number, [pointer]),
    ):
        for kind in ("bxcan", "fdcan"):
            function = getattr(library, f"{kind}_model_{name}")
            function.restype, function.argtypes = result, arguments
    return library


@functools.cache
def length_bits(identifier, data, remote_dlc):
    """Length on the bus from start of frame to the end of the interframe space, with the stuff bits of its contents."""
    dlc = len(data) if remote_dlc is None else remote_dlc
    header = [0] + [identifier >> bit & 1 for bit in range(10, -1, -1)] + [int(remote_dlc is not None), 0, 0]
    header += [dlc >> bit & 1 for bit in range(3, -1, -1)]
    body = header + [byte >> bit & 1 for byte in data for bit in range(7, -1, -1)]
    crc = 0
    for bit in body:
        crc = (crc << 1 ^ (0x4599 if bit ^ crc >> 14 & 1 else 0)) & 0x7FFF
    body += [crc >> bit & 1 for bit in range(14, -1, -1)]
    stuffed, run, last = 0, 0, None
    for bit in body:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, run, last = stuffed + 1, 1, 1 - bit
    return len(body) + stuffed + 3 + 7 + 3  # Delimiters and acknowledgement, end of frame, space.


@dataclass
class Frame:
    id: int
    data: bytes
    time_ns: int = 0
    sender: str = ""
    remote_dlc: int = None  # A remote frame with this length, and no data.

    def bits(self):
        return length_bits(self.id, self.data, self.remote_dlc)

    def setpoint(self):
        """(speed in mm/s, current in mA) of a setpoint."""
        return tuple(int.from_bytes(self.data[at : at + 2], "big", signed=True) for at in (1, 3))


class Controller:
    """The chip's bxCAN: the model of the driver's host tests, and what BTR makes of the chip's clock."""

    kind = "bxcan"

    library = None  # Set by the runner, see load_model.

    def __init__(self, machine):
        self.machine, self.model = machine, getattr(self.library, f"{self.kind}_model_create")(machine.board.banks)
        self.raw = RawFrame()
        self.raw_reference = ctypes.byref(self.raw)
        for name in (
            "read",
            "write",
            "is_on",
            "recessive",
            "dominant",
            "hold",
            "offer",
            "begin",
            "end",
            "receive",
            "receive_error",
            "lines",
            "violation",
            "overruns",
            "slow_aborts",
        ):
            setattr(self, name, functools.partial(getattr(self.library, f"{self.kind}_model_{name}"), self.model))

    def reset(self):
        getattr(self.library, f"{self.kind}_model_reset")(self.model, self.machine.board.banks)

    def address_of_read(self):
        return ctypes.cast(getattr(self.library, f"{self.kind}_model_read"), ctypes.c_void_p)

    def is_passive(self):
        return bool(self.read(0x18) & 2)  # ESR.EPVF

    def is_silent(self):
        return bool(self.read(0x1C) >> 31)  # BTR.SILM

    def timing(self):
        """(bit rate in Hz, sample point in permille), decoded from BTR and the clock tree."""
        btr = self.read(0x1C)
        before, after = (btr >> 16 & 0xF) + 1, (btr >> 20 & 7) + 1
        quanta = 1 + before + after
        return self.machine.clocks.apb1_hz() / ((btr & 0x3FF) + 1) / quanta, 1000 * (1 + before) / quanta

    def understands(self):
        """Crystal-exact 1 Mbit/s."""
        return self.machine.clocks.runs_from_crystal() and self.timing()[0] == 1_000_000

    def offered(self):
        mailbox, raw = self.offer(self.raw_reference), self.raw
        if mailbox < 0:
            return None, None
        self.machine.expect(not raw.extended and not raw.remote, "an extended or remote frame was sent")
        return mailbox, Frame(raw.id, bytes(raw.data[: raw.dlc]), sender="chip")

    def deliver(self, frame):
        remote = frame.remote_dlc is not None
        raw = RawFrame(id=frame.id, remote=remote, dlc=frame.remote_dlc if remote else len(frame.data))
        for at, byte in enumerate(frame.data):
            raw.data[at] = byte
        return self.receive(ctypes.byref(raw))


class FdController(Controller):
    """FDCAN: the same with NBTP, and the clock of its kernel."""

    kind = "fdcan"

    def timing(self):
        nbtp = self.read(0x1C)
        before, after = (nbtp >> 8 & 0xFF) + 1, (nbtp & 0x7F) + 1
        quanta = 1 + before + after
        return self.machine.clocks.can_hz() / ((nbtp >> 16 & 0x1FF) + 1) / quanta, 1000 * (1 + before) / quanta

    def is_passive(self):
        return self.read(0x40) & 0x80FF >= 0x80  # ECR: RP, or TEC of 128. A read of PSR would clear its flags.

    def is_silent(self):
        return bool(self.read(0x18) & 0x20)  # CCCR.MON


@dataclass
class Wheel:
    """One wheel: telemetry at the document's periods, speed following its setpoint, its own watchdog of 1 s."""

    side: int  # 0 left, 1 right
    phase_ns: int
    powered: bool = True
    speed_mm_s: float = 0.0
    target_mm_s: int = 0
    received_ns: int = -(10**12)
    ticks: float = 0.0
    queue: list = field(default_factory=list)
    due: dict = field(default_factory=dict)
    next_ns: int = None

    def power(self, on, now_ns):
        self.powered, self.queue, self.target_mm_s, self.speed_mm_s = on, [], 0, 0.0
        self.due = dict.fromkeys(("speed", "status", "force"), now_ns + self.phase_ns) if on else {}
        self.next_ns = now_ns + self.phase_ns if on else None

    def receive(self, frame):
        if self.powered and frame.id == (LEFT, RIGHT)[self.side]:
            self.target_mm_s, self.received_ns = frame.setpoint()[0], frame.time_ns

    def produce(self, now_ns):
        for kind, period_ms in (("speed", 4), ("status", 40), ("force", 50)):
            while kind in self.due and self.due[kind] <= now_ns:
                self.due[kind] += period_ms * MS
                self.queue.append(getattr(self, kind)(now_ns))
        self.next_ns = min(self.due.values())

    def speed(self, now_ns):
        target = self.target_mm_s if now_ns - self.received_ns < 1000 * MS else 0
        step = 8.0  # 2000 mm/s2 in 4 ms
        self.speed_mm_s += max(-step, min(step, target - self.speed_mm_s))
        self.ticks += self.speed_mm_s * 0.004 / (2 * math.pi * 0.192 * 1000 / 60)
        rpm = round(self.speed_mm_s / (2 * math.pi * 192 / 60))
        return Frame((256, 288)[self.side], rpm.to_bytes(2, "big", signed=True) + bytes(2), now_ns, f"wheel{self.side}")

    def status(self, now_ns):
        data = bytes([240, 25]) + int(self.ticks).to_bytes(4, "big", signed=True) + bytes([10])
        return Frame((257, 289)[self.side], data, now_ns, f"wheel{self.side}")

    def force(self, now_ns):
        return Frame((512, 544)[self.side], bytes([0, 100, 0, 0]), now_ns, f"wheel{self.side}")


class Bus:
    def __init__(self, machine, seed):
        chance = Random(seed)
        self.machine, self.log, self.attempts = machine, [], 0
        self.wheels = [Wheel(side, chance.randrange(4 * MS)) for side in (0, 1)]
        for wheel in self.wheels:
            wheel.power(True, 0)
        self.extra = []  # Frames of somebody else, sent once each.
        self.flood = None  # A frame that somebody sends without end.
        self.flooded = 0
        self.stuck = False  # Held dominant.
        self.stuck_in_ours = False  # ... since the middle of a frame of the chip.
        self.cut = None  # Point at which the chip is cut off: "cable" (it still receives its own frames) or "receiver" (always recessive).
        self.corrupt_chip = False  # Frames of the chip are destroyed.
        self.acknowledge_chip = True
        self.current = None  # (frame, mailbox or None, end)
        self.idle_ns = 0
        self.calm = False  # Nothing happens before the time that next_event_ns returned last.
        self.suspended_ns = 0  # Until then the chip may not begin: an error-passive node waits 8 bits after each of its frames.

    def next_event_ns(self, now_ns):
        due_ns = NEVER_NS
        for wheel in self.wheels:
            if wheel.next_ns is not None and wheel.next_ns < due_ns:
                due_ns = wheel.next_ns
        if self.current:
            self.calm = True
            return min(due_ns, self.current[2])
        if self.stuck:
            self.calm = False
            return due_ns
        self.calm = not self.machine.can_listens or self.machine.can.is_on()
        if self.is_wanted():
            due_ns = min(due_ns, max(self.idle_ns, now_ns))
        if now_ns < self.idle_ns < due_ns:
            due_ns = self.idle_ns
        if now_ns < self.suspended_ns < due_ns:
            due_ns = self.suspended_ns
        return due_ns if self.calm else min(due_ns, now_ns + 11 * BIT_NS)

    def is_wanted(self):
        """Another node than the chip has a frame to send."""
        return bool(self.extra or self.flood or self.wheels[0].queue or self.wheels[1].queue)

    def hold_dominant(self, on):
        self.stuck = on
        self.idle_ns = self.machine.now_ns
        if on:
            self.stuck_in_ours = self.current is not None and self.current[1] is not None
            self.break_off(BIT_ERROR)
            self.machine.can.dominant()

    def cut_off(self, where):
        """None: whole again."""
        self.cut = where
        self.break_off(BIT_ERROR if where == "receiver" else NO_ACKNOWLEDGEMENT)
        self.idle_ns = self.machine.now_ns

    def chip_vanishes(self):
        """The chip's controller is reset: its frame breaks off, and the others see an error."""
        if self.current and self.current[1] is not None:
            self.current = None
            self.idle_ns = self.machine.now_ns + 17 * BIT_NS

    def break_off(self, end):
        """What happens to a frame under way."""
        if self.current and self.current[1] is not None:
            self.machine.can.end(self.current[1], end)
        elif self.current and self.machine.can_listens:
            self.machine.can.receive_error()
        self.current = None

    def advance(self, now_ns):
        for wheel in self.wheels:
            if wheel.next_ns is not None and now_ns >= wheel.next_ns:
                wheel.produce(now_ns)
            if self.cut:
                wheel.queue.clear()  # They go on among themselves.
        if self.stuck:
            bits = (now_ns - self.idle_ns) // BIT_NS
            self.idle_ns += bits * BIT_NS
            if self.machine.can_listens:
                self.machine.can.hold(bits, self.stuck_in_ours)
            return
        if self.current and now_ns >= self.current[2]:
            self.finish()
        if not self.current:
            bits = (now_ns - self.idle_ns) // BIT_NS
            if bits > 0 and self.machine.can_listens and not self.machine.can.is_on():
                self.machine.can.recessive(bits)
            if bits >= 0:
                self.idle_ns += bits * BIT_NS
                self.arbitrate(now_ns)

    def arbitrate(self, now_ns):
        mailbox, frame = self.machine.can.offered() if self.machine.can_listens and now_ns >= self.suspended_ns else (None, None)
        for offer in self.offers() if self.is_wanted() else ():
            if frame is None or offer.id < frame.id:  # Of one identifier the first wins, before all others the chip.
                frame, mailbox = offer, None
        if frame is None:
            return
        if mailbox is not None:
            self.machine.can.begin(mailbox)
            self.attempts += 1
        frame.time_ns = now_ns
        self.current = (frame, mailbox, now_ns + frame.bits() * BIT_NS)

    def offers(self):
        if self.cut:
            return
        for wheel in self.wheels:
            if wheel.queue:
                yield min(wheel.queue, key=lambda frame: frame.id)
        if self.extra:
            yield self.extra[0]
        if self.flood:
            yield self.flood

    def finish(self):
        frame, mailbox, end_ns = self.current
        self.current, self.idle_ns = None, end_ns
        if mailbox is not None:
            done = self.finish_ours(frame, mailbox)
        else:
            done = self.finish_theirs(frame)
        if done:
            frame.time_ns = end_ns - 10 * BIT_NS  # Valid at the end of the frame's last-but-one bit, before the space.
            self.log.append(Frame(frame.id, frame.data, frame.time_ns, frame.sender))
            for wheel in self.wheels:
                wheel.receive(frame)
        if self.machine.can_listens and not self.machine.can.is_on():
            self.machine.can.dominant()
            self.machine.can.recessive(11)

    def finish_ours(self, frame, mailbox):
        understood = self.machine.can.understands() and not self.corrupt_chip and self.cut != "receiver"
        received = any(wheel.powered for wheel in self.wheels) and self.acknowledge_chip and not self.cut
        self.machine.can.end(mailbox, BIT_ERROR if not understood else SENT if received else NO_ACKNOWLEDGEMENT)
        if self.machine.can.is_passive():
            self.suspended_ns = self.idle_ns + 8 * BIT_NS
        return understood and received

    def finish_theirs(self, frame):
        listens = self.machine.can_listens
        if listens and not self.machine.can.understands():
            self.machine.can.receive_error()
            listens = False
        acknowledged = self.machine.can.deliver(frame) if listens else False
        others = sum(1 for wheel in self.wheels if wheel.powered and frame.sender != f"wheel{wheel.side}")
        if not acknowledged and others == 0:
            return False
        if frame.sender == "flood":
            self.flooded += 1
        elif frame in self.extra:
            self.extra.remove(frame)
        else:
            self.wheels[int(frame.sender[-1])].queue.remove(frame)
        return True

    def setpoints(self, since_ns=0, until_ns=None):
        """What the chip has put on the bus."""
        return [frame for frame in self.log if frame.sender == "chip" and frame.time_ns >= since_ns and (until_ns is None or frame.time_ns <= until_ns)]
