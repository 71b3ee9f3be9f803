# SPDX-License-Identifier: MIT
"""Who must not drive, does not: other machines, and what is old."""

import os
import subprocess
import sys
import time

from network import HERE_ADDRESS, Cable, Tape, ports_of, send_again
from ride import Ride, now_us
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


def anew(ride):
    """A bridge that knows nobody yet; its ports."""
    ride.bridge.end()
    ride.state.take()
    ride.start_bridge()
    ride.t.check(ride.await_state(lambda s: s["gateway"] == "up"), "the bridge is up again")
    return ports_of(ride.bridge.child.pid)


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
        again = anew(ride)
        t.check(again == ports, f"the same ports: {ports}, {again}")
        count = len(ride.tap.twists)
        send_again(cable, packets, path, HERE_ADDRESS)
        t.rule(len(ride.tap.twists) == count and not ride.moving(now_us() - 4_000_000), f"another machine drives: {len(ride.tap.twists) - count} commands")
        t.check(ride.client.request("status")["state"] == "listening", "nobody has armed")
        # The same packets do drive where they may: what was sent is no noise.
        again = anew(ride)
        t.check(again == ports, f"the same ports: {ports}, {again}")
        send_again(None, packets, path, "127.0.0.1")
        passed = len(ride.tap.twists) - count
        t.check(passed >= 20 and ride.moving(now_us() - 1_500_000), f"sent on this machine they drive: {passed} commands")
        t.figure(f"{len(packets)} packets: from there 0 commands, from here {passed}")
        ride.silence()
        t.judge(ride.rig)
    finally:
        cable.close()
