# SPDX-License-Identifier: MIT
"""The bridge without a browser: access rights, hostile peers, and the requests that reach the gateway and the bus."""

import contextlib
import gzip
import http.client
import json
import os
import re
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from bus import now_us
from certificate import self_signed
from harness import Process, wait_connect
from judge_log import GAP_US
from shifted_clock import ShiftedClock
from trials import ROOT, Driver, Skip, braking_ms, longest_gap_ms, until
from free_port import free_port
from web_rig import Person

ROUTES = ("/api/status", "/api/events", "/api/stops", "/api/recordings", "/api/recording?name=a.log", "/api/fleet", "/metrics", "/health")
PROVED = ("/api/estop", "/api/arm", "/api/drive", "/api/reset", "/api/record")  # STOP needs no proof.
COMMANDS = ("/api/stop", *PROVED)


def raw(rig, data, seconds=3):
    """The reply to these bytes, until the bridge closes the connection or sends nothing more."""
    with socket.create_connection(("127.0.0.1", rig.port), timeout=seconds) as one:
        answer = b""
        with contextlib.suppress(OSError):
            one.sendall(data)
            one.shutdown(socket.SHUT_WR)
            while piece := one.recv(65536):
                answer += piece
        return answer


def read_until(stream, holds):
    """Reads on until its latest text fulfils the condition."""
    text = b""
    while not holds(text):
        piece = stream.recv(65536)
        assert piece, "the stream has ended"
        text = text[-200:] + piece


def stopped_ms(rig, **options):
    """Milliseconds from the request for a stop to the first smaller setpoint on the bus."""
    since = now_us()
    status, body = rig.ask_json("POST", "/api/stop", **options)
    assert status == 200 and body["state"] == "stopping", body
    return braking_ms(rig, since)


def gateway_state(rig):
    client = rig.client(name="looker")
    try:
        return client.request("status")
    finally:
        client.close()


def at_standstill(rig):
    """By the gateway's own word: the bridge may be busy or without a connection."""
    until(lambda: gateway_state(rig)["state"] == "listening", what="the wheels are at standstill")


# ---- access ---------------------------------------------------------------------------------------------------------


def test_token_missing_or_wrong_reveals_and_stops_nothing(rig):
    rig.start().connected()
    driver = Driver(rig)
    for token in ("", "0" * 32, rig.token[:-1], rig.token + "0", rig.token.upper() + "x"):
        for path in ROUTES:
            status, body = rig.ask("GET", path, token=token)
            assert status == 401 and "bad_token" in body, (token, path, status)
        for path in PROVED:
            assert rig.ask("POST", path, token=token)[0] == 401, path
    for bearer in (rig.token, "0" * 32, rig.read_secret[:-1], ""):
        for path in ROUTES:
            assert rig.ask("GET", path, headers={"Authorization": f"Bearer {bearer}"})[0] == 401, path
    assert gateway_state(rig)["state"] == "armed"
    driver.end()
    assert oct(os.stat(rig.path("token")).st_mode & 0o777) == "0o600"
    assert rig.ask("GET", "/", token="")[0] == 200


def test_stop_never_needs_a_proof(rig):
    rig.start().connected()
    for token in ("", "0" * 32):
        driver = Driver(rig)
        assert (late := stopped_ms(rig, token=token)) < 200, f"{late} ms"
        driver.end()
        at_standstill(rig)


@pytest.mark.rig(driving=True)
def test_read_secret_reads_and_does_nothing_else(rig):
    rig.start().connected()
    reads = {"Authorization": f"Bearer {rig.read_secret}"}
    printed = subprocess.run([rig.program("iwheel-web"), "-c", rig.path("web.conf"), "--read-secret"], capture_output=True, text=True, check=True)
    assert printed.stdout.strip() == rig.read_secret
    for path in ("/api/status", "/api/stops", "/metrics", "/health"):
        assert rig.ask("GET", path, headers=reads)[0] == 200, path
    for path in PROVED:
        assert rig.ask("POST", path, headers=reads)[0] == 401, path


@pytest.mark.rig(driving=True)
def test_proof_replayed_moved_or_altered_is_refused(rig):
    rig.start().connected()
    person = rig.person
    arm = f"/api/arm?boot={person.boot}&t_us={now_us()}"
    header = person.header("GET", "/api/stops")

    def send(method, path, proof):
        return rig.ask(method, path, headers={"Authorization": proof})[0]

    assert send("GET", "/api/stops", header) == 200
    assert send("GET", "/api/stops", header) == 401, "the same once more"
    assert send("POST", arm, person.header("GET", arm)) == 401, "another method"
    assert send("POST", arm + "1", person.header("POST", arm)) == 401, "another target"
    parts = person.header("POST", arm).split()
    for wrong in (
        [*parts[:3], str(int(parts[3]) + 1), parts[4]],
        [*parts[:4], "0" * 64],
        [*parts[:2], "0" * 32, *parts[3:]],
        [parts[0], "f" * 32, *parts[2:]],
        parts[:4],
        [*parts, "x"],
        [*parts[:3], "0", parts[4]],
        [*parts[:3], "-1", parts[4]],
        [*parts[:3], "99999999999999999999", parts[4]],
    ):
        assert send("POST", arm, " ".join(wrong)) == 401, wrong
    first, second, third = (person.header("GET", "/health") for _ in range(3))
    assert send("GET", "/health", third) == 200
    assert send("GET", "/health", first) == 200, "a browser's requests overtake each other"
    for _ in range(64):
        assert send("GET", "/health", person.header("GET", "/health")) == 200
    assert send("GET", "/health", second) == 401, "older than the window"
    assert gateway_state(rig)["state"] == "listening"


@pytest.mark.rig(settings={"web": {"token_hours": 1}})
def test_token_over_or_replaced_ends_streams_and_is_refused(rig):
    rig.start().connected()
    for change in (lambda: os.utime(rig.path("token"), (1, 1)), lambda: os.unlink(rig.path("token"))):
        before = rig.token
        with rig.stream(10) as stream:
            assert stream.recv(100).startswith(b"HTTP/1.1 200")
            change()
            until(lambda: rig.ask("GET", "/health", token=before)[0] == 401, what="the old token is refused")
            rig.proved = None
            assert rig.token != before
            read_until(stream, lambda text: text.endswith(b"\r\n0\r\n\r\n"))
        assert rig.ask("GET", "/health")[0] == 200


def test_host_of_another_name_is_refused_everywhere(rig):
    """DNS rebinding: a foreign name that leads to this machine."""
    rig.start().connected()
    for host in ("evil.example", f"evil.example:{rig.port}", "localhost.evil.example", ""):
        for path in ("/", "/page.js", *ROUTES):
            assert rig.ask("GET", path, headers={"Host": host})[0] in (400, 421), (host, path)
        assert rig.ask("POST", "/api/estop", headers={"Host": host})[0] in (400, 421)
    assert b" 400 " in raw(rig, b"GET / HTTP/1.1\r\n\r\n") or b" 421 " in raw(rig, b"GET / HTTP/1.1\r\n\r\n")
    assert gateway_state(rig)["state"] == "listening"


