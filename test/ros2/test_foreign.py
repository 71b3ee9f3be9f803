# SPDX-License-Identifier: MIT
"""Programs of other vendors: Fast DDS of Debian, and ROS 2 itself."""

import os
import re
import shutil
import subprocess
import time

from jazzy import Jazzy, compiled
from ride import Ride, now_us
from scenario import Skip, scenario

HERE = os.path.dirname(os.path.abspath(__file__))


def fast_peer(t):
    """The path of the program."""
    if not os.path.exists("/usr/include/fastdds/dds/domain/DomainParticipant.hpp") or shutil.which("c++") is None:
        raise Skip("libfastrtps-dev or g++ is missing (scripts/install_tools check brings it)")
    library = "fastrtps" if os.path.exists("/usr/include/fastrtps") else "fastdds"  # Version 2 or 3.
    return compiled(t, "fast_peer", [os.path.join(HERE, "fast_peer.cpp")], "-O0", f"-l{library}", "-lfastcdr")


def run_fast(ride, program, *words):
    done = subprocess.run([program, str(ride.domain), *words], capture_output=True, text=True, timeout=100, check=False, cwd=ride.rig.folder)
    return done.stdout


@scenario("Fast DDS of another vendor receives the odometry, requests to arm, drives", 30)
def fast_dds(t):
    program = fast_peer(t)
    ride = Ride(t)
    output = run_fast(ride, program, "0.3")
    t.check("answer arm: done" in output, f"its request gets a reply: {output[-300:]}")
    odom = re.search(r"odom odom base_link x (\S+) v (\S+)", output)
    t.check(odom and float(odom[1]) > 0.2 and abs(float(odom[2]) - 0.3) < 0.1, f"it receives the odometry: {output[-300:]}")
    t.check(len(ride.tap.twists) >= 25, f"{len(ride.tap.twists)} of 30 commands")
    t.figure(f"{len(ride.tap.twists)} of 30 commands, {odom[0] if odom else 'no odometry'}")
    ride.judge_at_rest()


@scenario("Fast DDS calls the services: arm gets a reply, stop and estop stop, each call by a new client", 40)
def fast_services(t):
    program = fast_peer(t)
    ride = Ride(t)
    output = run_fast(ride, program, "iwheel/reset", "3")
    t.check(output.count("reply 0") == 3 and output.count("not permitted over the network") == 3, f"reset is refused with its reason, three times: {output}")
    output = run_fast(ride, program, "iwheel/arm", "1")
    t.check("reply 1" in output and "armed: send cmd_vel" in output, f"arm: {output}")
    ride.silence()
    stream = ride.driving()
    output = run_fast(ride, program, "iwheel/stop", "1")
    t.check("reply 1" in output, f"stop: {output}")
    stream.stop()
    t.stopped_by(ride.client, "client_stop", "stopping")
    ride.silence()
    time.sleep(0.6)
    stream = ride.driving()
    output = run_fast(ride, program, "iwheel/estop", "1")
    t.check("reply 1" in output, f"estop: {output}")
    t.check(ride.client.request("status")["state"] == "latched", "latched")
    stream.stop()
    found = re.findall(r"reply \d after (\d+) ms", output)
    t.figure(f"estop answered after {found[0] if found else '?'} ms")
    t.check("deserialization" not in ride.bridge.text(), f"nothing is undecodable: {ride.bridge.text()[-300:]}")
    t.judge(ride.rig)


def called_late(ride, program, service, how="late"):
    """The output of the program, and the time of its call (us)."""
    output = run_fast(ride, program, service, how)
    called = re.search(r"called at (\d+) us", output)
    ride.t.check(called and re.search(r"[1-9]\d* announcements sent late", output), f"{service}: the request comes before its writer is known: {output}")
    ride.t.check(how != "lost" or "1 requests lost" in output, f"{service}: the first request for the missing call is lost: {output}")
    return output, int(called[1]) if called else 0


