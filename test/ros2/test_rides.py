# SPDX-License-Identifier: MIT
"""The bridge in normal and disturbed operation: the wheels follow the commands of ROS, and every fault stops them. Judged from the bus log."""

import math
import os
import signal
import subprocess
import sys
import time

from harness import STRANGER, Process, become_stranger, now_us
from judge_log import Event
from peer import DataWriter, Reader, quality
from ride import Ride, Stream
from scenario import Skip, scenario
from settings_file import write_settings
from trials import until

SEEN_MS = 200  # a stop is visible within this
MESSAGES = {
    "odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "joint_states": "sensor_msgs/msg/JointState",
    "left/wrench": "geometry_msgs/msg/WrenchStamped",
    "right/wrench": "geometry_msgs/msg/WrenchStamped",
    "left/battery_state": "sensor_msgs/msg/BatteryState",
    "right/battery_state": "sensor_msgs/msg/BatteryState",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "iwheel/state": "std_msgs/msg/String",
}


@scenario("every message has the bytes that ROS would send, its type's name and hash", 12)
def messages(t):
    ride = Ride(t, {"odometry": {"tf": "yes"}})
    t.check(ride.rig.wait_status(ride.client, lambda s: all(s[side]["force_validity"] == "valid" for side in ("left", "right")), 8), "a zero of the force")
    readers = {name: ride.peer.reader(name, kind, transient=name == "iwheel/state") for name, kind in MESSAGES.items()}
    stream = ride.driving(0.3, 0.2, 2.2)
    stream.stop()
    for name, reader in readers.items():
        reader.take()
        if not t.check(reader.all, f"{name}: nothing came"):
            continue
        for raw, message, _ in reader.all:
            again = bytes(ride.peer.store.serialize_cdr(message, reader.name))
            # The third and fourth byte of the encapsulation contain the number of padding bytes in the last word.
            same = raw[:2] == again[:2] and again[4:] == raw[4 : len(again)] and raw[len(again) :] == bytes(-len(again) % 4)
            if not t.check(same, f"{name}: other bytes than ROS's: {raw.hex()} {again.hex()}"):
                break
        found = reader.reader.get_matched_publications()
        data = reader.reader.get_matched_publication_data(found[0])
        user = str(data.qos)
        t.check(ride.peer.store.hash_rihs01(reader.name) in user, f"{name}: the type's hash is not in {user}")
    odom = readers["odom"].all[-1][1]
    t.check(odom.header.frame_id == "odom" and odom.child_frame_id == "base_link", f"frames: {odom.header.frame_id} {odom.child_frame_id}")
    t.check(abs(odom.header.stamp.sec - time.time()) < 10, "stamps are of the wall clock")
    t.check(abs(odom.twist.twist.linear.x - 0.3) < 0.05 and abs(odom.twist.twist.angular.z - 0.2) < 0.15, f"speeds: {odom.twist.twist}")
    t.check(odom.pose.covariance[0] > 0 and odom.pose.covariance[35] > 0 and odom.pose.covariance[14] > 1e5, "covariance")
    tf = readers["/tf"].all[-1][1].transforms[0]
    t.check((tf.header.frame_id, tf.child_frame_id) == ("odom", "base_link"), "the transform is from odom to base_link")
    joints = readers["joint_states"].all[-1][1]
    t.check(joints.name == ["left_wheel_joint", "right_wheel_joint"] and joints.position[1] > joints.position[0] > 0.5, f"{joints}")
    battery = readers["left/battery_state"].all[-1][1]
    t.check(22 < battery.voltage < 27 and math.isnan(battery.percentage) and battery.present, f"{battery}")
    wrench = readers["left/wrench"].all[-1][1].wrench
    parts = [getattr(vector, axis) for vector in (wrench.force, wrench.torque) for axis in "xyz"]
    t.check(abs(parts[0]) < 50 and not any(parts[1:]), f"the wrench is that of the measured force alone: {wrench}")
    t.check(all(map(math.isfinite, parts)), f"RViz drops a wrench with a part that is no number: {wrench}")
    seconds = readers["odom"].all[-1][2] - readers["odom"].all[0][2]
    t.figure(f"{len(readers['odom'].all)} odom, {sum(len(r.all) for r in readers.values())} messages compared, {seconds:.1f} s")
    ride.judge_at_rest()