def test_post_from_another_site_changes_nothing(rig):
    rig.start().connected()
    driver = Driver(rig)
    for header in (
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": f"http://127.0.0.1:{rig.port + 1}"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ):
        for path in COMMANDS:
            assert rig.ask("POST", path, headers=header)[0] == 403, (header, path)
    assert gateway_state(rig)["state"] == "armed"
    assert rig.ask("POST", "/api/stop", headers={"Origin": f"http://127.0.0.1:{rig.port}", "Sec-Fetch-Site": "same-origin"})[0] == 200
    driver.end()


def test_answers_forbid_frames_foreign_sources_and_caches(rig):
    rig.start()
    for path in ("/", "/api/stops", "/nowhere"):
        rig.ask("GET", path)
        policy = rig.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy, policy
        assert rig.headers["Cache-Control"] == ("no-cache" if path == "/" else "no-store") and rig.headers["X-Content-Type-Options"] == "nosniff"
        assert "Access-Control-Allow-Origin" not in rig.headers and "Set-Cookie" not in rig.headers
    page = rig.ask("GET", "/")[1] + rig.ask("GET", "/page.js")[1]
    assert not re.search(r"(src|href)=\"(https?:)?//", page) and 'onclick="' not in page


def ask_bytes(rig, path, **headers):
    """(status, headers, body) of a request that may come back compressed."""
    connection = http.client.HTTPConnection("127.0.0.1", rig.port, timeout=5)
    try:
        connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def test_page_files_are_compressed_and_cached_until_they_change(rig):
    rig.start()
    page = rig.ask("GET", "/", token="")[1]
    files = ["/", *("/" + name for name in re.findall(r'(?:src|href)="([\w.]+\.(?:js|css))"', page))]
    assert len(files) > 10
    sent = whole = 0
    for path in files:
        status, plain_headers, plain = ask_bytes(rig, path)
        assert status == 200 and "Content-Encoding" not in plain_headers
        status, headers, packed = ask_bytes(rig, path, Accept_Encoding="gzip, deflate, br")
        assert status == 200 and headers["Content-Encoding"] == "gzip" and headers["Vary"] == "Accept-Encoding" and gzip.decompress(packed) == plain, path
        assert headers["ETag"] != plain_headers["ETag"]
        whole, sent = whole + len(plain), sent + len(packed)
        status, again, body = ask_bytes(rig, path, Accept_Encoding="gzip", If_None_Match=headers["ETag"])
        assert status == 304 and body == b"" and again["ETag"] == headers["ETag"] and again["Cache-Control"] == "no-cache", (path, status)
        assert ask_bytes(rig, path, If_None_Match=headers["ETag"])[0] == 200, "the tag of the other form"
    print(f"        the page: {sent} bytes compressed, {whole} as it is", flush=True)
    assert sent < 72_000 and sent < whole * 0.45, (sent, whole)
    assert ask_bytes(rig, "/api/challenge", Accept_Encoding="gzip")[1].get("Content-Encoding") is None


def test_paths_lead_nowhere_but_to_the_routes(rig):
    rig.start().connected()
    for path in (
        "/../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/page/../../token",
        "//etc/passwd",
        "/page.css/../token",
        "/..%2ftoken",
        "/%00",
        "/page.js%00.css",
        "/token",
        "/.git/config",
        "/index.html",
    ):
        assert rig.ask("GET", path)[0] in (400, 404), path
    for name in ("../token", "..%2Ftoken.log", "/etc/passwd.log", "a%22.log", "stop%00.log", "a.log.log", "", "a" * 80 + ".log", "stop-1.log%0a.log"):
        status, body = rig.ask("GET", f"/api/recording?name={name}")
        assert status == 400, (name, status, body)
    assert rig.ask("GET", "/api/recording?name=a.log&offset=-1")[0] == 400
    assert rig.ask("GET", "/api/recording?name=stop-000001-nowhere.log")[0] == 409


def test_request_with_a_body_is_refused_at_once(rig):
    rig.start().connected()
    head = b"POST /api/stop HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    assert b" 413 " in raw(rig, head + b"Content-Length: 1000000000\r\n\r\nx")
    assert b" 413 " in raw(rig, head + b"Transfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n")


def test_stop_with_a_short_body_stops(rig):
    """Many programs send one with each POST."""
    rig.start().connected()
    driver = Driver(rig)
    answer = raw(rig, b"POST /api/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n\r\n{}")
    assert b" 200 " in answer and b'"state":"stopping"' in answer, answer
    driver.end()


def test_header_that_counts_is_there_once(rig):
    """A proxy may read the last one, the library reads the first."""
    rig.start().connected()
    behind = b"POST /api/stop HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    length = str(len(behind)).encode()
    token = f"Authorization: Bearer {rig.read_secret}\r\n".encode()
    driver = Driver(rig)
    for twice in (
        b"Content-Length: 0\r\nContent-Length: " + length,
        b"Content-Length: 0\r\nTransfer-Encoding : chunked",
        b"Host: evil.example",
        b"host: 127.0.0.1",
        b"Transfer-Encoding: identity\r\nTransfer-Encoding: chunked",
        token + token.strip(),
    ):
        answer = raw(rig, b"GET /page.js HTTP/1.1\r\nHost: 127.0.0.1\r\n" + twice + b"\r\n\r\n" + behind)
        assert answer.startswith(b"HTTP/1.1 400 ") and answer.count(b"HTTP/1.1 ") == 1, (twice, answer[:200])
    assert gateway_state(rig)["state"] == "armed"
    driver.end()


# ---- hostile peers ---------------------------------------------------------------------------------------------------


# As many connections as it can have, replaced as they are closed. Every second one also requests the page without end.
FLOOD = """
import select, socket, sys
def knock(number):
    one = socket.socket()
    one.setblocking(False)
    one.connect_ex(("127.0.0.1", int(sys.argv[1])))
    poll.register(one, select.POLLIN | (select.POLLOUT if number % 2 else 0))
    return one
poll, held = select.poll(), {}
for number in range(1000):
    one = knock(number)
    held[one.fileno()] = (one, number)
while True:
    for fd, what in poll.poll():
        one, number = held[fd]
        try:
            if what & select.POLLOUT:
                one.send(b"GET / HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\n\\r\\n")
                poll.modify(one, select.POLLIN)
            elif one.recv(65536):
                continue
            else:
                raise OSError
        except OSError:
            poll.unregister(fd)
            del held[fd]
            one.close()
            one = knock(number)
            held[one.fileno()] = (one, number)
"""


def assert_no_gap(rig, since_us):
    """The gateway promises a setpoint for each wheel before this time, whatever its clients do (invariant 4)."""
    gap_ms = longest_gap_ms(rig, since_us)
    print(f"        longest gap on the bus: {gap_ms:.1f} ms", flush=True)
    assert gap_ms < GAP_US / 1000, f"{gap_ms:.1f} ms between two setpoints of a wheel"


@pytest.mark.rig(settings={"web": {"max_connections": 64}})
def test_stop_during_1000_connections_arrives_without_a_gap(rig):
    rig.start().connected()
    driver, since = Driver(rig), now_us()
    flood = subprocess.Popen([sys.executable, "-c", FLOOD, str(rig.port)], preexec_fn=lambda: os.nice(5))
    try:
        crowd = re.compile(r"iwheel_web_crowded_out_total (\d+)\n")
        before = int(until(lambda: (found := crowd.search(rig.ask("GET", "/metrics")[1])) and int(found[1]) > 1000 and found, what="the flood")[1])
        for _ in range(20):
            begun = time.monotonic()
            assert rig.ask("GET", "/health")[0] == 200
            assert time.monotonic() - begun < 0.5, "a client with the token waits"
            time.sleep(0.05)
        assert int(crowd.search(rig.ask("GET", "/metrics")[1])[1]) > before + 1000, "the flood has ended on its own"
        assert_no_gap(rig, since)
        assert gateway_state(rig)["state"] == "armed", gateway_state(rig)["cause"]
        assert (late := stopped_ms(rig)) < 500, f"{late} ms"
        assert rig.web.resident_kB() < 60_000, rig.web.resident_kB()
    finally:
        flood.kill()
        flood.wait()
    driver.end()


def test_slow_connections_and_bombs_cost_the_gateway_no_gap(rig):
    rig.start().connected()
    driver, since = Driver(rig), now_us()
    for bomb in (
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"X: " + b"a" * 200_000 + b"\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 20_000 + b"\r\n",
        b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"\x16\x03\x01" * 1000,
        b"\0" * 5000,
        b"GET / HTTP/9.9\r\n\r\n",
        b"\r\n" * 9000,
    ):
        answer = raw(rig, bomb)
        assert not answer or re.match(rb"HTTP/1\.[01] (4\d\d|505) ", answer), answer[:80]
    assert rig.ask("GET", "/health")[0] == 200
    slow = [socket.create_connection(("127.0.0.1", rig.port)) for _ in range(20)]
    begun = time.monotonic()
    while time.monotonic() - begun < 6.5:  # Single bytes with pauses are no request.
        for one in slow:
            with contextlib.suppress(OSError):
                one.send(b"G" if one is slow[0] else b"X")
        time.sleep(0.5)
    closed = 0
    for one in slow:
        one.settimeout(0.5)
        try:
            while one.recv(100):  # A refusal may come first.
                pass
            closed += 1
        except ConnectionError:
            closed += 1
        except OSError:
            pass
        one.close()
    assert closed == len(slow), f"{len(slow) - closed} slow connections are still open"
    assert_no_gap(rig, since)
    assert gateway_state(rig)["state"] == "armed", gateway_state(rig)["cause"]
    driver.end()


@pytest.mark.rig(settings={"web": {"max_connections": 8}})
def test_watchers_leave_room_for_stop(rig):
    rig.start().connected()
    streams = [rig.stream() for _ in range(7)]
    statuses = [stream.recv(100).split()[1] for stream in streams]
    assert statuses == [b"200"] * 5 + [b"503"] * 2, statuses
    idle = [socket.create_connection(("127.0.0.1", rig.port)) for _ in range(8)]
    assert rig.ask("POST", "/api/estop")[0] == 200
    until(lambda: b"latched" in streams[0].recv(65536), what="earlier watchers continue to watch")
    for one in streams + idle:
        one.close()


def test_64_watchers_are_one_gateway_client_and_all_get_events(rig):
    rig.start().connected()
    driver, since = Driver(rig), now_us()
    before = gateway_state(rig)["clients"]
    streams = [rig.stream() for _ in range(64)]
    try:
        assert gateway_state(rig)["clients"] == before
        time.sleep(1)  # The first ones fall behind.
        begun = now_us()
        for stream in streams:
            read_until(stream, lambda text: any(int(t_us) >= begun for t_us in re.findall(rb'"event":"state","t_us":(\d+)', text)))
        assert rig.ask("GET", "/metrics")[1].count("iwheel_web_watchers 64\n") == 1
        assert rig.web.resident_kB() < 80_000, rig.web.resident_kB()
        assert_no_gap(rig, since)
        driver.end()
    finally:
        for stream in streams:
            stream.close()
    until(lambda: "iwheel_web_watchers 0\n" in rig.ask("GET", "/metrics")[1], what="their streams are closed")


# ---- stopping and driving ---------------------------------------------------------------------------------------------


def test_stop_is_on_the_bus_within_a_fifth_of_a_second(rig):
    rig.start().connected()
    driver = Driver(rig)
    assert (late := stopped_ms(rig)) < 200, f"{late} ms"
    driver.end()
    at_standstill(rig)
    assert rig.ask_json("POST", "/api/estop")[1]["state"] == "latched"
    stops = until(lambda: (found := rig.ask_json("GET", "/api/stops")[1]["stops"]) and len(found) == 2 and found, 8, "both stops are reported")
    assert [stop["cause"] for stop in stops] == ["estop_software", "client_stop"] and len(stops[1]["frames_before"]) == 40


def test_gateway_killed_is_said_and_found_again(rig):
    rig.start().connected()
    rig.kill_gateway(signal.SIGKILL)
    until(lambda: rig.ask("GET", "/health")[0] == 503, 3, "health reports it")
    status, body = rig.ask_json("POST", "/api/stop")
    assert status == 503 and body["message"].startswith("NOT DELIVERED"), body
    assert "iwheel_up 0\n" in rig.ask("GET", "/metrics")[1]
    time.sleep(1)
    rig.start_gateway()
    rig.connected()
    assert rig.ask("POST", "/api/stop")[0] == 200
    assert rig.web.text().count("is gone; waiting for it") == 1


def test_gateway_that_hangs_stop_is_reported_not_delivered(rig):
    rig.start().connected()
    rig.gateway.signal(signal.SIGSTOP)
    status, body = rig.ask_json("POST", "/api/stop")
    rig.gateway.signal(signal.SIGCONT)
    assert status == 504 and body["message"].startswith("NOT DELIVERED"), body
    rig.connected()


def test_bridge_before_the_gateway_waits_for_it(rig):
    rig.start_web()
    assert rig.ask_json("GET", "/health")[1]["gateway"] == "away"
    rig.start_gateway()
    rig.connected()


def test_bridge_that_watches_cannot_drive_arm_or_reset(rig):
    rig.start().connected()
    for path in ("/api/arm", "/api/drive?v_mm_s=100", "/api/reset"):
        status, body = rig.ask_json("POST", path)
        assert status == 403 and body["error"] == "denied", body


@pytest.mark.rig(driving=True)
def test_page_drives_while_it_asks_and_no_longer(rig):
    rig.start().connected()
    person = rig.person
    status, terms = person.arm()
    assert status == 200 and terms["ok"] and re.fullmatch("[0-9a-f]{32}", terms["key"]), terms
    number = 0
    for number in range(1, 12):
        status, body = person.drive(terms["key"], number)
        assert status == 200 and body["left_mm_s"] == 150, body
        time.sleep(0.05)
    for key, sequence, age_us, v in (
        (terms["key"], number, 0, 150),
        (terms["key"], number + 1, 400_000, 150),
        ("0" * 32, number + 1, 0, 150),
        (terms["key"], number + 1, -1_000_000, 150),
        (terms["key"], number + 1, 0, 301),
    ):
        status, body = person.drive(key, sequence, age_us, v)
        assert status == 409 and body["error"] == "dropped", body
    since = now_us()
    until(lambda: gateway_state(rig)["state"] in ("stopping", "listening"), 3, "the wheels stop without commands")
    assert braking_ms(rig, since) < 1000
    assert person.drive(terms["key"], number + 9, v=0)[1]["ok"] is False
    until(lambda: rig.ask("GET", "/metrics")[1].count("iwheel_web_dropped_commands_total") == 1)
    until(lambda: person.arm()[1].get("ok"), 6, "it may arm again")


@pytest.mark.rig(driving=True)
def test_page_drives_a_gateway_with_a_clock_of_its_own(rig):
    ahead_us = 3_600_000_000
    rig.start_gateway()
    rig.web_settings["gateway"]["socket"] = rig.path("board.sock")
    ShiftedClock(rig.path("board.sock"), rig.path("gateway.sock"), ahead_us)
    rig.start_web()
    rig.connected()
    assert rig.person.arm()[1]["error"] == "stale_command"
    key = until(lambda: rig.person.arm(t_us=rig.ask_json("GET", "/api/status")[1]["t_us"])[1].get("key"), 6, "it may arm")
    for number in range(1, 5):
        assert rig.person.drive(key, number, age_us=-ahead_us)[0] == 200
        time.sleep(0.05)
    assert rig.person.drive(key, 9, age_us=400_000 - ahead_us)[1]["error"] == "dropped"


@pytest.mark.rig(driving=True)
def test_bridge_killed_while_driving_stops_the_wheels(rig):
    rig.start().connected()
    key = rig.person.arm()[1]["key"]
    for number in range(1, 10):
        assert rig.person.drive(key, number)[0] == 200
        time.sleep(0.05)
    since = now_us()
    rig.web.signal(signal.SIGKILL)
    assert (late := braking_ms(rig, since)) < 200, f"{late} ms"
    rig.web.wait(2)
    rig.start_web()
    rig.connected()
    assert rig.person.drive(key, 99)[1]["error"] == "dropped"


@pytest.mark.rig(driving=True, settings={"gateway": {}})
def test_driving_by_the_watch_socket_ends_with_the_missing_right(rig):
    rig.start_gateway()
    rig.web_settings["gateway"]["socket"] = rig.path("watch.sock")
    rig.refuses_to_start(77, "for watching only")


# ---- a stop is never refused and never queues -------------------------------------------------------------------------


# Each connection sends its next request as soon as it has the reply. The seconds between are too short for anything else.
POLL = """
import http.client, sys, threading
port, count, secret = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
def poll(path):
    while True:
        try:
            one = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
            while True:
                one.request("GET", path, headers={"Authorization": "Bearer " + secret})
                one.getresponse().read()
        except (OSError, http.client.HTTPException):
            pass
for number in range(count):
    threading.Thread(target=poll, args=(sys.argv[4 + number % (len(sys.argv) - 4)],), daemon=True).start()
threading.Event().wait()
"""


@contextlib.contextmanager
def polling(rig, count, *paths, code=POLL):
    child = subprocess.Popen([sys.executable, "-c", code, str(rig.port), str(count), rig.read_secret, *paths], preexec_fn=lambda: os.nice(5))
    try:
        time.sleep(1)
        yield
    finally:
        child.kill()
        child.wait()


def assert_stops(rig, times=4):
    for _ in range(times):
        driver = Driver(rig)
        late = stopped_ms(rig)
        driver.end()
        print(f"        {late:.0f} ms", flush=True)
        assert late < 200, f"{late} ms"
        at_standstill(rig)


def test_stop_reaches_a_gateway_whose_places_are_all_in_use(rig):
    """The bridge starts when other programs have all places of the socket: it can only use those that the gateway keeps for stops."""
    rig.settings.setdefault("northbound", {})["max_watchers"] = 2
    rig.write_config()
    rig.start_gateway()
    held = [wait_connect(rig.path("watch.sock"), rig.gateway) for _ in range(2)]
    try:
        rig.start_web()
        assert_stops(rig)
        assert rig.ask("GET", "/health")[0] == 503, "the bridge has no other connection"
    finally:
        for one in held:
            one.close()


def test_stop_never_waits_for_viewers_who_poll(rig):
    rig.start().connected()
    with polling(rig, 90, "/api/status"):
        assert_stops(rig)


def test_stop_never_waits_for_questions_of_viewers(rig):
    rig.start().connected()
    with polling(rig, 96, "/api/recordings", "/api/recording?name=a.log", "/api/status", "/api/stops"):
        assert_stops(rig)


def test_stop_never_needs_a_free_place_of_the_bridge(rig):
    """Every place of the bridge is in use: by streams, by pollers, by connections without a request."""
    rig.start().connected()
    streams = [rig.stream() for _ in range(80)]
    idle = [socket.create_connection(("127.0.0.1", rig.port)) for _ in range(200)]
    try:
        with polling(rig, 48, "/api/recordings", "/api/status"):
            assert_stops(rig)
    finally:
        for one in (*streams, *idle):
            one.close()


def test_stop_never_waits_for_stops_of_others(rig):
    """90 people press STOP again and again; one presses the second control."""
    rig.start().connected()
    with polling(rig, 90, "/api/stop", code=POLL.replace('"GET"', '"POST"')):
        begun = time.monotonic()
        assert rig.ask_json("POST", "/api/estop")[1]["state"] == "latched"
        assert (late := time.monotonic() - begun) < 0.2, f"{late} s"


# ---- one person --------------------------------------------------------------------------------------------------------


def two_people(rig):
    rig.start().connected()
    first, second = Person(rig), Person(rig)
    assert first.ask("GET", "/health")[0] == second.ask("GET", "/health")[0] == 200
    return first, second


def drive_for(person, key, sequence, seconds=0.5, v=150):
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        status, body = person.drive(key, sequence, v=v)
        assert status == 200, body
        sequence += 1
        time.sleep(0.05)
    return sequence


@pytest.mark.rig(driving=True)
def test_one_person_drives_and_the_second_is_busy_by_name(rig):
    first, second = two_people(rig)
    key = first.arm()[1]["key"]
    name = gateway_state(rig)["lease"]["name"]
    sequence = drive_for(first, key, 1)
    for _ in range(5):
        status, body = second.arm()
        assert status == 409 and body["error"] == "busy" and name in body["message"], body
        assert "key" not in body
        sequence = drive_for(first, key, sequence, 0.1)
    for stolen in (key, "0" * 32, ""):
        assert second.drive(stolen, sequence + 100, v=-150)[1]["error"] == "dropped"
    assert second.arm()[1]["error"] == "stale_command", "its own stick is deflected"
    sequence = drive_for(first, key, sequence, 0.1)
    assert gateway_state(rig)["lease"]["name"] == name and gateway_state(rig)["state"] == "armed"
    assert first.ask("POST", "/api/stop")[0] == 200
    at_standstill(rig)
    time.sleep(0.6)
    status, terms = second.arm()
    assert status == 200 and terms["key"] != key, terms
    assert first.drive(key, sequence + 1)[1]["error"] == "dropped"
    assert gateway_state(rig)["lease"]["name"] != name
    drive_for(second, terms["key"], 1, 0.2)


@pytest.mark.rig(driving=True)
def test_one_person_of_two_who_arm_at_once(rig):
    """Both arms leave before either has its reply."""
    people = two_people(rig)
    for person in people:
        assert person.boot
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda person: person.arm(), people))
    granted = [body for status, body in answers if status == 200]
    refused = [body for status, body in answers if status != 200]
    assert len(granted) == len(refused) == 1 and refused[0]["error"] == "busy", answers


