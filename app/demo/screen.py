# SPDX-License-Identifier: MIT
"""Two ways to show the demonstration: drawn on a terminal of 80 by 24, or as plain lines."""

import math
import shutil
import sys
import textwrap

FULL_SCALE_MM_S = 600
BAR = 33  # cells, the middle one is zero
MAP_WIDTH, MAP_HEIGHT = 25, 11
MIN_SPAN_MM = 1600


class Lines:
    """Plain lines for a pipe, a file or a small terminal."""

    def __init__(self, out):
        self.out = out
        self.printed_s = -1.0

    def _print(self, elapsed_s, text):
        print(f"[{elapsed_s:5.1f} s] {text}", file=self.out, flush=True)

    def step(self, elapsed_s, number, total, title, text):
        print(file=self.out)
        self._print(elapsed_s, f"{number}/{total} {title}: {text}")

    def fact(self, elapsed_s, text):
        self._print(elapsed_s, f"  ok: {text}")

    def snapshot(self, elapsed_s, status):
        left, right = status["left"], status["right"]
        if left["applied_mm_s"] is None or elapsed_s - self.printed_s < 0.5:
            return
        self.printed_s = elapsed_s
        word = {"armed": "drive", "stopping": "stop", "latched": "latched"}.get(status["state"], status["state"])
        self._print(
            elapsed_s,
            f"{word:<7} {left['applied_mm_s']}/{right['applied_mm_s']} mm/s   left {number(left['speed_mm_s'])} right {number(right['speed_mm_s'])} mm/s",
        )

    def close(self):
        pass


def number(value):
    return "--" if value is None else str(value)


class Glyphs:
    """Characters of the drawing; plain ASCII if the terminal has only that."""

    def __init__(self, unicode):
        self.full, self.empty, self.middle = ("█", "·", "│") if unicode else ("#", ".", "|")
        self.rule, self.lamp, self.tick = ("─", "●", "✓") if unicode else ("-", "*", "+")
        self.arrows = "↑↖←↙↓↘→↗" if unicode else "^\\</v\\>/"
        self.braille = unicode


def tint(text, *codes):
    return f"\x1b[{';'.join(map(str, codes))}m{text}\x1b[0m"


