# SPDX-License-Identifier: MIT
"""Hours of one gateway under random faults. Each episode is judged at its end and then deleted."""

import random
import signal
import time

import netdev
from bus import EXTENDED, REMOTE
from catalogue import kernel_test
from client import Client
from harness import now_us
from judge import Judge
from judge_log import LEFT, RIGHT, percentile
from kernel_rig import ESTOP_US, RAW_ESTOP_US

from .host import step_clock

SETTLE_EPISODES = 40  # memory is compared from here on: every kind of fault has been seen, every page touched
MEMORY_kB = 64
SLOW = "10"  # speed frames every 40 ms instead of 4, while idle and in nine episodes of ten; as documented in the tenth
STUCK_S = 20.0
PAUSE_S, ASLEEP_S = 20.0, 40.0  # the longest, between two episodes; wheels that sleep cost hardly anything, and about nine episodes of each kind remain
ASLEEP_OF_A_DAY_S, DAY_H = 80.0, 4.0  # a soak longer than DAY_H has about a hundred of each kind anyway
TURNING_mm_s = 100  # the left wheel is commanded more than that, so that every episode turns a wheel
WHOLE_H = 0.5  # a soak of this length must have had every kind of fault, and its memory must be stable
# Linux 6.1 has 512 line numbers, and never frees those of a chip that was removed while one of its lines was requested.
CHIPS_LOST_MAX = 50


