# SPDX-License-Identifier: MIT
"""Every row of the table "Commands and their results" of the page for ROS 2, with a real ROS 2 and simulated wheels."""

import math
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from free_domain import free_domain
from harness import Process
from jazzy import ROOT, Jazzy, finish
from ride import Ride, now_us
from scenario import Skip, scenario
from trials import until

# `t.rule` in a scenario without time limits: a stall of the machine does not explain a failure there.
SEEN_S = 12  # Limit from a typed command to its effect: Python starts, and DDS discovers.
TRIGGER = "std_srvs/srv/Trigger"


def rows():
    """{typed command: expected results} of the page."""
    (page,) = [path for path in Path(ROOT, "docs").rglob("ros2.md") if "| command | result |" in path.read_text(encoding="utf-8")]
    table = page.read_text(encoding="utf-8").split("| command | result |", 1)[1].split("\n\n", 1)[0]
    return dict(re.findall(r"^\| `([^`]+)` \| (.+) \|$", table, re.MULTILINE))


class Typed:
    """A ride, and a person at a terminal."""

    def __init__(self, t, vendor="fastrtps", settings=None, **options):
        self.t, self.ride = t, Ride(t, settings, **options)
        self.jazzy = Jazzy(self.ride.domain, vendor)

    def expect(self, command, *parts, without=()):
        output = self.jazzy.type(command)
        missing = [part for part in parts if not re.search(part, output)]
        self.t.check(not missing, f"{command}: {missing} is not in {output[-1500:]}")
        self.t.check(not [part for part in without if re.search(part, output)], f"{command}: {output[-800:]}")
        return output

    def call(self, verb, *parts):
        return self.expect(f"ros2 service call /iwheel/{verb} {TRIGGER}", *parts)

    def publishes(self, command, part, level, moves=False):
        """Checks that /diagnostics contains this while the command publishes."""
        begin_us = now_us()
        child = self.jazzy.start(command)
        self.t.check(self.ride.await_diagnosis("cmd_vel", part, SEEN_S) == level, f"{command}: /diagnostics does not contain: {part}")
        output = finish(child)
        self.t.rule(self.ride.moving(begin_us) == moves, f"{command}: it moves without arm: {output[-300:]}")
        time.sleep(0.7)

    def drives(self, command):
        begin_us = now_us()
        child = self.jazzy.start(command)
        output = child.communicate(timeout=40)[0]
        moved = [t_us for t_us, _, speed in self.ride.rig.bus.setpoints(begin_us) if speed]
        seconds = (moved[-1] - moved[0]) / 1e6 if moved else 0
        self.t.check(child.returncode == 0 and "and stopped" in output, f"{command}: {child.returncode} {output[-600:]}")
        self.t.check(1.7 < seconds < 3.2, f"{command}: the wheels were driven for {seconds:.1f} s", True, now_us())
        self.t.figure(f"driven for {seconds:.1f} s")
        self.ride.silence()
        time.sleep(0.6)


GRAPH = {
    "ros2 node list": (r"^/iwheel$".replace("^", r"(?m)^"),),
    "ros2 node info /iwheel": (
        r"/cmd_vel: geometry_msgs/msg/Twist", r"/odom: nav_msgs/msg/Odometry", r"/iwheel/estop: std_srvs/srv/Trigger", r"/iwheel/arm:", r"/iwheel/stop:",
        r"/iwheel/reset:", r"/iwheel/emergency_stop: std_msgs/msg/Bool",
    ),
    "ros2 topic list -t": (
        r"/cmd_vel \[geometry_msgs/msg/Twist, geometry_msgs/msg/TwistStamped\]", r"/joint_states \[sensor_msgs/msg/JointState\]", r"/diagnostics \[",
        r"/left/wrench \[geometry_msgs/msg/WrenchStamped\]", r"/right/battery_state \[sensor_msgs/msg/BatteryState\]", r"/iwheel/ask \[std_msgs/msg/String\]",
    ),
    "ros2 topic info -v /odom": (r"Node name: iwheel", r"Topic type: nav_msgs/msg/Odometry", r"Reliability: RELIABLE", r"Durability: VOLATILE"),
    "ros2 topic echo --once /odom": (r"frame_id[:=] ?'?odom", r"child_frame_id[:=] ?'?base_link"),
    "ros2 topic echo --once --qos-durability transient_local /odom": (r"(?i)incompatible qos.*DURABILITY",),
    "ros2 topic echo --once /iwheel/state": (r'"state":"listening"',),
    "ros2 topic echo --once /iwheel/emergency_stop": (r"data: false",),
    "ros2 service list -t": tuple(rf"/iwheel/{verb} \[std_srvs/srv/Trigger\]" for verb in ("arm", "stop", "estop", "reset")),
    "ros2 param list /iwheel": (r"(?i)timed out waiting for parameter services|Node not found|^$",),
}  # fmt: skip


