# SPDX-License-Identifier: MIT
"""Other machines and old messages must not drive the wheels."""

import os
import subprocess
import sys
import time

from network import HERE_ADDRESS, Cable, Tape, ports_of, send_again, timeless
from peer import Topic, Writer, make_idl_struct
from ride import Ride, Stream, now_us
from scenario import scenario

HERE = os.path.dirname(os.path.abspath(__file__))

DRIVER = """
import sys, time
sys.path[:0] = sys.argv[2:]
from peer import Peer
peer = Peer(int(sys.argv[1]))
print(peer.participant.guid.hex, flush=True)
ask, writer = peer.writer("iwheel/ask", "std_msgs/msg/String"), peer.writer("cmd_vel", "geometry_msgs/msg/Twist")
ask.await_match()
writer.await_match()
time.sleep(0.7)
ask.write(peer.make("std_msgs/msg/String", data="arm"))
time.sleep(0.2)
for _ in range(30):
    writer.write(peer.twist(0.3))
    time.sleep(0.05)
"""


def restart_bridge(ride, ports):
    """Restarts the bridge, so that it knows no writer; on the same ports."""
    ride.bridge.end()
    ride.state.take()
    ride.start_bridge()
    ride.t.check(ride.await_state(lambda s: s["gateway"] == "up"), "the bridge is up again")
    again = ports_of(ride.bridge.child.pid)
    ride.t.check(again == ports, f"the same ports: {ports}, {again}")


def old(seconds):
    return time.time_ns() - int(seconds * 1e9)


@scenario("a writer's first sample of 60 s ago does nothing: cmd_vel, arm, reset", 20)
def old_first_samples(t):
    ride = Ride(t, {"drive": {"allow_reset": "yes"}})
    ride.refuses("arm", "too late", "arm", at_ns=old(60))
    t.rule(ride.client.request("status")["state"] == "listening", "no writer has armed")
    topic, writers = ride.commands().writer.topic, []
    ride.arm()
    begin_us = now_us()
    for _ in range(20):
        writers.append(Writer.of(ride.peer, topic))
        writers[-1].await_match()
        writers[-1].write(ride.peer.twist(0.3), old(60))
    t.rule(not ride.tap.twists and not ride.moving(begin_us), f"{len(ride.tap.twists)} of 20 first commands of a minute ago are passed on")
    writers.clear()
    t.check(ride.await_diagnosis("cmd_vel", "came too late", 5) == 1, "reported")
    ride.silence()
    ride.peer.call("iwheel/estop")
    time.sleep(3)
    ride.refuses("reset", "too late", "reset", at_ns=old(60))
    t.rule(ride.client.request("status")["state"] == "latched", "the latch is closed")
    answer = ride.peer.call("iwheel/reset")
    t.check(answer and answer[0], f"reset of now: {answer}")
    t.judge(ride.rig, moves=False)


@scenario("bursts of 2 to 100 delayed commands move nothing, on this machine and on a network", 40)
def held_back_bursts(t):
    for network in ("loopback", "default"):  # The second is on this machine too, by CYCLONEDDS_URI, but the bridge does not know that.
        ride = Ride(t, {"ros": {"network": network}, "drive": {"auto_arm": "yes"}})
        topic = ride.commands().writer.topic
        time.sleep(0.6)
        begin_us = now_us()
        for count in (2, 3, 5, 10, 20, 50, 100):
            writer = Writer.of(ride.peer, topic, depth=100)
            writer.await_match()
            for i in range(count):  # The last command is as old as the delay of the network.
                writer.write(ride.peer.twist(0.3), old(60 - i * 0.05))
                time.sleep(0.001)
            time.sleep(0.6)
        t.rule(not ride.tap.twists and not ride.moving(begin_us), f"{network}: {len(ride.tap.twists)} commands of bursts are passed on")
        t.rule(ride.client.request("status")["state"] == "listening", f"{network}: no writer has armed")
        t.judge(ride.rig, moves=False)
        ride.bridge.end()


