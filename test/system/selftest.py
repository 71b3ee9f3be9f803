# SPDX-License-Identifier: MIT
"""The judge detects each fault. Good logs pass; every seeded fault is found under the rule it breaks.

The logs come from a small ideal gateway written here, so that a judge that always returns "good" or always "bad" fails.
"""

import struct

from judge import Judge
from judge_log import LEFT, RIGHT, Config, Event, Frame

MS = 1000
START, END = 1_000 * MS, 13_000 * MS
PRESS, RESET, STOP, GONE = 3_520 * MS, 5_400 * MS, 6_700 * MS, 9_620 * MS
CONFIG = Config()


def setpoint(t_us, side, speed, current=2000, kind=1, dlc=5):
    data = struct.pack(">Bhh", kind, speed, current).ljust(dlc, b"\0")[:dlc]
    return Frame(t_us, (LEFT, RIGHT)[side], data)


def script():
    """The timeline: drive and press; reset, drive and stop; drive and vanish."""
    events = [Event(START, "start")]

    def arm(t_ms):
        events.append(Event(t_ms * MS, "arm", (t_ms + 2) * MS))

    def drive(from_ms, to_ms, left, right):
        events.extend(Event(t * MS, "drive", t * MS + 400, left=left, right=right) for t in range(from_ms, to_ms, 50))

    arm(1_500)
    drive(1_700, 3_500, 300, 300)
    events.append(Event(PRESS, "press", PRESS + 300))
    events.append(Event(RESET, "reset", RESET + 500))
    arm(5_600)
    drive(5_700, 6_690, 200, 100)
    events.append(Event(STOP, "stop", STOP + 300))
    arm(9_000)
    drive(9_100, 9_610, -200, 200)
    events.append(Event(GONE, "gone", GONE))
    return events


def plan():
    """When the ideal gateway sends, and towards what: (from, to, target, how)."""
    return [
        (1_501, 1_701, (0, 0), "ramp"),
        (1_701, 3_520, (300, 300), "ramp"),
        (3_521, 5_030, (0, 0), "cut"),
        (5_601, 5_701, (0, 0), "ramp"),
        (5_701, 6_701, (200, 100), "ramp"),
        (6_701, 8_370, (0, 0), "ramp"),
        (9_001, 9_101, (0, 0), "ramp"),
        (9_101, 9_621, (-200, 200), "ramp"),
        (9_621, 11_290, (0, 0), "ramp"),
    ]


def towards(now, target, config, how):
    if how == "cut":
        return target
    steps = [t - n for n, t in zip(now, target, strict=False)]
    slopes = [config.accel_mm_s2 if abs(t) > abs(n) or n * t < 0 else config.decel_mm_s2 for n, t in zip(now, target, strict=False)]
    return tuple(int(n + max(-slope * 0.02, min(slope * 0.02, step))) for n, step, slope in zip(now, steps, slopes, strict=False))


def good(config=CONFIG):
    frames, speed = [], (0, 0)
    for begin, finish, target, how in plan():
        for t in range(begin, finish, 20):
            speed = towards(speed, target, config, how)
            current = config.max_current_mA if config.role == "limit" else (500 if any(speed) else 0)
            for side in (0, 1):
                sent = -speed[side] if config.invert[side] else speed[side]
                frames.append(setpoint(t * MS + side * 150, side, sent, current, config.setpoint_type, config.dlc))
    wheel, at = [0.0, 0.0], 0
    frames.sort()
    latest = [0, 0]
    for t in range(START, END, 4 * MS):
        while at < len(frames) and frames[at].t_us <= t:
            latest[frames[at].id == RIGHT] = struct.unpack_from(">h", frames[at].data, 1)[0]
            at += 1
        for side in (0, 1):
            wheel[side] += (latest[side] - wheel[side]) * 0.1
            frames.append(Frame(t + 37 + side * 130, 256 + 32 * side, struct.pack(">hh", round(wheel[side] / 20.1), 0)))
    return sorted(frames)


def verdict(frames, events, config=CONFIG, **options):
    return Judge(config, frames, events, **{"finished_us": END, **options}).judge()


def is_setpoint(frame):
    return frame.id in (LEFT, RIGHT)


def between(frames, from_ms, to_ms, change):
    """Replaces each setpoint of that time by change(frame): None drops it."""
    out = []
    for frame in frames:
        if is_setpoint(frame) and from_ms * MS <= frame.t_us < to_ms * MS:
            frame = change(frame)
        if frame is not None:
            out.append(frame)
    return sorted(out)


def with_data(at, value):
    def change(frame):
        data = bytearray(frame.data)
        struct.pack_into(">h" if at else ">B", data, at, value)
        return frame._replace(data=bytes(data))

    return change


def add(frames, *more):
    return sorted(list(frames) + list(more))


