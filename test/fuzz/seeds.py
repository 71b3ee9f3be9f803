# SPDX-License-Identifier: MIT
"""The first inputs of the fuzz targets: written by hand, and from recordings of the product itself (test/recordings)."""

import ast
import collections
import hashlib
import hmac
import json
import re
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
RECORDED = ROOT / "test/recordings/estop"
IDS = (266, 298, 256, 288, 257, 289, 290, 512, 544, 513, 545)
GATEWAY_IDS = (266, 298, 257, 289, 290, 512, 544, 513, 545, 600, 256, 288)
ECHO = 1
LINE = re.compile(r"\(([\d.]+)\) \S+ ([0-9A-F]+)#([0-9A-F]*)(?: ([RT]))?$")
ODD_LINES = """(1760000000.000001) can0 100#00100000
(1760000000.000120) can0 10A#010064 07D0 T
(1760000000.000240) can0 10A#01006407D0 T
(1.5) vcan0 1FFFFFFF#R8
(1760000000.123456) can0 20000080#0000000000000000
(1760000000.123456) can0 123##1112233 R
(1.5) can0 0ab#de.ad.be.ef.00.11.22.fF_9
(1.5) can0 0aB#0011223344556677_F T
(1.5) can0 123#R8_e
(1.5) can0 123#R9
(1.5) can0 123#R_9
(1.5) can0 123#00_9
(1.5) can0 123#0011223344556677_8
(1.5) can0 123#001122334455667788
(1.5) can0 123#0g
(1.5) can0 123#001
(1.5) can0 123##
(1.5) can0 123##f1a
# a comment
"""


def json_vectors():
    """Every row of the unit tests' table, as a line and as a field's value. A line break would end a request."""
    rows = re.findall(r'^(?:OWN_)?(?:YES|NO)\("[^"]*", (.*)\)', (ROOT / "test/support/json_vectors.inc").read_text(), re.M)
    texts = [b"".join(ast.literal_eval("b" + literal) for literal in re.findall(r'"(?:[^"\\]|\\.)*"', row)) for row in rows]
    assert len(texts) > 200, "the table of test/support/json_vectors.inc has another form"
    return [line for text in texts if b"\n" not in text for line in (text, b'{"cmd":"watch","topics":' + text + b"}")]