@scenario("a network: a writer drives when its clock is known; it may arm only with synchronised clocks", 20)
def writers_of_a_network(t):
    ride = Ride(t, {"ros": {"network": "default"}})
    writer = ride.commands()
    ride.refuses("arm", "clocks = synchronised", "arm")
    stream = Stream(writer, lambda: (ride.peer.twist(0.3), old(-3600)), 0.05)
    time.sleep(0.8)
    t.check(not ride.tap.twists, f"no command of an unknown writer passes: {ride.tap.twists[:3]}")
    t.check(ride.await_diagnosis("cmd_vel", "not known yet", 2) == 1, "reported")
    time.sleep(0.8)
    t.check(ride.tap.twists, "an hour ahead, and known")
    ride.silence(stream)
    t.judge(ride.rig, moves=False)


@scenario("a stop that cannot be decoded stops; an arm that cannot be does not arm", 15)
def undecodable_requests(t):
    ride = Ride(t)
    odd = make_idl_struct("Trigger_Request_", "std_srvs::srv::dds_::Trigger_Request_", {"data": str})
    writers = {}
    for verb in ("arm", "stop"):
        writers[verb] = Writer.of(ride.peer, Topic(ride.peer.participant, ride.peer.topic(f"iwheel/{verb}", "rq") + "Request", odd))
        writers[verb].await_match()
    for length in range(1, 24):  # Some are as long as a request.
        writers["arm"].write(odd(data="another type of request"[:length]))
    time.sleep(0.5)
    state = ride.client.request("status")["state"]
    t.rule(state == "listening", f"no writer has armed: {state}")
    stream = ride.driving()
    t_us = now_us()
    writers["stop"].write(odd(data="another type"))
    time.sleep(0.4)
    t.first_after(ride.rig, t_us, lambda speed: speed < 300, "the ramp begins", 200)  # A bridge may take 200 ms.
    stream.stop()
    t.stopped_by(ride.client, "client_stop", "stopping")
    ride.judge_at_rest()


@scenario("two people publish cmd_vel: the first one that drives after arm has the wheels, until a stop", 30)
def one_person_of_two_publishers(t):
    ride = Ride(t)
    first, second = ride.commands(), ride.commands()
    ride.arm()
    mine = ride.stream(0.3, writer=first)
    time.sleep(0.3)
    yours = ride.stream(-0.2, writer=second)
    time.sleep(1.0)
    t.rule(not [v for _, v, _ in ride.tap.twists if v < 0], "the second one's commands are passed on")
    t.check(ride.moving() and ride.client.request("status")["state"] == "armed", "the first one drives on")
    t.check(ride.await_diagnosis("cmd_vel", "2 publishers", 3) == 1, "reported")
    ride.silence(mine)
    ride.refuses("arm", "not zero", "arm during the second one's stream is refused")
    yours.stop()
    time.sleep(0.6)
    ride.arm()
    yours = ride.stream(-0.2, writer=second)
    time.sleep(0.5)
    t.check(ride.moving() and [v for _, v, _ in ride.tap.twists if v < 0], "now the second one drives")
    ride.refuses("arm", "", "and it has the wheels")
    t.check(ride.peer.call("iwheel/stop") == (True, ""), "every client can stop it")
    ride.judge_at_rest(yours)