@scenario("the odometry is at the position that the wheels have reached", 12)
def odometry(t):
    ride = Ride(t)
    odom = ride.peer.reader("odom", "nav_msgs/msg/Odometry", depth=200)
    writer = ride.commands()
    ride.arm()
    for v, yaw, seconds in ((0.4, 0.0, 1.5), (0.2, 0.8, 1.5), (0.3, -0.4, 1.2)):
        stream = ride.stream(v, yaw, writer)
        time.sleep(seconds)
        ride.silence(stream)
    time.sleep(0.2)
    odom.take()
    pose, status = odom.all[-1][1].pose.pose, ride.client.request("status")
    yaw = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
    wheels = (status["right"]["distance_mm"] - status["left"]["distance_mm"]) / 540
    t.check(abs(math.remainder(yaw - wheels, 2 * math.pi)) < 0.005, f"heading {yaw:.3f}, by the wheels {wheels:.3f}")
    x_m, y_m, psi = status["pose"]["x_mm"] / 1000, status["pose"]["y_mm"] / 1000, status["pose"]["psi_mrad"] / 1000
    t.check(
        abs(pose.position.x) > 0.5 and math.hypot(pose.position.x - x_m, pose.position.y - y_m) < 0.08,
        f"{pose.position}, the wheel itself reports {x_m} {y_m} {psi}",
    )
    t.figure(f"{pose.position.x:.2f} {pose.position.y:.2f} m, {yaw:.2f} rad; the wheel reports {x_m:.2f} {y_m:.2f}, {psi:.2f}")
    t.judge(ride.rig)


def numbers_of(message):
    """All floating point numbers of a message, however deep."""
    if isinstance(message, float):
        return [message]
    if hasattr(message, "__dict__"):
        return [number for part in vars(message).values() for number in numbers_of(part)]
    return [number for part in message for number in numbers_of(part)] if hasattr(message, "__len__") and not isinstance(message, (str, bytes)) else []


@scenario("a wheel without telemetry: its motion is left out, and no part of a message is NaN", 10)
def wheel_offline(t):
    ride = Ride(t, {"odometry": {"tf": "yes"}})
    readers = {name: ride.peer.reader(name, MESSAGES[name], depth=200) for name in ("odom", "/tf", "joint_states", "right/wrench")}
    t.check(ride.rig.wait_status(ride.client, lambda s: s["right"]["force_validity"] == "valid", 8), "a zero of the force")
    time.sleep(0.5)
    ride.rig.sim.ask("mute left")
    t.check(ride.rig.wait_status(ride.client, lambda s: s["left"]["speed_mm_s"] is None and s["left"]["distance_mm"] is not None), "its distance stays known")
    off = now_us()
    time.sleep(1)
    for name, reader in readers.items():
        reader.take()
        bad = [message for _, message, _ in reader.all if not all(map(math.isfinite, numbers_of(message)))]
        t.check(not bad, f"{name}: {len(bad)} of {len(reader.all)} have a part that is no number: {bad[:1]}")
    late = [
        message
        for _, message, _ in readers["joint_states"].all
        if message.header.stamp.sec + message.header.stamp.nanosec / 1e9 > time.time() - (now_us() - off) / 1e6 + 0.2
    ]
    t.check(
        late and all(message.name == ["right_wheel_joint"] and len(message.position) == len(message.velocity) == 1 for message in late),
        f"the other wheel alone: {late[-1:]}",
    )
    t.judge(ride.rig, moves=False)


