# SPDX-License-Identifier: MIT
"""Row 29 and bad arguments: refused with the right exit code, file, line and fix."""

import contextlib
import os
import socket
import subprocess

from scenario import Skip, scenario

USAGE, UNAVAILABLE, CONFIGURATION = 64, 69, 78
DEFAULT_DIRECTORY = "/var/lib/iwheel"  # Where a gateway records by default.


def call(rig, program, *arguments, seconds=5, **options):
    """(exit code, what it printed); None as code if it did not end."""
    command = [rig.program(program), *arguments]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=seconds, check=False, **options)
    except subprocess.TimeoutExpired as late:
        return None, (late.stdout or b"").decode(errors="replace")
    return done.returncode, done.stdout.decode(errors="replace")


@scenario("arguments: help, version, unknown, missing, surplus", 4)
def arguments(t):
    rig = t.rig()
    recorded = os.path.isdir(DEFAULT_DIRECTORY)
    for program in ("iwheel-gateway", "iwheelctl", "iwheel-sim"):
        code, text = call(rig, program, "--help")
        t.check(code == 0 and program in text and len(text.splitlines()) >= 8, f"{program} --help: {code}, {text[:100]!r}")
        t.check(max(map(len, text.splitlines())) <= 120, f"{program} --help has lines over 120 columns")
        code, text = call(rig, program, "--version")
        t.check(code == 0 and program in text and any(c.isdigit() for c in text) and text.count("\n") == 1, f"{program} --version: {code}, {text!r}")
        for bad in (("--nonsense",), ("-Z",)):
            code, text = call(rig, program, *bad)
            t.check(code == USAGE and bad[0].lstrip("-") in text, f"{program} {bad}: {code}, {text[:160]!r}")
            t.check("--help" in text, f"{program} {bad} names --help: {text[:160]!r}")
    cases = [
        ("iwheel-gateway", ("-c",), USAGE),
        ("iwheel-gateway", ("surplus",), USAGE),
        ("iwheel-gateway", ("--log-level", "loud"), USAGE),
        ("iwheel-gateway", ("--can", "unix:" + "x" * 200, "--socket", rig.path("x.sock")), USAGE),
        ("iwheel-gateway", ("--can", "unix:", "--socket", rig.path("x.sock")), USAGE),
        ("iwheel-gateway", ("--socket", "/" + "x" * 200), USAGE),
        ("iwheelctl", (), USAGE),
        ("iwheelctl", ("fly",), USAGE),
        ("iwheelctl", ("drive", "fast", "300"), USAGE),
        ("iwheelctl", ("drive", "300"), USAGE),
        ("iwheelctl", ("drive", "300", "300", "--for", "long"), USAGE),
        ("iwheelctl", ("drive", "300", "300", "--for", "-1s"), USAGE),
        ("iwheelctl", ("drive", "1.5", "300"), USAGE),
        ("iwheelctl", ("--socket", rig.path("nobody.sock"), "status"), UNAVAILABLE),
        ("iwheelctl", ("status", "surplus"), USAGE),
        ("iwheelctl", ("tare", "up"), USAGE),
        ("iwheelctl", ("watch", "weather"), USAGE),
        ("iwheel-sim", ("--seed", "many"), USAGE),
        ("iwheel-sim", ("--control", rig.path("nobody"), "surplus"), UNAVAILABLE),
    ]
    for program, words, expected in cases:
        code, text = call(rig, program, *words)
        t.check(code == expected, f"{program} {' '.join(words)[:60]}: exit code {code}, {expected} expected: {text[:160]!r}")
        t.check(len(text) > 15, f"{program} {words} prints no reason")
    made = os.path.isdir(DEFAULT_DIRECTORY) and not recorded
    if made:
        os.rmdir(DEFAULT_DIRECTORY)  # So that the next attempt detects it too.
    t.check(not made, f"nothing was made outside of the test: {DEFAULT_DIRECTORY}")
    t.figure(f"{len(cases) + 12} calls")


@scenario("a kernel without SocketCAN: gateway and simulator end and name the local bus", 1, native="the kernel of the tests has SocketCAN")
def socketcan_missing(t):
    with contextlib.suppress(OSError), socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW):
        raise Skip("the kernel of this machine has SocketCAN")
    rig = t.rig()
    common = ("-c", rig.path("gateway.conf"), "--socket", rig.path("x.sock"), "--estop", "none")
    for program, words in (("iwheel-gateway", (*common, "--can", "can0")), ("iwheel-sim", ("--can", "vcan0"))):
        code, text = call(rig, program, *words)
        t.check(code == UNAVAILABLE and "unix:" in text, f"{program} without SocketCAN: exit code {code}: {text[:200]!r}")


PROGRAMS = ("iwheel-gateway", "iwheelctl", "iwheel-sim", "iwheel-serial", "iwheel-mqtt", "iwheel-fleet", "iwheel-web", "iwheel-ros2")