@scenario("loopback: another machine that sends a local driver's packets moves nothing", 30)
def other_machine(t):
    cable = Cable(t)
    try:
        tape, ride = Tape(), Ride(t)
        ports = ports_of(ride.bridge.child.pid)
        done = subprocess.run([sys.executable, "-c", DRIVER, str(ride.domain), HERE, *sys.path], capture_output=True, text=True, timeout=60, check=True)
        t.check(ride.moving(now_us() - 1_500_000), "a program on this machine arms and drives")
        tape.stop()
        packets = tape.of(bytes.fromhex(done.stdout.strip())[:12], ports)
        path = ride.rig.path("packets")
        ride.silence()
        time.sleep(0.6)
        restart_bridge(ride, ports)
        count = len(ride.tap.twists)
        send_again(cable, packets, path, HERE_ADDRESS)
        t.rule(len(ride.tap.twists) == count and not ride.moving(now_us() - 4_000_000), f"another machine drives: {len(ride.tap.twists) - count} commands")
        t.check(ride.client.request("status")["state"] == "listening", "no writer has armed")
        # The same packets drive where they may: they are valid.
        restart_bridge(ride, ports)
        send_again(None, packets, path, "127.0.0.1")
        passed = len(ride.tap.twists) - count
        t.check(passed >= 20 and ride.moving(now_us() - 1_500_000), f"sent on this machine they drive: {passed} commands")
        ride.silence()
        restart_bridge(ride, ports)
        count = len(ride.tap.twists)
        send_again(None, timeless(packets), path, "127.0.0.1")
        t.rule(len(ride.tap.twists) == count and ride.client.request("status")["state"] == "listening", "a packet without a time stamp drives")
        t.figure(f"{len(packets)} packets: from there 0 commands, from here {passed}, without a time 0")
        t.judge(ride.rig)
    finally:
        cable.close()


CROWD = """
import sys, time
sys.path[:0] = sys.argv[3:]
from peer import Peer, DataWriter, Topic, Qos, Policy
peer = Peer(int(sys.argv[1]))
topics = [Topic(peer.participant, f"rt/crowd{i}", peer.types.of("std_msgs/msg/String")) for i in range(4)]
qos, writers = Qos(Policy.Userdata(b"x" * 8000)), []
for number in range(int(sys.argv[2])):
    writers.append(DataWriter(peer.participant, topics[number % 4], qos))
    time.sleep(0.002)
print("announced", flush=True)
time.sleep(60)
"""


@scenario("4,000 announced writers with 8 kB of user data each: memory is bounded, and a stop works", 60)
def announced_crowd(t):
    ride = Ride(t)
    stream = ride.driving()
    before_kB = ride.bridge.resident_kB()
    command = [sys.executable, "-c", CROWD, str(ride.domain), "4000", HERE, *sys.path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        try:
            t.check(child.stdout.readline().strip() == "announced", "4,000 writers")
            time.sleep(2)
            after_kB = ride.bridge.resident_kB()
            t.check(after_kB < 40_000, f"{before_kB} kB became {after_kB} kB; 8 kB for each would be {before_kB + 32_000}")
            t.figure(f"{before_kB} to {after_kB} kB")
            t.check(ride.peer.call("iwheel/stop") == (True, ""), "stop")
        finally:
            child.kill()
    ride.judge_at_rest(stream)


@scenario("20,000 undecodable samples, and texts of 60 kB: the log and the memory are bounded, a publisher drives", 40)
def garbage_at_1_khz(t):
    ride = Ride(t)
    odd = make_idl_struct("Twist_", "geometry_msgs::msg::dds_::Twist_", {"data": str})
    bad = Writer.of(ride.peer, Topic(ride.peer.participant, ride.peer.topic("cmd_vel"), odd))
    ask = ride.peer.writer("iwheel/ask", "std_msgs/msg/String")
    bad.await_match()
    ask.await_match()
    words = ride.peer.make("std_msgs/msg/String", data="arm" + "x" * 60_000)
    for number in range(20_000):
        bad.write(odd(data="another type"))
        if number % 20 == 0:
            ask.write(words)
            time.sleep(0.005)
    text, size_kB = ride.bridge.text(), ride.bridge.resident_kB()
    t.check(len(text) < 20_000, f"{len(text)} bytes of log: {text[-600:]}")
    t.check(size_kB < 40_000, f"{size_kB} kB")
    t.rule(ride.client.request("status")["state"] == "listening", "no writer has armed")
    t.figure(f"{len(text)} bytes of log, {size_kB} kB")
    stream = ride.driving()
    ride.judge_at_rest(stream)