@scenario("services: arm, stop, estop, reset; refused with the fix; the same by topic", 12)
def services(t):
    ride = Ride(t)
    stream = ride.driving()
    ride.peer.client("iwheel/stop")  # Discovery is not part of the measured time.
    t_us = now_us()
    t.check(ride.peer.call("iwheel/stop") == (True, ""), "stop")
    time.sleep(0.15)  # The reply can come before the next setpoint.
    ms = t.first_after(ride.rig, t_us, lambda speed: speed < 300, "the ramp begins", 200)  # A bridge may take 200 ms.
    t.figure(f"ramp after {ms or 0:.0f} ms")
    ride.silence()
    t.check(ride.still(), "the stream continues, the wheels stay at standstill")
    ride.refuses("arm", "drive", "arm during a stream is refused")
    stream.stop()
    time.sleep(0.6)
    ride.arm()
    stream = ride.stream(0.3, writer=stream.writer)
    time.sleep(0.5)
    t.check(ride.peer.call("iwheel/estop") == (True, ""), "estop")
    ride.refuses("arm", "let go of the stick", "the stream continues")
    stream.stop()
    time.sleep(0.6)
    ride.refuses("arm", "reset", "latched")
    ride.refuses("reset", "allow_reset", "reset over the network is refused")
    ask, answer = ride.peer.writer("iwheel/ask", "std_msgs/msg/String"), ride.peer.reader("iwheel/answer", "std_msgs/msg/String")
    ask.await_match()
    ask.write(ride.peer.make("std_msgs/msg/String", data="arm"))
    words = answer.wait(seconds=2)
    t.check(words and words.data.startswith("arm: refused: "), f"by topic: {words}")
    ask.write(ride.peer.make("std_msgs/msg/String", data="stop"))
    words = answer.wait(seconds=2)
    t.check(words and words.data == "stop: done", f"by topic: {words}")
    ride.refuses("arm", "too late", "an old request to arm is refused", at_ns=time.time_ns() - 10**9)
    t.judge(ride.rig)


@scenario("reset over the network, where it is configured", 10)
def reset_allowed(t):
    ride = Ride(t, {"drive": {"allow_reset": "yes"}})
    stream = ride.driving()
    stream.stop()
    ride.peer.call("iwheel/estop")
    answer = None
    end = time.monotonic() + 6
    while time.monotonic() < end and not (answer and answer[0]):
        answer = ride.peer.call("iwheel/reset")
        time.sleep(0.05)
    t.check(answer and answer[0], f"reset: {answer}")
    t.check(ride.await_state(lambda s: s["state"] == "listening"), "listening")
    t.check(ride.still(0.3), "a reset moves nothing")
    t.judge(ride.rig)


@scenario("hostile publishers: NaN, infinity, 10^30, from the past, at 1 kHz", 14)
def hostile_publishers(t):
    ride = Ride(t)
    writer = ride.commands()
    ride.arm()
    bad = [ride.peer.twist(v, yaw) for v, yaw in ((math.nan, 0), (0.2, math.nan), (math.inf, 0), (0, -math.inf), (1e30, 0), (0.1, -1e30))]
    for message in bad * 5:
        writer.write(message)
        time.sleep(0.01)
    t.check(not ride.tap.twists, f"no hostile command reaches the gateway: {ride.tap.twists[:3]}")
    ride.silence()
    ride.arm()
    flood = ride.stream(0.25, writer=writer, every=0.001)
    time.sleep(1.5)
    flood.stop()
    t.check(ride.moving(), "a flood drives like a stream")
    count = len(ride.tap.twists)
    # All are from the past: each a second old, in order. The speed identifies them, because the last command of the flood may still be in flight.
    old = Stream(writer, lambda: (ride.peer.twist(0.3), time.time_ns() - 10**9), 0.02)
    time.sleep(0.8)
    old.stop()
    t.check(not [v for _, v, _ in ride.tap.twists if v == 300], "old commands are dropped")
    t.check(ride.await_diagnosis("cmd_vel", "came too late", 2) == 1, "and reported")
    t.check(not ride.moving(now_us() - 100_000), "the wheels have stopped meanwhile")
    t.check(ride.bridge.resident_kB() < 40_000, f"{ride.bridge.resident_kB()} kB")
    t.figure(f"{count} of about 1500 passed on, {ride.bridge.resident_kB()} kB")
    ride.judge_at_rest()


DYING = """
import sys, time
sys.path[:0] = sys.argv[2:4]
from peer import Peer
peer = Peer(int(sys.argv[1]))
writer = peer.writer("cmd_vel", "geometry_msgs/msg/Twist")
writer.await_match()
print("matched", flush=True)
while True:
    writer.write(peer.twist(0.3))
    time.sleep(0.02)
"""


