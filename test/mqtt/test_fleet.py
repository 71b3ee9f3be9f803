# SPDX-License-Identifier: MIT
"""The recipes of share/fleet as shipped: three servers of which the leader is killed, a forwarding mosquitto, and access rights."""

import json
import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

from test_bridge import make_stops, numbers
from harness import Process
from free_port import free_port
from mqtt_rig import ID, Far, await_port
from trials import ROOT, Skip, until

FLEET = ROOT / "share/fleet"
HOSTS = ("127.0.0.1", "127.0.0.2", "127.0.0.3")


def certificates(rig, *words):
    done = subprocess.run([FLEET / "certificates", rig.path("certs"), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def make_certificates(rig):
    certificates(rig, "server", *HOSTS, "localhost")
    certificates(rig, "machine", ID, "w2")
    certificates(rig, "console")
    certificates(rig, "keeper")


def with_certificate(rig, name):
    """Setup of an outside client with this certificate."""
    return lambda client: client.tls_set(rig.path("certs/ca.pem"), rig.path(f"certs/{name}.pem"), rig.path(f"certs/{name}.key"))


def use_tls(rig, host, port):
    rig.mqtt_settings["broker"].update(
        {"host": host, "port": port, "ca": rig.path("certs/ca.pem"), "certificate": rig.path(f"certs/{ID}.pem"), "key": rig.path(f"certs/{ID}.key")}
    )


def start_by_tls(rig, host, port):
    use_tls(rig, host, port)
    rig.start_gateway()
    rig.start_bridge()


def need_nats():
    if not shutil.which("nats-server"):
        raise Skip("nats-server is missing (scripts/install_tools check brings it)")


def start_one_nats(rig):
    """A single nats-server with a stream engine. Returns its port and that of MQTT."""
    need_nats()
    port, mqtt = free_port(), free_port()
    Path(rig.path("one.conf")).write_text(
        f'server_name: one\nlisten: 127.0.0.1:{port}\njetstream {{ store_dir: "{rig.path("one")}" }}\nmqtt {{ listen: 127.0.0.1:{mqtt} }}\n', encoding="ascii"
    )
    rig.processes.append(Process(["nats-server", "-c", rig.path("one.conf")], rig.path("one.out")))
    await_port(mqtt)
    return port, mqtt


class Cluster:
    """Three nats-servers with the shipped configuration, on three addresses of this machine."""

    def __init__(self, rig):
        need_nats()
        make_certificates(rig)
        self.rig, self.servers = rig, {}
        self.nats, self.mqtt, self.routes = free_port(), free_port(), free_port()
        shutil.copy(FLEET / "nats-server.conf", rig.path("certs"))
        Path(rig.path("certs/routes.conf")).write_text(
            "routes: [" + ", ".join(f'"nats-route://{host}:{self.routes}"' for host in HOSTS) + "]\n", encoding="ascii"
        )
        for host in HOSTS:
            self.start(host)
        until(lambda: self.stream("create")[0] == 0, 30, f"the stream: {self.stream('create')}")

    def start(self, host):
        name = f"n{host[-1]}"
        environment = {
            **os.environ,
            "NAME": name,
            "NATS_LISTEN": f"{host}:{self.nats}",
            "CLUSTER_LISTEN": f"{host}:{self.routes}",
            "MQTT_LISTEN": f"{host}:{self.mqtt}",
            "STORE": self.rig.path(name),
        }
        server = Process(["nats-server", "-c", "nats-server.conf"], self.rig.path(f"{name}.out"), cwd=self.rig.path("certs"), env=environment)
        self.servers[host] = server
        self.rig.processes.append(server)

    def stream(self, verb):
        """(exit code, reply) of share/fleet/stream at a running server."""
        host = next(host for host, server in self.servers.items() if server.child.poll() is None)
        done = subprocess.run([FLEET / "stream", f"{host}:{self.nats}", self.rig.path("certs"), verb], capture_output=True, text=True, timeout=30, check=False)
        return done.returncode, (json.loads(done.stdout) if done.returncode == 0 else done.stderr[-300:])

    def leader(self):
        name = until(lambda: (info := self.stream("info"))[0] == 0 and info[1]["leader"], 20, "a leader")
        return next(host for host in HOSTS if host[-1] == name[-1])


def collector(rig, cluster, host, topics=("iwheel/+/event/+", "iwheel/+/availability")):
    """A session that outlasts its connection, so the cluster stores the events for it that it has confirmed to a machine."""
    await_port(cluster.mqtt, host)
    far = Far(cluster.mqtt, "console", topics=topics, setup=with_certificate(rig, "console"), host=host, clean=False)
    rig.fars.append(far)
    return far


def test_three_servers_leader_killed_each_stop_once_in_order(rig):
    cluster = Cluster(rig)
    leader = cluster.leader()
    others = [host for host in HOSTS if host != leader]
    far = collector(rig, cluster, others[0])
    start_by_tls(rig, " ".join((leader, others[1], others[0])), cluster.mqtt)
    until(lambda: far.texts("availability")[-1:] == ["online"], 15, f"online: {rig.words()}")
    first = make_stops(rig, 2)
    until(lambda: numbers(far) == list(range(1, first + 1)), 15, "the first")
    cluster.servers[leader].signal(9)
    killed = time.monotonic()
    last = make_stops(rig, 3)
    until(lambda: numbers(far) == list(range(1, last + 1)), 60, "all of them")
    print(f"        leader killed: the last of {last} stops {time.monotonic() - killed:.1f} s later", flush=True)
    far.print_figures("leader of three nats-servers killed, the bridge connected to it")
    assert f"connected to the broker at {leader}" in rig.words()
    until(lambda: (info := cluster.stream("info"))[0] == 0 and info[1]["messages"] > 0, 30, "the stream has a leader again, and events")


def test_confirmation_does_not_wait_for_a_stream_of_yours(rig):
    """docs/user/mqtt.md states about nats-server: a stream that accepts nothing withholds no confirmation, so a stream alone proves nothing."""
    port, mqtt = start_one_nats(rig)

    def ask(subject, body):
        with socket.create_connection(("127.0.0.1", port), timeout=5) as link, link.makefile("rb") as lines:
            link.sendall(b'CONNECT {"verbose":false}\r\nSUB _INBOX.x 1\r\nPUB %s _INBOX.x %d\r\n%s\r\n' % (subject, len(body), body))
            for line in lines:
                if line.startswith(b"MSG "):
                    return json.loads(lines.read(int(line.split()[-1])))
        return {}

    full = {"name": "full", "subjects": ["iwheel.*.event.>"], "max_msgs": 1, "discard": "new", "storage": "file"}
    assert "error" not in ask(b"$JS.API.STREAM.CREATE.full", json.dumps(full).encode())
    far = Far(mqtt, "w1")
    rig.fars.append(far)
    confirmed = [far.client.publish("iwheel/w1/event/stop", str(number), qos=1) for number in range(3)]
    for one in confirmed:
        one.wait_for_publish(5)
    assert all(one.is_published() for one in confirmed) and ask(b"$JS.API.STREAM.INFO.full", b"")["state"]["messages"] == 1


def start_fleet_broker(rig):
    """Starts a broker with share/fleet/mosquitto.conf and paths in our folder; returns its port."""
    make_certificates(rig)
    port = free_port()
    text = (FLEET / "mosquitto.conf").read_text(encoding="utf-8").replace("/etc/mosquitto/certs", rig.path("certs")).replace("8883", str(port))
    text = text.replace("/etc/mosquitto/iwheel.acl", str(FLEET / "mosquitto.acl")).replace("/var/lib/mosquitto/", rig.path("") + "/")
    Path(rig.path("fleet.conf")).write_text(text + rig.broker_lines[-1] + "\n", encoding="utf-8")
    rig.processes.append(Process(["mosquitto", "-c", rig.path("fleet.conf")], rig.path("fleet.out")))
    await_port(port)
    return port


def fleet_far(rig, port, name, **options):
    far = Far(port, name, setup=with_certificate(rig, name), **options)
    rig.fars.append(far)
    return far


def test_machine_reaches_nothing_of_another_machine(rig):
    port = start_fleet_broker(rig)
    console, first, second = (fleet_far(rig, port, name) for name in ("console", ID, "w2"))
    first.client.publish("iwheel/w2/cmd/estop", "{}", qos=1).wait_for_publish(3)
    first.client.publish("iwheel/w2/event/stop", "{}", qos=1).wait_for_publish(3)
    first.client.publish("iwheel/w1/event/stop", '{"id":"1","event":"stop"}', qos=1).wait_for_publish(3)
    console.client.publish("iwheel/w1/event/stop", "forged", qos=1).wait_for_publish(3)
    console.client.publish("iwheel/w2/cmd/stop", "asked", qos=1).wait_for_publish(3)
    until(lambda: console.all and second.all, what="permitted messages arrive")
    time.sleep(0.3)
    assert [topic for topic, *_ in second.all] == ["iwheel/w2/cmd/stop"], second.all
    assert [(topic, payload) for topic, payload, *_ in console.all if "/cmd/" not in topic] == [("iwheel/w1/event/stop", b'{"id":"1","event":"stop"}')], (
        console.all
    )


def test_forwarding_mosquitto_stores_while_fleet_is_down(rig):
    port = start_fleet_broker(rig)
    central = rig.processes[-1]
    text = (
        (FLEET / "mosquitto-forward.conf")
        .read_text(encoding="utf-8")
        .replace("/etc/mosquitto/certs", rig.path("certs"))
        .replace("listener 1883", f"listener {rig.port}")
    )
    text = text.replace("broker.example:8883", f"localhost:{port}").replace("/var/lib/mosquitto/", rig.path("spool") + "/")
    Path(rig.path("forward.conf")).write_text(text + rig.broker_lines[-1] + "\n", encoding="utf-8")
    rig.start_gateway()
    rig.processes.append(Process(["mosquitto", "-c", rig.path("forward.conf")], rig.path("forward.out")))
    await_port(rig.port)
    rig.start_bridge()
    console = fleet_far(rig, port, "console", clean=False)
    until(lambda: console.texts("availability")[-1:] == ["online"], 15, "online, forwarded")
    assert console.ask("stop")["ok"], "commands and replies are forwarded, and recent enough"
    first = make_stops(rig, 1)
    until(lambda: numbers(console) == [first], 10, "a stop, forwarded")
    central.signal(15)
    central.wait(5)
    last = make_stops(rig, 3)
    rig.processes.append(Process(["mosquitto", "-c", rig.path("fleet.conf")], rig.path("fleet.out")))
    until(lambda: numbers(console) == list(range(first, last + 1)), 40, "all of them")


def test_console_shows_online_and_stopped_machines(rig):
    rig.start_online()
    config = Path(rig.path("fleet.conf"))
    config.write_text(f"[broker]\nport = {rig.port}\n", encoding="ascii")
    rig.far().client.publish("iwheel/w9/availability", "offline", qos=1, retain=True).wait_for_publish(3)
    with subprocess.Popen([rig.program("iwheel-fleet"), "-c", str(config), "--for", "3", "--json"], stdout=subprocess.PIPE, text=True) as console:
        time.sleep(0.7)
        make_stops(rig, 1)
        rows = [json.loads(line) for line in console.communicate(timeout=10)[0].splitlines()]
    assert console.returncode == 0 and [(row["machine"], row["online"], row["cause"]) for row in rows] == [(ID, True, "estop_line"), ("w9", False, None)], rows
    assert "emergency" in rows[0]["sentence"] or "e-stop" in rows[0]["sentence"], rows[0]
    rig.end_broker()
    done = subprocess.run([rig.program("iwheel-fleet"), "-c", str(config), "--for", "1"], capture_output=True, text=True, timeout=10, check=False)
    assert done.returncode == 69 and "no broker" in done.stderr, done