def calls_first(t, how):
    program = fast_peer(t)
    ride = Ride(t)
    output, _ = called_late(ride, program, "iwheel/arm", how)
    t.check("reply 1" in output and "armed: send cmd_vel" in output, f"arm: {output}")
    ride.silence()
    for service, after in (("iwheel/stop", lambda speed: abs(speed) < 290), ("iwheel/estop", lambda speed: speed == 0)):
        stream = ride.driving()
        output, called_us = called_late(ride, program, service, how)
        t.check("reply 1" in output, f"{service}: {output}")
        time.sleep(0.2)
        ms = t.first_after(ride.rig, called_us, after, f"the effect of {service}", 200)
        if ms is not None:
            t.figure(f"{service}: {ms:.0f} ms, of which the writer was unknown for 50")
        stream.stop()
        if service == "iwheel/stop":
            ride.silence()
            time.sleep(0.6)
    t.check(ride.client.request("status")["state"] == "latched", "latched")
    t.judge(ride.rig)


@scenario("Fast DDS calls before the bridge knows the writer: stop and estop stop within 200 ms, arm gets a reply", 40)
def fast_calls_first(t):
    calls_first(t, "late")


@scenario("the same while Fast DDS misses the bridge's first request for the call: stop and estop stop within 200 ms", 40)
def fast_misses_a_request(t):
    calls_first(t, "lost")


@scenario("Fast DDS stores two stops from before the start of the bridge, and calls before the bridge knows it: one stop within 200 ms", 40)
def fast_keeps(t):
    program = fast_peer(t)
    ride = Ride(t)
    ride.driving().stop()
    ride.bridge.end()
    ride.state.take()
    ride.silence()
    command = [program, str(ride.domain), "iwheel/stop", "stored"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ride.rig.folder) as child:
        t.check("two are stored" in child.stdout.readline(), "two requests wait without a reader")
        before = len([event for event in ride.rig.timeline if event.kind == "stop"])
        ride.start_bridge()
        output = child.communicate(timeout=30)[0]
    t.check(re.search(r"[1-9]\d* announcements sent late", output) and "reply 1" in output, output)
    called = re.search(r"called at (\d+) us", output)
    time.sleep(0.5)
    stops = [event.t_us for event in ride.rig.timeline if event.kind == "stop"][before:]
    if t.check(len(stops) == 1 and called, f"one stop is current, not the earlier ones: {stops}, {output}"):
        ms = (stops[0] - int(called[1])) / 1000
        t.check(0 < ms < 200, f"{ms} ms after the call")
        t.figure(f"{ms:.0f} ms after the call, of which the writer was unknown for 50")
    t.judge(ride.rig)


@scenario("100 service clients of each vendor come and go while driving: no stop", 60)
def clients_come_and_go(t):
    program = fast_peer(t)
    ride = Ride(t)
    stream = ride.driving()
    begin_us = now_us()
    for service in ("iwheel/stop", "iwheel/estop"):
        output = run_fast(ride, program, service, "0")
        t.check("100 clients" in output, f"{service}: {output}")
        for _ in range(50):
            ride.peer.client(service)
            ride.peer.clients.clear()
    t.check(ride.client.request("status")["state"] == "armed" and ride.moving(), "it drives on")
    t.check(all(speed for _, _, speed in ride.rig.bus.setpoints(begin_us)), "without a stop")
    t.figure(f"{(now_us() - begin_us) / 1e6:.1f} s of driving")
    ride.judge_at_rest(stream)


@scenario("ROS 2 Jazzy, its default vendor: a call of iwheel/estop stops within 200 ms; all services reply", 40)
def jazzy_services(t):
    ride = Ride(t)
    jazzy = Jazzy(ride.domain)
    (answer,) = jazzy.call(ride, "/iwheel/reset")
    t.check(answer["success"] is False and "not permitted over the network" in answer["message"], f"reset: {answer}")
    (answer,) = jazzy.call(ride, "/iwheel/arm")
    t.check(answer["success"] is True and "armed: send cmd_vel" in answer["message"], f"arm: {answer}")
    ride.silence()
    stream = ride.driving()
    (answer,) = jazzy.call(ride, "/iwheel/stop")
    t.check(answer["success"] is True, f"stop: {answer}")
    ride.silence(stream)
    time.sleep(0.6)
    stream = ride.driving()
    (answer,) = jazzy.call(ride, "/iwheel/estop")
    if t.check(answer["success"] is True, f"estop: {answer}"):
        ms = t.first_after(ride.rig, answer["begin_us"], lambda speed: speed == 0, "zero", 200)
        t.figure(f"zero {ms or 0:.0f} ms after the call, answered after {(answer['answer_us'] - answer['begin_us']) / 1000:.0f} ms")
    t.check(ride.client.request("status")["state"] == "latched", "latched")
    stream.stop()
    t.judge(ride.rig)