@scenario("the publisher is killed: the wheels stop by the lease", 10)
def publisher_dies(t):
    ride = Ride(t)
    here = os.path.dirname(os.path.abspath(__file__))
    ride.peer.client("iwheel/arm")
    publisher = Process([sys.executable, "-c", DYING, str(ride.domain), here, here], ride.rig.path("publisher.out"))
    ride.rig.processes.append(publisher)
    # The stream begins before an arm: it is refused, as a stream during a reset is.
    until(lambda: ride.tap.twists)
    ride.refuses("arm", "", "an earlier stream does not drive")
    t.check(ride.await_diagnosis("cmd_vel", "refused", 3) == 1, "the reason for ignored commands is reported")
    publisher.signal(signal.SIGSTOP)
    time.sleep(0.7)
    ride.arm()
    publisher.signal(signal.SIGCONT)
    time.sleep(0.8)
    t.check(ride.moving(), "drives")
    killed_us = now_us()
    publisher.signal(signal.SIGKILL)
    time.sleep(0.9)
    ms = t.first_after(ride.rig, killed_us, lambda speed: speed == 0, "zero", 200 + 20 + 200 + 80)
    t.figure(f"zero after {ms or 0:.0f} ms")
    t.stopped_by(ride.client, "lease_lost", "stopping")
    ride.judge_at_rest()


@scenario("its source sends nothing for longer than timeout_ms: the bridge stops, once", 8)
def source_silent(t):
    ride = Ride(t, {"drive": {"timeout_ms": 100}}, {"drive": {"lease_ms": 400, "decel_mm_s2": 3000}})
    stream = ride.driving()
    t_us = now_us()
    stream.stop()
    time.sleep(1.0)
    stops = [event for event in ride.rig.timeline if event.kind == "stop" and event.t_us > t_us]
    t.check(len(stops) == 1 and stops[0].t_us - t_us < 220_000, f"{[(e.t_us - t_us) / 1000 for e in stops]}")
    t.stopped_by(ride.client, "client_stop", "stopping")
    ride.judge_at_rest()


@scenario("e-stop, lost lease, lost bus, lost gateway: seen within 0.2 s, each with its sentence; nothing starts on its own", 25)
def stops_are_seen(t):
    ride = Ride(t)
    figures = []

    def seen(name, wanted, status, part, since_us):
        found = ride.await_state(wanted, 2)
        ms = (now_us() - since_us) / 1000
        if t.check(found, f"{name}: not seen in iwheel/state"):
            t.check(ms <= SEEN_MS, f"{name}: seen after {ms:.0f} ms", True, now_us())
            figures.append(f"{name} {ms:.0f} ms")
        ride.diagnostics.take()
        words = [s.message for _, m, _ in ride.diagnostics.all[-3:] for s in m.status if s.name == f"iwheel: {status}"]
        t.check(any(part in text for text in words), f"{name}: {words}")

    def again():
        """The stream has continued all the time: nothing moves. After a reset and a pause of the stream it may move them."""
        t.check(ride.still(0.5), "continued commands start nothing")
        stream.stop()
        ride.reset()
        t.check(ride.still(0.7), "nothing after reset")

    stream = ride.driving()
    ride.state.take()
    seen("e-stop", lambda s: s.get("estop") == "pressed", "e-stop", "release the button", ride.rig.press())
    ride.rig.release()
    again()
    ride.arm()
    stream = ride.stream(0.3, writer=stream.writer)
    time.sleep(0.6)
    stream.stop()
    seen("lease", lambda s: s.get("cause") == "lease_lost", "gateway", "sent no drive command", now_us() + 200_000)
    stream = ride.stream(0.3, writer=stream.writer)
    time.sleep(0.4)
    again()
    ride.arm()
    stream = ride.stream(0.3, writer=stream.writer)
    time.sleep(0.6)
    t_us = now_us()
    ride.rig.timeline.append(Event(t_us, "dead"))
    ride.rig.fault("busoff on")
    seen("bus", lambda s: s.get("bus") in ("bus_off", "down"), "bus", "bus", t_us)
    t.check(ride.still(0.4), "nothing")
    stream.stop()
    begin_us = now_us()
    ride.rig.sim.ask("busoff off")
    ride.rig.timeline.append(Event(begin_us, "alive", now_us()))
    time.sleep(0.3)
    again()
    ride.arm()
    stream = ride.stream(0.3, writer=stream.writer)
    time.sleep(0.6)
    t_us = now_us()
    ride.rig.kill_gateway(signal.SIGKILL)
    seen("gateway", lambda s: s["gateway"] == "gone", "gateway", "the gateway is gone", t_us)
    time.sleep(1.2)
    ride.restart_gateway(wheels=False, restart_hold=True)
    t.check(ride.await_state(lambda s: s["gateway"] == "up", 4), "the bridge finds it again")
    t.check(ride.still(0.6), "continued commands start nothing")
    ride.silence(stream)
    ride.arm()
    stream = ride.resumes(stream, 0.5, "armed again, it drives again", v=0.2)
    ride.silence(stream)
    t.figure(", ".join(figures))
    t.judge(ride.rig)