def pair(t_ms, left, right):
    return [setpoint(int(t_ms * MS), 0, left), setpoint(int(t_ms * MS) + 150, 1, right)]


def without(events, kind, from_ms=0, to_ms=99_999):
    return [e for e in events if not (e.kind == kind and from_ms * MS <= e.t_us < to_ms * MS)]


def drop(frame):
    return None


def late(by_ms):
    return lambda frame: frame._replace(t_us=frame.t_us + by_ms * MS)


def only(side, change):
    return lambda frame: change(frame) if (frame.id == RIGHT) == bool(side) else frame


def late_press(events):
    """The test noted the time 50 ms before it pressed."""
    return [e._replace(t_us=e.t_us - 50 * MS) if e.kind == "press" else e for e in events]


def broken_at_exit(frames, events):
    """The last right setpoint is missing, and the gateway exits."""
    last = [frame for frame in frames if is_setpoint(frame)][-1]
    return [frame for frame in frames if frame is not last], [*events, Event(last.t_us + MS, "exit")]


def faults():
    """(name, frames, events, the rule that must be named[, options])"""
    f, e = good(), script()
    stream = [frame for ms in range(11_400, 12_500, 20) for frame in pair(ms, 0, 0)]
    tail = [frame for ms in range(9_960, 10_700, 20) for frame in pair(ms, -30, 30)]
    yield "an empty log", [], e, "empty"
    yield "a log without telemetry", [x for x in f if is_setpoint(x)], e, "empty"
    yield "nothing ever commanded", between(f, 0, 99_999, with_data(1, 0)), e, "never_moved"
    yield "wheels that never turn", [x if is_setpoint(x) else x._replace(data=bytes(4)) for x in f], e, "never_turned"
    yield "armed, but nothing is sent", between(f, 0, 99_999, drop), e, "never_sent"
    yield "one wheel never sent to", between(f, 0, 99_999, only(1, drop)), e, "never_sent"
    yield "a zero pair before the first arm", add(f, *pair(1_200, 0, 0)), e, "sent_in_listening"
    yield "a moving pair before the first arm", add(f, *pair(1_200, 100, 100)), e, "motion_unarmed"
    yield "motion by arming alone", between(f, 1_600, 1_640, with_data(1, 8)), e, "motion_without_drive"
    yield "motion after reset, arm without drive", f, without(e, "drive", 5_650, 6_700), "motion_without_drive"
    yield "100 ms without setpoints while armed", between(f, 2_500, 2_610, drop), e, "gap"
    yield "200 ms without setpoints for the right wheel", between(f, 2_500, 2_700, only(1, drop)), e, "gap"
    yield "no setpoints during the ramp", between(f, 6_720, 6_850, drop), e, "gap"
    yield "no setpoints in the hold", between(f, 7_500, 7_700, drop), e, "gap"
    yield "hold 300 ms too short", between(f, 8_050, 8_400, drop), e, "gap"
    yield "no hold after an e-stop", between(f, 3_560, 5_100, drop), e, "gap"
    yield "listening again 700 ms too early", between(f, 10_590, 99_999, drop), [*e, Event(10600 * MS, "silent")], "gap", {"finished_us": 10_700 * MS}
    yield "ended 700 ms too early", between(f, 10_590, 99_999, drop), [*e, Event(10600 * MS, "exit")], "gap", {"finished_us": 10_700 * MS}
    yield "hold that never ends", add(f, *stream), e, "no_silence"
    yield "left without right", between(f, 2_000, 2_020, only(1, drop)), e, "pair"
    yield "left without right at an exit", *broken_at_exit(f, e), "pair"
    yield "right without left", between(f, 2_000, 2_020, only(0, drop)), e, "pair"
    yield "right 10 ms after left", between(f, 2_000, 2_020, only(1, late(10))), e, "pair_spread"
    tick = {"pair_limit_us": 15 * MS}
    yield "right 16 ms after left, a tick allowed", between(f, 2_000, 2_020, only(1, late(16))), e, "pair_spread", tick
    yield "wrong setpoint type", between(f, 2_000, 2_020, with_data(0, 2)), e, "type"
    yield "four bytes", between(f, 2_000, 2_020, lambda x: x._replace(data=x.data[:4])), e, "dlc"
    yield "eight bytes", between(f, 2_000, 2_020, lambda x: x._replace(data=x.data.ljust(8, b"\0"))), e, "dlc"
    yield "too fast", between(f, 2_300, 2_320, with_data(1, 1200)), e, "speed"
    yield "too fast backwards", between(f, 2_300, 2_320, with_data(1, -32768)), e, "speed"
    yield "a turn too fast", between(f, 2_300, 2_320, only(1, with_data(1, -300))), e, "yaw"
    yield "too much current", between(f, 2_300, 2_320, with_data(3, 2001)), e, "current"
    yield "too much negative current", between(f, 2_300, 2_320, with_data(3, -2001)), e, "current"
    steep = good(CONFIG._replace(accel_mm_s2=1000))
    yield "a slope a quarter too steep", steep, e, "slew"
    yield "a ramp down a quarter too steep", good(CONFIG._replace(decel_mm_s2=2000)), e, "slew"
    yield "full speed in one step", between(f, 1_720, 1_741, with_data(1, 300)), e, "slew"
    yield "faster than commanded", between(f, 2_500, 2_600, with_data(1, 310)), e, "beyond_command"
    yield "backwards when forwards was commanded", between(f, 1_760, 1_780, with_data(1, -5)), e, "beyond_command"
    yield "a hard stop although the client only left", between(f, 9_622, 9_900, with_data(1, 0)), e, "hard_stop"
    yield "e-stop answered after 9 ms", between(f, 3_521, 5_100, late(9)), e, "estop_latency"
    yield (
        "e-stop answered by a ramp",
        add(between(f, 3_515, 3_570, drop), *pair(3_521, 270, 270), *pair(3_541, 240, 240), *pair(3_561, 210, 210)),
        e,
        "nonzero_after_estop",
    )
    yield "e-stop ignored until the end", between(f, 3_515, 5_100, with_data(1, 300)), e, "nonzero_after_estop"
    yield "e-stop ignored after a late press", between(f, 3_515, 5_100, with_data(1, 300)), late_press(e), "nonzero_after_estop"
    waits = add(between(f, 6_701, 8_370, late(300)), *(x for ms in range(6_702, 7_000, 20) for x in pair(ms, 200, 100)))
    slow = [x._replace(done_us=STOP + 300 * MS) if x.kind == "stop" else x for x in e]
    slow += [Event(ms * MS, "drive", ms * MS + 400, left=200, right=100) for ms in range(6_700, 7_000, 50)]
    yield "a stop obeyed and answered after 300 ms", waits, slow, "nonzero_after_ramp"
    yield "an old pair after the e-stop's zeros", add(f, *pair(4_105, 300, 300), *pair(4_110, 300, 300)), e, "nonzero_after_estop"
    yield "no zero at all after the e-stop", between(f, 3_520, 99_999, drop), e, "estop_no_zero"
    yield "motion after release and reset", add(f, *pair(5_450, 100, 100)), e, "sent_after_reset"
    yield "zeros after reset", add(f, *pair(5_550, 0, 0)), e, "sent_after_reset"
    yield "driving on after the client left", add(f, *tail), e, "nonzero_after_ramp"
    yield "driving on after stop", between(f, 6_700, 7_600, with_data(1, 200)), e, "nonzero_after_ramp"
    yield "driving on after the lease", f, without(e, "drive", 2_000, 3_510), "lease"
    yield "a drive accepted after the lease", f, without(e, "drive", 2_000, 2_900), "late_drive"
    yield "a drive accepted after the e-stop", f, [*e, Event(3900 * MS, "drive", 3901 * MS, left=100, right=100)], "drive_after_end"
    yield "an unknown id", add(f, Frame(2_000 * MS, 267, bytes(5))), e, "unknown_id"
    yield "a remote setpoint", add(f, Frame(2_000 * MS, LEFT | 0x40000000, b"")), e, "unknown_id"
    yield "an extended setpoint", add(f, Frame(2_000 * MS, LEFT | 0x80000000, bytes(5))), e, "unknown_id"
    yield "sending after the process died", f, [*e, Event(3000 * MS, "end")], "nonzero_after_killed"
    yield "a latching fault answered late", f, [*e, Event(3000 * MS, "cut", within_us=100 * MS)], "nonzero_after_cut"
    yield "old setpoints out of a queue", f, [*e, Event(2500 * MS, "dead"), Event(3300 * MS, "alive", 3300 * MS)], "motion_on_dead_bus"
    yield "a bus that lives again before it died", f, [*e, Event(2500 * MS, "alive", 2500 * MS), Event(2501 * MS, "dead")], "timeline"
    off = [Event(9_500 * MS, "dead"), Event(9_500 * MS, "cut", within_us=50 * MS), Event(12_000 * MS, "alive", 12_000 * MS)]
    dark = between(f, 9_500, 99_999, drop)
    yield "two old frames after the bus lives again", add(dark, *pair(12_001, -200, 200), *pair(12_002, -200, 200)), e + off, "old_frame"
    yield "an old frame without its zero", add(dark, *pair(12_001, -200, 200)), e + off, "old_frame"
    yield "an old frame, its zero 20 ms later", add(dark, *pair(12_001, -200, 200), *pair(12_021, 0, 0)), e + off, "old_frame"
    yield "old frames again and again", add(dark, *pair(12_001, -200, 200), *pair(12_002, 0, 0), *pair(12_041, -200, 200)), e + off, "nonzero_after_cut"
    yield "motion after a restart", add(f, *pair(12_120, 50, 50)), [*e, Event(12100 * MS, "restart_hold")], "motion_without_drive"
    yield "no zeros after a crash while armed", f, [*e, Event(12100 * MS, "restart_hold")], "never_sent"
    yield (
        "nonzero current in a zero",
        between(good(CONFIG._replace(role="setpoint")), 7_200, 8_300, with_data(3, 2000)),
        e,
        "nonzero_after_ramp",
        {"config": CONFIG._replace(role="setpoint")},
    )
    yield (
        "dirty padding",
        between(good(CONFIG._replace(dlc=8)), 2_000, 2_020, lambda x: x._replace(data=x.data[:7] + b"\1")),
        e,
        "padding",
        {"config": CONFIG._replace(dlc=8)},
    )
    yield "not inverted", good(), e, "beyond_command", {"config": CONFIG._replace(invert=(True, False))}