@pytest.mark.rig(driving=True)
def test_one_person_with_a_deflected_stick_refuses_arm_and_reset(rig):
    first, second = two_people(rig)
    for sequence in range(1, 5):
        assert first.drive("0" * 32, sequence)[1]["error"] == "dropped"  # Not armed, and deflected.
    for person in (first, second):
        status, body = person.arm()
        assert status == 409 and body["error"] == "stale_command" and "web page" in body["message"], body
    assert rig.ask("POST", "/api/estop")[0] == 200
    until(lambda: second.ask("GET", "/api/stops")[1]["stops"], what="the stop is known")
    time.sleep(1.2)
    assert first.drive("0" * 32, 9)[1]["error"] == "dropped"
    assert second.reset()[1]["error"] == "stale_command"
    time.sleep(0.6)
    assert first.drive("0" * 32, 10, v=0)[1]["error"] == "dropped"
    status, body = second.reset()
    assert status == 200 and body["state"] == "listening", body


@pytest.mark.rig(driving=True)
def test_one_person_key_is_in_no_event_status_or_log(rig):
    first, _second = two_people(rig)
    with rig.stream() as stream:
        key = first.arm()[1]["key"]
        drive_for(first, key, 1, 0.3)
        first.ask("POST", "/api/stop")
        time.sleep(0.3)
        text = stream.recv(1_000_000).decode(errors="replace")
    for path in ("/api/status", "/api/stops", "/metrics", "/health"):
        text += rig.ask("GET", path)[1]
    assert key not in text + rig.web.text() + rig.gateway.text()


