#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws the file of record_csv.py as a PNG: speed and force of both wheels over time. Needs matplotlib.

usage: plot_csv.py FILE.csv FILE.png
"""

import csv
import itertools
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

COLOURS = {"left": "tab:blue", "right": "tab:orange"}


def column(rows: list[dict[str, str]], name: str, scale: float = 1.0) -> list[float]:
    """Returns a column as numbers. An unknown value becomes NaN, a gap in the plot."""
    return [float(row[name]) * scale if row[name] else float("nan") for row in rows]


def draw(source: str, target: str) -> None:
    with open(source, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    times = column(rows, "time_s")
    figure, (speed, force) = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
    for side, colour in COLOURS.items():
        speed.step(times, column(rows, f"{side}_applied_mm_s"), where="post", color=colour, ls=":", label=f"{side}, applied")
        speed.plot(times, column(rows, f"{side}_speed_mm_s"), color=colour, label=f"{side}, measured")
        force.plot(times, column(rows, f"{side}_force_net_mN", 1e-3), color=colour, label=side)
    for before, row in itertools.pairwise(rows):
        if row["state"] == "latched" and before["state"] != "latched":
            speed.axvline(float(row["time_s"]), color="tab:red", label="latched")
    speed.set_ylabel("speed in mm/s")
    force.set_ylabel("force on the shaft in N")
    force.set_xlabel("time in s")
    for axes in (speed, force):
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right", fontsize="small")
    figure.savefig(target, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: plot_csv.py FILE.csv FILE.png")
    draw(sys.argv[1], sys.argv[2])