@scenario("the bridge does not grow: floods, resets and reconnects for a minute (only with --full)", 70)
def no_growth(t):
    if os.environ.get("IWHEEL_FULL") != "1":
        raise Skip("a minute long: ./check --full ros2")
    ride = Ride(t, {"odometry": {"rate_hz": 100, "tf": "yes"}})
    writer = ride.commands()
    flood = ride.stream(0.0, writer=writer, every=0.001)
    sizes = []
    for _ in range(6):
        time.sleep(9)
        ride.client.request("stop")
        sizes.append((ride.bridge.resident_kB(), ride.bridge.descriptors()))
    flood.stop()
    t.check(sizes[-1][0] <= sizes[0][0] + 300 and sizes[-1][1] <= sizes[0][1], f"kB and descriptors: {sizes}")
    t.figure(f"{sizes[0][0]} kB after 10 s, {sizes[-1][0]} kB after 55 s of 1 kHz")
    t.judge(ride.rig, moves=False)


@scenario("3,000 publishers come and go: the bridge does not grow (only with --full)", 60)
def publishers_come_and_go(t):
    if os.environ.get("IWHEEL_FULL") != "1":
        raise Skip("a minute long: ./check --full ros2")
    ride = Ride(t)
    topic, sizes = ride.commands().writer.topic, []
    for number in range(3000):
        one = DataWriter(ride.peer.participant, topic, quality())
        one.write(ride.peer.twist())
        time.sleep(0.01)
        del one
        if number % 100 == 99:
            sizes.append(ride.bridge.resident_kB())
    # DDS releases entities some seconds after they are gone: the size is a sawtooth of 0.9 MB. Without any release it would grow by 2.6 MB.
    t.check(max(sizes[15:]) <= max(sizes[:15]) + 600, f"kB after each hundred: {sizes}")
    t.figure(f"{sizes[0]} to {max(sizes)} kB, {sizes[-1]} kB at the end")
    t.judge(ride.rig, moves=False)


@scenario("the gateway hangs: seen within 0.2 s, and it accepts no old command when it wakes", 10)
def gateway_hangs(t):
    ride = Ride(t)
    stream = ride.driving()
    ride.state.take()
    t_us = now_us()
    # The system tests treat a stopped process in the same way: it is dead meanwhile, and cuts as soon as it runs.
    ride.rig.note("cut", within_us=2_000_000)
    ride.rig.note("dead")
    ride.rig.gateway.signal(signal.SIGSTOP)
    t.check(ride.await_state(lambda s: s["gateway"] == "silent", 2), "silent")
    ms = (now_us() - t_us) / 1000
    t.check(ms <= SEEN_MS + 20, f"seen after {ms:.0f} ms", True, now_us())
    time.sleep(0.8)
    back_us = now_us()
    ride.rig.gateway.signal(signal.SIGCONT)
    ride.rig.note("alive")
    t.check(ride.await_state(lambda s: s["gateway"] == "up", 3), "up again")
    t.check(ride.still(0.5) and not ride.moving(back_us), "only zeros, although commands continue")
    stream.stop()
    ride.reset()
    t.check(ride.still(0.3), "nothing after reset")
    t.figure(f"seen after {ms:.0f} ms")
    t.judge(ride.rig)
    replies = {"arm": "the gateway does not answer", "stop": "nothing came in time; if the gateway", "estop": "gateway"}
    for verb in replies:
        ride.peer.client(f"iwheel/{verb}")
    ride.rig.gateway.signal(signal.SIGSTOP)
    t.check(ride.await_state(lambda s: s["gateway"] == "silent", 2), "silent again")
    for verb, part in replies.items():
        t_us = now_us()
        refused = ride.peer.call(f"iwheel/{verb}")
        t.check(refused and not refused[0] and part in refused[1], f"{verb}: {refused}")
        t.check(now_us() - t_us < 500_000, f"{verb}: answered after {now_us() - t_us} us", True, now_us())
    ride.rig.gateway.signal(signal.SIGCONT)