def by_hand():
    """{target: [bytes]}: also inputs that a target must refuse."""
    sample = [line for path in (ROOT / "docs/user/northbound.md", ROOT / "README.md") for line in re.findall(r"\{\"[^`\n]*\}", path.read_text())]
    return {
        "codec": [bytes([n, 8, 0, *range(8)]) for n in range(len(IDS))] + [b"\xff\x80\x00\x01\x0a\x08\x00" + bytes(8)],
        "gateway": [],
        "request": [line.encode() for line in sample]
        + json_vectors()
        + [b'{"cmd":"drive","left_mm_s":1e2,"right_mm_s":-1,"id":"x"}']
        + [b'{"cmd":"recording","name":"' + name + b'","offset":-1}' for name in (b"../x", b"a" * 64, b"stop-000001-a.log\\u0000", b"")],
        "config": [
            (ROOT / "share/gateway.conf").read_bytes(),
            b"[wheels]\nsetpoint_type = 1\ncurrent_role = limit\ntrack_mm = 540\ngear_ratio = 3/2\n",
            *odd_values(),
            *(b"[drive]\nlease_ms = %d\nmax_speed_mm_s = %d\ndecel_mm_s2 = %d\n" % budget for budget in ((500, 1000, 1500), (20, 5000, 100), (200, 1000, 900))),
        ],
        "candump": [ODD_LINES.encode()],
        "line": [
            b'0 {"cmd":"link"}*e2d27f9b\n',
            b'3 1250000 {"ok":true}*e0f15d9c\n',
            b'1 {"boot":"0123456789abcdef","seq":1,"t_us":2,"cmd":"stop"}\xfe',
            b"8 {}\xfe\xff8 0 {}\xfe",
            b"2 18446744073709551616 {}\xfe9 01 {}\xfe1 x {}\xfe1 5{}\xfe",
            b"{}*0000000G\n{}*00000000\n*\n\n",
            b'1 7 {"boot":"0123456789abcdef","seq":18446744073709551615,"t_us":01,"cmd":"stop"}\xfe',
            b'1 {"boot":"0123456789abcdef","seq":18446744073709551616,"t_us":1,"a":1}\xfe1 {"boot":"0123456789abcdef","seq":01,"t_us":1,"a":1}\xfe1 {"boot":"0123456789abcdef","seq":1,"t_us":}\xfe',
            b"x" * 600 + b"\n0 {}\xfe",
        ],
        "web": [b"GET\n/\n[::1]\nnull\ncross-site\n\n", b"POST\n/api/estop\nwalker.lan:8470\nhttps://walker.lan:8470\nsame-origin\nbearer " + b"0" * 32],
        "mqtt": [
            b'stop\n{"from":"far","seq":1,"boot":"0123456789abcdef","t_us":1}',
            b'estop\n{"from":"a/b"}',
            b"iwspool1" + bytes(40),
            b'{"boot":"a","t_us":1,"seq":1,"ok":true,"recordings":[{"name":"stop-000001-x","cause":"x","wall_us":1,"log_bytes":9}]}',
            b'{"id":"a-1","heard_wall_us":5,"sentence":"x\\u001b[2J","number":4,"missed":true,"wall_us":7,"present":false,"cause":"y"}',
            *mqtt_odd(),
        ],
        "memory": [checked(b'{"format":"iwheel-ledger"}\n')]
        + [store(item, b"") for item in memory_items()]
        + [
            store(b"", b'"%s":{"from":"%s","unit":"dN","offset_mN":%d,"drift_mN":%d,"deviation_mN":%d,"samples":%d,"wall_us":5}' % row)
            for row in (
                (b"left", b"estimated", 150, -900, 900, 40),
                (b"right", b"operator", -1200, 0, 0, 40),
                (b"right", b"wheel", -1200, 0, 0, 0),
                (b"right", b"stored", 0, 0, 0, 0),
            )
        ],
        "session": [
            b"".join(
                b"%s%s\n+5\n" % (b"q" if b'"drive"' in line or b'"twist"' in line else b"", line)
                for line in (text.encode() for text in sample)
                if b'"cmd"' in line
            ),
            *relayed(),
        ],
        "client": [b"\0" + chunk for chunk in states()]
        + [b"\x90" + chunk for chunk in greetings()]
        + [bytes([how]) + b"".join(line.encode() + b"\n" for line in sample if "cmd" not in line) for how in (0, 1, 2, 7, 15, 16, 255)],
    }


def checked(text):
    """The text with its checksum, as the assumption store writes its file."""
    return text + b"%08x\n" % zlib.crc32(text)


def odd_values():
    """Each section of the example, with one odd value for all its keys."""
    sections = re.findall(r"^(\[\w+\])$(.*?)(?=^\[|\Z)", (ROOT / "share/gateway.conf").read_text(), re.M | re.S)
    values = ("0", "1", "50", "4294967296", "012", "none", "yes", "dN", "low", "unix:/run/x", "'a'", "a b c", "27/2/", "")
    return [
        f"{head}\n{''.join(f'{key} = {value}{chr(10)}' for key in re.findall(r'^;?([a-z][a-z_A-Z0-9]*) = ', rows, re.M))}".encode()
        for head, rows in sections
        for value in values
    ]


