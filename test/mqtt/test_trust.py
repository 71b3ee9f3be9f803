# SPDX-License-Identifier: MIT
"""Events that a broker does not accept, the identity of the broker, names and files of others, and reports of refusals."""

import os
import shutil
import sys
import time
from pathlib import Path

import pytest
from test_bridge import arm, make_certificates as sign, make_stops, numbers, steer, turns
from test_console import console, write_config
from test_fleet import HOSTS, Cluster, certificates, fleet_far, start_by_tls, start_fleet_broker, use_tls, with_certificate
from harness import Process
from mqtt_rig import ID, Far, Line, paho
from settings_file import write_settings
from trials import Skip, until

STRANGER = 65534
DRIVING = {"driving": True, "settings": {"state": {"every_ms": 100}}}


def need_root():
    if os.geteuid() != 0:
        raise Skip("another user's process needs root")


# ---- events that a broker never accepts -----------------------------------------------------------------------------


@pytest.mark.rig(settings={"broker": {"protocol": "5"}})
def test_event_too_large_is_set_aside_and_later_ones_go(rig):
    """The broker's largest packet is smaller than a stop, info and state: messages that fit arrive, the rest after they fit."""
    rig.broker_lines.append("max_packet_size 420")
    line = rig.cut_here()
    far = rig.start_online()
    last = make_stops(rig, 3)
    until(lambda: len(far.events("estop")) == 2 * last, what="events that fit")
    until(lambda: "did not accept" in rig.words() and "/event/stop" in rig.words(), what=f"it is reported: {rig.words()}")
    assert not far.events("stop") and far.texts("availability")[-1] == "online"
    rig.broker_lines.remove("max_packet_size 420")
    rig.end_broker()
    rig.bring_broker_back(line, far)
    until(lambda: sorted(numbers(far)) == list(range(1, last + 1)), 20, f"all stops, now that they fit: {numbers(far)}")
    until(lambda: far.messages("info")[-1]["events"]["waiting"] == 0 and far.messages("info")[-1]["events"]["refused"] >= last, what="counted")


class Choosy(Line):
    """A broker of MQTT 3.1.1 that ends the connection over which it receives an event that it does not accept."""

    CHUNK = 65536  # The name of the event must not be split.

    def __init__(self, port, word):
        self.word, self.ended = word, 0
        super().__init__(port)

    def passed(self, data):
        if self.word in data:
            self.ended += 1
            return b"", False
        return data, True


def test_event_that_ends_each_connection_is_set_aside(rig):
    line = Choosy(rig.port, b"event/lease")
    rig.fars.append(line)
    rig.mqtt_settings["broker"]["port"] = line.port
    far = rig.start_online()
    client = rig.client(name="walker")
    until(lambda: client.request("arm", name="walker")["ok"], what="armed")
    until(lambda: "the connection ended each time" in rig.words(), 30, f"set aside: {rig.words()}")
    client.close()
    last = make_stops(rig, 1)
    until(lambda: last in numbers(far), 40, f"the stop behind them arrives: {numbers(far)}, {rig.words()}")
    assert not far.events("lease") and line.ended < 40, line.ended


# ---- the client's name ----------------------------------------------------------------------------------------------


def thief(rig, port, name, certificate, host="127.0.0.1", **options):
    """A client that connects with this name again and again."""
    client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=name, **options)
    client.reconnect_delay_set(0.05, 0.1)
    if certificate:
        with_certificate(rig, certificate)(client)
    client.connect_async(host, port)
    client.loop_start()
    client.close = lambda: (client.disconnect(), client.loop_stop())
    rig.fars.append(client)
    return client


def test_machine_cannot_use_the_name_of_another_at_mosquitto(rig):
    port = start_fleet_broker(rig)
    start_by_tls(rig, "localhost", port)
    console_far = fleet_far(rig, port, "console")
    until(lambda: console_far.texts("availability")[-1:] == ["online"], 15, f"online: {rig.words()}")
    for name in ("w1", "iwheel-w1"):
        thief(rig, port, name, "w2")
    time.sleep(3)
    assert console_far.ask("stop")["ok"] and console_far.texts("availability") == ["online"], rig.words()


def test_machine_cannot_use_the_name_of_another_at_nats(rig):
    """nats-server ties no name to a user: the bridge's name is random in each run, so no other client can know it."""
    cluster = Cluster(rig)
    start_by_tls(rig, HOSTS[0], cluster.mqtt)
    until(lambda: "connected to the broker" in rig.words(), 30, rig.words())
    for name in ("w1", "iwheel-w1"):
        thief(rig, cluster.mqtt, name, "w2", HOSTS[0])
    time.sleep(3)
    assert rig.words().count("connected to the broker") == 1 and "is used by another" not in rig.words(), rig.words()


