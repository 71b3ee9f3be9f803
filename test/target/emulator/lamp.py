# SPDX-License-Identifier: MIT
"""Watches the lamp and reads its pattern."""

from .chip import MS


class Lamp:
    def __init__(self, port, pin, lit):
        self.port, self.pin, self.lit, self.changes = port, pin, lit, [(0, False)]

    def watch(self, machine):
        port = getattr(machine, self.port)
        state = port.is_output(self.pin) and port.level(self.pin) == self.lit
        if state != self.changes[-1][1]:
            self.changes.append((machine.now_ns, state))

    def was_lit(self, time_ns):
        return next(state for since_ns, state in reversed(self.changes) if since_ns <= time_ns)

    def pattern(self, now_ns):
        """Pattern of the last second: "steady", "dark", or how often it was lit, as "3 flashes"; half-second blinks by their
        number too, with the share of light: "2 flashes, 50 % lit"."""
        samples = [self.was_lit(time_ns) for time_ns in range(max(now_ns - 1000 * MS, 0), now_ns, MS)]
        if all(samples) or not any(samples):
            return "steady" if samples[0] else "dark"
        flashes = sum(1 for before, after in zip([samples[-1], *samples], samples, strict=False) if after and not before)
        share = sum(samples) / len(samples)
        return f"{flashes} flashes, {round(share * 100 / 6.25) * 6.25:g} % lit"
