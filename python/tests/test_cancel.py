# SPDX-License-Identifier: MIT
"""A cancelled task ends during any wait, and its wheels stop: on every Python version that the package supports."""

import asyncio
import gc
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import pytest
from rig import SOURCES, RigCase, now_us
from stand_in import StandIn

from iwheel import AsyncGateway, Refused

pytestmark = pytest.mark.native("a race")
COUNT = int(os.environ.get("IWHEEL_CANCELLATIONS", "2400"))
END_S = 0.1
"""A cancelled task ends within this time, including its stop if the wheels are already at standstill."""
AT_MOST_S = 0.004
"""Cancellations come within this time after the start of the task: while it connects, arms, drives, leaves."""


LOST = []
"""Not empty: the cancellation was lost LOST_S ago. The tasks then end, and the test can report it."""
LOST_S = 5


# The work of a task when it is cancelled ------------------------------------------------------------------------------


async def drives_in_a_block(path):
    async with AsyncGateway(path).arm("block") as wheels:
        while not LOST:
            await wheels.drive(100, 100)


async def asks_and_drives(path):
    async with AsyncGateway(path) as gateway, gateway.arm("both") as wheels:
        while not LOST:
            await gateway.status()
            await wheels.drive(100, 100)


async def drives_for(path):
    async with AsyncGateway(path).arm("for") as wheels:
        await wheels.drive_for(60, 100, 100, on_status=lambda _: bool(LOST), rate_hz=100)


async def drives_without_a_block(path):
    wheels = await AsyncGateway(path).arm("bare")
    while not LOST:
        await wheels.drive(100, 100)


async def arms_again_and_again(path):
    async with AsyncGateway(path) as gateway:
        while not LOST:
            async with gateway.arm("again") as wheels:
                await wheels.drive(100, 100)


async def reads_events(path):
    async with AsyncGateway(path) as gateway:
        await gateway.watch("state")
        async for _ in gateway.events(timeout=1):
            if LOST:
                break


TASKS = (drives_in_a_block, asks_and_drives, drives_for, drives_without_a_block, arms_again_and_again, reads_events)


# The ways to cancel it: each returns the time -------------------------------------------------------------------------


async def by_cancel(work, seconds):
    task = asyncio.ensure_future(work)
    await asyncio.sleep(seconds)
    at = time.monotonic()
    task.cancel()
    await asyncio.wait({task})
    assert task.cancelled(), f"it ended otherwise: {task}"
    return at


async def by_timeout(work, seconds):
    at = time.monotonic() + seconds
    try:
        async with asyncio.timeout(seconds):
            await work
    except TimeoutError:
        return at
    raise AssertionError("no TimeoutError")


async def by_a_group(work, seconds):
    at = []

    async def fail():
        await asyncio.sleep(seconds)
        at.append(time.monotonic())
        raise ZeroDivisionError

    try:
        async with asyncio.TaskGroup() as group:
            group.create_task(work)
            group.create_task(fail())
    except BaseException as group_error:  # noqa: BLE001
        assert [type(error) for error in group_error.exceptions] == [ZeroDivisionError], group_error
    return at[0]


async def by_wait_for(work, seconds):
    at = time.monotonic() + seconds
    try:
        await asyncio.wait_for(work, seconds)
    except asyncio.TimeoutError:
        return at
    raise AssertionError("no TimeoutError")


WAYS = [by_cancel, by_wait_for] + ([by_timeout, by_a_group] if sys.version_info >= (3, 11) else [])


ON_ITS_WAY = 2
"""Commands that may come later: the one in flight, and one more while wait_for of Python 3.10 needs some rounds of the loop."""


class Stall:
    """Total delay of a task that sleeps 1 ms: the time that the machine, not the client, adds. A task that ends needs several rounds
    of the loop, and a busy machine can delay each of them."""

    async def __aenter__(self):
        self.late, self.begin = 0.0, time.monotonic()
        self.task = asyncio.ensure_future(self.sleep())
        return self

    async def __aexit__(self, *_):
        self.task.cancel()

    async def sleep(self):
        self.late = time.monotonic() - self.begin  # The instant is chosen before the first round; a delay between the two counts too.
        while True:
            before = time.monotonic()
            await asyncio.sleep(0.001)
            self.late += max(0.0, time.monotonic() - before - 0.001)


