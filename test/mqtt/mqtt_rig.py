# SPDX-License-Identifier: MIT
"""Simulated wheels, gateway, MQTT bridge and broker in one private folder, and an outside client that may send anything."""

import contextlib
import json
import os
import pwd
import queue
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

try:
    from paho.mqtt import client as paho
except ImportError:
    paho = None

sys.path[:0] = [str(Path(__file__).resolve().parent.parent / folder) for folder in ("system", "support")]

from bus import now_us
from free_port import free_port
from harness import WORDS, Process, Rig
from settings_file import write_settings
from trials import Skip, until

# These limits fit any machine, however busy; the demonstration has the same.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}
ID = "w1"


def put_table(page, maker, lines):
    """Writes a table into the page, between the marks that name the program."""
    text = page.read_text(encoding="utf-8")
    begin, end = f"<!-- figures: {maker} -->\n", "<!-- end of figures -->"
    before, rest = text.split(begin, 1)
    page.write_text(before + begin + "\n" + "\n".join(lines) + "\n\n" + end + rest.split(end, 1)[1], encoding="utf-8")


class Far:
    """A client of the broker that stores all messages and sends commands."""

    def __init__(self, port, name="far", topics=("iwheel/#",), setup=None, host="127.0.0.1", clean=True):
        self.name, self.seq, self.all, self.lock = name, 0, [], threading.Lock()
        self.answers = queue.Queue()
        self.client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=name, clean_session=clean)
        self.client.reconnect_delay_set(0.1, 0.3)
        if setup:
            setup(self.client)
        self.listens = threading.Event()
        self.client.on_connect = lambda client, *_: client.subscribe([(topic, 1) for topic in topics])
        self.client.on_subscribe = lambda *_: self.listens.set()
        self.client.on_disconnect = lambda *_: self.listens.clear()
        self.client.on_message = self.receive
        self.client.connect_async(host, port)
        self.client.loop_start()
        assert self.listens.wait(5), f"{name} is at the broker"

    def receive(self, _client, _data, message):
        with self.lock:
            self.all.append((message.topic, message.payload, message.retain, now_us()))
        if message.topic.endswith(f"/reply/{self.name}"):
            self.answers.put(json.loads(message.payload))

    def texts(self, what, machine=ID):
        with self.lock:
            return [payload.decode() for topic, payload, _, _ in self.all if topic == f"iwheel/{machine}/{what}"]

    def messages(self, what, machine=ID):
        return [json.loads(text) for text in self.texts(what, machine)]

    def print_figures(self, fault, often=1, machine=ID):
        """Asserts that each event of the bridge has arrived, in order, and prints the row. The number of sent events follows from the events' numbers."""
        with self.lock:
            events = [(json.loads(payload), at_us) for topic, payload, _, at_us in self.all if topic.startswith(f"iwheel/{machine}/event/")]
        numbers = list(dict.fromkeys(int(event["id"].rsplit("-", 1)[1]) for event, _ in events))
        assert numbers == list(range(numbers[0], numbers[-1] + 1)), f"a gap, or out of order: {numbers}"
        latest_s = max(at_us - event["t_us"] for event, at_us in events) / 1e6
        row = f"{fault} | {often} | {numbers[-1] - numbers[0] + 1} | {len(numbers)} | {len(events) - len(numbers)} | {latest_s:.1f} s"
        print("figures:", row, flush=True)
        if "IWHEEL_FIGURES" in os.environ:  # See figures.py.
            with open(os.environ["IWHEEL_FIGURES"], "a", encoding="utf-8") as file:
                file.write(f"figures: {row}\n")

    def events(self, name=None, machine=ID):
        """Events in the order of arrival, without doubles of the same id."""
        seen, found = set(), []
        with self.lock:
            all_of = list(self.all)
        for topic, payload, _, _ in all_of:
            if topic.startswith(f"iwheel/{machine}/event/"):
                event = json.loads(payload)
                if event["id"] not in seen and name in (None, event["event"]):
                    found.append(event)
                seen.add(event["id"])
        return found

    def send(self, verb, machine=ID, retain=False, **fields):
        """Publishes exactly these fields."""
        self.client.publish(f"iwheel/{machine}/cmd/{verb}", json.dumps(fields), qos=1, retain=retain)

    def quote(self, seconds=3):
        """boot and t_us of a message that the machine sends now."""
        self.seq += 1
        seq = self.seq
        self.send("hello", **{"from": self.name, "seq": seq})
        answer = self.answer(seq, seconds)
        return {"boot": answer["boot"], "t_us": answer["t_us"]}

    def latest(self):
        """boot and t_us of the newest state."""
        state = json.loads(self.texts("state")[-1])
        return {key: state[key] for key in ("boot", "t_us")}

    def answer(self, seq, seconds=3):
        while True:
            try:
                answer = self.answers.get(timeout=seconds)
            except queue.Empty as error:
                raise AssertionError(f"no answer to {seq} in {seconds} s") from error
            if answer["seq"] == seq:
                return answer

    def ask(self, verb, quote=None, wait=True, **fields):
        """Sends a correct command and returns its reply."""
        fields = {**(quote or self.quote()), **fields}
        self.seq += 1
        seq = self.seq
        self.send(verb, **{"from": self.name, "seq": seq, **fields})
        return self.answer(seq) if wait else None

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()