def goods():
    f, e = good(), script()
    yield "the ideal gateway", f, e, {}
    for name, config in (
        ("setpoint role", CONFIG._replace(role="setpoint")),
        ("mirrored", CONFIG._replace(invert=(True, False))),
        ("eight bytes", CONFIG._replace(dlc=8, setpoint_type=7)),
    ):
        yield name, good(config), e, {"config": config}
    yield "foreign frames that the scenario itself sent", add(f, *(x._replace(own=True) for x in pair(12_000, 900, 900))), e, {}
    yield "one pair on its way at the e-stop", add(f, *pair(3_520.2, 300, 300)), e, {}
    yield "a press that the test made 50 ms late", f, late_press(e), {}
    off = [Event(9_500 * MS, "dead"), Event(9_500 * MS, "cut", within_us=50 * MS), Event(12_000 * MS, "alive", 12_000 * MS)]
    yield (
        "one old frame per wheel and its zero",
        add(between(f, 9_500, 99_999, drop), *pair(12_001, -200, 200), *pair(12_001.5, 0, 0)),
        [x for x in e if x.t_us < 9_500 * MS] + off,
        {},
    )
    muted = [x for x in f if x.id != 256 or not 6_900 * MS <= x.t_us < 8_300 * MS]
    more = [frame for ms in range(8_370, 8_800, 20) for frame in pair(ms, 0, 0)]
    yield "a hold that waits for a wheel that was offline in it", add(muted, *more), e, {}
    seam = [Event(7_000 * MS, "dead"), Event(7_201_100, "alive", 7_201_100)]  # over between left and right
    yield "a pair on the seam of a dead bus", f, e + seam, {}
    yield "right 10 ms after left, a tick allowed", between(f, 2_000, 2_020, only(1, late(10))), e, {"pair_limit_us": 15 * MS}
    yield "left without right at an exit, on a bus that this clears", *broken_at_exit(f, e), {"exit_clears": True}
    yield "no motion wanted, none made", [x for x in f if not is_setpoint(x)], [e[0]], {"moves": False}