def built(rig):
    """The programs that exist: a bridge is built only if its libraries are installed."""
    for program in PROGRAMS:
        try:
            rig.program(program)
        except FileNotFoundError:
            continue
        yield program


@scenario("arguments that mean nothing: a bare --, an empty one, an option in place of a value", 4)
def meaningless_arguments(t):
    rig = t.rig()
    private = ("--control", rig.path("own"), "--can", f"unix:{rig.path('own-bus')}", "--estop", rig.path("own-button"))
    calls = 0
    for program in built(rig):
        common = private if program == "iwheel-sim" else ()
        verb = ("status",) if program == "iwheelctl" else ()
        for words, about in (
            (("--",), "--"),
            ((*verb, "--"), "--"),
            (("--", "--version"), "--"),
            (("",), "is empty"),
            ((*verb, ""), "is empty"),
            (("--help", ""), "is empty"),
        ):
            code, text = call(rig, program, *common, *words, seconds=2)
            t.check(code == USAGE, f"{program} {words}: exit code {code}: {text[:160]!r}")
            t.check(about in text and "leave it out" in text, f"{program} {words} names the fix: {text[:160]!r}")
            calls += 1
    valued = {
        "iwheel-gateway": ("-c", "--can", "--socket", "--watch-socket", "--estop", "--log-level"),
        "iwheelctl": ("--socket",),
        "iwheel-sim": ("--can", "--estop", "--control", "--script", "--log", "--seed", "--uptime"),
        "iwheel-serial": ("-c", "--port", "--baud", "--socket", "--watch-socket"),
        "iwheel-fleet": ("-c", "--for", "--last", "--since", "--until", "--wait", "--output"),
    }
    for program in built(rig):
        common = private if program == "iwheel-sim" else ()
        for option in valued.get(program, ("-c",)):
            code, text = call(rig, program, *common, option, "--version", seconds=2)
            t.check(code == USAGE, f"{program} {option} --version: exit code {code}: {text[:160]!r}")
            t.check("--version" in text or "needs" in text, f"{program} {option}: names what is wrong: {text[:160]!r}")
            calls += 1
    t.check(not os.path.exists("--version"), "no file of that name was made")
    t.figure(f"{calls} calls")


def closed_pipe():
    """The writing end of a pipe without a reader."""
    reader, writer = os.pipe()
    os.close(reader)
    return writer


@scenario("a closed pipe as stderr or stdout ends no program early", 4)
def closed_streams(t):
    rig = t.rig()
    for program in built(rig):
        pipe = closed_pipe()
        for words, code in ((("--nonsense",), USAGE), (("--version",), 0), (("--help",), 0)):
            done = subprocess.run([rig.program(program), *words], stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, timeout=5, check=False)
            t.check(done.returncode == code, f"{program} {words}: {done.returncode}, not {code}")
        os.close(pipe)
    if "iwheel-fleet" in built(rig):
        pipe = closed_pipe()
        with subprocess.Popen([rig.program("iwheel-fleet")], stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe) as fleet:
            try:
                t.check(fleet.wait(5) >= 0, "iwheel-fleet ends when its table has no reader")
            except subprocess.TimeoutExpired:
                fleet.kill()
                t.check(False, "iwheel-fleet continues although its table has no reader")
        os.close(pipe)
    os.mkdir(rig.path("shared"))
    os.chmod(rig.path("shared"), 0o1777)  # The gateway logs a warning about this first.
    rig.socket_name = "shared/gateway.sock"
    pipe = closed_pipe()
    rig.start_gateway(setup=lambda: os.dup2(pipe, 2))
    os.close(pipe)
    t.check(rig.gateway.child.poll() is None, "the gateway runs")


