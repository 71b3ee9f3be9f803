# SPDX-License-Identifier: MIT
"""The host's end of the serial line, for the scenarios of the image `gateway`: a relay that sends the given lines, valid or not."""

import json
import zlib

from emulator.chip import MS

BAUD = 1_000_000


def framed(text):
    """Bytes of a line with its CRC, and without its newline."""
    return text + b"*%08x" % zlib.crc32(text)


def compact(message):
    return json.dumps(message, separators=(",", ":")).encode()


class Line:
    """A line that the board wrote."""

    def __init__(self, text):
        body, star, crc = text.rpartition(b"*")
        assert star and crc == b"%08x" % zlib.crc32(body), f"the board wrote a line whose CRC is wrong: {text[-80:]}"
        channel, stamp, self.json = body.split(b" ", 2)
        self.channel, self.t_us, self.message = int(channel), int(stamp), json.loads(self.json)


class Host:
    """`rig` continues to run while a reply is awaited. `lines` contains all lines of the board; channel 0 is the relay's own."""

    def __init__(self, rig, alive=True):
        self.rig, self.machine, self.uart = rig, rig.machine, rig.machine.uart
        self.lines, self.rest, self.seq, self.number, self.alive_ns = [], b"", {}, 0, None
        self.t_us, self.boot, self.line_bytes = 0, None, None
        if alive:
            self.stay_alive()

    def stay_alive(self):
        """`alive` every 100 ms from now on, until `alive_ns` is None."""
        self.alive_ns = self.machine.now_ns

        def tick():
            if self.alive_ns is not None:
                self.say(0, {"cmd": "alive"})
                self.machine.at(self.machine.now_ns + 100 * MS, tick)

        tick()

    def fall_silent(self):
        self.alive_ns = None

    def raw(self, line):
        self.uart.send(line)

    def say(self, channel, message):
        """Sends one valid line."""
        body = message if isinstance(message, bytes) else compact(message)
        self.raw(framed(b"%d " % channel + body) + b"\n")

    def listen(self):
        """The lines of the board since the last call."""
        new, self.rest = self.rest + bytes(self.uart.sent), b""
        self.uart.sent.clear()
        *texts, self.rest = new.split(b"\n")
        fresh = [Line(text) for text in texts]
        for line in fresh:
            self.t_us = max(self.t_us, line.t_us)
            if line.message.get("event") == "link":
                self.boot, self.line_bytes = line.message["boot"], line.message["line_bytes"]
        self.lines += fresh
        return fresh

    def wait(self, wanted, within_ms=200):
        """The first line from now on for which `wanted` is true."""
        begin = len(self.lines)
        for _ in range(within_ms + 1):
            self.listen()
            for line in self.lines[begin:]:
                if wanted(line):
                    return line
            self.rig.run(MS)
        raise AssertionError(f"no such line within {within_ms} ms; the last: {[line.json[:200] for line in self.lines[-3:]]}")

    def ask(self, channel, message, within_ms=200):
        """The reply to a request."""
        self.number += 1
        number = self.number
        self.say(channel, {**message, "id": number})
        return self.wait(lambda line: line.channel == channel and line.message.get("id") == number, within_ms).message

    def open(self, channel=1, watch=False):
        self.say(0, {"cmd": "open", "channel": channel, "watch": watch})
        hello = self.wait(lambda line: line.channel == channel and line.message.get("event") == "hello").message
        self.seq[channel] = 0
        return hello

    def begin(self, channel=1):
        """A relay that connects to a board whose wheels are both at standstill."""
        self.rig.run(600 * MS)
        self.say(0, {"cmd": "link"})
        self.wait(lambda line: line.channel == 0 and line.message.get("event") == "link")
        return self.open(channel)

    def begin_again(self, channel=1):
        """After a start of the board: drops a line that was cut, and everything received before."""
        self.rest = b""
        self.uart.sent.clear()
        self.uart.typed.clear()
        self.stay_alive()
        self.t_us = 0
        return self.begin(channel)

    def power_cycle(self):
        self.machine.lose_power()
        self.begin_again()

    def quoted(self, channel, message, t_us=None, boot=None, seq=None):
        """The request with a quote, as the relay writes it."""
        self.listen()
        if seq is None:
            self.seq[channel] = seq = self.seq.get(channel, 0) + 1
        quote = compact({"boot": boot or self.boot, "seq": seq, "t_us": self.t_us if t_us is None else t_us})
        return quote[:-1] + b"," + compact(message)[1:]

    def drive_line(self, speed_mm_s, **fields):
        """A line of channel 1 that may be sent later, more than once or changed."""
        return framed(b"1 " + self.quoted(1, {"cmd": "drive", "left_mm_s": speed_mm_s, "right_mm_s": speed_mm_s, **fields})) + b"\n"

    def drive(self, speed_mm_s, channel=1, wait=True, **quote):
        self.number += 1
        number = self.number
        body = {"cmd": "drive", "left_mm_s": speed_mm_s, "right_mm_s": speed_mm_s, "id": number}
        self.say(channel, self.quoted(channel, body, **quote))
        return self.wait(lambda line: line.channel == channel and line.message.get("id") == number).message if wait else None

    def arm(self, channel=1, **fields):
        reply = self.ask(channel, {"cmd": "arm", "name": f"client of channel {channel}", **fields})
        assert reply["ok"], reply
        return reply

    def keep_driving(self, speed_mm_s, span_ms, channel=1, period_ms=20):
        """Drives for that time, without waiting for the replies."""
        for _ in range(span_ms // period_ms):
            self.drive(speed_mm_s, channel, wait=False)
            self.rig.run(period_ms * MS)

    def events(self, name, channel=None):
        self.listen()
        return [line.message for line in self.lines if line.message.get("event") == name and channel in (None, line.channel)]