def graph(t, vendor):
    typed = Typed(t, vendor)
    for command, parts in GRAPH.items():
        if "topic info" in command and "kilted" in typed.jazzy.folder:  # Fast DDS 3 does not find the node of a CycloneDDS writer.
            parts = tuple(part.replace("iwheel", "_CREATED_BY_BARE_DDS_APP_") for part in parts)
        output = typed.expect(command, *parts)
        if command == "ros2 topic echo --once /odom":
            t.check(not re.search(r"\b(nan|inf)\b", output), f"finite numbers: {output[:400]}")
    output = typed.jazzy.type("ros2 topic hz /odom", 8)
    rate = re.findall(r"average rate: ([\d.]+)", output)
    t.check(rate and abs(float(rate[-1]) - 50) < 5, f"hz: {output[-300:]}", True, now_us())
    typed.ride.rig.press()
    typed.expect("ros2 topic echo --once /iwheel/emergency_stop", r"data: true")
    typed.ride.rig.release()
    output = typed.jazzy.type(["ROS_DOMAIN_ID=99", "ros2 node list"][1], ROS_DOMAIN_ID=str(free_domain()))
    t.check("/iwheel" not in output, f"another domain: {output}")
    typed.ride.reset()
    t.judge(typed.ride.rig, moves=False)


def services(t, vendor):
    typed = Typed(t, vendor)
    ride = typed.ride
    typed.call("reset", r"success=False", r"not permitted over the network", r"iwheelctl reset")
    typed.call("arm", r"success=True", r"send cmd_vel at 15 Hz or more")
    ride.silence()
    for verb, wanted in (("stop", lambda speed: speed < 300), ("estop", lambda speed: speed == 0)):
        stream = ride.driving()
        output = typed.call(verb, r"success=True")
        asked = re.search(r"requested at (\d+) us", output)
        if asked:  # ros2cli does not print when it sent the request.
            ms = t.first_after(ride.rig, int(asked[1]), wanted, f"the effect of {verb}", 200)
            t.figure(f"{verb}: {ms or 0:.0f} ms")
        t.check(not ride.moving(now_us() - 100_000) or verb == "stop", f"{verb}: zero")
        stream.stop()
        if verb == "stop":
            ride.silence()
            time.sleep(0.6)
    t.check(ride.client.request("status")["state"] == "latched", "latched")
    t.judge(ride.rig)


@scenario("what a user types: the graph, the topics, QoS, domains, as on the page (Fast DDS)", 60)
def typed_graph_fastrtps(t):
    graph(t, "fastrtps")


@scenario("what a user types: the graph, the topics, QoS, domains, as on the page (CycloneDDS)", 60)
def typed_graph_cyclonedds(t):
    graph(t, "cyclonedds")


@scenario("what a user types: the four services (Fast DDS)", 45)
def typed_services_fastrtps(t):
    services(t, "fastrtps")


@scenario("what a user types: the four services (CycloneDDS)", 45)
def typed_services_cyclonedds(t):
    services(t, "cyclonedds")


