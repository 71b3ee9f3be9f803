# SPDX-License-Identifier: MIT
"""The history of a fleet while nats-servers are killed: events missing in the stream are reported. IWHEEL_KILLS=100 pytest test/mqtt -k kills for the long form."""

import contextlib
import json
import os
import socket
import threading
import time

import pytest
from test_bridge import numbers
from test_console import cluster_config, console, lines
from test_fleet import HOSTS, Cluster, collector, use_tls
from mqtt_rig import ID, await_port
from trials import until

KILLS = int(os.environ.get("IWHEEL_KILLS", "4"))


class Teller:
    """The part of a gateway that the bridge needs, without wheels: it sends `stop` when the test wants it."""

    def __init__(self, path):
        self.number, self.wall_us, self.clients, self.watchers = 0, 0, [], []
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(path)
        self.listener.listen()
        threading.Thread(target=self.run, daemon=True).start()
        threading.Thread(target=self.tick, daemon=True).start()

    def run(self):
        while True:
            link = self.listener.accept()[0]
            self.clients.append(link)
            self.send(
                link,
                {"event": "hello", "t_us": time.monotonic_ns() // 1000, "name": "iwheel-gateway", "api": 1, "client": len(self.clients), "rights": "watch"},
            )
            threading.Thread(target=self.serve, args=(link,), daemon=True).start()

    @staticmethod
    def send(link, message):
        with contextlib.suppress(OSError):
            link.sendall(json.dumps(message, separators=(",", ":")).encode() + b"\n")

    def stop_fields(self):
        return {"number": self.number, "cause": "client_stop", "wall_us": self.wall_us, "sentence": f"stop number {self.number}"}

    def serve(self, link):
        for line in link.makefile("rb"):
            asked = json.loads(line)
            reply = {"id": asked["id"], "ok": True}
            if asked["cmd"] == "watch":
                reply |= {"topics": asked["topics"], "rate_hz": asked["rate_hz"], "limited": False}
                self.watchers.append(link)
            elif asked["cmd"] == "why":
                reply |= self.stop_fields()
            self.send(link, reply)

    def tick(self):
        while True:
            for link in list(self.watchers):
                self.send(link, {"event": "state", "t_us": time.monotonic_ns() // 1000, "state": "listening"})
            time.sleep(1)

    def stop(self):
        self.number += 1
        self.wall_us = time.time_ns() // 1000
        for link in list(self.watchers):
            self.send(link, {"event": "stop", "t_us": time.monotonic_ns() // 1000, **self.stop_fields()})


def judge(rig, config, teller, far):
    """Compares the stops missing in the stream, counted by the test, with the report of the history."""

    def delivered():
        info = (far.messages("info") or [{}])[-1]
        return (info.get("last_stop") or {}).get("number") == teller.number and info["events"]["waiting"] == 0

    until(delivered, 90, f"the machine has delivered all: {far.messages('info')[-1:]}, {rig.words()[-2000:]}")

    def read():
        """While the servers elect a leader, a history may report that its end is not checked: then it is read again."""
        code, out, err = console(rig, config, "history", ID, "--last", "2h", "--json", timeout=120)
        read = lines(out) if code == 0 else []
        return read if read and read[-1]["end_checked"] else print("        ", err.strip(), read[-1:])

    *events, total = until(read, 90, "the history with its end checked")
    there = {event["message"]["number"] for event in events if "message" in event}
    missing = set(range(1, teller.number + 1)) - there
    leading = min(missing, default=0) == 1 and (min(there, default=teller.number + 1) - 1)  # The first event has no gap before it if there is no earlier event.
    assert total["stops_missing"] == len(missing) - leading, (total, sorted(missing), events[-3:])
    return len(missing)


def kill_and_stop(rig, cluster, teller, host):
    cluster.servers[host].signal(9)
    cluster.servers[host].wait(5)
    for _ in range(3):
        teller.stop()
        time.sleep(0.7)
    cluster.start(host)
    await_port(cluster.mqtt, host, 20)
    until(lambda: cluster.stream("info")[0] == 0, 30, "the stream answers")


@pytest.mark.limit(240 + 60 * KILLS)
def test_history_under_kills_reports_each_gap(rig):
    """Kills leader and follower of the stream in turn; each stop is in the history, or reported as missing, also at the end."""
    cluster = Cluster(rig)
    config = cluster_config(rig, cluster)
    far = collector(rig, cluster, HOSTS[0], ("iwheel/+/event/+", "iwheel/+/availability", "iwheel/+/info"))
    use_tls(rig, " ".join(HOSTS), cluster.mqtt)
    teller = Teller(rig.path("watch.sock"))
    rig.start_bridge()
    until(lambda: far.texts("availability")[-1:] == ["online"], 30, rig.words())
    teller.stop()
    missing = judge(rig, config, teller, far)
    for turn in range(KILLS):
        leader = cluster.leader()
        kill_and_stop(rig, cluster, teller, leader if turn % 2 == 0 else next(host for host in HOSTS if host != leader))
        if turn % 10 == 9 or turn == KILLS - 1 or KILLS < 10:
            missing = judge(rig, config, teller, far)
            print(f"        {turn + 1} kills, {teller.number} stops, {len(set(numbers(far)))} by MQTT, {missing} not in the stream, all reported", flush=True)
