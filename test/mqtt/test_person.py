# SPDX-License-Identifier: MIT
"""Stops that nothing delays, and a lease that belongs to one person: two people at one broker, in every order."""

import json
import threading
import time

import pytest
from test_bridge import arm, steer, turns
from bus import now_us
from mqtt_rig import ID
from trials import Driver, braking_ms, until

DRIVING = {"driving": True, "settings": {"state": {"every_ms": 100}}, "config": {"drive": {"lease_ms": 400}}}
STOP_MS = 200  # Limit from the command at the broker to the first smaller setpoint on the bus.


class Flood(threading.Thread):
    """A sender that sends `verb` at this rate, each time with a quote of the newest state."""

    def __init__(self, rig, verb, rate, name="flood", names=1, **fields):
        super().__init__(daemon=True)
        self.far, self.verb, self.rate, self.names, self.fields, self.sent, self.ended = rig.far(name), verb, rate, names, fields, 0, threading.Event()
        until(lambda: self.far.texts("state"), what="a state to quote")
        self.start()

    def run(self):
        begun = time.monotonic()
        while not self.ended.wait(0.005):
            quote = self.far.latest()
            while self.sent < (time.monotonic() - begun) * self.rate and not self.ended.is_set():
                self.sent += 1
                sender = self.far.name if self.names == 1 else f"{self.far.name}-{self.sent % self.names}"
                self.far.send(self.verb, **{"from": sender, "seq": self.sent, **quote, **self.fields})

    def end(self):
        self.ended.set()
        self.join(5)


def stops_in_time(rig, far, times=5):
    delays = []
    for _ in range(times):
        driver = Driver(rig)
        quote = far.quote()
        asked_us = now_us()
        far.ask("stop", quote=quote, wait=False)
        delays.append(braking_ms(rig, asked_us))
        driver.end()
        rig.at_standstill()
        time.sleep(0.6)
    print("        command to bus, ms:", " ".join(f"{delay:.0f}" for delay in delays), flush=True)
    assert max(delays) < STOP_MS, delays


@pytest.mark.rig(settings={"state": {"every_ms": 100}})
def test_stop_never_waits_behind_questions(rig):
    far = rig.start_online()
    flood = Flood(rig, "why", 400)
    stops_in_time(rig, far)
    flood.end()
    assert flood.sent > 1000, flood.sent


@pytest.mark.rig(settings={"state": {"every_ms": 100}})
def test_stop_never_refused_for_other_senders(rig):
    """There are more senders than the bridge stores, and one that uses up the numbers of the person who stops."""
    far = rig.start_online()
    crowd = Flood(rig, "hello", 100, name="crowd", names=40)
    why = Flood(rig, "why", 100, name="many", names=40)
    thief = rig.far("thief")
    for _ in range(3):
        driver = Driver(rig)
        thief.send("why", **{"from": far.name, "seq": 1 << 60, **thief.quote()})
        reply = far.ask("stop")
        assert reply["ok"], reply
        driver.end()
        rig.at_standstill()
        time.sleep(0.6)
    crowd.end()
    why.end()


class Hand(threading.Thread):
    """A person who drives with a key until the end."""

    def __init__(self, far, speed):
        super().__init__(daemon=True)
        self.far, self.speed, self.ended = far, speed, threading.Event()
        self.start()

    def run(self):
        steer(self.far, 0, self.speed, until_time=time.monotonic() + 0.05)
        while not self.ended.wait(0.05):
            self.far.ask("drive", quote=self.far.latest(), wait=False, key=self.far.key, left_mm_s=self.speed, right_mm_s=self.speed)

    def end(self):
        self.ended.set()
        self.join(5)