def test_name_used_by_another_client_is_reported(rig):
    """Two programs with one certificate; with MQTT 5 the broker reports it, with 3.1.1 it only ends the connection."""
    port = start_fleet_broker(rig)
    rig.start_gateway()
    for protocol in ("3.1.1", "5"):
        use_tls(rig, "localhost", port)
        rig.mqtt_settings["broker"]["protocol"] = protocol
        rig.start_bridge()
        until(lambda: "connected to the broker" in rig.words(), 15, rig.words())
        one = thief(rig, port, "any", ID)
        until(lambda: "is used by another client" in rig.words(), 20, f"reported, protocol {protocol}: {rig.words()}")
        one.close()
        rig.forget_bridge()


# ---- the identity of the broker -------------------------------------------------------------------------------------

LISTENER = """
import os, socket, sys
os.setgroups([]); os.setgid(65534); os.setuid(65534)
server = socket.create_server(("127.0.0.1", int(sys.argv[1])))
print("listens", flush=True)
held = []
while True:
    if sys.argv[2] == "accepts":
        link = server.accept()[0]
        held.append(link)
        link.settimeout(3)
        try:
            data = link.recv(1000)
        except OSError:
            data = b""
        print("came", len(data), data[:80], flush=True)
    else:
        import time
        time.sleep(1)
"""


def test_stranger_on_loopback_gets_no_password_and_no_command(rig):
    need_root()
    secret = Path(rig.path("secret"))
    secret.write_text("w1:pass-word\n", encoding="ascii")
    secret.chmod(0o600)
    rig.mqtt_settings["broker"]["credentials"] = str(secret)
    rig.start_gateway()
    for how in ("accepts", "waits"):  # The kernel shows root as the owner of a connection that is not accepted yet.
        stranger = Process([sys.executable, "-c", LISTENER, str(rig.port), how], rig.path(f"{how}.out"))
        rig.processes.append(stranger)
        until(lambda one=stranger: "listens" in one.text(), what="the other user's process listens")
        bridge = rig.start_bridge()
        until(lambda one=bridge: "belongs to user 65534" in one.text() or "names no owner" in one.text(), 10, f"refused: {bridge.text()}")
        time.sleep(2)
        assert "came" not in stranger.text() or stranger.text().count("came 0") == stranger.text().count("came"), stranger.text()
        assert ("belongs to user 65534" in bridge.text()) == (how == "accepts"), bridge.text()
        code, _, err = console(rig, write_config(rig, port=rig.port, credentials=secret), "--for", "3")
        assert code == 69 and ("belongs to user 65534" in err or "names no owner" in err), err
        bridge.end()
        stranger.end()
        os.unlink(rig.path("mqtt.out"))


@pytest.mark.rig(**DRIVING)
def test_broker_of_a_stranger_does_not_drive(rig):
    need_root()
    rig.broker_lines = ["allow_anonymous true", "persistence false", "user nobody"]
    os.chmod(rig.folder, 0o755)
    rig.start()
    until(lambda: "belongs to user 65534" in rig.words(), 10, f"refused: {rig.words()}")
    assert "connected to the broker" not in rig.words()
    rig.forget_bridge()
    rig.mqtt_settings["broker"]["process_user"] = "nobody"
    rig.start_bridge()
    rig.online()


@pytest.mark.rig(**DRIVING)
def test_broker_on_a_unix_socket_drives_if_its_user_is_right(rig):
    need_root()
    path = rig.path("broker.sock")
    rig.broker_lines.append(f"listener 0 {path}")
    rig.mqtt_settings["broker"]["host"] = path
    far = rig.start_online()
    assert arm(far)
    steer(far, 0.7)
    assert turns(rig)
    rig.bridge.end()
    rig.end_broker()
    os.unlink(rig.path("mqtt.out"))
    os.unlink(path)
    stranger = Process(
        [
            sys.executable,
            "-c",
            "import os, socket, sys, time\nserver = socket.socket(socket.AF_UNIX)\nserver.bind(sys.argv[1])\nos.chmod(sys.argv[1], 0o777)\n"
            "os.setuid(65534)\nserver.listen()\ntime.sleep(60)\n",
            path,
        ],
        rig.path("stranger.out"),
    )
    rig.processes.append(stranger)
    until(lambda: os.path.exists(path), what="it listens")
    time.sleep(0.3)
    rig.start_bridge()
    until(lambda: "belongs to user 65534" in rig.words(), 10, f"refused: {rig.words()}")


def write_broker(rig, **broker):
    rig.mqtt_settings["broker"].update(broker)
    write_settings(rig.path("mqtt.conf"), rig.mqtt_settings)