FLIGHT = """
import sys, time, rclpy
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node("many")
clients = [node.create_client(Trigger, f"/iwheel/{verb}") for verb in ("stop", "reset", "arm", "stop", "stop")]
for client in clients:
    client.wait_for_service(10)
print("ready", flush=True)
sys.stdin.readline()
futures = [client.call_async(Trigger.Request()) for _ in range(4) for client in clients]
end = time.monotonic() + 8
while time.monotonic() < end and not all(future.done() for future in futures):
    rclpy.spin_once(node, timeout_sec=0.05)
print(sum(future.done() for future in futures), "answered of", len(futures))
print(sum(future.done() and future.result().success for index, future in enumerate(futures) if index % 5 in (0, 3, 4)), "stops")
"""


@scenario("20 calls of five service clients in flight: each stop is carried out, and the clients get their replies (Fast DDS)", 20)
def calls_in_flight(t):
    typed = Typed(t)
    bridge = typed.ride.bridge.child
    with subprocess.Popen([typed.jazzy.python, "-c", FLIGHT], env=typed.jazzy.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        t.check(child.stdout.readline() == "ready\n", "the services are there")
        bridge.send_signal(signal.SIGSTOP)  # The calls wait for the bridge together.
        child.stdin.write("\n")
        child.stdin.flush()
        time.sleep(0.3)
        bridge.send_signal(signal.SIGCONT)
        output = child.communicate(timeout=60)[0]
    answered, stops = (int(number) for number in re.findall(r"^(\d+) (?:answered|stops)", output, re.MULTILINE))
    done = len([event for event in typed.ride.rig.timeline if event.kind == "stop"])
    t.check(done == 12, f"{done} of 12 stops are carried out")
    # Every client of a service receives all of its replies, and stores 10: of 12 that arrive together it may drop 2.
    t.check(answered >= 18 and stops >= 10, output)
    t.figure(f"{answered} of 20 answered")
    typed.ride.silence()
    t.judge(typed.ride.rig, moves=False)


PUBLISHED = {
    'ros2 topic pub -r 20 /cmd_vel geometry_msgs/msg/Twist "{linear: {x: 0.2}}"': ("commands are refused", 1),
    'ros2 topic pub -r 20 /cmd_vel geometry_msgs/msg/TwistStamped "{twist: {linear: {x: 0.2}}}"': ("commands are refused", 1),
    'ros2 topic pub -r 20 /cmd_vel std_msgs/msg/String "{data: go}"': (
        "/cmd_vel are not received: one sends std_msgs/msg/String; publish geometry_msgs/msg/Twist or TwistStamped", 1,
    ),
    'ros2 topic pub -r 20 /base/cmd_vel geometry_msgs/msg/Twist "{linear: {x: 0.2}}"': ("no publisher of /cmd_vel, but /base/cmd_vel has one", 0),
    'ros2 topic pub -r 20 /cmd_vel geometry_msgs/msg/Twist "{linear: {x: .nan}}"': ("no usable numbers", 1),
}  # fmt: skip


@scenario("what a user types: publishers that do not drive, each named in /diagnostics with the fix", 60)
def typed_publishers(t):
    typed = Typed(t)
    for command, (part, level) in PUBLISHED.items():
        typed.publishes(command, part, level)
    t.judge(typed.ride.rig, moves=False)


DRIVES = ("python3 /usr/share/iwheel-ros2/drive.py 0.2 --for 2", "python3 /usr/share/iwheel-ros2/drive.py 0.2 --for 2 --stamped")


@scenario("what a user types: one command arms, drives for two seconds and stops; Twist and TwistStamped", 40)
def typed_drive(t):
    typed = Typed(t)
    for command in DRIVES:
        typed.drives(command)
    child = typed.jazzy.start(DRIVES[0].replace("--for 2", "--for 9"))
    until(typed.ride.moving, SEEN_S, "it drives")
    finish(child)
    t.check(child.returncode == 130, f"Ctrl-C: {child.returncode}")
    time.sleep(0.6)
    t.check(not typed.ride.moving(now_us() - 100_000), "Ctrl-C stops")
    t.stopped_by(typed.ride.client, "client_stop", typed.ride.client.request("status")["state"])
    typed.ride.silence()  # An e-stop restarts the hold of zero.
    typed.ride.client.request("estop")
    output = typed.jazzy.type(DRIVES[0])
    t.check("iwheel/arm: " in output and "reset" in output, f"refused with the fix: {output[-300:]}")
    t.judge(typed.ride.rig)


@scenario("the page's table and the tests have the same rows", 1)
def table_is_whole(t):
    services_typed = {f"ros2 service call /iwheel/{verb} {TRIGGER}" for verb in ("arm", "stop", "estop", "reset")}
    tested = {*GRAPH, *PUBLISHED, *DRIVES, *services_typed, "ros2 topic hz /odom", "ROS_DOMAIN_ID=99 ros2 node list"}
    t.rule(set(rows()) == tested, f"only on the page: {set(rows()) - tested}; only here: {tested - set(rows())}")


@scenario("without the profile, and from another domain, Fast DDS does not find the bridge", 20)
def typed_without_profile(t):
    typed = Typed(t)
    output = Jazzy(typed.ride.domain, profile=False).type("ros2 node list")
    t.check("/iwheel" not in output, f"{output}")
    typed.expect("ros2 node list", r"/iwheel")
    t.judge(typed.ride.rig, moves=False)


DIAGNOSTICS = """
import sys, time, rclpy
from diagnostic_msgs.msg import DiagnosticArray
rclpy.init()
node, seen = rclpy.create_node("aggregator"), set()
node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: seen.update((s.hardware_id, s.name) for s in m.status), 50)
end = time.monotonic() + 6
while time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
for hardware, name in sorted(seen):
    print(hardware, name, sep="|")
"""


@scenario("two machines in one domain: two nodes, no name twice in /diagnostics, and each drives by its own cmd_vel", 40)
def typed_two_machines(t):
    typed = Typed(t)
    ride = typed.ride
    other = Ride(t, {"ros": {"domain": ride.domain, "namespace": "w1"}, "odometry": {"base_frame": "w1/base_link", "odom_frame": "w1/odom", "tf": "yes"}})
    typed.expect("ros2 node list", r"(?m)^/iwheel$", r"(?m)^/w1/iwheel$")
    typed.expect("ros2 topic echo --once /w1/odom", r"w1/odom", r"w1/base_link")
    done = subprocess.run([typed.jazzy.python, "-c", DIAGNOSTICS], env=typed.jazzy.environment, capture_output=True, text=True, timeout=60, check=False)
    names = done.stdout.split()
    keys = {tuple(line.split("|")) for line in done.stdout.splitlines()}
    t.check(len(keys) == 16 and {hardware for hardware, _ in keys} == {"iwheel", "w1/iwheel"}, f"{len(keys)} keys: {names} {done.stderr[-300:]}")
    begin_us = now_us()
    output = typed.jazzy.type("python3 /usr/share/iwheel-ros2/drive.py 0.2 --for 1.5 --namespace w1", 40)
    t.check("and stopped" in output and other.moving(begin_us), f"/w1 drives: {output[-300:]}")
    t.rule(not ride.moving(begin_us), "the other one does not")
    other.silence()
    t.judge(ride.rig, moves=False)
    t.judge(other.rig)


RECORD = """
import sys, time, rclpy
from rclpy.qos import QoSProfile
from rclpy.parameter import Parameter
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from geometry_msgs.msg import WrenchStamped
from diagnostic_msgs.msg import DiagnosticArray
rclpy.init()
node = rclpy.create_node("recorder", parameter_overrides=[Parameter("use_sim_time", value=True)])
out = open(sys.argv[1], "wb")
def store(topic, kind):
    def write(data):
        out.write(f"{topic} {kind} {len(data)}\\n".encode() + bytes(data))
    return write
for topic, cls, kind in (("/odom", Odometry, "nav_msgs/msg/Odometry"), ("/joint_states", JointState, "sensor_msgs/msg/JointState"),
                         ("/left/wrench", WrenchStamped, "geometry_msgs/msg/WrenchStamped"), ("/diagnostics", DiagnosticArray, "diagnostic_msgs/msg/DiagnosticArray")):
    node.create_subscription(cls, topic, store(topic, kind), QoSProfile(depth=100), raw=True)
end = time.monotonic() + 5
while time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
out.close()
"""


@scenario("a recording of five seconds by rclpy, in a bag by rosbags: every message is read again; a node of simulated time receives too", 30)
def typed_bag(t):
    from rosbags.rosbag2 import Reader, Writer

    typed = Typed(t)
    raw, bag = typed.ride.rig.path("raw"), typed.ride.rig.path("bag")
    subprocess.run([typed.jazzy.python, "-c", RECORD, raw], env=typed.jazzy.environment, timeout=60, check=True)
    store, count = typed.ride.peer.store, 0
    with Writer(bag, version=9) as writer, open(raw, "rb") as file:
        connections = {}
        while head := file.readline().split():
            topic, kind, size = head[0].decode(), head[1].decode(), int(head[2])
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            count += 1
            writer.write(connections[topic], count, file.read(size))
    seen, wall_s = {}, time.time()
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            seen[connection.topic] = seen.get(connection.topic, 0) + 1
            t.check(abs(message.header.stamp.sec - wall_s) < 30, "stamps are of the wall clock, whatever time the reader uses")
            if connection.topic == "/odom":
                t.check(all(math.isfinite(number) for number in message.pose.covariance), "a covariance")
    t.check(sum(seen.values()) == count and len(seen) >= 3 and seen.get("/odom", 0) > 100, f"{count} written, {seen}")
    t.figure(f"{count} messages")
    t.judge(typed.ride.rig, moves=False)


@scenario("the gamepad node: no zero-length hold drives on; it ends by release, by missing reports, by a bad axis; it begins after a release only", 2)
def gamepad_deadman(t):
    code = Path(ROOT, "share/ros2/iwheel_bringup/scripts/joystick.py").read_text(encoding="utf-8")
    pure = "import math\n" + code[code.index("ZEROS_S =") : code.index("class JoystickNode")]
    space = {}
    exec(compile(pure, "joystick.py", "exec"), space)  # This part runs without ROS.
    pad = space["Deadman"](2.0)
    pad.report(True, 0.4, 0.0, 0.0)
    t.rule(pad.step(0.1) is None, "held from the start: nothing")
    pad.report(False, 0.0, 0.0, 0.2)
    pad.report(True, 0.4, 0.1, 0.3)
    t.rule(pad.step(2.2) == (0.4, 0.1), "it drives while it reports")
    t.rule(pad.step(2.4) == (0.0, 0.0) and pad.step(2.8) == (0.0, 0.0), "no report for 2 s: zeros")
    t.rule(pad.step(3.0) is None, "then nothing")
    pad.report(True, 0.4, 0.0, 3.1)
    t.rule(pad.step(3.2) is None, "the link is back with the button held: nothing")
    pad.report(False, 0.0, 0.0, 3.3)
    pad.report(True, 0.2, 0.0, 3.4)
    t.rule(pad.step(3.5) == (0.2, 0.0), "released and held again")
    pad.report(True, math.nan, 0.0, 3.6)
    t.rule(pad.step(3.7) == (0.0, 0.0), "a missing axis ends it")
    for wrong in (0.0, -1.0, 2.1, math.nan):
        try:
            space["Deadman"](wrong)
            t.rule(False, f"a timeout of {wrong} s is accepted")
        except ValueError:
            pass


@scenario("the gamepad's configuration applies in every namespace: joy_node does not repeat there", 15)
def gamepad_configuration(t):
    jazzy = Jazzy(1)
    code = """
import rclpy
rclpy.init()
for name, parameter in (("joy_node", "autorepeat_rate"), ("iwheel_joystick", "report_timeout")):
    print(name, rclpy.create_node(name).declare_parameter(parameter, 99.0).value)
"""
    config = os.path.join(ROOT, "share", "ros2", "iwheel_bringup", "config", "joystick.yaml")
    for namespace in ("/", "/w1", "/a/b"):
        words = [jazzy.python, "-c", code, "--ros-args", "--params-file", config, "-r", f"__ns:={namespace}"]
        done = subprocess.run(words, env=jazzy.environment, capture_output=True, text=True, timeout=30, check=False)
        t.check(done.stdout.split() == ["joy_node", "0.0", "iwheel_joystick", "2.0"], f"{namespace}: {done.stdout} {done.stderr[-300:]}")


@scenario("the gamepad node as a node: drives by joy, stops when the gamepad reports no change with the button held", 30)
def gamepad_node(t):
    typed = Typed(t)
    ride = typed.ride
    script = os.path.join(ROOT, "share", "ros2", "iwheel_bringup", "scripts", "joystick.py")
    node = Process(["env", *(f"{key}={value}" for key, value in typed.jazzy.environment.items()), typed.jazzy.python, script], ride.rig.path("pad.out"))
    ride.rig.processes.append(node)
    ride.commands()
    joy = ride.peer.writer("joy", "sensor_msgs/msg/Joy")
    joy.await_match(15)
    header = ride.peer.twist_stamped(0, time.time_ns()).header

    def report(held, axis):
        joy.write(ride.peer.make("sensor_msgs/msg/Joy", header=header, axes=[0.0, axis], buttons=[0, 0, 0, 0, held]))

    for _ in range(5):
        report(0, 0.0)
        time.sleep(0.1)
    ride.arm()
    silent_us = now_us()
    for n in range(10):
        report(1, 0.5 + n / 1000)
        silent_us = now_us()
        time.sleep(0.1)
    t.check(ride.moving(), f"it drives: {node.text()[-300:]}")
    for _ in range(35):  # A driver that repeats the last report of a gamepad whose link has died.
        report(1, 0.509)
        time.sleep(0.1)
    moved = [t_us for t_us, _, speed in ride.rig.bus.setpoints(silent_us) if speed]
    seconds = (moved[-1] - silent_us) / 1e6 if moved else 0.0
    t.check(1.5 < seconds < 2.8, f"the wheels turned for {seconds:.1f} s after the last report", True, now_us())
    t.figure(f"{seconds:.1f} s after the last report")
    ride.judge_at_rest()


@scenario("the description: xacro makes a URDF of two wheels with the names of joint_states and of the wrenches", 3)
def description(t):
    jazzy = Jazzy(1)
    path = os.path.join(ROOT, "share", "ros2", "iwheel_description", "urdf", "iwheel.urdf.xacro")
    words = f"import xacro; print(xacro.process_file({path!r}, mappings={{'radius': '0.2', 'track': '0.6', 'prefix': 'w1/'}}).toxml())"
    done = subprocess.run([jazzy.python, "-c", words], env=jazzy.environment, capture_output=True, text=True, timeout=30, check=False)
    if "No module named 'xacro'" in done.stderr:
        raise Skip("no xacro: scripts/python_packages build/ros-jazzy requirements/ros-jazzy.txt installs it")
    text = done.stdout
    for part in ('name="left_wheel_joint"', 'name="right_wheel_joint"', 'name="w1/left_handle"', 'name="w1/base_link"', 'radius="0.2"', 'xyz="0 0.3 0.2"'):
        t.rule(part in text, f"{part} is not in {text[-1500:]}")


INSTALLED = """
import os
from ament_index_python.packages import get_package_prefix, get_package_share_directory
programs = os.path.join(get_package_prefix("iwheel_bringup"), "lib", "iwheel_bringup")
print(*sorted(os.listdir(programs)))
for package, files in (("iwheel_bringup", ("launch/iwheel.launch.py", "config/joystick.yaml")),
                       ("iwheel_description", ("launch/description.launch.py", "urdf/iwheel.urdf.xacro", "rviz/iwheel.rviz"))):
    print("missing:", *(name for name in files if not os.path.isfile(os.path.join(get_package_share_directory(package), name))), flush=True)
os.execv(os.path.join(programs, "drive"), ["drive", "--help"])
"""


# Stand-ins for launch and launch_ros, which no package index has: every path and every own node of the launch files exists, and every argument is declared.
LAUNCHED = """
import os, runpy, sys, types
from ament_index_python.packages import get_package_prefix, get_package_share_directory
NAMES = {
    "launch": "LaunchDescription", "launch.actions": "DeclareLaunchArgument IncludeLaunchDescription", "launch.conditions": "IfCondition",
    "launch.launch_description_sources": "PythonLaunchDescriptionSource", "launch.substitutions": "Command LaunchConfiguration PathJoinSubstitution",
    "launch_ros": "", "launch_ros.actions": "Node", "launch_ros.parameter_descriptions": "ParameterValue", "launch_ros.substitutions": "FindPackageShare",
}
made = []
def class_of(name):
    def make(*words, **named):
        result = {"FindPackageShare": get_package_share_directory, "PathJoinSubstitution": lambda parts: os.path.join(*parts)}.get(name, lambda *_, **__: words)
        made.append((name, result(*words, **named), named))
        return made[-1][1]
    return make
for module, names in NAMES.items():
    sys.modules[module] = types.ModuleType(module)
    vars(sys.modules[module]).update({name: class_of(name) for name in names.split()})
for package, file in (("iwheel_bringup", "iwheel.launch.py"), ("iwheel_description", "description.launch.py")):
    made.clear()
    runpy.run_path(os.path.join(get_package_share_directory(package), "launch", file))["generate_launch_description"]()
    declared = {words[0] for name, words, _ in made if name == "DeclareLaunchArgument"}
    print(file, "undeclared:", *({words[0] for name, words, _ in made if name == "LaunchConfiguration"} - declared))
    print(file, "no file:", *(path for name, path, _ in made if name == "PathJoinSubstitution" and not os.path.isfile(path)))
    nodes = [(named["package"], named["executable"]) for name, _, named in made if name == "Node"]
    print(file, "no program:", *(node for node in nodes if node[0].startswith("iwheel") and not os.access(os.path.join(get_package_prefix(node[0]), "lib", *node), os.X_OK)))
    print(file, "starts:", *("/".join(node) for node in nodes))
"""


def colcon_recipe():
    """The page's commands for the packages, without the installation."""
    (page,) = Path(ROOT, "docs").rglob("ros2.md")
    block = re.search(r"^## Packages for colcon\n\n((?: {4}.+\n)+)", page.read_text(encoding="utf-8"), re.MULTILINE)
    lines = [line for line in block[1].splitlines() if "sudo apt " not in line]
    return "\n".join(lines).replace("/usr/share/iwheel-ros2", os.path.join(ROOT, "share", "ros2"))


@scenario("the page's commands for colcon build the packages with Jazzy's ament_cmake; ROS finds the nodes, the launch files and the model", 60)
def packages_for_colcon(t):
    jazzy, colcon = Jazzy(1), shutil.which("colcon")
    if colcon is None:
        raise Skip("colcon is missing: scripts/install_tools check installs it")
    # ament's scripts run in the Python of ROS, and use the modules of Debian's colcon.
    modules = [os.path.join(os.path.dirname(os.path.dirname(colcon)), "lib", "python3", "dist-packages"), "/usr/lib/python3/dist-packages"]
    with tempfile.TemporaryDirectory() as home:
        environment = {
            **jazzy.environment, "HOME": home, "PATH": os.path.dirname(jazzy.python) + ":" + os.environ["PATH"], "CMAKE_PREFIX_PATH": jazzy.folder,
            "PYTHONPATH": ":".join(modules), "INSTALLED": INSTALLED, "LAUNCHED": LAUNCHED,
        }  # fmt: skip
        script = f'set -e\n{colcon_recipe()}\npython3 -c "$LAUNCHED"\npython3 -c "$INSTALLED"'
        done = subprocess.run(["sh", "-c", script], env=environment, capture_output=True, text=True, timeout=300, check=False)
    launched = (
        r"^iwheel\.launch\.py undeclared:\n.* no file:\n.* no program:\n.* starts: joy/joy_node iwheel_bringup/joystick$",
        r"^description\.launch\.py undeclared:\n.* no file:\n.* no program:\n.* starts: robot_state_publisher/robot_state_publisher rviz2/rviz2$",
    )
    for part in (*launched, r"^drive drive\.py joystick joystick\.py$", r"^missing:\nmissing:\n", r"^usage: drive "):
        t.rule(re.search(part, done.stdout, re.MULTILINE), f"{part} is not in {done.stdout[-800:]} {done.stderr[-1200:]}")