def states():
    """States that a gateway reports, with values of each kind."""
    wheel = {
        "heard": True,
        "at_rest": False,
        "speed_mm_s": -100,
        "commanded_mm_s": 0,
        "applied_mm_s": 5,
        "distance_mm": 7,
        "battery_dV": 240,
        "temperature_degC": 30,
        "speed_age_ms": 1,
        "force_age_ms": None,
        "force_validity": "valid",
        "force_net_mN": -9,
    }
    return [
        json.dumps(
            {
                "event": "state",
                "t_us": 1,
                "state": state,
                "cause": "x",
                "lease": lease,
                "estop": {"state": "released"},
                "bus": {"state": "active"},
                "left": wheel,
                "right": {**wheel, "heard": 0, "force_validity": "x"},
            }
        ).encode()
        + b"\n"
        for state in ("listening", "armed", "stopping", "latched", "x")
        for lease in ({"holder": 3, "remaining_ms": 9}, {"holder": None})
    ]


def greetings():
    hello = {"event": "hello", "api": 1, "client": 3}
    return [
        json.dumps(chunk).encode() + b"\n"
        for chunk in (
            hello,
            {**hello, "api": 2},
            {**hello, "rights": "watch"},
            {"ok": False, "error": "too_many_clients", "message": "later"},
            {"ok": True},
            {"event": "state"},
        )
    ] + [b"", b"x\n"]


def mqtt_odd():
    """Commands of every kind: retained, of others, late, early, to a bridge that only watches; with a response topic and correlation data."""

    def sample(**more):
        return b"\n" + json.dumps({"from": "a", "seq": 1, "boot": "0123456789abcdef", "t_us": 49900000} | more).encode()

    verbs = ("hello", "stop", "estop", "arm", "drive", "twist", "reset", "why", "recordings", "recording", "fly")
    fields = (
        {"ttl_ms": 0},
        {"ttl_ms": 1001},
        {"seq": 0},
        {"t_us": -1},
        {"t_us": 50000001},
        {"t_us": 1},
        {"boot": "0"},
        {"boot": 5},
        {"from": "a" * 33},
        {"left_mm_s": 1.5},
        {"reason": "x" * 300},
        {"reason": None},
    )
    return (
        [flag + verb.encode() + sample() for verb in verbs for flag in (b"", b"!", b"#", b"-", b"+")]
        + [verb + sample(**more) for more in fields for verb in (b"estop", b"drive")]
        + [b"stop\t" + topic + b"\tlabel" + sample() for topic in (b"iwheel/w1/reply/b", b"iwheel/w2/reply/b", b"iwheel/w1/reply/b+", b"")]
        + [b"stop\tiwheel/w1/reply/b\t" + b"x" * 65 + sample()]
    )


def memory_items():
    """An entry of each possible kind, from the bus and from the operator."""
    bus = (
        ("setpoint_type", 1000, "255"),
        ("force_unit_left", 10000, "cN"),
        ("force_unit_right", 1000, "dN"),
        ("offset_included", 10000, "yes"),
        ("feedback_sign_left", 200, "yes"),
        ("feedback_sign_right", 200, "yes"),
        ("gear_ratio", 1000, "3/2, rpm of the rotor"),
        ("pose_byte_order", 9000, "yes"),
        ("dlc", 7, "yes"),
    )
    against = (
        ("force_unit_left", 1000, "cN"),
        ("offset_included", 0, "yes"),
        ("feedback_sign_left", -200, "yes"),
        ("gear_ratio", 500, "1"),
        ("pose_byte_order", 0, "yes"),
        ("dlc", 4, "yes"),
    )
    words = (
        ("current_role", "limit", "setpoint"),
        ("mount_sign_left", "no", "yes"),
        ("wheel_radius", "192", "200"),
        ("track", "540", "600"),
        ("gear_ratio", "1, rpm of the wheel", "2/1"),
        ("setpoint_type", "1", ""),
    )
    row = '"%s":{"state":"%s","evidence":"%s","figure":%d,"value":"%s","found":"%s","since_wall_us":1%s}'
    return [
        (row % (name, state, "bus", figure, value, "", "")).encode()
        for state, chunk in (("confirmed", bus), ("contradicted", against))
        for name, figure, value in chunk
    ] + [
        (row % (name, state, "operator", 0, value, found, ',"how":"measured"')).encode()
        for state in ("confirmed", "contradicted")
        for name, value, found in words
    ]


