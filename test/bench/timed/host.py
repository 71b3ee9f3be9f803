# SPDX-License-Identifier: MIT
"""The timed benchmark from outside: builds its programs, installs the peers, boots the kernel, and makes rows of the results."""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
sys.path[:0] = [str(ROOT / "test/kernel"), str(ROOT / "test/system"), str(HERE)]

from boot import Boot, find_kernel

CODEC = HERE.parent / "codec"
INCLUDES = [f"-I{CODEC}", f"-I{ROOT / 'core/include'}"]
MORE = {"floor_receive": [CODEC / "floor.c"], "flood": [CODEC / "mix.c"]}
PACKAGES = {"candump": "can-utils", "gpiomon": "gpiod", "strace": "strace"}
ALL = ("calls", "period_idle", "period_loaded", "flood", "flood_loaded", "line", "reported", "estop")
COUNTED = ("calls",)  # in virtual time: each frame comes at its own moment, however long it takes to trace the calls
FULL = {"rounds": 3, "period_s": 4.0, "flood_s": 3.0, "calls_s": 3.0, "count": 150, "presses": 12}
SHORT = {"rounds": 1, "period_s": 0.6, "flood_s": 0.3, "calls_s": 0.5, "count": 10, "presses": 1, "stall_us": 15_000}
# Limits of the smoke test: a figure beyond is far too large for any load of the machine.
ABSURD = {"ppm": 20_000, "lost": 3_000, "per_frame": 20, "p50": 100_000}
LIMIT_S = 1800
SMOKE_LIMIT_S = 400


def build_tools(folder):
    for source in sorted(HERE.glob("*.c")):
        if source.stem != "timed":
            more = MORE.get(source.stem, [])
            subprocess.run(["gcc", "-O2", "-std=gnu11", *INCLUDES, source, HERE / "timed.c", *more, "-o", folder / source.stem], check=True)


def have(program):
    return any(os.access(os.path.join(path, program), os.X_OK) for path in os.environ["PATH"].split(":"))


def get_packages():
    """Installs the missing Debian packages of peers, if this is root on Debian. Packages that are unavailable are left out with a message."""
    missing = sorted({package for program, package in PACKAGES.items() if not have(program)})
    if missing and os.geteuid() == 0 and have("apt-get"):
        print(f"installing: apt-get install -y --no-install-recommends {' '.join(missing)}")
        subprocess.run(
            ["apt-get", "-qq", "install", "-y", "--no-install-recommends", *missing],
            stdout=subprocess.DEVNULL,
            check=False,
            env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
        )
    for program, package in PACKAGES.items():
        if not have(program):
            print(f"left out: {program} ({package} is not installed)")


def get_python_can(folder):
    """Path of python-can in a separate folder, from PyPI; empty if it is unavailable."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--target", str(folder), "python-can>=4,<5"]
    if subprocess.run(pip, check=False).returncode == 0:
        return str(folder)
    print("left out: python-can (pip could not install it)")
    return ""


def be_prompt():
    """Raises the priority of the timed programs above other programs, as far as this process may."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        print("without real-time priority: other programs of this machine disturb the figures")


def boot_and_wait(kernel, folder, plan, limit_s):
    """Yields the results turn by turn. All programs run on one processor: a change of the processor takes longer than the timed work."""
    name, processor = "counted" if plan["virtual"] else "timed", max(os.sched_getaffinity(0))
    boot = Boot(kernel, str(folder), name, {"group": "timed", **plan}, {processor})
    try:
        while boot.running() and boot.seconds() < limit_s:
            yield from boot.results()
            time.sleep(0.2)
        yield from boot.results()
        if not boot.running() and boot.text("status").strip() != "0":
            raise RuntimeError(boot.complaint())
    finally:
        boot.end()


def play(kernel, folder, plan, limit_s):
    """Results of all measures of the plan, each in its kind of time."""
    for virtual in (False, True):
        names = [name for name in plan["measures"] if (name in COUNTED) is virtual]
        if names:
            yield from boot_and_wait(kernel, folder, {**plan, "measures": names, "virtual": virtual}, limit_s)