class Soak:
    """The state of one soak; `fault_*` methods each inject one fault in motion and undo it."""

    def __init__(self, t, rig, seed):
        self.t, self.rig, self.chance = t, rig, random.Random(seed)
        self.client = rig.client("soak")
        self.counts, self.episode, self.gap_us, self.presses = {}, 0, 0, 0
        self.latencies = []
        self.faults = sorted(name for name in dir(self) if name.startswith("fault_"))
        self.baseline = None

    # Driving ----------------------------------------------------------------------------------------------------------

    def drive(self, seconds):
        """Drives with changing speeds; ends early when refused."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            left = self.chance.choice((-1, 1)) * self.chance.randrange(TURNING_mm_s, 700)
            right = self.chance.randrange(-700, 700)
            for _ in range(self.chance.randrange(2, 12)):
                if not self.client.drive(left, right)["ok"]:
                    return
                time.sleep(self.chance.choice((0.02, 0.05, 0.1, 0.15)))

    def cut(self, within_ms):
        self.rig.note("cut", within_us=within_ms * 1000)

    def wait(self, low, high):
        time.sleep(self.chance.uniform(low, high))

    def settle(self):
        """Resets until the gateway listens again. Returns False if that takes too long."""
        end = time.monotonic() + STUCK_S
        while time.monotonic() < end:
            status = self.client.request("status")
            if status["state"] == "listening" and not status["present"]:
                self.rig.note("silent")
                return True
            if status["state"] == "latched":
                self.client.request("reset")
            time.sleep(0.1)
        self.t.check(False, f"{self.where()}: stuck in {status['state']}, {status['cause']}, present {status['present']}")
        return False

    def where(self):
        return f"episode {self.episode} ({self.kind}) of seed {self.t.plan['seed']}"

    # Faults -----------------------------------------------------------------------------------------------------------

    def fault_none(self):
        self.client.request("stop")

    def fault_lease(self):
        time.sleep(0.5)

    def fault_client_gone(self):
        self.client.close(holder=True)
        time.sleep(0.05)
        self.client = self.rig.client("soak")

    def fault_software_estop(self):
        self.client.request("estop", reason="soak")

    def fault_press(self):
        self.rig.press()
        self.presses += 1
        self.wait(0.01, 1.0)
        self.rig.release()

    def fault_pulse(self):
        self.rig.pulse(self.chance.uniform(0.0005, 0.02))
        self.presses += 1

    def fault_chip_vanishes(self):
        self.rig.lose_chip()
        self.wait(0.05, 1.0)
        self.rig.find_chip()
        if self.counts[self.kind] == CHIPS_LOST_MAX:
            self.faults.remove(self.kind)

    def lose(self, command, side, within_ms):
        """One wheel offline ends in a ramp, both offline in an immediate zero."""
        self.rig.fault(command, "cut" if side == "both" else "ramp", within_ms=within_ms)

    def fault_mute(self):
        side = self.chance.choice(("left", "right", "both"))
        self.lose(f"mute {side}", side, 90)
        self.wait(0.15, 2.0)
        self.rig.sim.ask(f"unmute {side}")

    def fault_reboot(self):
        side = self.chance.choice(("left", "right", "both"))
        self.lose(f"reboot {side}", side, 120)  # It sends nothing for a while.
        self.wait(0.3, 1.0)

    def fault_down(self):
        self.rig.note("dead")
        self.cut(60)
        netdev.down(self.rig.interface)
        self.wait(0.0, 0.6)
        netdev.up(self.rig.interface)
        self.rig.note("alive")

    def fault_no_buffers(self):
        self.rig.note("dead")
        self.cut(150)
        netdev.discipline(self.rig.interface, "pfifo", "limit", "0")
        self.wait(0.1, 0.6)
        netdev.discipline(self.rig.interface)
        self.rig.note("alive")

    def fault_foreign(self):
        self.cut(30)
        self.rig.bus.send(self.chance.choice((LEFT, RIGHT)), b"\1\0\x50\7\xd0")

    def fault_odd_frames(self):
        for _ in range(20):
            can_id = self.chance.choice((256, 257, 288, 289, 512, LEFT)) | self.chance.choice((EXTENDED, REMOTE))
            self.rig.bus.send(can_id, bytes(self.chance.randrange(256) for _ in range(self.chance.randrange(9))))
            time.sleep(0.003)
        self.client.request("stop")

    def fault_unknown_ids(self):
        for _ in range(200):
            self.rig.bus.send(self.chance.randrange(0x300, 0x7FF), bytes(8))
            if self.chance.random() < 0.2:
                time.sleep(0.001)
        self.client.request("stop")

    def fault_process_stopped(self):
        seconds = self.chance.uniform(0.15, 1.5)
        self.rig.note("dead")
        self.cut(int(seconds * 1000) + 60)
        self.rig.gateway.signal(signal.SIGSTOP)
        time.sleep(seconds)
        self.rig.gateway.signal(signal.SIGCONT)
        self.rig.note("alive")

    def fault_wall_clock(self):
        step_clock(self.rig, self.chance.randrange(-3600, 3600) * 10**9)
        self.drive(0.5)
        self.client.request("stop")

    def fault_visitors(self):
        """Observers, invalid requests and half lines next to the owner."""
        for number in range(20):
            stray = Client(self.rig.path("gateway.sock"), [])
            if number % 3 == 0:
                stray.send_raw(bytes(self.chance.randrange(1, 256) for _ in range(200)) + b"\n")
            elif number % 3 == 1:
                stray.request("watch", topics=["state", "frame"], rate_hz=50)
            else:
                stray.send_raw(b'{"cmd":"drive","left_mm_s":900')
            self.client.drive(100, 100)
            stray.close()
        self.client.request("stop")

    def idle(self):
        """No client drives. Three times of four the wheels sleep meanwhile, which saves the test most of its work."""
        asleep = self.chance.random() < 0.75
        if asleep:
            self.rig.sim.ask("mute both")
        longest_asleep_s = ASLEEP_OF_A_DAY_S if self.t.plan["hours"] > DAY_H else ASLEEP_S
        self.wait(0.1, longest_asleep_s if asleep else PAUSE_S)
        if asleep:
            self.rig.sim.ask("unmute both")
            time.sleep(0.5)

    # Judging ----------------------------------------------------------------------------------------------------------

    def one(self):
        """One episode: arm, drive, one fault and its end; then no commands, and the verdict. False: end the soak."""
        self.episode += 1
        self.kind = self.chance.choice(self.faults)
        self.counts[self.kind] = self.counts.get(self.kind, 0) + 1
        self.rig.sim.ask(f"slow {1 if self.episode % 10 == 0 else SLOW}")
        self.t.arm(self.client)
        self.drive(self.chance.uniform(0.3, 4.0))
        getattr(self, self.kind)()
        settled = self.settle()
        self.rig.sim.ask(f"slow {SLOW}")
        self.idle()
        self.verdict()
        self.resources()
        if self.episode % 50 == 0:
            print(f"soak: {self.episode} episodes, {now_us() / 3.6e9:.2f} h", flush=True)
        return settled and not self.t.failures

    def verdict(self):
        frames, events = self.rig.bus.frames[:], self.rig.timeline[:]
        judge = Judge(self.rig.judge_config(), frames, events, finished_us=now_us(), estop_limit_us=RAW_ESTOP_US)
        for found in judge.judge()[:5]:
            self.t.failures.append([f"{self.where()}: {found.rule}: {found.text}", "rule", found.t_us])
        self.gap_us = max(self.gap_us, judge.gap_max_us)
        latencies = [self.t.after_edge(self.rig, judge, *pair) for pair in judge.estop_latencies]
        for at_us, latency_us in latencies:
            text = f"{self.where()}: {latency_us / 1000:.2f} ms from the e-stop to the zero pair"
            self.t.check(latency_us <= ESTOP_US, text, at_us=at_us)
        self.latencies += latencies
        self.rig.presses.clear()
        if not self.t.failures:  # else they are shown
            del self.rig.bus.frames[: len(frames)]
            del self.rig.timeline[: len(events)]
            self.client.events.clear()

    def resources(self):
        now = (self.rig.gateway.resident_kB(), self.rig.gateway.descriptors())
        if self.episode == SETTLE_EPISODES:
            self.baseline = now
        if self.baseline:
            self.t.check(now[0] <= self.baseline[0] + MEMORY_kB, f"{self.where()}: memory {self.baseline[0]} to {now[0]} kB")
            self.t.check(now[1] <= self.baseline[1], f"{self.where()}: descriptors {self.baseline[1]} to {now[1]}")


@kernel_test("hours of one gateway with random faults", "soak", 0)
def soak(t):
    rig, first = t.running()
    first.close()
    hours = t.plan["hours"]
    run = Soak(t, rig, t.plan["seed"])
    begin = time.monotonic()
    while time.monotonic() - begin < hours * 3600 and run.one():
        pass
    lived_h = (time.monotonic() - begin) / 3600
    thorough(t, run, hours)
    t.latencies += run.latencies
    p99_us = percentile([latency_us for _, latency_us in run.latencies] or [0], 99)
    t.check(p99_us <= ESTOP_US, f"e-stop to zero pair, p99 {p99_us / 1000:.2f} ms")
    t.measure("gap_ms", run.gap_us / 1000)
    memory_kB, descriptors = rig.gateway.resident_kB(), rig.gateway.descriptors()
    t.figure(f"{lived_h:.2g} h, {run.episode} episodes, {run.presses} presses, longest gap {run.gap_us / 1000:.0f} ms")
    t.figure(f"memory {run.baseline[0]} to {memory_kB} kB, {descriptors} descriptors" if run.baseline else f"memory {memory_kB} kB")


def thorough(t, run, hours):
    """It had every kind of fault, and ran long enough to compare memory. A shorter soak prints what it cannot judge."""
    missing = sorted(name[len("fault_") :] for name in set(run.faults) - set(run.counts))
    if t.failures:
        return
    if hours >= WHOLE_H:
        t.check(not missing, f"faults that never happened: {missing}")
        t.check(run.baseline, "too short to compare memory")
        return
    if missing:
        t.figure(f"too short for {len(missing)} of {len(run.faults)} kinds of fault: {', '.join(missing)}")
    if not run.baseline:
        t.figure(f"too short to compare memory, which takes {SETTLE_EPISODES} episodes")
