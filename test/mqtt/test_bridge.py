# SPDX-License-Identifier: MIT
"""What the bridge publishes, carries out, drops, stores and drives. The judges are the gateway's replies, the bus log, and a client of the broker."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bus import now_us
from certificate import NEW_KEY, openssl, self_signed
from harness import read_only
from mqtt_rig import ID
from shifted_clock import ShiftedClock
from trials import ROOT, Driver, Skip, braking_ms, until
from verdict import hold

STEPPED = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>
int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    static unsigned calls;
    if (!real) { real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime"); }
    int result = real(clock, now);
    if (clock == CLOCK_REALTIME) { now->tv_sec += (calls++ % 2) ? 86400 * 400 : -86400 * 400; }
    return result;
}
"""

# A disk that answers nothing for 3 s and then fails. Calls of the main thread that wait for it are reported on stderr.
SLOW_DISK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <sys/syscall.h>
static int is_spool(int fd) {
    char link[64], path[256];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    path[length > 0 ? length : 0] = 0;
    return strstr(path, "/spool") != NULL;
}
static void note(const char *call) {
    if (getpid() == (pid_t)syscall(SYS_gettid)) { fprintf(stderr, "the main thread waits for the disk: %s\n", call); }
}
int fdatasync(int fd) {
    (void)fd;
    note("fdatasync");
    sleep(3);
    errno = EIO;
    return -1;
}
int fsync(int fd) { note("fsync"); return fdatasync(fd); }
ssize_t write(int fd, const void *bytes, size_t size) {
    static ssize_t (*real)(int, const void *, size_t);
    if (!real) { real = (ssize_t (*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write"); }
    if (is_spool(fd)) { note("write"); }
    return real(fd, bytes, size);
}
"""


def counts(far):
    return far.messages("info")[-1]["commands"]


def numbers(far):
    return [event["number"] for event in far.events("stop")]


def make_stops(rig, count):
    """Makes this many stops, each latched by the button and reset again; returns the number of the last."""
    client = rig.client(name="stopper")
    number = client.request("why")["number"]
    for _ in range(count):
        rig.press()
        number = until(lambda before=number: (reply := client.request("why")["number"]) > before and reply, what="a stop")
        rig.press(False)
        until(lambda: client.request("reset")["ok"], what="the latch is reset")
    client.close()
    return number


def arm(far):
    """Arms and stores the key; a busy machine may need a second try."""
    far.key = until(lambda: (reply := far.ask("arm"))["ok"] and reply, what="armed")["key"]
    return far.key


@pytest.mark.rig(driving=True)
def test_gateway_with_a_clock_of_its_own_is_stopped_and_armed(rig):
    rig.start_gateway()
    rig.start_broker()
    rig.mqtt_settings["gateway"]["socket"] = rig.path("board.sock")
    ShiftedClock(rig.path("board.sock"), rig.path("gateway.sock"), 3_600_000_000)
    rig.start_bridge()
    far = rig.online()
    count = len(far.messages("state"))
    state = until(lambda: (states := far.messages("state"))[count:] and states[-1], what="a new state")
    assert state["t_us"] > now_us() + 3_000_000_000
    assert far.ask("stop", quote=far.latest())["ok"]
    arm(far)


def steer(far, seconds, speed=200, until_time=None):
    """Drives with quotes of the newest state, like a page; returns the number of sent commands."""
    until(lambda: far.messages("state"), what="a state")
    end, sent = until_time or time.monotonic() + seconds, 0
    while time.monotonic() < end:
        far.ask("drive", quote=far.latest(), wait=False, key=far.key, left_mm_s=speed, right_mm_s=speed)
        sent += 1
        time.sleep(0.05)
    return sent


# ---- what it publishes ----------------------------------------------------------------------------------------------


def test_topics_match_the_page_and_values_match_the_gateway(rig):
    far = rig.start_online()
    state = until(lambda: far.messages("state"), what="a state")[-1]
    snapshot = rig.gateway_state()
    assert set(state) - {"boot", "event"} == set(snapshot) - {"id", "ok"}, set(state) ^ set(snapshot)
    info = far.messages("info")[-1]
    assert info["machine"] == ID and info["gateway"] == "connected" and info["may_drive"] is False and info["budget"] == snapshot["budget"], info
    assert info["boot"] == state["boot"] and len(info["boot"]) == 16
    make_stops(rig, 1)
    stop = until(lambda: far.events("stop"), what="the stop is published")[0]
    why = rig.client(name="asker").request("why")
    assert all(stop[key] == why[key] for key in ("number", "cause", "latched", "wall_us", "at_us")), (stop, why)
    assert until(lambda: far.events("fault"), what="a fault")[0]["cause"] == "estop_line" and far.events("estop")
    late = rig.far("late")
    until(lambda: late.texts("availability") == ["online"] and late.messages("info"), what="retained ones")
    assert not late.events() and all(retained == (topic.split("/")[2] in ("availability", "info")) for topic, _, retained, _ in late.all[:2])
    rig.bridge.signal(signal.SIGTERM)
    assert rig.bridge.wait(3) == 0
    until(lambda: far.texts("availability")[-1] == "offline", what="a clean end is published")


@pytest.mark.rig(settings={"state": {"every_ms": 60000}})
def test_state_is_sent_on_change_else_at_configured_interval(rig):
    far = rig.start_online()
    time.sleep(1.5)
    before = len(far.messages("state"))
    assert before <= 1, before
    begun = time.monotonic()
    rig.press()
    until(lambda: any(state["state"] == "latched" or state["present"] for state in far.messages("state")[before:]), 3, "the change")
    assert time.monotonic() - begun < 1.5


@pytest.mark.rig(settings={"state": {"every_ms": 60000}})
def test_wheels_that_roll_are_sent_at_once(rig):
    far = rig.start_online()
    rig.sim.ask("push both 20")
    until(lambda: [state for state in far.messages("state") if state["rolling"]], 3, "a state that rolls")


def test_gateway_gone_or_bridge_killed_is_published_offline(rig):
    far = rig.start_online()
    rig.gateway.signal(signal.SIGKILL)
    until(lambda: far.texts("availability")[-1] == "offline" and far.messages("info")[-1]["gateway"] == "away", what="gateway away")
    rig.gateway.wait(3)
    rig.start_gateway()
    until(lambda: far.texts("availability")[-1] == "online", what="gateway back")
    rig.bridge.signal(signal.SIGKILL)
    until(lambda: far.texts("availability")[-1] == "offline", what="the last will")


def test_gateway_that_hangs_is_published_offline_until_its_state(rig):
    far = rig.start_online()
    rig.gateway.signal(signal.SIGSTOP)
    begun = time.monotonic()
    until(lambda: far.texts("availability")[-1] == "offline" and far.messages("info")[-1]["gateway"] == "away", 6, "offline")
    waited = time.monotonic() - begun
    count = len(far.messages("state"))
    rig.gateway.signal(signal.SIGCONT)
    until(lambda: far.texts("availability")[-1] == "online" and far.messages("info")[-1]["gateway"] == "connected", what="online again")
    until(lambda: len(far.messages("state")) > count, what="the newest state")
    assert waited > 2.4, "two lost states are no cause"
    assert "sends no state for 3500 ms" in rig.bridge.text() and "is gone" not in rig.bridge.text()


def test_bridge_before_gateway_and_broker_waits_for_both(rig):
    rig.start_bridge()
    time.sleep(1)
    assert rig.bridge.child.poll() is None and rig.bridge.text().count("no broker") == 1 and rig.bridge.text().count("no gateway") == 1, rig.bridge.text()
    rig.start_broker()
    far = rig.far()
    until(lambda: far.messages("info") and far.texts("availability")[-1:] == ["offline"], what="the bridge is there, the gateway is not")
    rig.start_gateway()
    rig.online(far)


@pytest.mark.rig(settings={"home_assistant": {"enabled": "yes"}})
def test_home_assistant_gets_sensors_that_are_in_the_state(rig):
    rig.start()
    ha = rig.far("ha", topics=("homeassistant/#", "iwheel/#"))
    rig.online(ha)
    reply = until(
        lambda: (
            len([1 for topic, *_ in ha.all if topic.startswith("homeassistant/")]) == 11
            and [(topic, json.loads(payload), retain) for topic, payload, retain, _ in ha.all if topic.startswith("homeassistant/")]
        ),
        what="eleven sensors",
    )
    state = until(lambda: ha.messages("state"), what="a state")[-1]
    for topic, config, _ in reply:
        assert topic.startswith(("homeassistant/sensor/iwheel_w1/", "homeassistant/binary_sensor/iwheel_w1/")) and topic.endswith("/config"), topic
        assert (
            config["state_topic"] == f"iwheel/{ID}/state"
            and config["availability_topic"] == f"iwheel/{ID}/availability"
            and config["device"]["identifiers"] == ["iwheel_w1"]
        )
        value = state
        for part in config["value_template"].split("value_json.")[1].split(" ")[0].split("."):
            assert part in value, (part, config)
            value = value[part]
        assert config["origin"]["name"] == "iwheel-mqtt" and config["origin"]["sw_version"], config
        measured = config.get("unit_of_measurement") is not None
        assert (config.get("state_class") in ("measurement", "total")) == measured, f"a number has statistics, a text has none: {config}"
    assert len({config["unique_id"] for _, config, _ in reply}) == 11
    lines = {"released": "OFF", "pressed": "ON", "unreadable": "ON", "disagrees": "ON", "none": "None"}
    buses = {"active": "OFF", "passive": "OFF", "bus_off": "ON", "down": "ON"}
    for sensor, states in (("estop", lines), ("bus", buses)):
        (template,) = [config["value_template"] for topic, config, _ in reply if topic.endswith(f"/{sensor}/config")]
        jinja = pytest.importorskip("jinja2").Template(template)
        for value, shown in states.items():
            assert jinja.render(value_json={sensor: {"state": value}}) == shown, f"{value}: Home Assistant shows None as unknown"
    assert rig.far("later", topics=("homeassistant/#",)) and until(
        lambda: len(rig.fars[-1].all) == 11 and all(retain for _, _, retain, _ in rig.fars[-1].all), what="retained"
    )


# ---- what it carries out --------------------------------------------------------------------------------------------


def test_stop_and_estop_that_are_fresh_stop_the_wheels(rig):
    far = rig.start_online()
    driver = Driver(rig)
    asked_us = now_us()
    answer = far.ask("stop")
    assert answer["ok"] and answer["state"] in ("stopping", "listening"), answer
    assert braking_ms(rig, asked_us) < 500
    driver.end()
    assert far.ask("estop", reason="a person in the way")["state"] == "latched"
    why = rig.client(name="asker").request("why")
    assert why["cause"] == "estop_software" and "a person in the way" in why["sentence"]


def test_command_late_early_or_of_another_boot_stops_nothing(rig):
    far = rig.start_online()
    driver = Driver(rig)
    old = far.quote()
    fresh = far.ask("why")
    assert fresh["ok"], fresh
    time.sleep(1.1)
    for verb in ("stop", "estop"):
        assert far.ask(verb, quote=old)["error"] == "late"
        assert far.ask(verb, quote={**far.quote(), "boot": "0" * 16})["error"] == "other_boot"
        quote = far.quote()
        assert far.ask(verb, quote={**quote, "t_us": quote["t_us"] + 60_000_000})["error"] == "early"
        assert far.ask(verb, quote={**quote, "t_us": str(quote["t_us"])})["error"] == "garbled"
    assert rig.gateway_state()["state"] == "armed"
    until(lambda: all(counts(far)[word] == 2 for word in ("late", "other_boot", "early", "garbled")), what="counted")
    driver.end()


def test_command_doubled_counts_once(rig):
    far = rig.start_online()
    quote = far.quote()
    far.seq += 1
    for _ in range(3):
        far.send("why", **{"from": far.name, "seq": far.seq, **quote})
    answers = [far.answer(far.seq) for _ in range(3)]
    assert [answer.get("error") for answer in answers] == [None, "doubled", "doubled"], answers
    far.send("why", **{"from": far.name, "seq": far.seq - 1, **quote})
    assert far.answer(far.seq - 1)["error"] == "doubled"
    until(lambda: counts(far)["doubled"] == 3, what="counted")


def test_retained_command_does_nothing_now_or_at_any_start(rig):
    far = rig.start_online()
    driver = Driver(rig)
    far.seq += 1
    quote = far.quote()
    rig.end_bridge()
    far.send("estop", **{"from": far.name, "seq": far.seq, **quote}, retain=True)
    time.sleep(0.3)
    rig.start_bridge()
    rig.online(far)
    until(lambda: counts(far)["retained"] == 1, what="counted")
    assert rig.gateway_state()["state"] == "armed"
    driver.end()


def test_stop_never_refused_by_mqtt_in_motion_without_json(rig):
    """Its age is not known, so only a retained one does nothing."""
    far = rig.start_online()
    driver = Driver(rig)
    rig.end_bridge()
    far.client.publish(f"iwheel/{ID}/cmd/stop", b'{"cmd":"stop"', qos=1, retain=True)
    time.sleep(0.3)
    rig.start_bridge()
    rig.online(far)
    until(lambda: counts(far)["garbled"] == 1, what="the retained one is counted")
    assert rig.gateway_state()["state"] == "armed"
    sent_us = now_us()
    far.client.publish(f"iwheel/{ID}/cmd/stop", b'{"reason":"\\ud83d"}', qos=1)
    assert braking_ms(rig, sent_us) < 1000
    driver.end()
    driver = Driver(rig)
    far.client.publish(f"iwheel/{ID}/cmd/estop", b'{"reason":"cut', qos=1)
    until(lambda: rig.gateway_state()["state"] == "latched", what="latched")
    driver.end()


def test_garbage_is_dropped_counted_and_changes_nothing(rig):
    far = rig.start_online()
    quote = far.quote()
    good = {"from": "far", "seq": 1000, **quote}
    garbage = [
        b"",
        b"stop",
        b"{",
        b"[]",
        b"\xff\xfe",
        b'{"from":"far"}',
        b"{" * 5000,
        b'{"from":"far","from":"far"}',
        json.dumps({**good, "t_us": 1.5}).encode(),
        json.dumps({**good, "t_us": -1}).encode(),
        json.dumps({**good, "boot": None}).encode(),
    ]
    for payload in garbage:
        far.client.publish(f"iwheel/{ID}/cmd/stop", payload, qos=1)
    wrong = ({"from": "far/../x"}, {"from": "x" * 33}, {"seq": "1"}, {"seq": 0}, {"ttl_ms": 1001}, {"speed": 1})  # A stop needs none of these.
    for fields in wrong:
        far.client.publish(f"iwheel/{ID}/cmd/why", json.dumps({**good, **fields}), qos=1)
    far.client.publish(f"iwheel/{ID}/cmd/self-destruct", json.dumps(good), qos=1)
    dropped = len(garbage) + len(wrong) + 1
    until(lambda: counts(far)["garbled"] == dropped, what=f"{dropped} counted: {counts(far)}")
    assert rig.gateway_state()["state"] == "listening" and rig.client(name="a").request("why")["number"] == 0
    assert far.ask("why")["ok"]

    def latches():
        strange = {**far.quote(), "from": "a/b", "ttl_ms": 0, "reason": ['x\n{"cmd":"reset"}'], "speed": 1}
        far.client.publish(f"iwheel/{ID}/cmd/estop", json.dumps(strange), qos=1)
        return rig.gateway_state()["state"] == "latched"

    until(latches, what="latched")


def test_bridge_that_watches_neither_arms_drives_nor_resets(rig):
    far = rig.start_online()
    for verb, fields in (("arm", {}), ("drive", {"left_mm_s": 1, "right_mm_s": 1}), ("twist", {"v_mm_s": 1, "yaw_mrad_s": 0}), ("reset", {"stop": 0})):
        answer = far.ask(verb, **fields)
        assert answer["error"] == "denied" and "[drive]" in answer["message"], answer
    assert far.ask("stop")["ok"] and rig.gateway_state()["state"] == "listening"


def test_recording_is_fetched_in_pieces_with_checksum(rig):
    far = rig.start_online()
    make_stops(rig, 1)
    name = until(lambda: far.ask("recordings")["recordings"], what="a recording")[0]["name"] + ".conf"
    piece = until(lambda: (reply := far.ask("recording", name=name, offset=0))["ok"] and reply, what="its first piece")
    assert piece["size"] > 0 and piece["file_crc32"] is not None and far.ask("recording", name="../x.conf")["error"] == "bad_value"


def test_gateway_that_hangs_stop_is_reported_not_delivered(rig):
    far = rig.start_online()
    quote = far.quote()
    rig.gateway.signal(signal.SIGSTOP)
    answer = far.ask("stop", quote=quote)
    rig.gateway.signal(signal.SIGCONT)
    assert answer["ok"] is False and answer["error"] == "not_delivered", answer


def example(rig, language):
    """The page's example in that language, for this rig's broker."""
    text = (ROOT / "docs/user/mqtt.md").read_text(encoding="utf-8")
    code = re.search(rf"```{language}\n(.*?)```", text, re.S)[1]
    return code.replace("1883", str(rig.port)).replace("mosquitto_rr", f"mosquitto_rr -p {rig.port}")


def test_examples_of_the_page_stop_the_wheels(rig):
    rig.start_online()
    if not shutil.which("mosquitto_rr"):
        raise Skip("mosquitto-clients is missing (scripts/install_tools check brings it)")
    for command in (["sh", "-c", example(rig, "sh")], [sys.executable, "-c", example(rig, "python")]):
        driver = Driver(rig)
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
        assert "stopping" in done.stdout, done
        rig.at_standstill()
        assert rig.client(name="asker").request("why")["cause"] == "client_stop"
        driver.end()
        time.sleep(0.6)


# ---- driving --------------------------------------------------------------------------------------------------------


def turns(rig, since_us=0):
    return any(abs(speed) > 20 for _, _, speed in rig.bus.setpoints(since_us))


DRIVING = {"driving": True, "settings": {"state": {"every_ms": 100}}, "config": {"drive": {"lease_ms": 200}}}


@pytest.mark.rig(**DRIVING)
def test_sender_drives_while_it_sends_and_no_longer(rig):
    far = rig.start_online()
    arm(far)
    steer(far, 1)
    silent_us = now_us()
    assert turns(rig)
    assert braking_ms(rig, silent_us) < 700
    other = rig.far("other")
    arm(far)
    assert other.ask("drive", left_mm_s=100, right_mm_s=100)["error"] == "not_holder", "another one drives"


@pytest.mark.rig(**DRIVING)
def test_broker_stalls_300_ms_wheels_stop_without_late_drive(rig):
    """From the bus log: lease and period after the last command the wheels brake, and the backlog moves nothing."""
    far = rig.start_online()
    arm(far)
    steer(far, 1)
    assert turns(rig)
    rig.broker.signal(signal.SIGSTOP)
    stalled_us = now_us()
    steer(far, 0, until_time=time.monotonic() + 0.3)
    rig.broker.signal(signal.SIGCONT)
    back_us = now_us()
    braked_ms = braking_ms(rig, stalled_us)
    assert braked_ms < 300, f"braked {braked_ms} ms after the stall began"
    steer(far, 1.5)
    speeds = [abs(speed) for t_us, _, speed in rig.bus.setpoints(stalled_us) if t_us > back_us]
    hold(all(later <= before + 1 for before, later in zip(speeds, speeds[2:], strict=False)), f"faster again: {speeds[:40]}")
    assert rig.gateway_state()["state"] == "listening"
    stop = until(lambda: far.events("stop"), what="the stop is published")[-1]
    assert stop["cause"] in ("lease_lost", "client_stop"), stop


@pytest.mark.rig(**DRIVING)
def test_broker_killed_while_driving_stops_the_wheels(rig):
    far = rig.start_online()
    arm(far)
    steer(far, 0.7)
    rig.end_broker()
    killed_us = now_us()
    assert turns(rig) and braking_ms(rig, killed_us) < 400
    rig.at_standstill()


@pytest.mark.rig(**DRIVING)
def test_bridge_killed_or_frozen_while_driving_stops_the_wheels(rig):
    far = rig.start_online()
    for number in (signal.SIGSTOP, signal.SIGKILL):
        arm(far)
        steer(far, 0.7)
        rig.bridge.signal(number)
        assert braking_ms(rig, now_us()) < 400
        rig.at_standstill()
        rig.bridge.signal(signal.SIGCONT)
        time.sleep(0.6)


@pytest.mark.rig(driving=True)
def test_driving_by_the_watch_socket_ends_with_the_missing_right(rig):
    rig.mqtt_settings["gateway"]["socket"] = rig.path("watch.sock")
    rig.start()
    assert rig.bridge.wait(10) == 77 and "watching only" in rig.bridge.text(), rig.bridge.text()


# ---- nothing lost ---------------------------------------------------------------------------------------------------


def settle(far):
    """Waits until the spool is empty, so the last event has arrived too."""
    until(lambda: far.messages("info")[-1]["events"]["waiting"] == 0, 20, "the spool is empty")


def all_arrive(far, last, seconds):
    """Each stop once and in order, and every other event."""
    until(lambda: numbers(far) == list(range(1, last + 1)), seconds, f"all {last}")
    settle(far)


def test_broker_killed_and_back_each_stop_once_in_order(rig):
    line = rig.cut_here()
    far = rig.start_online()
    make_stops(rig, 2)
    until(lambda: numbers(far) == [1, 2], what="the first two")
    rig.end_broker()
    last = make_stops(rig, 5)
    rig.bring_broker_back(line, far)
    until(lambda: numbers(far) == list(range(1, last + 1)), 20, f"all {last}")
    faults = [(event["cause"], event["present"]) for event in far.events("fault") if event["cause"] == "estop_line"]
    assert faults == [("estop_line", True), ("estop_line", False)] * last, faults
    settle(far)
    far.print_figures("broker killed, back later")


def test_network_cut_at_any_byte_each_stop_once_in_order(rig):
    """A lost confirmation makes a double, which has the same id; nothing makes a gap."""
    line = rig.cut_here()
    far = rig.start_online()
    line.left = 0
    last = make_stops(rig, 6)
    for byte in (60, 150, 900, 2000, 4000):
        line.left = byte
        until(lambda: line.left <= 0, 40, "cut again")
    line.restore()
    all_arrive(far, last, 40)
    far.print_figures("connection cut behind a byte, also in the middle of a confirmation", 6)


@pytest.mark.full
@pytest.mark.rig(settings={"broker": {"keepalive_s": 5}})
def test_network_that_drops_all_is_noticed_and_no_stop_is_lost(rig):
    line = rig.cut_here()
    far = rig.start_online()
    line.frozen = True
    last = make_stops(rig, 3)
    until(lambda: "no broker" in rig.bridge.text(), 20, "noticed")
    line.frozen = False
    all_arrive(far, last, 40)
    far.print_figures("network that loses everything, noticed after 1.5 times `keepalive_s` (`--full`)")


def test_bridge_killed_with_stored_events_each_stop_comes_once(rig):
    line = rig.cut_here()
    rig.start_gateway()
    rig.start_broker()
    far = rig.far()
    rig.end_broker()
    for _ in range(4):
        rig.start_bridge()
        until(lambda: "connected to the gateway" in rig.bridge.text(), what="the bridge listens")
        stored = make_stops(rig, 2)
        until(lambda number=stored: f'"number":{number},'.encode() in Path(rig.path("spool/events")).read_bytes(), what="stored")
        rig.end_bridge(signal.SIGKILL)
        os.unlink(rig.path("mqtt.out"))
    unseen = make_stops(rig, 1)  # The bridge is down; it learns of the stop from `why` later.
    rig.start_bridge()
    rig.bring_broker_back(line, far)
    until(lambda: numbers(far) == list(range(1, unseen + 1)), 20, f"all {unseen}")
    assert far.events("stop")[-1].get("missed") is True, far.events("stop")[-1]
    rig.end_bridge()
    rig.start_bridge()
    rig.online(far)
    time.sleep(0.5)
    assert numbers(far) == list(range(1, unseen + 1)), "a new start publishes no stop again"
    far.print_figures("bridge killed while events wait", 4)


def test_disk_full_events_wait_in_memory_and_are_reported(rig):
    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))

    line = rig.cut_here()
    rig.start_gateway()
    rig.start_broker()
    far = rig.far()
    rig.end_broker()
    rig.start_bridge(small_files, stdout=subprocess.DEVNULL)
    time.sleep(0.4)
    last = make_stops(rig, 5)
    until(lambda: "accepts no data" in rig.bridge.text(), what="reported in the log")
    rig.bring_broker_back(line, far)
    until(lambda: numbers(far) == list(range(1, last + 1)), 20, f"all {last}")
    until(lambda: "on its disk again" in rig.bridge.text(), what="the disk is used again")
    settle(far)
    far.print_figures("disk full at 2 kB: events stored in memory, `on_disk` and the log report it")


def preloaded(rig, text):
    """The environment in which the bridge uses these functions."""
    source, library = rig.path("preload.c"), rig.path("preload.so")
    Path(source).write_text(text, encoding="ascii")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    if "asan" in subprocess.run(["ldd", rig.program("iwheel-mqtt")], capture_output=True, text=True, check=True).stdout:
        raise Skip("the sanitizer must be loaded first")
    return {**os.environ, "LD_PRELOAD": library}


def test_disk_that_hangs_and_fails_delays_no_stop(rig):
    rig.start_gateway()
    rig.start_broker()
    rig.start_bridge(env=preloaded(rig, SLOW_DISK))
    far = rig.online()
    make_stops(rig, 2)
    end, longest = time.monotonic() + 10, 0.0
    while time.monotonic() < end:
        begun = time.monotonic()
        answer = far.ask("stop", quote=far.quote(10))
        longest = max(longest, time.monotonic() - begun)
        assert answer["ok"], (answer, longest)
        time.sleep(0.1)
    all_arrive(far, 2, 10)
    assert "accepts no data" in rig.bridge.text() and not far.messages("info")[-1]["events"]["on_disk"]
    assert "the main thread waits" not in rig.bridge.text(), rig.bridge.text()
    assert longest < 0.8, f"a stop and its question took {longest:.2f} s"
    rig.bridge.signal(signal.SIGTERM)
    assert rig.bridge.wait(4) == 0, "the end waits for the disk for a second at most"


def test_clock_that_steps_changes_neither_ages_nor_order(rig):
    rig.start_gateway()
    rig.start_broker()
    rig.start_bridge(env=preloaded(rig, STEPPED))
    far = rig.online()
    assert far.ask("stop")["ok"] and far.ask("why")["ok"]
    make_stops(rig, 2)
    all_arrive(far, 2, 10)
    far.print_figures("wall clock that jumps by two years and back at each reading")
    clocks = [event["heard_wall_us"] for event in far.events()]
    assert max(clocks) - min(clocks) > 86400_000_000, "the clock did step"


@pytest.mark.full
def test_campaign_of_kills_each_stop_once_in_order(rig):
    """Bridge and broker, killed in turn, fifty times."""
    line = rig.cut_here()
    far = rig.start_online()
    last = 0
    for turn in range(50):
        last = make_stops(rig, 1)
        until(lambda number=last: number in numbers(far), 40, "the newest has come")
        if turn % 2:
            rig.end_broker()
            last = make_stops(rig, 1)
            rig.bring_broker_back(line, far)
        else:
            rig.end_bridge(signal.SIGKILL)
            rig.start_bridge()
    all_arrive(far, last, 60)
    far.print_figures("bridge and broker killed in turn (`--full`)", 50)


# ---- access ---------------------------------------------------------------------------------------------------------


def make_certificates(rig):
    """Two signers, and certificates of a broker and of the machine."""
    for name in ("ca", "other"):
        self_signed(rig.folder, name, name)
    for name, subject in (("broker", "localhost"), ("machine", ID)):
        openssl(rig.folder, f"{NEW_KEY} -subj /CN={subject} -keyout {name}.key -out {name}.csr")
        Path(rig.path(f"{name}.ext")).write_text(f"subjectAltName=DNS:{subject}\n", encoding="ascii")
        openssl(rig.folder, f"x509 -req -in {name}.csr -CA ca.pem -CAkey ca.key -CAcreateserial -out {name}.pem -days 2 -extfile {name}.ext")


def test_tls_needs_signer_name_and_certificate_of_machine(rig):
    make_certificates(rig)
    rig.broker_lines += [f"cafile {rig.path('ca.pem')}", f"certfile {rig.path('broker.pem')}", f"keyfile {rig.path('broker.key')}", "require_certificate true"]
    rig.mqtt_settings["broker"].update({"host": "localhost", "ca": rig.path("ca.pem"), "certificate": rig.path("machine.pem"), "key": rig.path("machine.key")})
    rig.start_gateway()
    rig.start_broker()
    for wrong in ({"ca": rig.path("other.pem")}, {"host": "127.0.0.1"}, {"certificate": "none", "key": "none"}):
        right = dict(rig.mqtt_settings["broker"])
        rig.mqtt_settings["broker"].update(wrong)
        bridge = rig.start_bridge()
        until(lambda: bridge.text().count("no broker"), 5, f"reported: {bridge.text()}")
        time.sleep(0.3)
        assert "connected to the broker" not in bridge.text(), (wrong, bridge.text())
        bridge.end()
        rig.mqtt_settings["broker"] = right
        os.unlink(rig.path("mqtt.out"))
    rig.start_bridge()
    until(lambda: "connected to the broker" in rig.bridge.text(), 5, rig.bridge.text())
    far = rig.far(setup=lambda client: client.tls_set(rig.path("ca.pem"), rig.path("machine.pem"), rig.path("machine.key")) or client.tls_insecure_set(True))
    rig.online(far)


def test_tls_file_that_cannot_be_read_delays_no_stop(rig):
    """A pipe without a writer: a read of the file does not return, as on a disk that hangs."""
    os.mkfifo(rig.path("ca.pem"))
    rig.mqtt_settings["broker"].update({"host": "localhost", "ca": rig.path("ca.pem")})
    rig.start_gateway()
    rig.start_bridge()
    until(lambda: "connected to the gateway" in rig.bridge.text(), what="the bridge does its other work")
    rig.bridge.signal(signal.SIGTERM)
    assert rig.bridge.wait(4) == 0


def test_credentials_wrong_or_readable_by_others_are_refused(rig):
    secret = Path(rig.path("secret"))
    subprocess.run(["mosquitto_passwd", "-b", "-c", rig.path("passwords"), ID, "pass:word"], check=True)
    os.chmod(rig.path("passwords"), 0o644)
    rig.broker_lines = ["allow_anonymous false", f"password_file {rig.path('passwords')}", *rig.broker_lines[1:]]
    rig.mqtt_settings["broker"]["credentials"] = str(secret)
    rig.start_gateway()
    rig.start_broker()
    for text, mode, code, words in (
        ("w1:pass:word\n", 0o644, 77, "other users may read"),
        ("nothing\n", 0o600, 78, "USER:PASSWORD"),
        (None, 0, 77, "No such file"),
    ):
        secret.unlink(missing_ok=True)
        if text:
            secret.write_text(text, encoding="ascii")
            secret.chmod(mode)
        assert rig.start_bridge().wait(3) == code and words in rig.bridge.text(), (text, rig.bridge.text())
    for text, words in (("w1:wrong\n", "not authorised"), ("w1:pass:word\n", "connected to the broker")):
        secret.write_text(text, encoding="ascii")
        secret.chmod(0o600)
        bridge = rig.start_bridge()
        until(lambda: words in bridge.text().lower(), 5, f"{words}: {bridge.text()}")
        bridge.end()


def test_second_bridge_with_the_same_directory_is_refused(rig):
    rig.start_online()
    first = rig.bridge
    assert rig.start_bridge().wait(3) == 73 and "another bridge uses it" in rig.bridge.text()
    assert first.child.poll() is None


def test_check_refuses_a_spool_file_that_the_start_refuses(rig):
    events = Path(rig.path("spool"), "events")
    rig.start_bridge()
    until(events.exists, what="the spool is there")
    rig.bridge.end()
    os.link(events, rig.path("second"))
    assert rig.start_bridge().wait(3) == 73
    code, words = rig.check_bridge()
    assert code == 73 and "belongs to another user" in words, words
    os.unlink(rig.path("second"))
    assert rig.check_bridge()[0] == 0


def test_check_of_read_only_spool_warns_and_bridge_starts(rig):
    if os.geteuid() != 0:
        raise Skip("needs root to mount")
    mount = read_only(rig.path("spool"))
    assert rig.start_bridge(mount).wait(1) is None, rig.words()
    rig.bridge.end()
    code, words = rig.check_bridge(mount)
    assert code == 0 and "warning" in words and "Read-only file system" in words, words


def test_check_judges_everything_and_leaves_no_file(rig):
    rig.start_bridge().end()
    for name in os.listdir(rig.path("spool")):
        os.unlink(os.path.join(rig.path("spool"), name))
    assert rig.check_bridge() == (0, "iwheel-mqtt: configuration and files are in order\n") and not os.listdir(rig.path("spool"))
    os.rmdir(rig.path("spool"))
    code, words = rig.check_bridge()
    assert code == 73 and "[spool]" in words, words