def measure(build, request, measures=ALL, candidates=None, limit_s=LIMIT_S, show=print):
    """{measure: {candidate: [figures of each round]}}, and the failures. RuntimeError if there is no kernel."""
    kernel = find_kernel()
    if candidates is None:
        get_packages()
    be_prompt()
    measured, failures = {}, []
    with tempfile.TemporaryDirectory(prefix="iwheel-timed-") as name:
        folder = Path(name)
        build_tools(folder)
        peers = get_python_can(folder / "peers") if candidates is None else ""
        plan = {**request, "guest": str(HERE / "guest.py"), "build": str(Path(build).resolve()), "tools": name, "peers": peers, "measures": list(measures)}
        plan |= {"candidates": list(candidates)} if candidates else {}
        for result in play(kernel, folder, plan, limit_s):
            show(result)
            if "failed" in result:
                failures.append(f"{result['measure']}, {result['candidate']}: {result['failed']}")
            else:
                measured.setdefault(result["measure"], {}).setdefault(result["candidate"], []).append(result["figures"])
    return measured, failures


# ---- rows ---------------------------------------------------------------------------------------------------------

NAMES = {
    "bcm": "CAN_BCM",
    "looks": "leanest that reads the e-stop",
    "driving": "gateway that drives",
    "attended": "gateway with a client",
    "python_can": "python-can",
    "gpiomon": "gpiomon and cansend",
}


def whole(measured, name):
    """True if the figures of the floor and of the gateway exist."""
    return {"gateway", "floor"} <= set(measured.get(name, {})) or (name == "calls" and "gateway" in measured.get(name, {}))


def middle(rounds, key):
    return statistics.median(figures[key] for figures in rounds)


def ratio(of, candidate, key):
    """Ratios within the same round, so a slow minute affects both."""
    return statistics.median(mine[key] / max(floor[key], 0.001) for mine, floor in zip(of[candidate], of["floor"], strict=True))


def times(value):
    return f"{value:.0f} ×" if value >= 20 else f"{value:.1f} ×"


def peers_of(of, text):
    return ", ".join(f"{NAMES.get(name, name)} {text(name)}" for name in of if name not in ("floor", "gateway")) or "--"


def us(value):
    return f"{value:.0f} µs" if value >= 10 else f"{value:.1f} µs"


def row(what, floor, mine, peers, goal):
    return [what, floor, mine, peers, goal]


def period_rows(measured):
    for name, words in (("period_idle", "a quiet bus"), ("period_loaded", "617 frames/s of telemetry")):
        if whole(measured, name):
            of = measured[name]
            yield row(
                f"setpoint period, deviation p50, {words}",
                us(middle(of["floor"], "p50")),
                times(ratio(of, "gateway", "p50")),
                peers_of(of, lambda c, of=of: times(ratio(of, c, "p50"))),
                "≤ 1.6 ×",
            )
            yield row(
                f"its mean error, {words}",
                f"{middle(of['floor'], 'ppm'):.0f} ppm",
                f"{middle(of['gateway'], 'ppm'):.0f} ppm",
                peers_of(of, lambda c, of=of: f"{middle(of[c], 'ppm'):.0f} ppm"),
                "≤ 100 ppm",
            )


def flood_rows(measured):
    if not whole(measured, "flood"):
        return
    of = measured["flood"]
    lost = {c: sum(figures["lost"] for figures in of[c]) / sum(figures["sent"] for figures in of[c]) for c in of}
    yield row("21 000 frames/s: lost", f"{lost['floor']:.1%}", f"{lost['gateway']:.1%}", peers_of(of, lambda c: f"{lost[c]:.1%}"), "0")
    yield row(
        "21 000 frames/s: processor time",
        "1 ×",
        times(ratio(of, "gateway", "processor_ns")),
        peers_of(of, lambda c: times(ratio(of, c, "processor_ns"))),
        "≤ 1.8 ×",
    )