@pytest.mark.rig(driving=True)
def test_arm_and_reset_too_old_or_of_another_stop_are_stale(rig):
    rig.start().connected()
    person = rig.person
    for age_us in (1_100_000, 5_000_000, 60_000_000, -300_000, -60_000_000):
        assert person.arm(t_us=now_us() - age_us)[1]["error"] == "stale_command", age_us
    assert person.ask("POST", f"/api/arm?boot={'0' * 32}&t_us={now_us()}")[1]["error"] == "stale_command"
    for target in ("/api/arm", f"/api/arm?boot={person.boot}", f"/api/arm?t_us={now_us()}", f"/api/arm?boot={person.boot}&t_us=x"):
        assert person.ask("POST", target)[1]["error"] == "stale_command", target
    assert gateway_state(rig)["state"] == "listening"
    assert rig.ask("POST", "/api/estop")[0] == 200
    number = until(lambda: (found := person.ask("GET", "/api/stops")[1]["stops"]) and found, what="the stop")[0]["number"]
    time.sleep(1.1)
    for age_us in (1_100_000, 10_000_000, -300_000):
        assert person.reset(t_us=now_us() - age_us, stop=number)[1]["error"] == "stale_command", age_us
    for stop in (number - 1, number + 1, "", "x"):
        assert person.reset(stop=stop)[1]["error"] == "stale_command", stop
    assert gateway_state(rig)["state"] == "latched"
    assert person.reset(t_us=now_us() - 800_000, stop=number)[0] == 200
    assert person.arm(t_us=now_us() - 800_000)[0] == 200