@scenario("bridge killed while driving: ramp within 60 ms; restarted, it moves nothing", 10)
def bridge_killed(t):
    ride = Ride(t)
    stream = ride.driving()
    killed_us = now_us()
    ride.bridge.signal(signal.SIGKILL)
    time.sleep(0.4)
    ms = t.first_after(ride.rig, killed_us, lambda speed: speed < 300, "the ramp begins", 70)
    t.figure(f"ramp after {ms or 0:.0f} ms")
    ride.bridge.wait(2)
    ride.start_bridge()
    t.check(ride.await_state(lambda s: s["gateway"] == "up"), "the new bridge is up")
    t.check(ride.still(0.8), "the stream continues, the wheels stay at standstill")
    ride.judge_at_rest(stream)


@scenario("bridge frozen while driving: the lease stops the wheels; thawed, it sends nothing old", 10)
def bridge_frozen(t):
    ride = Ride(t)
    stream = ride.driving()
    frozen_us = now_us()
    ride.bridge.signal(signal.SIGSTOP)
    time.sleep(1.0)
    ms = t.first_after(ride.rig, frozen_us, lambda speed: speed == 0, "zero", 200 + 20 + 200 + 60)
    t.figure(f"zero after {ms or 0:.0f} ms")
    ride.bridge.signal(signal.SIGCONT)
    t.check(ride.still(0.6), "thawed, its commands are refused")
    ride.judge_at_rest(stream)


@scenario("bridge ended by SIGTERM while driving: stops the wheels, exits with 0", 8)
def bridge_ends(t):
    ride = Ride(t)
    stream = ride.driving()
    ride.bridge.signal(signal.SIGTERM)
    t.check(ride.bridge.wait(3) == 0, f"exit code: {ride.bridge.text()[-300:]}")
    stream.stop()
    t.stopped_by(ride.client, "client_stop", "stopping")
    ride.judge_at_rest()


@scenario("auto_arm: only after standstill, and not after a stop of another cause", 16)
def auto_arm(t):
    ride = Ride(t, {"drive": {"auto_arm": "yes"}})
    time.sleep(0.6)
    stream = ride.stream(0.3)
    time.sleep(0.8)
    t.check(ride.moving(), "a command after a pause arms and drives")
    ride.silence(stream)
    time.sleep(0.6)
    stream = ride.resumes(stream, 0.8, "after its own pause too")
    ride.silence(stream)
    t.check(ride.peer.call("iwheel/stop") == (True, ""), "a person stops a machine at standstill")
    time.sleep(1.2)
    stream = ride.stream(0.3, writer=stream.writer)
    t.rule(ride.still(1.5), "the next stream arms")
    stream.stop()
    time.sleep(1.2)
    stream = ride.resumes(stream, 0.8, "after a pause of the source it arms again")
    ride.rig.press()
    ride.rig.release()
    stream.stop()
    ride.reset()
    time.sleep(0.7)
    stream = ride.stream(0.3, writer=stream.writer)
    t.check(ride.still(1.0), "after an e-stop it waits for the service")
    stream.stop()
    time.sleep(0.6)
    ride.arm()
    stream = ride.resumes(stream, 0.5, "after the service call it drives")
    ride.judge_at_rest(stream)


@scenario("current_role = setpoint: driving is refused with its sentence, watching works", 8)
def setpoint_role(t):
    ride = Ride(t, config={"wheels": {"current_role": "setpoint"}})
    odom = ride.peer.reader("odom", "nav_msgs/msg/Odometry")
    ride.refuses("arm", "carries no current", "arm")
    stream = ride.stream(0.3)
    t.check(ride.still(0.4) and not ride.tap.twists, "no command is passed on")
    stream.stop()
    t.check(odom.wait(), "odometry comes")
    t.check(ride.await_diagnosis("cmd_vel", "carries no current") == 1, "reported")
    t.check("carries no current" in ride.bridge.text(), f"at start: {ride.bridge.text()}")
    t.judge(ride.rig, moves=False)