def loaded_flood_rows(measured):
    if whole(measured, "flood_loaded"):
        of = measured["flood_loaded"]
        lost = {c: sum(figures["lost"] for figures in of[c]) / sum(figures["sent"] for figures in of[c]) for c in of}
        yield row(
            "21 000 frames/s next to four programs that compute: lost",
            f"{lost['floor']:.1%}",
            f"{lost['gateway']:.1%}",
            peers_of(of, lambda c: f"{lost[c]:.1%}"),
            "0",
        )


def call_rows(measured):
    if whole(measured, "calls"):
        of = dict(measured["calls"])
        if "driving" in of:
            yield row(
                "617 frames/s: system calls for a frame, driving",
                "--",
                f"{middle(of.pop('driving'), 'per_frame'):.2f}",
                peers_of({c: of[c] for c in of if c != "attended"}, lambda c: f"{middle(of[c], 'per_frame'):.2f}"),
                "≤ 2.5",
            )
        yield row(
            "617 frames/s: system calls for a frame, no client",
            "--",
            f"{middle(of['gateway'], 'per_frame'):.2f}",
            peers_of(of, lambda c: f"{middle(of[c], 'per_frame'):.2f}"),
            "≤ 2.5",
        )


def latency_rows(measured):
    wanted = (
        ("line", "client's line to frame on the bus", (("p50", "≤ 2.0 ×"), ("p90", "≤ 1.4 ×"))),
        ("reported", "frame on the bus to client's line", (("p50", "≤ 1.3 ×"),)),
        ("estop", "press of the e-stop to both zeros", (("p50", "≤ 1.3 ×"), ("p90", "≤ 1.8 ×"))),
    )
    for name, words, parts in wanted:
        for key, goal in parts if whole(measured, name) else ():
            of = measured[name]
            yield row(
                f"{words}, {key}",
                us(middle(of["floor"], key)),
                times(ratio(of, "gateway", key)),
                peers_of(of, lambda c, of=of, key=key: times(ratio(of, c, key))),
                goal,
            )


def rows(measured):
    return [*call_rows(measured), *period_rows(measured), *flood_rows(measured), *loaded_flood_rows(measured), *latency_rows(measured)]


def pair_table(build, before, rounds, pair_s):
    """Lines about the gap between both setpoints of a pair, of the program `before` and of this build in turns."""
    request = {"rounds": rounds, "pair_s": pair_s, "before": str(Path(before).resolve()), "stall_us": 1_000_000}
    measured, failures = measure(build, request, ("pair",), ("before", "gateway"), show=lambda result: print(".", end="", flush=True))
    lines = ["", *failures, "| | pairs | p50 | p99 | p99.9 | largest | later than 1 ms | left alone |", "|---|---:|---:|---:|---:|---:|---:|---:|"]
    for name, turns in measured.get("pair", {}).items():
        gaps = [gap for turn in turns for gap in turn["gaps_ns"]]
        whole_us = sorted(gap / 1000 for gap in gaps if gap >= 0)
        at = [us(whole_us[min(len(whole_us) - 1, int(len(whole_us) * part))]) for part in (0.5, 0.99, 0.999, 1.0)]
        late = sum(gap > 1000 for gap in whole_us)
        lines.append(f"| {name} | {len(gaps)} | {' | '.join(at)} | {late} | {len(gaps) - len(whole_us)} |")
    return lines


def smoke(build):
    """The faults of the short turns of floor and gateway; empty: none."""
    wanted = [name for name in ALL if name != "calls" or have("strace")]
    if len(wanted) < len(ALL):
        print("left out: calls (strace is not installed)")
    measured, faults = measure(build, SHORT, wanted, ("floor", "gateway"), SMOKE_LIMIT_S, show=lambda result: None)
    faults += [f"{name}: no figures" for name in wanted if "gateway" not in measured.get(name, {}) and not any(f.startswith(name) for f in faults)]
    for name, of in measured.items():
        for figures in of.get("gateway", []):
            faults += [f"{name}: {figures}" for key, limit in ABSURD.items() if abs(figures.get(key, 0)) > limit]
    return faults