class Forwarder(threading.Thread):
    """Delays the bytes of each connection by that time, towards the bridge only."""

    def __init__(self, rig):
        super().__init__(daemon=True)
        self.rig, self.delay_s = rig, 0.0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.start()

    def run(self):
        while True:
            one, _ = self.listener.accept()
            threading.Thread(target=self.forward, args=(one, self.delay_s), daemon=True).start()

    def forward(self, one, delay_s):
        request = one.recv(65536)
        time.sleep(delay_s)
        with socket.create_connection(("127.0.0.1", self.rig.port)) as other:
            other.sendall(request)
            while piece := other.recv(65536):
                one.sendall(piece)
        one.close()


def held_back(rig, forwarder, method, target, header):
    head = f"{method} {target} HTTP/1.1\r\nHost: 127.0.0.1:{rig.port}\r\nAuthorization: {header}\r\nConnection: close\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", forwarder.port), timeout=90) as one:
        one.sendall(head)
        answer = b""
        while piece := one.recv(65536):
            answer += piece
    return int(answer.split()[1]), json.loads(answer.split(b"\r\n\r\n", 1)[1])


def reset_of(person, number):
    target = f"/api/reset?boot={person.boot}&t_us={now_us()}&stop={number}"
    return target, person.header("POST", target)


@pytest.mark.rig(driving=True)
def test_reset_held_back_opens_no_latch_that_was_set_meanwhile(rig):
    rig.start().connected()
    person, forwarder = rig.person, Forwarder(rig)

    def newest():
        return person.ask("GET", "/api/stops")[1]["stops"][0]["number"]

    assert rig.ask("POST", "/api/estop")[0] == 200
    time.sleep(1.2)
    number = newest()
    for delay_s, burst in ((0.1, 1), (1.2, 1), (5, 20)) + (((60, 100),) if os.environ.get("IWHEEL_FULL") == "1" else ()):
        forwarder.delay_s = delay_s
        claims = [reset_of(person, number) for _ in range(burst)]
        with ThreadPoolExecutor(burst) as pool:
            answers = list(pool.map(lambda claim: held_back(rig, forwarder, "POST", *claim), claims))
        if delay_s < 1:
            assert answers[0][0] == 200 and gateway_state(rig)["state"] == "listening", answers
            assert rig.ask("POST", "/api/estop")[0] == 200
            time.sleep(1.2)
            until(lambda: newest() != number, what="another stop")
            number = newest()
        else:
            assert gateway_state(rig)["state"] == "latched"
            assert [answer for answer in answers if answer[1]["error"] != "stale_command"] == []
    # In time, but for the previous stop: a person at the machine has reset it and pressed again.
    forwarder.delay_s = 0.6
    claim = reset_of(person, number)
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(held_back, rig, forwarder, "POST", *claim)
        client = rig.client(name="at the machine")
        assert client.request("reset")["ok"] and client.request("estop")["ok"]
        client.close()
        assert answer.result()[1]["error"] == "stale_command", answer.result()
    assert gateway_state(rig)["state"] == "latched"


# ---- other programs on loopback -----------------------------------------------------------------------------------------