def timings():
    """(name, frames, events, rule, whether a measured stall of that length can be the reason)"""
    f, e = good(), script()
    yield "600 ms without setpoints", between(f, 2_200, 2_800, drop), e, "gap", True
    yield "e-stop answered after 400 ms", between(f, 3_521, 5_100, late(400)), e, "estop_latency", True
    yield "driving on for a second after the lease", f, without(e, "drive", 2_000, 3_510), "lease", False
    yield "e-stop ignored for a second", between(f, 3_515, 4_500, with_data(1, 300)), e, "nonzero_after_estop", False


def run():
    """Returns (number of checks, list of failures)."""
    failures, count = [], 0
    for name, frames, events, rule, wanted in timings():
        count += 1
        found = [v for v in verdict(frames, events) if v.rule == rule]
        if not found or all(v.timing for v in found) != wanted:
            failures.append(f"'{name}': {rule} counts as a failure {'of the rule' if wanted else 'in time'} (found: {found[:2]})")
    for name, frames, events, options in goods():
        count += 1
        options = dict(options)
        found = verdict(frames, events, options.pop("config", CONFIG), **options)
        if found:
            failures.append(f"good log '{name}' was refused: {found[0].rule}: {found[0].text}")
    for name, frames, events, rule, *options in faults():
        count += 1
        options = dict(options[0]) if options else {}
        found = {v.rule for v in verdict(frames, events, options.pop("config", CONFIG), **options)}
        if rule not in found:
            failures.append(f"seeded fault '{name}' was not found as {rule} (found: {', '.join(sorted(found)) or 'nothing'})")
    return count, failures


if __name__ == "__main__":
    checks, wrong = run()
    print("\n".join([*wrong, f"{checks} logs judged, {len(wrong)} wrongly"]))
    raise SystemExit(1 if wrong else 0)