def await_port(port, host="127.0.0.1", seconds=10, process=None):
    """Waits until a server listens, of a program that runs."""

    def listens():
        assert process is None or process.child.poll() is None, process.text()
        with socket.socket() as one:
            return one.connect_ex((host, port)) == 0

    until(listens, seconds, f"{host} port {port} listens")


def shut(end):
    """Ends a connection in both directions, if it has not ended yet."""
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)


class Line(threading.Thread):
    """A network between bridge and broker that can be cut: after any byte, or silently."""

    CHUNK = 4096  # Bytes that are transported together.

    def __init__(self, port):
        super().__init__(daemon=True)
        self.to, self.pairs, self.frozen = port, [], False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.left, self.counts = None, threading.Lock()  # Bytes until the line is cut; None: never.
        self.delay = 0.0  # Delay of every 4 kB.
        self.start()

    def run(self):
        while True:
            try:
                near = self.listener.accept()[0]
            except OSError:
                return
            try:
                far = socket.create_connection(("127.0.0.1", self.to))
            except OSError:
                near.close()
                continue
            self.pairs += [near, far]
            for one, other in ((near, far), (far, near)):
                threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    def carry(self, one, other):
        try:
            lasts = True
            while lasts and (data := one.recv(self.CHUNK)):
                data, lasts = self.passed(data)
                other.sendall(data)
        except OSError:
            pass
        shut(one)
        shut(other)

    def passed(self, data):
        """(the part that is transported, whether the connection stays)"""
        while self.frozen:
            time.sleep(0.01)
        time.sleep(self.delay)
        with self.counts:
            if self.left is None:
                return data, True
            data = data[: max(0, self.left)]
            self.left -= len(data)
            return data, self.left > 0

    def restore(self):
        with self.counts:
            self.left = None

    def close(self):
        for one in (self.listener, *self.pairs):
            shut(one)
            one.close()