def test_host_that_only_begins_like_loopback_is_another_machine(rig):
    for host, code in (
        ("127.example.org", 78),
        ("127.0.0.1.example", 78),
        ("10.0.0.1", 78),
        ("127.8.9.1", 0),
        ("::1", 0),
        ("localhost", 0),
        ("/run/broker.sock", 0),
    ):
        write_broker(rig, host=host)
        assert rig.check_bridge()[0] == code, (host, rig.check_bridge())
    rig.mqtt_settings["drive"]["enabled"] = "yes"
    write_broker(rig, host="10.0.0.1", allow_plain="yes")
    code, words = rig.check_bridge()
    assert code == 78 and "needs TLS" in words, words


# ---- files ----------------------------------------------------------------------------------------------------------


def test_key_that_others_may_read_is_refused(rig):
    sign(rig)
    key = Path(rig.path("machine.key"))
    write_broker(rig, host="localhost", ca=rig.path("ca.pem"), certificate=rig.path("machine.pem"), key=str(key))
    for mode, code in ((0o644, 77), (0o640, 77 if os.geteuid() else 0), (0o600, 0)):
        key.chmod(mode)
        checked = rig.check_bridge()
        assert checked[0] == code, (oct(mode), checked)
        assert code or rig.start_bridge().child.poll() is None, oct(mode)
        rig.bridge and rig.bridge.end()


def test_spool_of_other_owner_is_refused_and_no_link_followed(rig):
    need_root()
    spool, other = Path(rig.path("spool")), Path(rig.path("other"))
    other.write_text("of somebody", encoding="ascii")
    for prepare, undo in (
        (lambda: spool.chmod(0o777), lambda: spool.chmod(0o700)),
        (lambda: os.chown(spool, STRANGER, -1), lambda: os.chown(spool, 0, -1)),
        (lambda: (spool / "events").write_bytes(b"") or os.chown(spool / "events", STRANGER, -1), (spool / "events").unlink),
        (lambda: os.link(other, spool / "events"), (spool / "events").unlink),
    ):
        prepare()
        code = rig.start_bridge().wait(5)
        assert code == 73 and "belongs to another user" in rig.words(), (code, rig.words())
        undo()
        os.unlink(rig.path("mqtt.out"))
    os.link(other, spool / "events.new")
    rig.start_online()
    assert other.read_text(encoding="ascii") == "of somebody"
    rig.bridge.end()
    shutil.move(spool, rig.path("moved"))
    os.symlink(rig.path("moved"), spool)
    os.unlink(rig.path("mqtt.out"))
    assert rig.start_bridge().wait(5) == 73 and "symbolic link" in rig.words(), rig.words()


# ---- Home Assistant under the shipped rights ------------------------------------------------------------------------


@pytest.mark.rig(settings={"home_assistant": {"enabled": "yes"}})
def test_home_assistant_sensors_pass_shipped_mosquitto_rights(rig):
    port = start_fleet_broker(rig)
    certificates(rig, "console", "homeassistant")
    start_by_tls(rig, "localhost", port)
    sensors = fleet_far(rig, port, "homeassistant", topics=("homeassistant/#", "iwheel/+/availability"))
    until(lambda: len([1 for topic, *_ in sensors.all if topic.startswith("homeassistant/")]) == 11, 15, rig.words())
    console_far = fleet_far(rig, port, "console")
    until(
        lambda: console_far.messages("info")[-1:] and console_far.messages("info")[-1].get("home_assistant") == {"sensors": 11, "passed_on": 11},
        15,
        "counted in info",
    )
    assert "Home Assistant" not in rig.words(), rig.words()
    second = fleet_far(rig, port, "w2")
    second.client.publish("homeassistant/sensor/iwheel_w1/forged/config", "{}", qos=1).wait_for_publish(3)
    time.sleep(0.5)
    assert not [topic for topic, *_ in sensors.all if "forged" in topic]


@pytest.mark.rig(settings={"home_assistant": {"enabled": "yes"}})
def test_home_assistant_sensors_pass_the_shipped_rights_of_nats(rig):
    cluster = Cluster(rig)
    start_by_tls(rig, HOSTS[0], cluster.mqtt)
    console_far = Far(cluster.mqtt, "console", topics=("iwheel/+/info",), setup=with_certificate(rig, "console"), host=HOSTS[0])
    rig.fars.append(console_far)
    until(
        lambda: console_far.messages("info")[-1:] and console_far.messages("info")[-1].get("home_assistant") == {"sensors": 11, "passed_on": 11},
        25,
        f"counted in info: {rig.words()}",
    )


@pytest.mark.rig(settings={"home_assistant": {"enabled": "yes"}})
def test_home_assistant_sensors_that_are_refused_are_reported(rig):
    acl = Path(rig.path("acl"))
    acl.write_text("topic readwrite iwheel/#\n", encoding="ascii")
    rig.broker_lines.append(f"acl_file {acl}")
    far = rig.start_online()
    until(lambda: "sensors that the broker forwarded: 0 of 11" in rig.words(), 15, rig.words())
    until(lambda: far.messages("info")[-1]["home_assistant"] == {"sensors": 11, "passed_on": 0}, what="in info")