class Cancelled(unittest.TestCase):
    """Tests with a stand-in for the gateway."""

    def setUp(self):
        LOST.clear()
        before = signal.signal(signal.SIGALRM, lambda *_: LOST.append(True))
        self.addCleanup(signal.signal, signal.SIGALRM, before)
        self.addCleanup(signal.setitimer, signal.ITIMER_REAL, 0)

    def with_stand_in(self, story, **options):
        async def run():
            with tempfile.TemporaryDirectory() as folder:
                path = os.path.join(folder, "socket")
                stand_in = await StandIn(7, **options).listen(path)
                await story(stand_in, path)
                stand_in.server.close()

        asyncio.run(run())

    async def one(self, stand_in, path, task, way, seconds):
        before = len(stand_in.clients)
        signal.setitimer(signal.ITIMER_REAL, LOST_S)
        async with Stall() as stall:
            at = await way(task(path), seconds)
            elapsed_s = time.monotonic() - at
        signal.setitimer(signal.ITIMER_REAL, 0)
        await asyncio.sleep(0.002)  # The stand-in reads the rest of the socket.
        for client in stand_in.clients[before:]:
            if task is not drives_without_a_block:
                self.assertFalse(client.drove_since_stop(), "its block ended without a stop")
            self.assertFalse(client.may_drive, "still armed and connected")
            self.assertLessEqual(client.drives_since(at + stall.late), ON_ITS_WAY)
        self.assertLess(elapsed_s, END_S + stall.late, f"took {elapsed_s * 1000:.1f} ms, of which the machine delayed it by {stall.late * 1000:.1f} ms")

    def test_cancelled_at_any_instant_each_task_ends_and_stops(self):
        instants = random.Random(35)

        async def story(stand_in, path):
            for task in TASKS:
                for way in WAYS:
                    for _ in range(COUNT // (len(TASKS) * len(WAYS))):
                        seconds = instants.random() * AT_MOST_S
                        with self.subTest(task=task.__name__, way=way.__name__, ms=seconds * 1000):
                            await self.one(stand_in, path, task, way, seconds)

        self.with_stand_in(story)

    def test_cancelled_while_it_arms_an_open_gateway_is_not_armed(self):
        instants = random.Random(37)

        async def story(stand_in, path):
            async with AsyncGateway(path) as gateway:
                for _ in range(200):
                    task = asyncio.ensure_future(gateway.arm("arming"))
                    await asyncio.sleep(instants.random() * 0.002)
                    task.cancel()
                    await asyncio.wait({task})
                    await asyncio.sleep(0.002)
                    if task.cancelled():
                        self.assertFalse(any(client.may_drive for client in stand_in.clients))
                    else:
                        await task.result().stop()

        self.with_stand_in(story)

    def test_task_cancelled_again_while_stopping_ends_immediately(self):
        instants = random.Random(36)

        async def story(stand_in, path):
            for _ in range(200):
                task = asyncio.ensure_future(drives_in_a_block(path))
                await asyncio.sleep(instants.random() * AT_MOST_S)
                for _ in range(2):
                    task.cancel()
                    await asyncio.sleep(instants.random() * 0.001)
                await asyncio.wait({task}, timeout=1)
                self.assertTrue(task.cancelled())
                await asyncio.sleep(0.002)
                self.assertFalse(stand_in.clients and stand_in.clients[-1].may_drive)

        self.with_stand_in(story)

    def test_cancelled_task_leaves_the_others_of_its_gateway(self):
        async def story(stand_in, path):
            async with AsyncGateway(path) as gateway, gateway.arm("others") as wheels:
                for n in range(200):
                    asking = asyncio.ensure_future(gateway.status())
                    await asyncio.sleep(0.00001 * n)
                    asking.cancel()
                    await asyncio.wait({asking})
                    await wheels.drive(100, 100)
            self.assertEqual(len(stand_in.clients), 1)

        self.with_stand_in(story)


class Dropped(unittest.TestCase):
    """Connections end with their owner. Selected together with the cancellations: a dropped task is the same kind."""

    with_stand_in = Cancelled.with_stand_in

    async def open_after(self, stand_in):
        gc.collect()
        await asyncio.sleep(0.01)
        return sum(client.open for client in stand_in.clients)

    def test_refused_arms_leave_no_connection_to_cancel(self):
        async def story(stand_in, path):
            stored = []
            for _ in range(50):
                try:
                    async with AsyncGateway(path).arm("retry"):
                        pass
                except Refused as refusal:
                    stored.append(refusal)  # Its traceback refers to all objects of the call.
            self.assertEqual(len(stored), 50)
            self.assertEqual(await self.open_after(stand_in), 0)

        self.with_stand_in(story, refused=("arm",))

    def test_dropped_gateways_leave_no_connection_to_cancel(self):
        async def story(stand_in, path):
            for _ in range(50):
                await AsyncGateway(path).status()
                wheels = await AsyncGateway(path).arm("dropped")
                await wheels.drive(100, 100)
                del wheels
            self.assertEqual(await self.open_after(stand_in), 0)

        self.with_stand_in(story)

    def test_a_gateway_serves_one_event_loop_after_the_other(self):
        stored = []

        async def story(stand_in, path):
            stored[:] = stored or [AsyncGateway(path)]
            stored[0]._path = path
            await stored[0].status()

        for _ in range(3):
            self.with_stand_in(story)
        stored[0].close()

    def test_a_dropped_task_cancels_its_permission(self):
        async def story(stand_in, path):
            gateway = AsyncGateway(path)

            async def drive():
                async with gateway.arm("dropped") as wheels:
                    while True:
                        await wheels.drive(100, 100)

            work = drive()
            waits = None
            while not any(cmd == "drive" for client in stand_in.clients for _, cmd in client.asked):
                waits = work.send(None)
                while not waits.done():
                    await asyncio.sleep(0)
            work.close()
            self.assertEqual(await self.open_after(stand_in), 0)

        self.with_stand_in(story)


class CancelledWithRig(RigCase):
    """Tests with the real gateway and simulated wheels."""

    def test_cancelled_once_each_of_300_tasks_that_ask_ends(self):
        async def ask(gateway):
            while True:
                await gateway.status()

        async def story():
            instants = random.Random(13)
            async with AsyncGateway(self.socket) as gateway:
                for _ in range(300):
                    task = asyncio.ensure_future(ask(gateway))
                    await asyncio.sleep(0.003 + instants.random() * 0.006)
                    task.cancel()
                    done, _ = await asyncio.wait({task}, timeout=1)
                    self.assertTrue(done, "cancel() had no effect")

        asyncio.run(story())

    def test_cancelled_while_it_drives_the_wheels_stop(self):
        async def work(gateway):
            async with gateway.arm("cancelled") as wheels:
                while True:
                    await gateway.status()
                    await wheels.drive(150, 150)

        async def story():
            instants = random.Random(14)
            async with AsyncGateway(self.socket) as gateway:
                for way in WAYS * 2:
                    await way(work(gateway), 1.2 + instants.random() * 0.05)
                    at_us = now_us()
                    self.assert_stood_by(at_us, 0)

        asyncio.run(story())

    def run_program(self, script, *end):
        child = subprocess.Popen(
            [sys.executable, "-c", "import asyncio, os, sys, threading, time\nfrom iwheel import *\n" + script, self.socket],
            env={**os.environ, "PYTHONPATH": os.pathsep.join([SOURCES, os.environ.get("PYTHONPATH", "")])},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.addCleanup(child.wait)
        self.addCleanup(child.kill)
        child.stdout.readline()
        time.sleep(0.5)
        self.assertGreater(self.last_motion_us(), now_us() - 200_000, "it does not drive")
        for number in end:
            child.send_signal(number)
        ended_us = now_us()
        _, output = child.communicate(timeout=10)
        time.sleep(0.8)
        self.assert_stood_by(ended_us, 1100)
        self.assertNotIn("Exception ignored", output)
        self.assertNotIn("was destroyed", output)
        return output

    DRIVE = (
        "async def drive():\n"
        "    async with AsyncGateway(sys.argv[1]).arm('x') as w:\n"
        "        print('armed', flush=True)\n"
        "        while True: await w.drive(200, 200)\n"
    )

    def test_cancelled_by_ctrl_c_the_wheels_stop(self):
        output = self.run_program(self.DRIVE + "asyncio.run(drive())\n", signal.SIGINT)
        self.assertIn("KeyboardInterrupt", output)

    def test_cancelled_by_the_end_of_its_loop_the_wheels_stop(self):
        self.run_program(self.DRIVE + "async def main():\n    task = asyncio.ensure_future(drive())\n    await asyncio.sleep(1.2)\nasyncio.run(main())\n")

    def test_cancelled_by_the_end_of_the_interpreter_the_wheels_stop(self):
        self.run_program(self.DRIVE + "threading.Thread(target=lambda: asyncio.run(drive()), daemon=True).start()\ntime.sleep(1.2)\n")

    def test_cancelled_from_another_thread_the_wheels_stop(self):
        self.run_program(
            self.DRIVE + "async def main():\n"
            "    global loop, task\n"
            "    loop, task = asyncio.get_running_loop(), asyncio.ensure_future(drive())\n"
            "    await asyncio.wait({task})\n"
            "thread = threading.Thread(target=lambda: asyncio.run(main()))\n"
            "thread.start()\n"
            "time.sleep(1.2)\n"
            "loop.call_soon_threadsafe(task.cancel)\n"
            "thread.join()\n"
        )

    def test_closed_from_another_thread_the_lease_is_cancelled(self):
        self.run_program(
            "async def drive():\n"
            "    global gateway\n"
            "    gateway = AsyncGateway(sys.argv[1])\n"
            "    wheels = await gateway.arm('x')\n"
            "    print('armed', flush=True)\n"
            "    try:\n"
            "        while True: await wheels.drive(200, 200)\n"
            "    except ConnectionLost: pass\n"
            "thread = threading.Thread(target=lambda: asyncio.run(drive()))\n"
            "thread.start()\n"
            "time.sleep(1.2)\n"
            "gateway.close()\n"
            "thread.join()\n"
        )

    def test_killed_or_cancelled_a_forked_child_holds_nothing(self):
        output = self.run_program(
            self.DRIVE.replace(
                "        while True",
                "        await w.drive(200, 200)\n"
                "        if os.fork() == 0:\n"
                "            try: await w.drive(200, 200)\n"
                "            except ConnectionLost: print('refused', file=sys.stderr, flush=True)\n"
                "            os._exit(0)\n"
                "        while True",
            )
            + "asyncio.run(drive())\n",
            signal.SIGKILL,
        )
        self.assertIn("refused", output)


if __name__ == "__main__":
    unittest.main()