def memory():
    """Files of the assumption store: empty, with entries, and with an offset."""
    items = (
        b"",
        b'"setpoint_type":{"state":"confirmed","evidence":"bus","figure":850,"value":"255","found":"","since_wall_us":0}',
        b'"force_unit_left":{"state":"confirmed","evidence":"bus","figure":11500,"value":"cN","found":"","since_wall_us":1760000000000000}',
    )
    offset = b'"left":{"from":"wheel","unit":"cN","offset_mN":1200,"drift_mN":0,"deviation_mN":0,"samples":0,"wall_us":1760000000000000}'
    texts = [(item, b"") for item in items] + [(b",".join(items[1:]), offset)]
    return [store(*text) for text in texts]


def store(items, offsets):
    return checked(b'{"format":"iwheel-ledger","version":1,"bus":"can0","items":{%s},"offsets":{%s}}\n' % (items, offsets))


def relayed():
    """Further input of a board: from its relay, from a second client, about its configuration and its assumptions."""
    keys = (
        "wheels.gear_ratio=3/2",
        "wheels.gear_ratio=0/1",
        "wheels.track_mm=600",
        "drive.lease_ms=9999",
        "left.invert=yes",
        "left.invert=maybe",
        "wheels.current_role=setpoint",
        "wheels.rpm_of=rotor",
        "bus.bitrate=5",
        "drive.period_ms=",
    )
    config = b"".join(b'{"cmd":"config","key":"%s","value":"%s"}\n' % tuple(pair.encode().split(b"=")) for pair in keys)
    confirm = b"".join(
        b'{"cmd":"confirm","id":4,"item":"%s","value":"%s","how":"x"}\n' % pair
        for pair in (
            (b"wheel_radius", b"192"),
            (b"track", b"9"),
            (b"current_role", b"setpoint"),
            (b"gear_ratio", b"1"),
            (b"dlc", b"yes"),
            (b"mount_sign_left", b"no"),
        )
    )
    tare = b'+700\n{"cmd":"tare","side":"left"}\n{"cmd":"tare"}\n{"cmd":"why"}\n{"cmd":"recordings"}\n{"cmd":"status"}\n'
    return [
        config + b'{"cmd":"config","commit":true}\n{"cmd":"config","commit":false}\n{"cmd":"config"}\n',
        config[:60] + b'{"cmd":"config","commit":true}\n+900\n',
        confirm,
        tare,
        b'@{"cmd":"open","channel":2,"watch":true}\n2{"cmd":"arm"}\n2{"cmd":"stop","id":9}\n2{"cmd":"status"}\n@{"cmd":"close","channel":1}\n@{"cmd":"open","channel":1,"watch":false}\n',
        b'@{"cmd":"open","channel":2,"watch":false}\n2{"cmd":"arm","takeover":true,"name":"b"}\n+60\n{"cmd":"arm"}\n2{"cmd":"disarm"}\n@{"cmd":"link"}\n@{"cmd":"open","channel":9}\n@{"ok":true}\n@x\n',
    ]


def session():
    """Drives that are stopped in each way, for fuzz_session.c."""
    drive = b'q{"cmd":"drive","id":1,"left_mm_s":200,"right_mm_s":-100}\n+40\n' * 4
    begin = b'+700\n{"cmd":"arm"}\n+60\n' + drive
    ends = (
        b'{"cmd":"stop","id":2}\n',
        b"^\n+900\n_\n+600\n" + b'q{"cmd":"reset","id":3}\n' + begin,
        b'{"cmd":"estop","reason":"x"}\n+900\nq{"cmd":"reset"}\n',
        b"+900\n",
        b'q{"cmd":"twist","v_mm_s":100,"yaw_mrad_s":300}\n+40\n{"cmd":"watch","topics":["state","force"],"rate_hz":10}\n+300\n',
    )
    return [begin + end for end in ends]


