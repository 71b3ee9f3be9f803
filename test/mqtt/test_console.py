# SPDX-License-Identifier: MIT
"""The console: history from the cluster's stream, recordings fetched from a machine over a disturbed line, and MQTT 5."""

import pytest
import base64
import contextlib
import json
import re
import shutil
import signal
import socket
import socketserver
import ssl
import subprocess
import threading
import time
import zlib
from datetime import datetime, timezone
from pathlib import Path

from test_bridge import make_stops, numbers
from test_fleet import HOSTS, Cluster, start_by_tls, start_one_nats, with_certificate
from harness import Process
from mqtt_rig import ID, Far, Line, await_port, paho
from trials import until

try:
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties
except ImportError:
    pass  # The rig then skips the test.

FILES = (".conf", ".jsonl", ".log")


def write_config(rig, **keys):
    path = Path(rig.path("console.conf"))
    path.write_text("[broker]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()), encoding="ascii")
    return str(path)


def console(rig, config, *words, timeout=30):
    """(exit code, stdout, stderr)"""
    done = subprocess.run([rig.program("iwheel-fleet"), "-c", config, *words], capture_output=True, text=True, timeout=timeout, check=False)
    return done.returncode, done.stdout, done.stderr


def refuses(expected, part, rig, config, *words):
    """Checks the exit code and a part of the message."""
    code, _, err = console(rig, config, *words)
    assert code == expected and part in err, (code, err)


def lines(text):
    return [json.loads(line) for line in text.splitlines()]


# ---- history --------------------------------------------------------------------------------------------------------


def cluster_config(rig, cluster, host="", name="console", **keys):
    return write_config(
        rig,
        host=host or " ".join(HOSTS),
        port=cluster.mqtt,
        stream_port=cluster.nats,
        ca=rig.path("certs/ca.pem"),
        certificate=rig.path(f"certs/{name}.pem"),
        key=rig.path(f"certs/{name}.key"),
        **keys,
    )


def machine_at(rig, cluster, name="w2"):
    """A machine of the fleet that publishes what the test requests."""
    await_port(cluster.mqtt, HOSTS[1])
    far = Far(cluster.mqtt, name, topics=(f"iwheel/{name}/cmd/+",), setup=with_certificate(rig, name), host=HOSTS[1])
    rig.fars.append(far)
    return far


def publish_stops(far, events, pad=0, qos=1):
    """(boot, number of the event, number of the stop, time of the stop in s from now)"""
    sent = []
    for boot, number, stop, when_s in events:
        event = {
            "id": f"{boot}-{number}",
            "boot": boot,
            "heard_wall_us": int((time.time() + when_s) * 1e6),
            "event": "stop",
            "number": stop,
            "cause": "wheel_lost",
            "wall_us": int((time.time() + when_s) * 1e6),
            "sentence": f"left wheel offline, reported as {stop}" + "." * pad,
        }
        sent.append(far.client.publish(f"iwheel/{far.name}/event/stop", json.dumps(event), qos=qos))
    for one in sent:
        one.wait_for_publish(20)
    assert all(one.is_published() for one in sent)


def test_history_after_lost_leader_has_each_stop_once_and_gaps(rig):
    cluster = Cluster(rig)
    config = cluster_config(rig, cluster)
    code, out, err = console(rig, config, "history")
    assert code == 0 and out.startswith("0 stops of 0 machines"), (code, out, err)
    start_by_tls(rig, " ".join(HOSTS), cluster.mqtt)
    until(lambda: "connected to the broker" in rig.words(), 15, "the bridge is there")
    last = make_stops(rig, 2)
    far = machine_at(rig, cluster)
    publish_stops(far, [("a", 1, 1, -9000), ("a", 2, 2, -60), ("a", 2, 2, -60), ("a", 5, 3, -50), ("b", 6, 6, -40), ("a", 5, 3, -50)])
    cluster.servers[cluster.leader()].signal(9)
    until(lambda: console(rig, config, "history", "--last", "1h")[1].count(" stop   ") == 6, 30, "all of them")
    code, out, err = console(rig, config, "history", "w2", "--last", "1h")
    assert code == 0 and "2 duplicates left out" in out and "(stored " in out and ID not in out.split(), (code, out, err)
    assert re.search(
        r"-- 2 events before this one are not in the stream.*\n.*reported as 3\n.*-- 2 stops before this one are not in the stream.*\n.*reported as 6\n", out
    ), out
    print("        " + out.replace("\n", "\n        "), flush=True)
    *events, total = lines(console(rig, config, "history", "--json", "--last", "1h")[1])
    assert [event["message"]["number"] for event in events if event["machine"] == ID] == [last - 1, last], events
    assert total["events"] == 6 and total["machines"] == 2 and total["doubled"] == 2 and total["missing"] == 2 and total["stops_missing"] == 2, total
    before = datetime.fromtimestamp(time.time() - 8000, timezone.utc).strftime("%Y-%m-%dT%H:%MZ")
    code, out, err = console(rig, config, "history", "w2", "--since", "2020-01-01", "--until", before)
    assert code == 0 and out.count(" stop   ") == 1 and "reported as 1" in out, (code, out, err)
    everything = lines(console(rig, config, "history", ID, "--all", "--json")[1])[:-1]
    shown = [event for event in everything if "message" in event]  # The other rows report events that the killed leader did not put into the stream.
    assert len(everything) - len(shown) <= 1, everything
    assert {"stop", "estop"} <= {event["message"]["event"] for event in shown} and not any(event["missing_before"] for event in shown), everything
    rows = lines(console(rig, config, "--for", "3", "--json")[1])
    assert [(row["machine"], row["stop_from"], row["cause"]) for row in rows if row["machine"] == "w2"] == [("w2", "stream", "wheel_lost")], rows


def test_history_with_a_frozen_first_host_checks_its_end(rig):
    """A host that accepts connections and never replies costs the time of one greeting only: the console asks the next one."""
    cluster = Cluster(rig)
    config = cluster_config(rig, cluster)
    far = machine_at(rig, cluster)
    publish_stops(far, [("a", 1, 1, -60)])
    until(lambda: console(rig, config, "history", "w2")[1].count(" stop   ") == 1, 20, "it is stored")
    cluster.servers[HOSTS[0]].signal(signal.SIGSTOP)
    try:

        def checked():
            code, out, err = console(rig, config, "history", "w2", "--json", timeout=60)
            return (code == 0 and lines(out)[-1]["end_checked"]) or print("        ", err.strip())

        until(checked, 60, "the other two have a leader, and the end is checked")
    finally:
        cluster.servers[HOSTS[0]].signal(signal.SIGCONT)


def test_history_of_thousands_is_complete_and_read_only(rig):
    """More events than the engine sends without flow control; and other rights of the console's certificate."""
    cluster = Cluster(rig)
    far = machine_at(rig, cluster)
    publish_stops(far, [("a", number, number, 0) for number in range(1, 3001)], pad=1000, qos=0)
    until(lambda: cluster.stream("info")[1]["messages"] == 3000, 20, "all are stored")
    config = cluster_config(rig, cluster)
    begun = time.monotonic()
    *events, total = lines(console(rig, config, "history", "--json")[1])
    assert len(events) == 3000 and total["doubled"] == total["missing"] == 0, total
    print(f"        history of 3,000 stops, {sum(len(json.dumps(event)) for event in events) / 1e6:.1f} MB: {time.monotonic() - begun:.1f} s", flush=True)
    for subject in (
        "$JS.API.STREAM.DELETE.iwheel",
        "$JS.API.STREAM.PURGE.iwheel",
        "$JS.API.STREAM.MSG.DELETE.iwheel",
        "$JS.API.STREAM.UPDATE.iwheel",
        "iwheel.w2.event.stop",
    ):
        assert "Permissions Violation" in nats_says(rig, cluster, "console", subject), subject
    assert "Permissions Violation" in nats_says(rig, cluster, "w2", "$JS.API.CONSUMER.CREATE.iwheel")
    assert cluster.stream("info")[1]["messages"] == 3000
    refuses(69, "users.conf", rig, cluster_config(rig, cluster, name="w2"), "history")
    # A machine's certificate is no server certificate: its owner cannot act as the cluster for the console.
    for host in HOSTS:
        cluster.servers[host].signal(9)
        cluster.servers[host].wait(5)
    code, _, err = console(rig, config, "history")
    assert code == 69 and "no nats-server answers" in err and err.split("no nats-server")[1].count("127.0.0.") == 3, (code, err)
    for name in ("pem", "key"):
        shutil.copy(rig.path(f"certs/w2.{name}"), rig.path(f"certs/server.{name}"))
    cluster.start(HOSTS[0])
    await_port(cluster.nats, HOSTS[0])
    refuses(69, "SSL", rig, config, "history")


def nats_says(rig, cluster, name, subject):
    """A server's reply to an empty message with this certificate."""
    context = ssl.create_default_context(cafile=rig.path("certs/ca.pem"))
    context.load_cert_chain(rig.path(f"certs/{name}.pem"), rig.path(f"certs/{name}.key"))
    raw = socket.create_connection((HOSTS[0], cluster.nats), timeout=5)
    line = b""
    while not line.endswith(b"\n"):
        line += raw.recv(1)
    with context.wrap_socket(raw, server_hostname=HOSTS[0]) as link:
        link.sendall(b'CONNECT {"verbose":false,"pedantic":false,"tls_required":true}\r\nPUB %s 0\r\n\r\nPING\r\n' % subject.encode())
        received = b""
        while b"PONG" not in received:
            received += link.recv(4096)
    return received.decode()


def test_history_without_stream_names_fix_and_info_last_stop(rig):
    rig.start_online()
    make_stops(rig, 1)
    config = write_config(rig, port=rig.port)
    until(
        lambda: (rows := lines(console(rig, config, "--for", "1", "--json")[1])) and rows[0]["stop_from"] == "info" and rows[0]["cause"] == "estop_line",
        10,
        "info has it",
    )
    text = console(rig, config, "--for", "1")[1]
    assert "last stops: from each machine's info" in text and "estop_line" in text, text
    page = Path(rig.path("fleet.json"))
    assert console(rig, config, "--for", "3", "--output", str(page))[:2] == (0, "")
    result = json.loads(page.read_text(encoding="utf-8"))
    assert (
        result["ok"] and not result["stream"] and abs(result["wall_us"] / 1e6 - time.time()) < 5 and [row["machine"] for row in result["machines"]] == [ID]
    ), result
    assert page.stat().st_mode & 0o007 == 0 and not Path(f"{page}.part").exists()
    assert console(rig, config, "--for", "3", "--output", "/proc/nowhere/x")[0] == 73
    code, _, err = console(rig, config, "history", ID)
    assert code == 78 and "stream_port" in err and "share/fleet" in err, (code, err)
    for words in (
        ("history", "--last", "12"),
        ("history", "a/b"),
        ("history", "--since", "yesterday"),
        ("recording",),
        ("nonsense",),
        ("recordings", ID, "--all"),
        ("history", "--since", "2026-02-02", "--until", "2026-02-01"),
        ("--json",),
    ):
        code, out, err = console(rig, config, *words)
        assert code == 64 and out == "" and err.startswith("iwheel-fleet: "), (words, code, err)


# ---- recordings -----------------------------------------------------------------------------------------------------


def folder_of(rig):
    """The folder for fetched recordings."""
    folder = Path(rig.path("fetched"))
    folder.mkdir(exist_ok=True)
    return folder


def stop_with_recording(rig, seconds=0.0):
    """Makes a stop with a complete recording; returns its name."""
    time.sleep(seconds)
    make_stops(rig, 1)
    name = until(lambda: next(iter(sorted(Path(rig.folder).glob("stop-*.log"))), None), what="a recording").stem
    end = Path(rig.path(name + ".jsonl"))
    until(lambda: end.exists() and '"end"' in "".join(end.read_text(encoding="utf-8").splitlines()[-1:]), what="it is whole")
    return name


def test_recording_is_fetched_whole_and_overwrites_no_file(rig):
    rig.start_online()
    name = stop_with_recording(rig)
    config, folder = write_config(rig, port=rig.port), folder_of(rig)
    code, out, err = console(rig, config, "recordings", ID)
    assert code == 0 and name in out and "1 recordings of w1" in out, (code, out, err)
    code, out, err = console(rig, config, "recording", ID, "-o", str(folder / "x.log"))
    assert code == 0 and "0 requested again" in out, (code, out, err)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {"x" + ending: Path(rig.path(name + ending)).read_bytes() for ending in FILES}
    for verb, word in (("why", "---- stop"), ("decode", "speed"), ("replay", "estop")):
        done = subprocess.run([rig.program("iwheelctl"), verb, str(folder / "x.log")], capture_output=True, text=True, timeout=30, check=False)
        assert done.returncode == 0 and word in done.stdout, (verb, done.stdout[-500:], done.stderr)
    code, out, err = console(rig, config, "recording", ID, "-o", str(folder / "x"))
    assert code == 73 and "exists already" in err and len(list(folder.iterdir())) == 3, (code, err)
    result = lines(console(rig, config, "recording", ID, str(int(name.split("-")[1])), "--json", "-o", str(folder / "y"))[1])[0]
    assert result["name"] == name and result["bytes"] == sum(Path(rig.path(name + ending)).stat().st_size for ending in FILES), result
    refuses(1, "no recording 99", rig, config, "recording", ID, "99")
    refuses(69, "no machine w8", rig, config, "recording", "w8", "--wait", "3")
    refuses(73, "/proc/nowhere/x", rig, config, "recording", ID, "-o", "/proc/nowhere/x")


def slow_console(rig, *words):
    """A console behind a line on which a recording needs seconds; `rig.line` can cut it."""
    rig.line = Line(rig.port)
    rig.line.delay = 0.03
    rig.fars.append(rig.line)
    process = Process([rig.program("iwheel-fleet"), "-c", write_config(rig, port=rig.line.port), "recording", ID, *words], rig.path("console.out"))
    rig.processes.append(process)
    until(lambda: any(path.stat().st_size for path in folder_of(rig).glob("x.log.*")), 15, f"the transfer is in progress: {process.text()}")
    return process


def test_recording_fetch_continues_after_bridge_restart(rig):
    rig.start_online()
    name = stop_with_recording(rig, 3)
    folder = folder_of(rig)
    process = slow_console(rig, "-o", str(folder / "x"))
    rig.end_bridge(signal.SIGKILL)
    rig.start_bridge()
    assert process.wait(30) == 0, process.text()
    assert int(re.search(r"(\d+) requested again", process.text()).group(1)) > 0, process.text()
    assert all((folder / ("x" + ending)).read_bytes() == Path(rig.path(name + ending)).read_bytes() for ending in FILES)
    assert len(list(folder.iterdir())) == 3


def test_recording_of_absent_machine_leaves_no_file(rig):
    rig.start_online()
    stop_with_recording(rig, 3)
    process = slow_console(rig, "-o", str(folder_of(rig) / "x"), "--wait", "3")
    rig.end_bridge(signal.SIGKILL)
    assert process.wait(30) == 75 and "has not answered for 3 s and is offline" in process.text(), process.text()
    assert not list(folder_of(rig).iterdir())
    rig.start_bridge()
    rig.online()
    process = slow_console(rig, "-o", str(folder_of(rig) / "x"))
    process.signal(15)
    assert process.wait(10) == 75 and "no file was written" in process.text(), process.text()
    assert not list(folder_of(rig).iterdir())


class Played(Far):
    """A machine that the test plays: it replies as on the page, and handles the piece with that number according to `trouble`."""

    def __init__(self, port, name, data, trouble):
        self.data, self.trouble, self.pieces, self.boot = data, trouble, 0, "first"
        super().__init__(port, name, topics=(f"iwheel/{name}/cmd/+",))
        self.client.publish(f"iwheel/{name}/availability", "online", qos=1, retain=True).wait_for_publish(3)

    def receive(self, client, data, message):
        threading.Thread(target=self.answer, args=(message.topic.rsplit("/", 1)[1], json.loads(message.payload)), daemon=True).start()

    def answer(self, verb, asked):
        reply = {"boot": self.boot, "t_us": time.monotonic_ns() // 1000, "cmd": verb, "seq": asked["seq"], "ok": True}
        if verb != "hello" and asked["boot"] != self.boot:
            reply.update(ok=False, error="other_boot", message="send it again with boot and t_us of this reply")
        elif verb == "recordings":
            reply["recordings"] = [
                {"name": "stop-000001-wheel_lost", "cause": "wheel_lost", "wall_us": 1, "log_bytes": len(self.data), "jsonl_bytes": None, "conf_bytes": None}
            ]
        elif verb == "recording":
            self.pieces += 1
            piece = self.data[asked["offset"] : asked["offset"] + 24576]
            last = asked["offset"] + len(piece) == len(self.data)
            reply.update(
                name=asked["name"],
                offset=asked["offset"],
                size=len(self.data),
                data=base64.b64encode(piece).decode(),
                crc32=zlib.crc32(piece),
                file_crc32=zlib.crc32(self.data) if last else None,
            )
            if self.trouble(self, reply) == "lost":
                return
        self.client.publish(f"iwheel/{self.name}/reply/{asked['from']}", json.dumps(reply))


def fetch_from(rig, name, data, trouble):
    played = Played(rig.port, name, data, trouble)
    rig.fars.append(played)
    return console(rig, write_config(rig, port=rig.port), "recording", name, "--wait", "8", "-o", str(folder_of(rig) / "x"))


def test_recording_with_piece_lost_or_refused_once_is_complete(rig):
    rig.start_broker()
    data = bytes(number * number % 251 for number in range(100000))

    def trouble(played, reply):
        if played.pieces == 2:
            return "lost"
        if played.pieces == 4:
            reply["crc32"] ^= 1
        if played.pieces == 5:
            reply.update(ok=False, error="not_delivered", message="the gateway does not answer")
        if played.pieces == 6:
            played.boot = "second"
        return None

    code, out, err = fetch_from(rig, "w5", data, trouble)
    assert code == 0 and (folder_of(rig) / "x.log").read_bytes() == data and [path.name for path in folder_of(rig).iterdir()] == ["x.log"], (code, out, err)
    assert int(re.search(r"(\d+) requested again", out).group(1)) >= 4, out


def test_recording_that_stays_damaged_fails_and_leaves_no_file(rig):
    rig.start_broker()
    data = bytes(60000)

    def each(_played, reply):
        reply["crc32"] ^= 1

    def whole(_played, reply):
        reply["file_crc32"] = reply["file_crc32"] and 7

    def other(_played, reply):
        reply["offset"] += 1

    for number, trouble in enumerate((each, whole, other)):
        code, out, err = fetch_from(rig, f"w{number}", data, trouble)
        assert code == 65 and "the checksum of" in err and "is wrong" in err and out == "", (code, out, err)
        assert not list(folder_of(rig).iterdir())


# ---- MQTT 5 ---------------------------------------------------------------------------------------------------------


class Far5:
    """A client with MQTT 5; stores (topic, payload, properties)."""

    def __init__(self, rig, name="far5"):
        self.all, self.listens = [], threading.Event()
        self.client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=name, protocol=paho.MQTTv5)
        self.client.on_connect = lambda client, *_: client.subscribe([("iwheel/#", 1)])
        self.client.on_subscribe = lambda *_: self.listens.set()
        self.client.on_message = lambda _client, _data, message: self.all.append((message.topic, message.payload, message.properties))
        self.client.connect("127.0.0.1", rig.port)
        self.client.loop_start()
        rig.fars.append(self)
        assert self.listens.wait(5)

    def of(self, what):
        return [(payload, properties) for topic, payload, properties in list(self.all) if topic == f"iwheel/{ID}/{what}"]

    def ask(self, verb, answer_to=None, correlation=None, **fields):
        properties = Properties(PacketTypes.PUBLISH)
        properties.MessageExpiryInterval = 1
        if answer_to:
            properties.ResponseTopic = answer_to
        if correlation:
            properties.CorrelationData = correlation
        self.client.publish(f"iwheel/{ID}/cmd/{verb}", json.dumps({"from": "far5", **fields}), properties=properties)

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()


@pytest.mark.rig(settings={"broker": {"protocol": "5"}})
def test_mqtt5_all_but_events_expire_replies_use_response_topic(rig):
    rig.start()
    far = Far5(rig)
    until(lambda: far.of("state"), what="a state")
    assert far.of("state")[-1][1].MessageExpiryInterval == 2
    make_stops(rig, 1)
    stop = until(lambda: far.of("event/stop"), what="a stop")
    assert not hasattr(stop[0][1], "MessageExpiryInterval") and not hasattr(far.of("info")[0][1], "MessageExpiryInterval")
    far.ask("hello", answer_to=f"iwheel/{ID}/reply/elsewhere", correlation=b"\x00one", seq=1)
    payload, properties = until(lambda: far.of("reply/elsewhere"), what="an answer")[0]
    assert properties.CorrelationData == b"\x00one" and properties.MessageExpiryInterval == 10 and json.loads(payload)["ok"]
    for number, topic in enumerate((f"iwheel/{ID}/event/stop", "iwheel/w2/reply/far5", f"iwheel/{ID}/reply/a/b")):
        far.ask("hello", answer_to=topic, seq=2 + number)
        refusal = json.loads(until(lambda most=number: len(far.of("reply/far5")) > most and far.of("reply/far5")[-1], what="a refusal")[0])
        assert refusal["error"] == "garbled" and "response topic" in refusal["message"], refusal
    assert len(far.of("event/stop")) == 1
    name, folder = stop_with_recording(rig), folder_of(rig)
    code, out, err = console(rig, write_config(rig, port=rig.port, protocol=5), "recording", ID, name, "-o", str(folder / "x"))
    assert code == 0 and (folder / "x.log").read_bytes() == Path(rig.path(name + ".log")).read_bytes(), (code, out, err)


class DeadLine(socketserver.ThreadingUnixStreamServer):
    """Between bridge and gateway, as iwheel-serial with a dead line: it passes everything on but stops, which it refuses."""

    daemon_threads = True

    class RequestHandlerClass(socketserver.StreamRequestHandler):
        def handle(self):
            with socket.socket(socket.AF_UNIX) as gateway:
                gateway.connect(self.server.gateway)
                threading.Thread(target=self.pass_back, args=(gateway,), daemon=True).start()
                for line in self.rfile:
                    request = json.loads(line)
                    if request["cmd"] == "stop":
                        refusal = {"id": request["id"], "ok": False, "error": "bus_down", "message": "this stop was not delivered"}
                        self.wfile.write(json.dumps(refusal).encode() + b"\n")
                    else:
                        gateway.sendall(line)

        def pass_back(self, gateway):
            with contextlib.suppress(OSError):
                while data := gateway.recv(65536):
                    self.wfile.write(data)

    def __init__(self, path, gateway):
        self.gateway = gateway
        super().__init__(path, self.RequestHandlerClass)
        threading.Thread(target=self.serve_forever, daemon=True).start()


@pytest.mark.rig(settings={"broker": {"protocol": "5"}})
def test_mqtt5_stop_without_json_is_reported_as_the_gateway_reports_it(rig):
    rig.mqtt_settings["gateway"]["socket"] = rig.path("line.sock")
    rig.start_gateway()
    rig.start_broker()
    with DeadLine(rig.path("line.sock"), rig.path("watch.sock")) as line:
        rig.start_bridge()
        far = Far5(rig)
        until(lambda: far.of("availability")[-1:] and far.of("availability")[-1][0] == b"online", what="online")
        properties = Properties(PacketTypes.PUBLISH)
        properties.ResponseTopic = f"iwheel/{ID}/reply/far5"
        far.client.publish(f"iwheel/{ID}/cmd/stop", "{", properties=properties)
        reply = json.loads(until(lambda: far.of("reply/far5"), what="a reply")[0][0])
        assert reply["error"] == "bus_down", reply
        rig.end_bridge()
        line.shutdown()


@pytest.mark.rig(settings={"broker": {"protocol": "5"}})
def test_mqtt5_event_refused_by_broker_is_stored_and_sent_later(rig):
    """With 3.1.1 a broker confirms messages that its ACL forbids, so the bridge cannot know."""
    acl = Path(rig.path("acl"))
    acl.write_text(
        "topic read #\ntopic write iwheel/+/state\ntopic write iwheel/+/info\ntopic write iwheel/+/availability\ntopic write iwheel/+/event/estop\n",
        encoding="ascii",
    )
    rig.broker_lines.append(f"acl_file {acl}")
    far = rig.start_online()
    last = make_stops(rig, 2)
    until(lambda: "did not accept" in rig.words() and "Not authorized" in rig.words(), what=f"it is reported: {rig.words()}")
    until(lambda: far.messages("info")[-1]["events"]["aside"] >= 2, what="set aside, and counted")
    assert len(far.events("estop")) == 4 and not far.events("stop"), "a refused event blocks no later event"
    assert far.texts("availability")[-1] == "online" and rig.words().count("connected to the broker") == 1, "a refused message ends no connection"
    acl.write_text("topic readwrite #\n", encoding="ascii")
    rig.broker.signal(1)
    until(lambda: numbers(far) == list(range(last - 1, last + 1)), 20, "both stops")
    until(lambda: far.messages("info")[-1]["events"]["aside"] == 0, 20, "nothing is set aside any more")


def test_mqtt5_at_a_broker_without_it_names_the_fix(rig):
    _, mqtt = start_one_nats(rig)
    refuses(69, "does not support MQTT 5; set protocol = 3.1.1 under [broker]", rig, write_config(rig, port=mqtt, protocol=5), "--for", "2")
    assert console(rig, write_config(rig, port=mqtt), "--for", "1")[0] == 0
