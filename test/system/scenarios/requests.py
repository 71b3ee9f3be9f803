# SPDX-License-Identifier: MIT
"""Rows 8 to 10: lines that are too long, invalid, or out of range."""

import time

from client import Closed
from scenario import scenario


def closed_after(client, seconds=2.0):
    try:
        while client.read_line(seconds) is not None:
            pass
    except Closed:
        return True
    return False


@scenario("1 MB line, no newline, bytes one by one: bounded, refused, closed", 5)
def row08_endless_lines(t):
    rig, observer = t.running()
    before_kB = rig.gateway.resident_kB()
    for chunk, times in ((b"x" * 4096, 256), (b'{"cmd":"status",' + b" " * 4080, 256)):
        client = rig.client()
        client.read_line()
        try:
            for _ in range(times):
                client.send_raw(chunk)
        except OSError:
            pass
        try:
            reply = client.read_reply()
            t.check(reply and reply.get("error") == "line_too_long", f"line_too_long expected, got {reply}")
        except Closed:
            t.check(False, "closed without a reason")
        t.check(closed_after(client), "the connection is closed")
    client = rig.client()
    for byte in b'{"cmd":"hello","id":5}\n':
        client.send_raw(bytes([byte]))
        time.sleep(0.001)
    reply = client.read_reply()
    t.check(reply and reply["ok"] and reply["id"] == 5, f"bytes one by one are a line too: {reply}")
    exact = b'{"cmd":"hello","id":6' + b" " * (4096 - 22) + b"}\n"
    client.send_raw(exact)
    reply = client.read_reply()
    t.check(len(exact) == 4097 and reply and reply["ok"], f"4096 bytes and a newline are allowed: {reply}")
    client.send_raw(exact.replace(b"6 ", b"6  ", 1))
    reply = client.read_reply()
    t.check(reply and reply.get("error") == "line_too_long", f"4097 are not: {reply}")
    half = rig.client()  # A stop in a bad line is executed, but this is no line.
    half.send_raw(b'{"cmd":"estop"}')
    half.close()
    time.sleep(0.1)
    t.check(observer.request("status")["state"] == "listening", "half a line is never applied")
    after_kB = rig.gateway.resident_kB()
    t.check(after_kB <= before_kB + 256, f"memory {before_kB} kB before, {after_kB} kB after")
    t.judge(rig, moves=False)


BAD_LINES = [
    (b"", None),
    (b"hello", "bad_json"),
    (b"{", "bad_json"),
    (b"[]", "bad_json"),
    (b"null", "bad_json"),
    (b'"cmd"', "bad_json"),
    (b"{}", "missing_field"),
    (b'{"cmd":"drive","left_mm_s":100,"right_mm_s":100,}', "bad_json"),
    (b'{"cmd":"hello","id":1} {"cmd":"hello"}', "bad_json"),
    (b'{"cmd":"hel\xfflo"}', "bad_json"),
    (b'{"cmd":"arm","name":"\xc3\x28"}', "bad_json"),
    (b'{"cmd":"hello\x00"}', "bad_json"),
    (b'{"cmd":"hello"}\x00', "bad_json"),
    (b'{"cmd":"arm","name":"\\u0000"}', "bad_json"),
    (b'{"cmd":"arm","name":' + b"[" * 1500 + b"]" * 1500 + b"}", "bad_json"),
    (b'{"a":' * 500 + b"1" + b"}" * 500, "bad_json"),
    (b'{"cmd":"drive","left_mm_s":1e999,"right_mm_s":100}', ("bad_json", "bad_value")),
    (b'{"cmd":"drive","left_mm_s":NaN,"right_mm_s":100}', "bad_json"),
    (b'{"cmd":"drive","left_mm_s":Infinity,"right_mm_s":100}', "bad_json"),
    (b'{"cmd":"drive","left_mm_s":1.5,"right_mm_s":100}', "bad_value"),
    (b'{"cmd":"drive","left_mm_s":1.0,"right_mm_s":100}', "bad_value"),
    (b'{"cmd":"drive","left_mm_s":1e2,"right_mm_s":100}', "bad_value"),
    (b'{"cmd":"drive","left_mm_s":"100","right_mm_s":100}', "bad_value"),
    (b'{"cmd":"drive","left_mm_s":true,"right_mm_s":100}', "bad_value"),
    (b'{"cmd":"drive","left_mm_s":null,"right_mm_s":100}', "bad_value"),
    (b'{"cmd":"drive","left_mm_s":0x64,"right_mm_s":100}', "bad_json"),
    (b'{"cmd":"drive","left_mm_s":0100,"right_mm_s":100}', "bad_json"),
    (b'{"cmd":"drive","left_mm_s":100,"left_mm_s":100,"right_mm_s":100}', "bad_json"),
    (b'{"cmd":"drive","left_mm_s":100,"right_mm_s":100,"speed":3}', "unknown_field"),
    (b'{"cmd":"hello","extra":1}', "unknown_field"),
    (b'{"cmd":"drive","left_mm_s":100}', "missing_field"),
    (b'{"cmd":"drive"}', "missing_field"),
    (b'{"cmd":"drive","left_mm_s":100,"right_mm_s":100,"left_mA":500}', "missing_field"),
    (b'{"cmd":"fly"}', "unknown_cmd"),
    (b'{"cmd":"ARM"}', "unknown_cmd"),
    (b'{"cmd":7}', ("bad_value", "unknown_cmd")),
    (b'{"cmd":"arm","takeover":"yes"}', "bad_value"),
    (b'{"cmd":"arm","name":5}', "bad_value"),
    (b'{"cmd":"watch"}', "missing_field"),
    (b'{"cmd":"watch","topics":["weather"]}', "bad_value"),
    (b'{"cmd":"watch","topics":"state"}', "bad_value"),
    (b'{"cmd":"watch","topics":["state"],"rate_hz":0}', ("out_of_range", "bad_value")),
    (b'{"cmd":"tare","side":"up"}', "bad_value"),
    (b'{"cmd":"hello","id":{}}', "bad_value"),
]