def test_start_without_both_loopback_addresses_is_refused(rig):
    rig.start_gateway()
    for address, family in (("127.0.0.1", socket.AF_INET), ("::1", socket.AF_INET6)):
        with socket.socket(family) as other:
            try:
                other.bind((address, rig.port))
            except OSError as error:
                if family == socket.AF_INET6:
                    raise Skip("this machine has no IPv6 on loopback") from error
                raise
            other.listen()
            rig.refuses_to_start(69, f"cannot listen on {address} port")
    rig.start_web()
    listening = Path("/proc/net/tcp").read_text(encoding="ascii") + Path("/proc/net/tcp6").read_text(encoding="ascii")
    ours = sorted(line.split()[1] for line in listening.splitlines() if f":{rig.port:04X} " in line and line.split()[3] == "0A")
    assert ours == [f"{'0' * 24}01000000:{rig.port:04X}", f"0100007F:{rig.port:04X}"], ours


def listening(rig, *addresses):
    """The sockets that systemd would hold."""
    sockets = []
    for address in addresses:
        one = socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind((address, rig.port))
        one.listen(128)
        os.set_inheritable(one.fileno(), True)
        sockets.append(one)
    return sockets


def start_with(rig, sockets):
    """As systemd starts it: with the listening sockets from descriptor 3 on."""
    rig.write_web()
    starter = Path(rig.path("starter"))
    passed = " ".join(f"{3 + i}<&{one.fileno()}" for i, one in enumerate(sockets))
    starter.write_text(
        f"#!/bin/bash\nLISTEN_PID=$$ LISTEN_FDS={len(sockets)} exec {rig.program('iwheel-web')} -c {rig.path('web.conf')} {passed}\n", encoding="ascii"
    )
    starter.chmod(0o755)
    rig.web = Process([str(starter)], rig.path("web.out"), close_fds=False)
    rig.processes.append(rig.web)
    return rig.web