@scenario("a namespace, stamped commands judged by their stamp, the node in the graph of Humble and newer", 14)
def names(t):
    for release, size in (("humble", 24), ("jazzy", 16)):
        ride = Ride(t, {"ros": {"release": release, "namespace": "w1", "node": "base"}, "drive": {"command": "twist_stamped"}})
        graph = Reader(ride.peer, "ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo", transient=True)
        info = graph.wait()
        if t.check(info, f"{release}: no node in the graph"):
            node = info.node_entities_info_seq[0]
            t.check((node.node_namespace, node.node_name) == ("/w1", "base"), f"{node.node_namespace} {node.node_name}")
            t.check(len(node.reader_gid_seq) == 6 and len(node.writer_gid_seq) == 14, f"{len(node.reader_gid_seq)} readers, {len(node.writer_gid_seq)} writers")
            t.check(len(info.gid.data) == size, f"{release}: ids of {len(info.gid.data)} bytes")
            raw = graph.all[-1][0]
            again = bytes(ride.peer.store.serialize_cdr(info, graph.name))
            t.check(raw[4 : len(again)] == again[4:], "its bytes")
        if release == "jazzy":
            writer = ride.commands(stamped=True)
            ride.arm()
            stream = Stream(writer, lambda: ride.peer.twist_stamped(0.3, time.time_ns()), 0.05)
            time.sleep(0.6)
            t.check(ride.moving(), "drives in its namespace")
            stream.stop()
            stream = Stream(writer, lambda: ride.peer.twist_stamped(0.2, time.time_ns() - 10**9), 0.05)
            time.sleep(0.4)
            stream.stop()
            t.check(not [v for _, v, _ in ride.tap.twists if v == 200], "a command with a stamp of a second ago is dropped")
            ride.judge_at_rest()
        ride.bridge.end()


@scenario("starts before the gateway; only watches where configured; its command line", 12)
def starts(t):
    ride = Ride(t, {"drive": {"enabled": "no"}}, gateway=False)
    t.check(ride.await_diagnosis("gateway", "the gateway is gone") == 2, "reports the missing gateway")
    ride.restart_gateway()
    t.check(ride.await_state(lambda s: s["gateway"] == "up", 4), "finds the gateway when it starts")
    answer = ride.peer.call("iwheel/arm")
    t.check(answer and not answer[0] and "enabled = no" in answer[1], f"{answer}")
    t.check(ride.peer.call("iwheel/stop") == (True, ""), "every client may stop")

    def call(*arguments, **options):
        done = subprocess.run([ride.program(), *arguments], capture_output=True, text=True, timeout=10, check=False, **options)
        return done.returncode, done.stdout + done.stderr

    code, text = call("--check", "-c", ride.conf)
    t.check(code == 0 and text.count("ok  ") >= 3, f"--check: {code} {text}")
    for words, wanted, part in (
        (("--help",), 0, "iwheel/arm"), (("--version",), 0, "iwheel-ros2 "), (("--nonsense",), 64, "--help"), (("surplus",), 64, "--help"),
        (("-c",), 64, "needs a value"), (("-c", "/nonexistent"), 78, "/nonexistent"), (("--print-config", "-c", ride.conf), 0, "enabled = no"),
    ):  # fmt: skip
        code, text = call(*words)
        t.check(code == wanted and part in text, f"{words}: {code} {text[:200]}")
    with open(ride.conf, "a", encoding="utf-8") as file:
        file.write("[drive]\nautoarm = yes\n")
    code, text = call("-c", ride.conf)
    t.check(code == 78 and f"{ride.conf}:" in text and "unknown key autoarm" in text, f"{code} {text}")
    if os.geteuid() == 0:
        settings = {"gateway": {"socket": ride.rig.path("gateway.sock")}, "ros": {"network": "loopback", "domain": ride.domain}}
        write_settings(ride.rig.path("driving.conf"), settings)
        for path in (ride.rig.folder, os.path.dirname(ride.rig.folder)):
            os.chmod(path, 0o755)
        os.chmod(ride.rig.path("driving.conf"), 0o644)
        code, text = call("-c", ride.rig.path("driving.conf"), preexec_fn=become_stranger)
        t.check(code == 77 and "group iwheel" in text, f"user {STRANGER}: {code} {text}")
    t.judge(ride.rig, moves=False)


@scenario("./demo --ros: a square by DDS messages from outside, back to its start", 30)
def demo_square(t):
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    command = [sys.executable, os.path.join(root, "app", "demo", "ros.py"), "--build", t.build, "--plain"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    t.check(done.returncode == 0 and "A square of 1 m" in done.stdout, f"{done.returncode} {done.stdout[-600:]} {done.stderr[-600:]}")
    t.figure(done.stdout.strip().splitlines()[-2] if done.returncode == 0 else "")