def frames():
    """[(line, id, data, whether the gateway sent it)]"""
    found = [(line, LINE.match(line)) for line in RECORDED.with_suffix(".log").read_text().splitlines()]
    return [(line, int(match[2], 16), bytes.fromhex(match[3]), match[4] == "T") for line, match in found]


def rows():
    return [json.loads(line) for line in RECORDED.with_suffix(".jsonl").read_text().splitlines()]


def some_of_each(number):
    """For each id the first frames that differ."""
    seen = collections.defaultdict(dict)
    for frame in frames():
        if len(seen[frame[1]]) < number:
            seen[frame[1]].setdefault(frame[2], frame)
    return [frame for of_id in seen.values() for frame in of_id.values()]


def codec():
    """Frames in the form that take_frame() of fuzz_codec.c reads: one by one, and a drive in its order."""
    chunk = [bytes([IDS.index(number), len(data), ECHO if own else 0]) + data.ljust(8, b"\0") for _, number, data, own in some_of_each(6)]
    return [*chunk, b"".join(chunk)]


def candump():
    """Parts of the log: where the gateway sends nothing, where it drives, where it stops."""
    lines = [line for line, *_ in frames()]
    first = next(at for at, frame in enumerate(frames()) if frame[3])
    return ["\n".join(part).encode() for part in (lines[:20], lines[first - 5 : first + 25], lines[-20:], [line for line, *_ in some_of_each(3)])]


def request():
    """The requests that iwheelctl and the Python client send to a gateway."""
    return [line.encode() for line in (RECORDED.parent / "requests.jsonl").read_text().splitlines()]


def line():
    """The same requests from the relay, on a channel and with a CRC."""
    return [b"1 " + sample + b"\xfe" for sample in request() if len(sample) < 400]


def config():
    return [RECORDED.with_suffix(".conf").read_bytes()]


def client():
    """The gateway's own notes, as events."""
    lines = [json.dumps({"event": row["type"], **row}).encode() + b"\n" for row in rows()]
    return [b"\0" + line for line in lines[:20]] + [bytes([how]) + b"".join(lines[:60]) for how in (0, 1, 8, 40)]


def mqtt():
    """Commands that fuzz_mqtt.c accepts, and a spool's file with two events of which one is confirmed."""
    sample = b'\n{"from":"far","seq":7,"boot":"0123456789abcdef","t_us":49900000'
    verbs = (b"stop", b"arm", b"why", b"estop", b"drive", b"recording")
    fields = (b"", b"", b',"ttl_ms":500', b',"reason":"in the way"', b',"left_mm_s":100,"right_mm_s":-5', b',"name":"stop-000001-estop_line.log","offset":0')

    def record(letter, number, rest=b""):
        body = letter + number.to_bytes(8, "little") + bytes(8) + rest
        return len(body).to_bytes(4, "little") + zlib.crc32(body).to_bytes(4, "little") + body

    events = [record(b"e", number, b"stop\0" + b'{"number":%d}' % number) for number in (1, 2)]
    return [verb + sample + more + b"}" for verb, more in zip(verbs, fields, strict=False)] + [
        b"iwspool1" + record(b"c", 0) + b"".join(events) + record(b"c", 1)
    ]


def web():
    """Requests of a browser with the token of fuzz_web.c: to watch, and to drive."""
    token = b"00112233445566778899aabbccddeeff"
    session, nonce = b"a" * 32, b"0123456789abcdef" * 2
    sample = b"127.0.0.1:8470\nhttp://127.0.0.1:8470\nsame-origin\n"
    drive = b"\n" + token + b"\n9900000\n1\n200\n-100\nstop-000001-estop_line.jsonl"

    def proof(method, target):
        mac = hmac.new(token, b"\n".join((method, target, session, nonce, b"1")), hashlib.sha256).hexdigest().encode()
        return b"IWheel " + b" ".join((session, nonce, b"1", mac))

    reads = b"Bearer " + hmac.new(token, b"iwheel-web read", hashlib.sha256).hexdigest()[:32].encode()
    asked = [(b"GET", b"/api/events"), (b"POST", b"/api/drive")]
    return [b"\n".join((*one, sample + proof(*one))) + drive for one in asked] + [b"GET\n/metrics\n" + sample + reads + drive]