class Screen:
    """Draws the whole picture again at each snapshot, and restores the terminal at the end."""

    def __init__(self, out):
        self.out = out
        self.glyphs = Glyphs("utf" in (out.encoding or "").lower())
        self.title, self.text, self.number, self.total = "", "", 0, 0
        self.facts, self.path = [], []
        self.status, self.elapsed_s = None, 0.0
        out.write("\x1b[?1049h\x1b[?25l\x1b[2J")
        out.flush()

    def step(self, elapsed_s, number_, total, title, text):
        self.number, self.total, self.title, self.text, self.elapsed_s = number_, total, title, text, elapsed_s
        self.facts = [(fact, True) for fact, _ in self.facts[-4:]]
        self.draw()

    def fact(self, elapsed_s, text):
        self.facts.append((text, False))
        self.elapsed_s = elapsed_s
        self.draw()

    def snapshot(self, elapsed_s, status):
        self.status, self.elapsed_s = status, elapsed_s
        pose = status["pose"]
        if pose and pose["x_mm"] is not None:
            place = (pose["x_mm"], pose["y_mm"], pose["psi_mrad"] / 1000)
            if not self.path or math.dist(self.path[-1][:2], place[:2]) > 15 or abs(self.path[-1][2] - place[2]) > 0.1:
                self.path.append(place)
        self.draw()

    def close(self):
        self.out.write("\x1b[0m\x1b[?25h\x1b[?1049l")
        self.out.flush()

    # Drawing ---------------------------------------------------------------------------------------------------------

    def draw(self):
        rows = [self._head(), "", self._state(), ""]
        rows += [left + right for left, right in zip(self._wheels(), self._map(), strict=False)]
        rows += [tint(self.glyphs.rule * 80, 2), tint(f" {self.title}", 1)]
        rows += [" " + line for line in textwrap.wrap(self.text, 78)[:2]]
        facts = [line for fact, old in self.facts for line in self._fact(fact, old)]
        rows += [""] * (19 - len(rows)) + facts[-5:]
        picture = "\x1b[H" + "\r\n".join(row + "\x1b[K" for row in rows[:24]) + "\x1b[J"
        self.out.write(picture)
        self.out.flush()

    def _fact(self, fact, old):
        """Facts of earlier steps are dimmed."""
        lines = textwrap.wrap(fact, 76)[:4]
        marks = [tint(self.glyphs.tick, 32) if old else tint(self.glyphs.tick, 32, 1)] + [" "] * 3
        return [f" {mark} {tint(line, 2) if old else line}" for mark, line in zip(marks, lines, strict=False)]

    def _head(self):
        left, right = (" iWheel: the real gateway, two simulated wheels", f"{self.number} of {self.total}   {self.elapsed_s:5.1f} s ")
        return tint(left + " " * (80 - len(left) - len(right)) + right, 7)

    def _state(self):
        if self.status is None:
            return " starting"
        state, lease, estop = self.status["state"], self.status["lease"], self.status["estop"]["state"]
        colour = {"listening": 36, "armed": 32, "stopping": 33, "latched": 31}[state]
        remaining = "no lease holder" if lease["holder"] is None else f"lease holder {lease['name']}, {number(lease['remaining_ms']):>4} ms"
        lamp = tint(f"{self.glyphs.lamp} e-stop released", 32) if estop == "released" else tint(f" {self.glyphs.lamp} E-STOP {estop.upper()} ", 41, 97, 1)
        return f" state {tint(f'{state.upper():<10}', colour, 1)}  {remaining:<32}  " + lamp

    def _wheels(self):
        rows = []
        for side in ("left", "right"):
            wheel = (self.status or {}).get(side)
            rows += [
                tint(f" {side} wheel", 1) + " " * (53 - 7 - len(side)),
                self._bar("appl", wheel and wheel["applied_mm_s"], 36),
                self._bar("meas", wheel and wheel["speed_mm_s"], 32),
                self._values(wheel),
                " " * 53,
            ]
        return [*rows[:-1], " " * 53, f" {'':5} {'-600':<{BAR // 2}}0{'+600 mm/s':>{BAR // 2}}".ljust(53)]

    def _bar(self, label, value, colour):
        half = BAR // 2
        cells = [self.glyphs.empty] * BAR
        filled = 0 if value is None else round(min(1, abs(value) / FULL_SCALE_MM_S) * half)
        low, high = (half - filled, half) if (value or 0) < 0 else (half + 1, half + 1 + filled)
        body = tint("".join(cells[:low]), 2) + tint(self.glyphs.full * (min(high, half) - low), colour) if low < half else tint("".join(cells[:half]), 2)
        tail = tint(self.glyphs.full * (high - half - 1), colour) + tint("".join(cells[max(high, half + 1) :]), 2)
        return f"  {label} {body}{self.glyphs.middle}{tail} {number(value):>5} mm/s "[:400] + " "

    def _values(self, wheel):
        if wheel is None:
            return " " * 53
        volts = "--" if wheel["battery_dV"] is None else f"{wheel['battery_dV'] / 10:.1f} V"
        force = "--" if wheel["force_net_mN"] is None else f"{round(wheel['force_net_mN'] / 1000, 1) + 0.0:.1f} N"
        metres = "--" if wheel["distance_mm"] is None else f"{wheel['distance_mm'] / 1000:.2f} m"
        return f"       {metres}   {volts}   force {force}".ljust(53)

    def _map(self):
        """Returns the path so far, from above, forward is up."""
        points = [(-y, x) for x, y, _ in self.path] or [(0, 0)]
        span = max(MIN_SPAN_MM, *(max(p[axis] for p in points) - min(p[axis] for p in points) for axis in (0, 1))) * 1.1
        middle = [(max(p[axis] for p in points) + min(p[axis] for p in points)) / 2 for axis in (0, 1)]
        across, down = MAP_WIDTH * 2, MAP_HEIGHT * 4
        scale = min(across, down) / span
        dots = {(int(across / 2 + (px - middle[0]) * scale), int(down / 2 - (py - middle[1]) * scale)) for px, py in points}
        grid = [[" "] * MAP_WIDTH for _ in range(MAP_HEIGHT)]
        bits = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
        cells = {}
        for px, py in dots:
            cells.setdefault((py // 4, px // 2), []).append(bits[px % 2][py % 4])
        for (row, column), parts in cells.items():
            if 0 <= row < MAP_HEIGHT and 0 <= column < MAP_WIDTH:
                grid[row][column] = chr(0x2800 + sum(parts)) if self.glyphs.braille else "."
        if self.path:
            row, column = (int(down / 2 - (points[-1][1] - middle[1]) * scale) // 4, int(across / 2 + (points[-1][0] - middle[0]) * scale) // 2)
            arrow = self.glyphs.arrows[round(self.path[-1][2] / (math.pi / 4)) % 8]
            if 0 <= row < MAP_HEIGHT and 0 <= column < MAP_WIDTH:
                grid[row][column] = tint(arrow, 33, 1)
        title = f"from above, {across / scale / 1000:.1f} m wide".rjust(MAP_WIDTH)
        if all(cell == " " for cell in grid[-1]):
            grid[-1] = [tint(title, 2)]
        return [tint(self.glyphs.middle, 2) + "".join(row) for row in grid]


def choose(out, plain):
    """Returns the drawing if the terminal is large enough, otherwise plain lines."""
    size = shutil.get_terminal_size()
    if plain or not out.isatty():
        return Lines(out)
    if size.columns < 80 or size.lines < 24:
        print(f"this terminal has {size.columns} x {size.lines} characters; the drawing needs 80 x 24, so plain lines follow", file=out)
        return Lines(out)
    return Screen(out)


if __name__ == "__main__":
    sys.exit("run ./demo")