class MqttRig(Rig):
    """`driving`: commands may drive and reset."""

    def __init__(self, build, driving=False, settings=None, config=None):
        if not paho:
            raise Skip("paho-mqtt is missing in .venv (scripts/python_packages .venv requirements/check.txt)")
        if not shutil.which("mosquitto"):
            raise Skip("mosquitto is missing (scripts/install_tools check brings it)")
        self.bridge = self.broker = None
        self.fars, self.port = [], free_port()
        self.broker_lines = ["allow_anonymous true", "persistence false", f"user {pwd.getpwuid(os.getuid()).pw_name}"]
        super().__init__(str(build), {section: {**CONFIG.get(section, {}), **(config or {}).get(section, {})} for section in {*CONFIG, *(config or {})}})
        self.mqtt_settings = {
            "gateway": {"socket": self.path("gateway.sock" if driving else "watch.sock")},
            "machine": {"id": ID},
            "broker": {"port": self.port},
            "state": {"every_ms": 1000},
            "spool": {"directory": self.path("spool")},
            "home_assistant": {},
            "drive": {},
        }
        if driving:
            self.mqtt_settings["drive"] = {"enabled": "yes", "allow_reset": "yes"}
        for section, keys in (settings or {}).items():
            self.mqtt_settings[section].update(keys)
        Path(self.path("spool")).mkdir(mode=0o700)

    def words(self):
        return self.bridge.text() if self.bridge else ""

    def said(self):
        return self.words()[-WORDS:] + super().said()

    def gateway_command(self, *extra):
        return super().gateway_command("--watch-socket", self.path("watch.sock"), *extra)

    def start(self):
        self.start_gateway()
        self.start_broker()
        self.start_bridge()
        return self

    def start_online(self):
        """Starts all, and returns an outside client for which the machine is online."""
        self.start()
        return self.online()

    def end_bridge(self, number=signal.SIGTERM):
        self.bridge.signal(number)
        self.bridge.wait(5)

    def forget_bridge(self):
        """Ends it; the next one has its own output."""
        self.bridge.end()
        os.unlink(self.path("mqtt.out"))

    def at_standstill(self):
        until(lambda: self.gateway_state()["state"] == "listening", what="stopped")

    def check_bridge(self, setup=None):
        """(exit code, output) of --check."""
        command = [self.program("iwheel-mqtt"), "-c", self.path("mqtt.conf"), "--check"]
        done = subprocess.run(command, capture_output=True, text=True, preexec_fn=setup, check=False)
        return done.returncode, done.stdout + done.stderr

    def start_broker(self):
        Path(self.path("mosquitto.conf")).write_text("\n".join(["listener " + str(self.port) + " 127.0.0.1", *self.broker_lines, ""]), encoding="utf-8")
        self.broker = Process(["mosquitto", "-c", self.path("mosquitto.conf")], self.path("mosquitto.out"))
        self.processes.append(self.broker)

        await_port(self.port, process=self.broker)

    def bring_broker_back(self, line, far):
        """Starts the broker so that `far` connects before the bridge: a killed broker has no subscribers, and earlier messages would be lost."""
        line.left = 0
        far.listens.clear()  # Its thread may not have noticed the end yet.
        self.start_broker()
        assert far.listens.wait(5), "far is back"
        line.restore()

    def end_broker(self, number=9):
        self.broker.signal(number)
        self.broker.wait(5)

    def start_bridge(self, setup=None, **options):
        write_settings(self.path("mqtt.conf"), self.mqtt_settings)
        self.bridge = Process([self.program("iwheel-mqtt"), "-c", self.path("mqtt.conf")], self.path("mqtt.out"), setup, **options)
        self.processes.append(self.bridge)
        return self.bridge

    def cut_here(self):
        """Inserts a line that can be cut between the bridge and the broker."""
        line = Line(self.port)
        self.mqtt_settings["broker"]["port"] = line.port
        self.fars.append(line)
        return line

    def far(self, name="far", **options):
        one = Far(self.port, name, **options)
        self.fars.append(one)
        return one

    def online(self, far=None):
        far = far or self.far()
        until(lambda: far.texts("availability")[-1:] == ["online"], what=f"online: {self.words()}")
        return far

    def gateway_state(self):
        client = self.client(name="looker")
        try:
            return client.request("status")
        finally:
            client.close()

    def press(self, pressed=True):
        self.sim.ask("estop press" if pressed else "estop release")

    def close(self, keep=False):
        for far in self.fars:
            far.close()
        super().close(keep)