def put(number, data, own):
    """A frame in the world of fuzz_gateway.c: an echo of what was sent, or one from the bus."""
    if own:
        return bytes([5, number == 298])
    return bytes([6, 0, GATEWAY_IDS.index(number), len(data)]) + data.ljust(8, b"\0")


def short_drives():
    """Arm and drive at two speeds in the world of fuzz_gateway.c. Frames of another device arrive meanwhile: with another identifier, each is a foreign setpoint."""
    others = 3 * (put(600, bytes(4), False) + bytes([0, 8]))
    arm, slow, fast = bytes([1, 60, 1, 60, 11, 4, 0, 10]), bytes([11, 0, 10, 3, 232, 5, 3, 232, 5]), bytes([2, 200, 10, 0, 11, 2, 88, 9, 2, 88, 9])
    drives = bytes([0, 1, 15]) + arm + slow + others + fast + others
    return [drives, drives + bytes([8, 0, 2, 1]) + drives, bytes([2]) + drives[1:]]


def do(row):
    """A request, or a reading of the button, in the world of fuzz_gateway.c."""
    if row["type"] == "arm":
        return bytes([10, 4])
    if row["type"] == "drive":
        return bytes([10, 0, 200]) + b"".join(row[side].to_bytes(2, "big", signed=True) + bytes([125]) for side in ("left_mm_s", "right_mm_s"))
    if row["type"] == "estop_line":
        return bytes([8, 2 if row["answer"] else 255])
    return b""


def windows():
    """The parts of the recording that contain decisions, [(from, to)]: before arm until it drives, and around the stop."""
    armed_us = next(row["t_us"] for row in rows() if row["type"] == "arm")
    latched_us = next(row["t_us"] for row in rows() if row["type"] == "state" and row["state"] == "latched")
    return (armed_us - 300_000, armed_us + 80_000), (latched_us - 40_000, latched_us + 10_000)


def gateway():
    """The recording as input of fuzz_gateway.c: until it drives, and then until the stop."""
    chunk, used, done_us, seen, parts = bytes([0, 1, 15]), 0, None, frames(), []
    for begin_us, end_us in windows():
        for row in rows():
            new = seen[used : row.get("frames", 0)]
            used = max(used, row.get("frames", 0))
            if not begin_us <= row.get("t_us", 0) <= end_us:
                done_us = None
                continue
            if row["type"] != "step":
                chunk += b"".join(put(number, data, own) for _, number, data, own in new[-16:]) + do(row)
                continue
            # Input that came while the gateway did not run: some frames, some time, and so on.
            units = (row["t_us"] - (done_us or row["t_us"])) // 100
            done_us = (done_us or row["t_us"]) + units * 100
            parts_of = max(1, -(-units // 200), -(-len(new) // 16))
            for part in range(parts_of):
                some = new[len(new) * part // parts_of : len(new) * (part + 1) // parts_of]
                chunk += b"".join(put(number, data, own) for _, number, data, own in some)
                chunk += bytes([2, units * (part + 1) // parts_of - units * part // parts_of])
        parts.append(chunk)
        used = 0
    return parts


def recorded():
    """{target: [bytes]}: a target that does not accept them no longer tests its code."""
    return {
        "codec": codec(),
        "gateway": short_drives() + gateway(),
        "request": request(),
        "config": config(),
        "candump": candump(),
        "client": client(),
        "mqtt": mqtt(),
        "web": web(),
        "line": line(),
        "memory": memory(),
        "session": session(),
    }