@pytest.mark.rig(**DRIVING)
def test_one_person_drives_and_the_second_is_busy(rig):
    rig.start()
    first, second = rig.online(rig.far("anna")), rig.far("ben")
    until(lambda: first.texts("state") and second.texts("state"), what="states")
    key = arm(first)
    assert len(key) == 32 and set(key) <= set("0123456789abcdef")
    hand = Hand(first, 200)
    until(lambda: turns(rig), what="anna drives")
    begun_us = now_us()
    for fields in ({}, {"takeover": True}):
        reply = second.ask("arm", **fields)
        assert not reply["ok"] and reply["error"] == ("stale_command" if fields else "busy") and "anna" in reply["message"], reply
    for number, (sender, fields) in enumerate((("ben", {}), ("ben", {"key": "0" * 32}), ("anna", {}), ("anna", {"key": "f" * 32}))):
        second.send("drive", **{"from": sender, "seq": (1 << 40) + number, **second.quote(), "left_mm_s": -300, "right_mm_s": -300, **fields})
        time.sleep(0.1)
    time.sleep(0.3)
    assert all(speed >= 0 for t_us, _, speed in rig.bus.setpoints(begun_us)), "nothing of ben's was driven"
    until(lambda: [json.loads(text) for text in second.texts("reply/ben") if '"cmd":"drive"' in text and '"not_holder"' in text][1:], what="ben is refused")
    hand.end()
    until(lambda: rig.gateway_state()["state"] == "listening", what="the wheels stop without commands")
    with first.lock:
        shown = {topic for topic, payload, *_ in first.all if key.encode() in payload and "/cmd/" not in topic}
    assert shown == {f"iwheel/{ID}/reply/anna"}, shown
    assert key not in rig.bridge.text() + rig.gateway.text()


@pytest.mark.rig(**DRIVING)
def test_one_person_passes_control_only_at_standstill(rig):
    rig.start()
    first, second = rig.online(rig.far("anna")), rig.far("ben")
    until(lambda: first.texts("state"), what="a state")
    arm(first)
    hand = Hand(first, 0)
    time.sleep(0.4)
    assert second.ask("arm")["error"] == "busy"
    reply = until(lambda: (answer := second.ask("arm", takeover=True))["ok"] and answer, what="taken over at standstill")
    hand.end()
    assert reply["key"] != first.key
    refused = first.ask("drive", key=first.key, left_mm_s=100, right_mm_s=100)
    assert refused["error"] == "not_holder", refused
    second.key = reply["key"]
    assert second.ask("drive", key=second.key, left_mm_s=0, right_mm_s=0)["ok"]


@pytest.mark.rig(**DRIVING)
def test_one_person_with_a_deflected_stick_refuses_arm_and_reset(rig):
    """Row 7: the bridge accepts no command of that person, and refuses arm and reset while its commands come, under its own name or another's."""
    rig.start()
    first, second = rig.online(rig.far("anna")), rig.far("ben")
    until(lambda: second.texts("state"), what="a state")
    second.key = "0" * 32
    hand = Hand(second, 150)
    time.sleep(0.3)
    for asks in (first, second):
        reply = asks.ask("arm")
        assert reply["error"] == "stale_command" and "ben" in reply["message"], reply
    rig.press()
    rig.press(False)
    number = until(lambda: first.ask("why")["number"], what="a stop")
    time.sleep(1.2)
    reply = first.ask("reset", stop=number)
    assert reply["error"] == "stale_command" and "ben" in reply["message"], reply
    hand.end()
    time.sleep(0.6)
    assert until(lambda: (answer := first.ask("reset", stop=number))["ok"] and answer, what="reset, after the stick is released")
    assert not turns(rig)


@pytest.mark.rig(**DRIVING)
def test_one_person_resets_only_the_stop_that_is_meant(rig):
    far = rig.start_online()
    rig.press()
    rig.press(False)
    number = until(lambda: far.ask("why")["number"], what="a stop")
    time.sleep(1.2)
    assert far.ask("reset")["error"] == "garbled"
    for age_s in (0.4, 0.9, 2.0):
        quote = far.quote()
        time.sleep(age_s)
        assert far.ask("reset", quote=quote, stop=number)["error"] == "late", age_s
        assert far.ask("arm", quote=quote)["error"] == "late", age_s
    assert far.ask("reset", stop=number + 1)["error"] == "stale_command"
    assert far.ask("reset", stop=number - 1)["error"] == "stale_command"
    assert rig.gateway_state()["state"] == "latched"
    assert until(lambda: (answer := far.ask("reset", stop=number))["ok"] and answer, what="reset")