# The gateway refuses a stop for none of its fields.
ODD_STOPS = [
    b'{"cmd":"stop","t_us":1}',
    b'{"cmd":"disarm","key":"x","id":1.5}',
    b'{"cmd":"estop","reason":"' + b"x" * 201 + b'"}',
    b'{"cmd":"estop","reason":"Traceback:\\n line","now":true}',
]


@scenario("bad UTF-8, NUL, depth, 1e999, NaN, 1.5, double and unknown keys: refused as a whole", 5)
def row09_odd_json(t):
    rig, observer = t.running()
    owner = rig.client("owner")
    t.arm(owner)
    for line, error in BAD_LINES:
        client = rig.client()
        client.read_line()
        client.send_raw(line + b"\n")
        if error is None:
            client.send_raw(b'{"cmd":"hello","id":77}\n')
        try:
            reply = client.read_reply(2)
        except Closed:
            reply = None
        wanted = error if isinstance(error, tuple) else (error,)
        if error is not None:
            t.check(
                reply and not reply["ok"] and reply.get("error") in wanted and len(reply.get("message", "")) > 10,
                f"{line[:70]!r}: {error} expected, got {reply}",
            )
        client.close()
    t.figure(f"{len(BAD_LINES)} lines")
    for line in ODD_STOPS:
        client = rig.client()
        client.read_line()
        client.send_raw(line + b"\n")
        t.rule(client.read_reply(2)["ok"], f"{line[:70]!r} is executed")
        client.close()
    t.rule(not any(speed for _, _, speed in rig.bus.setpoints()), "nothing moved")
    t.expect(observer.request("hello"))
    t.judge(rig, moves=False)


@scenario("out of range: refused for both wheels, and no refused command feeds the lease", 6)
def row10_out_of_range(t):
    rig, client = t.running()
    t.arm(client)
    begin = time.monotonic()
    bad = [
        {"left_mm_s": 100, "right_mm_s": 40000},
        {"left_mm_s": -32769, "right_mm_s": 100},
        {"left_mm_s": 100, "right_mm_s": 4294967396},
        {"left_mm_s": 100, "right_mm_s": 10**25},
        {"left_mm_s": 100, "right_mm_s": 100, "left_mA": 500, "right_mA": 2001},
        {"left_mm_s": 100, "right_mm_s": 100, "left_mA": -2001, "right_mA": 0},
        {"left_mm_s": 2**63, "right_mm_s": 0},
    ]
    while time.monotonic() - begin < 1.4:
        for fields in bad:
            reply = client.request("drive", **fields)
            allowed = ("out_of_range", "not_armed") if time.monotonic() - begin > 0.9 else ("out_of_range",)
            if abs(fields["right_mm_s"]) > 2**62 or fields["left_mm_s"] > 2**62:
                allowed += ("bad_json", "bad_value")
            t.check(not reply["ok"] and reply["error"] in allowed, f"{fields}: {reply}")
        time.sleep(0.03)
    t.stopped_by(client, "lease_lost", "stopping")
    t.rule(not any(speed for _, _, speed in rig.bus.setpoints()), "nothing moved, neither left nor right")
    t.silence(rig, client)
    t.arm_and_drive(client, 150, 150, 0.3)
    t.judge(rig)