def test_port_of_systemd_stays_ours_while_the_bridge_restarts(rig):
    rig.start_gateway()
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(one) for one in listening(rig, "127.0.0.1", "::1")]
        start_with(rig, sockets)
        until(rig.answers, what="the bridge answers on the passed sockets")
        rig.web.signal(signal.SIGKILL)
        rig.web.wait(2)
        with socket.socket() as thief:
            thief.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                thief.bind(("127.0.0.1", rig.port))
                raise AssertionError("another program got the port")
            except OSError:
                pass
        waits = stack.enter_context(socket.create_connection(("127.0.0.1", rig.port), timeout=10))
        waits.sendall(b"POST /api/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
        start_with(rig, sockets)
        assert waits.recv(100).startswith(b"HTTP/1.1 "), "the next bridge answers the connections made meanwhile"


def test_sockets_of_systemd_that_listen_elsewhere_are_refused(rig):
    rig.start_gateway()
    for addresses in (("127.0.0.1",), ("127.0.0.2", "::1"), ("127.0.0.1", "::1", "127.0.0.2")):
        sockets = listening(rig, *addresses)
        try:
            web = start_with(rig, sockets)
            assert web.wait(5) == 69 and "iwheel-web.socket listens elsewhere" in rig.web.text(), (addresses, rig.web.text())
        finally:
            for one in sockets:
                one.close()


# ---- TLS, files, figures -----------------------------------------------------------------------------------------------


def certificate(rig, name):
    self_signed(rig.folder, name, "localhost", "-addext subjectAltName=DNS:localhost,IP:127.0.0.1")


def test_tls_needs_a_trusted_certificate_and_its_key(rig):
    if not shutil.which("openssl"):
        raise Skip("openssl is missing")
    certificate(rig, "ours")
    certificate(rig, "other")
    rig.start_gateway()
    rig.web_settings["web"].update(certificate=rig.path("ours.pem"), key=rig.path("other.key"))
    rig.refuses_to_start(78, "does not fit the key")
    rig.web_settings["web"].update(key=rig.path("ours.key"))
    rig.start_web(wait=False)

    def answer(trusted):
        context = ssl.create_default_context(cafile=rig.path(f"{trusted}.pem"))
        with socket.create_connection(("127.0.0.1", rig.port), timeout=5) as one, context.wrap_socket(one, server_hostname="localhost") as safe:
            safe.sendall(f"GET /health HTTP/1.0\r\nHost: localhost\r\nAuthorization: Bearer {rig.read_secret}\r\n\r\n".encode())
            return safe.recv(1000)

    def answers():
        try:
            return b"may_drive" in answer("ours") or b"200" in answer("ours")
        except ssl.SSLError:
            raise
        except OSError:
            return False

    until(answers, what="TLS answers")
    try:
        answer("other")
        raise AssertionError("a wrong certificate was accepted")
    except ssl.SSLCertVerificationError:
        pass


def test_private_key_that_others_can_read_is_refused(rig):
    certificate(rig, "ours")
    rig.start_gateway()
    rig.web_settings["web"].update(certificate=rig.path("ours.pem"), key=rig.path("ours.key"))
    for mode, code in ((0o644, 77), (0o604, 77), (0o660, 77), (0o640, None)):
        os.chmod(rig.path("ours.key"), mode)
        if code is None:
            rig.starts_web()
        else:
            rig.refuses_to_start(code, "may be read by others", oct(mode))


def test_check_refuses_a_token_that_the_start_refuses(rig):
    rig.start_web(wait=False).end()
    token = Path(rig.path("token"))

    def check():
        done = subprocess.run([rig.program("iwheel-web"), "-c", rig.path("web.conf"), "--check"], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout + done.stderr

    token.unlink(missing_ok=True)
    assert check()[0] == 0 and not token.exists(), "the start makes one"
    for text, mode, about in (("a" * 32, 0o644, "other users may read"), ("short", 0o600, "contains no token"), ("a" * 32, 0o600, None)):
        token.write_text(text + "\n", encoding="ascii")
        os.chmod(token, mode)
        code, words = check()
        if about is None:
            assert code == 0, words
            rig.starts_web()
        else:
            assert code == 78 and about in words, (code, words)
            rig.refuses_to_start(78, about)


def start_lan(rig):
    """The bridge by `--lan`, and the address that it prints."""
    rig.write_web()
    rig.web = Process([rig.program("iwheel-web"), "-c", rig.path("web.conf"), "--lan"], rig.path(f"web.{len(rig.processes)}.out"))
    rig.processes.append(rig.web)
    found = until(lambda: re.search(r"https://([\d.]+):(\d+)/#token=([0-9a-f]{32})", rig.web.text()), what="the address is printed")
    assert int(found[2]) == rig.port and found[3] == rig.token
    return found[0], found[1]


def test_lan_serves_https_with_own_certificate_and_never_drives(rig):
    rig.start_gateway()
    _, address = start_lan(rig)
    files = {name: Path(rig.path(name)) for name in ("lan-certificate.pem", "lan-key.pem", "token")}
    assert all(path.stat().st_mode & 0o077 == 0 for path in files.values())
    made = files["lan-certificate.pem"].read_bytes()
    trust = ssl.create_default_context(cafile=str(files["lan-certificate.pem"]))
    for host in (address, "localhost", socket.gethostname()):
        with socket.create_connection((address, rig.port), timeout=5) as one, trust.wrap_socket(one, server_hostname=host) as tls:
            tls.sendall(f"POST /api/stop HTTP/1.1\r\nHost: {host}:{rig.port}\r\nConnection: close\r\n\r\n".encode())
            assert tls.recv(100).startswith(b"HTTP/1.1 200"), host
    secret = urllib.request.Request(f"https://{address}:{rig.port}/health", headers={"Authorization": f"Bearer {rig.read_secret}"})

    def health():
        with contextlib.suppress(urllib.error.HTTPError):  # 503: it does not know the gateway's state yet.
            return json.loads(urllib.request.urlopen(secret, context=trust).read())

    assert until(health, what="the gateway's state is known")["may_drive"] is False
    rig.end_web()
    start_lan(rig)
    assert files["lan-certificate.pem"].read_bytes() == made, "made once"
    rig.end_web()
    files["lan-certificate.pem"].write_text("no certificate")
    start_lan(rig)
    assert files["lan-certificate.pem"].read_bytes() not in (made, b"no certificate")


def test_tls_is_new_and_authenticated_only(rig):
    certificate(rig, "ours")
    rig.start_gateway()
    rig.web_settings["web"].update(certificate=rig.path("ours.pem"), key=rig.path("ours.key"))
    rig.starts_web()

    def speaks(*options):
        done = subprocess.run(
            ["openssl", "s_client", "-connect", f"127.0.0.1:{rig.port}", *options], input="", capture_output=True, text=True, timeout=10, check=False
        )
        return "Cipher is (NONE)" not in done.stdout and done.returncode == 0

    assert speaks("-tls1_3") and speaks("-tls1_2") and speaks("-tls1_2", "-cipher", "ECDHE-ECDSA-AES256-GCM-SHA384")
    weak = "ALL:@SECLEVEL=0"
    assert not speaks("-tls1", "-cipher", weak) and not speaks("-tls1_1", "-cipher", weak)
    for cipher in ("ECDHE-ECDSA-AES128-SHA", "ECDHE-ECDSA-AES128-SHA256", "AES128-GCM-SHA256", "DHE-RSA-AES128-SHA"):
        assert not speaks("-tls1_2", "-cipher", f"{cipher}:@SECLEVEL=0"), cipher


def test_unix_socket_deletes_no_file_and_no_link(rig):
    rig.start_gateway()
    place = Path(rig.path("web.sock"))
    target = Path(rig.path("target"))
    target.write_text("mine", encoding="ascii")
    rig.web_settings["web"]["listen"] = f"unix:{place}"
    for make in (lambda: place.write_text("mine", encoding="ascii"), lambda: place.symlink_to(target)):
        make()
        rig.refuses_to_start(69, "cannot listen")
        assert place.read_text(encoding="ascii") == "mine"
        place.unlink()
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(place))
    rig.starts_web()


def test_unix_socket_in_place_of_a_port(rig):
    rig.web_settings["web"]["listen"] = f"unix:{rig.path('web.sock')}"
    rig.start_gateway()
    rig.start_web(wait=False)
    until(lambda: os.path.exists(rig.path("web.sock")) and Path(rig.path("token")).exists())
    with socket.socket(socket.AF_UNIX) as one:
        one.connect(rig.path("web.sock"))
        one.sendall(f"GET /health HTTP/1.0\r\nHost: localhost\r\nAuthorization: Bearer {rig.read_secret}\r\n\r\n".encode())
        assert re.match(rb"HTTP/1\.[01] (200|503) ", one.recv(100))
    assert oct(os.stat(rig.path("web.sock")).st_mode & 0o777) == "0o660"
    rig.end_web(3)
    assert not os.path.exists(rig.path("web.sock"))


SAMPLE = re.compile(r'([a-z_:][a-z0-9_:]*)(\{[a-z_]+="[^"]*"\})? (-?\d+(?:\.\d+)?)')


def test_metrics_are_those_of_the_snapshot_and_well_formed(rig):
    rig.start().connected()
    state = rig.ask_json("GET", "/api/status")[1]
    text = rig.ask("GET", "/metrics")[1]
    assert rig.headers["Content-Type"].startswith("application/openmetrics-text")
    types, seen = {}, set()
    lines = text.splitlines()
    assert lines[-1] == "# EOF" and lines.count("# EOF") == 1
    for line in lines[:-1]:
        if line.startswith("# TYPE "):
            name, kind = line.split()[2:]
            assert name not in types, name
            types[name] = kind
        elif not line.startswith("# HELP "):
            found = SAMPLE.fullmatch(line)
            assert found, line
            base = next(
                (found[1][: -len(end)] if end else found[1] for end in ("_total", "_bucket", "") if (found[1][: -len(end)] if end else found[1]) in types), None
            )
            assert base and (types[base] == "counter") == found[1].endswith("_total"), line
            assert (found[1], found[2]) not in seen, line
            seen.add((found[1], found[2]))
    for side in ("left", "right"):
        assert f'iwheel_wheel_battery_volts{{side="{side}"}} {state[side]["battery_dV"] / 10:.1f}' in lines
        assert not any(line.startswith(f'iwheel_wheel_applied_meters_per_second{{side="{side}"') for line in lines), "no value without telemetry"
    assert f'iwheel_state{{iwheel_state="{state["state"]}"}} 1' in lines


def test_rules_and_dashboard_know_only_figures_that_there_are(rig):
    rig.start().connected()
    there = set(re.findall(r"^# TYPE (\S+)", rig.ask("GET", "/metrics")[1], re.MULTILINE))
    for file in ("share/web/prometheus-rules.yml", "share/web/grafana-dashboard.json"):
        used = set(re.findall(r"\biwheel_[a-z0-9_]+", (ROOT / file).read_text(encoding="utf-8")))
        bare = {re.sub(r"_(total|bucket)$", "", name) for name in used}
        assert used and bare <= there, f"{file}: {bare - there}"
    json.loads((ROOT / "share/web/grafana-dashboard.json").read_text(encoding="utf-8"))
    if not shutil.which("promtool"):
        raise Skip("promtool is missing (apt-get install prometheus)")
    for words in (("check", "rules", ROOT / "share/web/prometheus-rules.yml"), ("test", "rules", ROOT / "test/web/prometheus-rules.test.yml")):
        done = subprocess.run(["promtool", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_metrics_count_a_stop_by_its_cause_and_tell_the_last_one(rig):
    rig.start().connected()

    def figure(name):
        found = re.search(rf"^{re.escape(name)} (\S+)$", rig.ask("GET", "/metrics")[1], re.MULTILINE)
        return float(found[1]) if found else None

    until(lambda: figure("iwheel_last_stop_number") == 0, what="none yet")
    before = figure('iwheel_stops_total{cause="estop_software"}')
    client = rig.client(name="at the machine")
    assert client.request("estop")["ok"]
    client.close()
    until(lambda: figure("iwheel_last_stop_number") == 1, what="the stop")
    assert before == 0 and figure('iwheel_stops_total{cause="estop_software"}') == 1
    assert abs(figure("iwheel_last_stop_timestamp_seconds") - time.time()) < 30
    time.sleep(3)  # The bridge asks for the frames around it: the same stop again.
    assert figure('iwheel_stops_total{cause="estop_software"}') == 1 and figure('iwheel_stops_total{cause="unknown"}') == 0


PROMETHEUS = """
global: {{scrape_interval: 200ms, scrape_timeout: 200ms, evaluation_interval: 200ms}}
rule_files: ["{rules}"]
scrape_configs:
  - {{job_name: iwheel, authorization: {{credentials: "{secret}"}}, static_configs: [{{targets: ["127.0.0.1:{port}"]}}]}}
"""


@contextlib.contextmanager
def prometheus(rig):
    """A Prometheus that scrapes the bridge with the shipped rules; called with a path, returns the data of its reply."""
    if not shutil.which("prometheus"):
        raise Skip("prometheus is missing (scripts/install_tools check brings it)")
    port = free_port()
    Path(rig.path("prometheus.yml")).write_text(
        PROMETHEUS.format(rules=ROOT / "share/web/prometheus-rules.yml", secret=rig.read_secret, port=rig.port), encoding="utf-8"
    )
    child = Process(
        ["prometheus", f"--config.file={rig.path('prometheus.yml')}", f"--storage.tsdb.path={rig.path('tsdb')}", f"--web.listen-address=127.0.0.1:{port}"],
        rig.path("prometheus.out"),
    )
    rig.processes.append(child)

    def ask(path):
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/v1/{path}", timeout=2) as answer:
                return json.load(answer)["data"]
        except OSError:
            assert child.child.poll() is None, child.text()[-800:]
            return None

    yield ask
    child.signal(signal.SIGTERM)
    child.wait(5)


def test_prometheus_takes_the_figures_and_alerts_of_an_estop(rig):
    rig.start().connected()
    with prometheus(rig) as ask:
        target = until(
            lambda: (data := ask("targets")) and (found := data["activeTargets"]) and found[0]["health"] != "unknown" and found[0], what="it scrapes"
        )
        assert target["health"] == "up", target["lastError"]

        def figure(query):
            data = ask("query?query=" + urllib.parse.quote(query))
            return float(data["result"][0]["value"][1]) if data and data["result"] else None

        until(lambda: figure("iwheel_up") == 1, what="its figures are there")
        state = rig.ask_json("GET", "/api/status")[1]
        assert figure('iwheel_wheel_battery_volts{side="left"}') == state["left"]["battery_dV"] / 10
        groups = ask("rules")["groups"]
        assert groups and all(rule["health"] == "ok" for rule in groups[0]["rules"]), groups
        assert not [alert for alert in ask("alerts")["alerts"] if alert["state"] == "firing"]

        def alerts(state):
            return {alert["labels"]["alertname"]: alert for alert in ask("alerts")["alerts"] if alert["state"] == state}

        rig.sim.ask("estop press")
        firing = until(lambda: len(found := alerts("firing")) > 1 and found, 8, "two alerts fire")
        assert set(firing) == {"IwheelLatched", "IwheelStopped"} and firing["IwheelStopped"]["labels"]["cause"] == "estop_line", firing
        assert "iwheelctl why" in firing["IwheelLatched"]["annotations"]["summary"], firing
        assert figure("iwheel_stops_total > 0") == 1 and figure("iwheel_last_stop_number") == 1 and figure("iwheel_build_info") == 1
        assert abs(figure("iwheel_last_stop_timestamp_seconds") - time.time()) < 60
        rig.web.signal(signal.SIGTERM)
        until(lambda: "IwheelWebAway" in alerts("pending"), 8, "Prometheus cannot scrape")
        assert figure("up") == 0


def test_words_of_the_page_are_those_of_iwheelctl(rig):
    """strings.en.js repeats the fixes of causes and the next actions: its texts must be identical."""
    advice = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "app/ctl").rglob("advice.c"))
    strings = (ROOT / "app/bridge/web/page/strings.en.js").read_text(encoding="utf-8")
    fixes = dict(re.findall(r'\{"(\w+)", "([^"]+)"\}', advice))
    ours = dict(re.findall(r'^    (\w+): "([^"]+)",$', strings[strings.index("  fixes: {") :], re.MULTILINE))
    assert fixes and fixes == ours, set(fixes.items()) ^ set(ours.items())
    joined = re.sub(r'"\s*\n\s*"', "", advice)
    for name, words in re.findall(r'^    (\w+): "([^"]+)",$', strings[strings.index("  next: {") : strings.index("  fixes: {")], re.MULTILINE):
        plain = re.split(r"\{\w+\}", words)
        assert all(part in joined for part in plain), (name, words)


# ---- a fleet --------------------------------------------------------------------------------------------------------


def test_fleet_serves_only_the_file_of_iwheel_fleet(rig):
    rig.start()
    assert rig.ask_json("GET", "/api/fleet")[0] == 404 and rig.ask_json("GET", "/health")[1]["fleet"] is False
    rig.end_web()
    source = Path(rig.path("fleet.json"))
    rig.web_settings["fleet"]["source"] = source
    rig.start_web()
    assert rig.ask_json("GET", "/health")[1]["fleet"] is True
    text = '{"ok":true,"wall_us":1,"stream":false,"left_out":0,"machines":[]}'

    def refused():
        status, body = rig.ask_json("GET", "/api/fleet")
        return status == 404 and "check that iwheel-fleet writes" in body["message"]

    assert refused()
    source.write_text(text, encoding="ascii")
    assert rig.ask("GET", "/api/fleet") == (200, text)
    assert rig.headers["Content-Type"] == "application/json" and rig.ask("GET", "/api/fleet", token="")[0] == 401
    for wrong in ("", "[]", "{" * 1048577):
        source.write_text(wrong, encoding="ascii")
        assert refused(), wrong[:9]
    for make in (lambda: os.mkfifo(source), lambda: source.symlink_to(rig.path("token")), source.mkdir):
        source.unlink()
        make()
        assert refused()
        if source.is_dir():
            source.rmdir()
            source.touch()


def test_record_on_request_writes_until_it_is_ended(rig):
    """On the socket for watching: it moves nothing. The secret for reading does not suffice."""
    rig.start().connected()
    headers = {"Authorization": f"Bearer {rig.read_secret}"}
    assert rig.ask("POST", "/api/record?on=true", headers=headers, token="")[0] == 401
    assert [rig.ask("POST", f"/api/record{query}")[0] for query in ("", "?on=1", "?on=true%22")] == [400] * 3
    assert not rig.ask_json("GET", "/api/recordings")[1]["on_request"]["on"]
    status, answer = rig.ask_json("POST", "/api/record?on=true")
    assert status == 200 and answer["on"] and answer["most_ms"] == 600_000, answer

    def listed(on):
        found = rig.ask_json("GET", "/api/recordings")[1]
        entry = [one for one in found["recordings"] if one["cause"] == "requested"]
        return found["on_request"]["on"] is on and bool(found["on_request"]["ended"]) is not on and entry and (entry[0]["log_bytes"] or 0) > 10_000 and entry[0]

    name = until(lambda: listed(True), 5, "frames are on the disk")["name"]
    assert rig.ask_json("POST", "/api/record?on=false")[1]["on"] is False
    until(lambda: listed(False), 5, "it has ended")
    lines = Path(rig.path(f"{name}.jsonl")).read_text(encoding="ascii").splitlines()
    assert json.loads(lines[-1])["type"] == "end", lines[-1]