# (text, line that must be named, words that must appear)
BAD_CONFIGURATIONS = [
    ("[wheels]\nsetpoint_typ = 1\n", 2, ["setpoint_typ"]),
    ("[whels]\nsetpoint_type = 1\n", None, ["whels"]),
    ("[drive]\nlease_ms = 0\n", 2, ["lease_ms", "20"]),
    ("[drive]\nlease_ms = 5000\n", 2, ["lease_ms", "500"]),
    ("[drive]\nperiod_ms = 20ms\n", 2, ["period_ms"]),
    ("[drive]\nperiod_ms = 20.5\n", 2, ["period_ms"]),
    ("[drive]\nperiod_ms =\n", 2, ["period_ms"]),
    ("[drive]\naccel_mm_s2 = 100000\n", 2, ["accel_mm_s2", "20000"]),
    ("[drive]\nmax_current_mA = -1\n", 2, ["max_current_mA"]),
    ("[drive]\nmax_current_mA = 2001\n", 2, ["max_current_mA", "2000"]),
    ("[drive]\nzero_hold_ms = 1000\n", 2, ["zero_hold_ms", "1100"]),
    ("[drive]\nlease_ms = 500\nmax_speed_mm_s = 1000\n", None, ["1000 ms"]),
    ("[drive]\ndecel_mm_s2 = 100\n", 2, ["1000"]),
    ("[wheels]\ncurrent_role = torque\n", 2, ["limit", "setpoint"]),
    ("[wheels]\nsetpoint_type = 256\n", 2, ["255"]),
    ("[wheels]\nsetpoint_dlc = 4\n", 2, ["setpoint_dlc"]),
    ("[wheels]\ngear_ratio = 0\n", 2, ["gear_ratio"]),
    ("[left]\ninvert = perhaps\n", 2, ["yes", "no"]),
    ("[left]\nforce_unit = N\n", 2, ["cN", "dN"]),
    ("[left]\nsetpoint_id = 298\n", 2, ["setpoint_id"]),
    ("[drive]\nlease_ms = 200\nlease_ms = 300\n", 3, ["lease_ms"]),
    ("lease_ms = 200\n", 1, ["section"]),
    ("[drive\nlease_ms = 200\n", 1, []),
    ("[drive]\nlease_ms 200\n", 2, []),
    ("[estop]\nactive = sometimes\n", 2, ["high", "low"]),
    ("[bus]\non_mismatch = hope\n", 2, ["refuse", "warn"]),
    ("[northbound]\nmode = 0999\n", 2, ["mode"]),
    ("[northbound]\nmax_clients = 0\n", 2, ["max_clients"]),
    ("\x00[drive]\n", None, []),
    ("[drive]\n# " + "x" * 5000 + "\nlease_ms = 200\n", None, None),
]


@scenario("bad configuration: refused with file, line and fix; nothing is sent", 5)
def row29_bad_configuration(t):
    rig = t.rig()
    path = rig.path("bad.conf")
    common = ("--can", f"unix:{rig.path('bus')}", "--socket", rig.path("gateway.sock"), "--estop", "none")
    for text, line, words in BAD_CONFIGURATIONS:
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        if words is None:
            continue
        code, printed = call(rig, "iwheel-gateway", "-c", path, *common, seconds=2)
        name = repr(text[:50])
        t.check(code == CONFIGURATION, f"{name}: exit code {code}: {printed[-200:]}")
        t.check(path in printed and (line is None or f"{path}:{line}:" in printed), f"{name}: file and line {line}: {printed[:200]!r}")
        t.check(all(word in printed for word in words), f"{name}: {words} in {printed[:300]!r}")
    code, printed = call(rig, "iwheel-gateway", "-c", rig.path("missing.conf"), *common)
    t.check(code == CONFIGURATION and "missing.conf" in printed, f"missing file: {code}, {printed[:200]!r}")
    t.check(not os.path.exists(rig.path("gateway.sock")), "no socket was made")
    t.rule(not rig.bus.setpoints(), "nothing was sent")
    t.figure(f"{len(BAD_CONFIGURATIONS)} files")


@scenario("setpoint type, current role or track not set: listens, but does not arm", 7)
def row29_type_not_set(t):
    for missing, error in (("setpoint_type", "type_not_set"), ("current_role", "type_not_set"), ("track_mm", "track_not_set")):
        rig = t.rig()
        del rig.settings["wheels"][missing]
        rig.write_config()
        client = rig.connect_to_new()
        refusal = client.arm()
        t.expect(refusal, error)
        t.check(f"{missing} not configured" in refusal["message"], f"the message names the key: {refusal['message']}")
        t.rule(not rig.bus.setpoints(), "nothing was sent")


@scenario("--print-config can be read again; --check moves nothing", 4)
def print_config_and_check(t):
    rig = t.rig()
    code, text = call(rig, "iwheel-gateway", "-c", rig.path("gateway.conf"), "--print-config")
    t.check(code == 0 and "[drive]" in text and "lease_ms" in text, f"--print-config: {code}, {text[:200]!r}")
    with open(rig.path("again.conf"), "w", encoding="utf-8") as file:
        file.write(text)
    code, again = call(rig, "iwheel-gateway", "-c", rig.path("again.conf"), "--print-config")
    t.check(code == 0 and again.replace("again.conf", "gateway.conf") == text, f"printed, read and printed again is the same: {code}")
    common = ("-c", rig.path("gateway.conf"), "--can", f"unix:{rig.path('bus')}", "--socket", rig.path("gateway.sock"), "--estop", f"unix:{rig.path('button')}")
    code, text = call(rig, "iwheel-gateway", *common, "--check")
    t.check(code == 0 and "ok" in text and "fail" not in text.lower().replace("0 fail", ""), f"--check with all there: {code}, {text[:400]!r}")
    rig.sim.ask("estop press")
    code, text = call(rig, "iwheel-gateway", *common, "--check")
    t.check("press" in text.lower(), f"--check reports that the button is pressed: {text[:400]!r}")
    rig.sim.end()
    code, text = call(rig, "iwheel-gateway", *common, "--check")
    t.check(code != 0 and "fail" in text.lower(), f"--check without a bus: {code}, {text[:400]!r}")
    t.rule(not rig.bus.setpoints(), "nothing was sent")
