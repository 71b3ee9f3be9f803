# SPDX-License-Identifier: MIT
"""AsyncGateway and AsyncArmed with the real daemon."""

import asyncio
import signal
import threading
import time
import unittest
import warnings
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import pytest
from rig import RigCase, now_us

from iwheel import AsyncGateway, ConnectionLost, GatewayUnavailable, LeaseEnded, Refused


class Async(RigCase):
    def run_async(self, coroutine, seconds=20):
        return asyncio.run(asyncio.wait_for(coroutine, seconds))

    def test_drives_and_is_at_standstill_after_the_block(self):
        async def story():
            async with AsyncGateway(self.socket).arm("example") as wheels:
                return await wheels.drive_for(0.5, 200, 200)

        self.assertEqual(self.run_async(story()).left_mm_s, 200)
        self.assert_stood_by(now_us(), 0)

    def test_stop_never_refused_in_another_event_loop(self):
        wheels, armed, end = [], threading.Event(), threading.Event()

        async def drive():
            async with AsyncGateway(self.socket) as gateway:
                wheels.append(await gateway.arm("server"))
                await wheels[0].drive(200, 200)
                armed.set()
                while not end.is_set():
                    await asyncio.sleep(0.02)

        server = threading.Thread(target=asyncio.run, args=[drive()])
        server.start()
        armed.wait(5)
        self.assertTrue(self.run_async(wheels[0].stop()))
        self.assertEqual(self.run_async(wheels[0]._gateway.estop("button")), "latched")
        end.set()
        server.join()

    def test_stop_never_waits_for_a_thread_of_the_executor(self):
        async def story():
            over = threading.Event()
            loop = asyncio.get_running_loop()
            loop.set_default_executor(ThreadPoolExecutor(1))
            job = loop.run_in_executor(None, over.wait, 10)
            try:
                self.assertEqual(await asyncio.wait_for(AsyncGateway(self.socket).stop(), 3), "listening")
                with mock.patch("threading.Thread.start", side_effect=RuntimeError("can't start new thread")):
                    self.assertEqual(await AsyncGateway(self.socket).stop(), "listening")
                cancelled = asyncio.ensure_future(AsyncGateway(self.socket).estop("cancelled"))
                await asyncio.sleep(0)
                cancelled.cancel()
                await asyncio.sleep(0.2)
                self.assertTrue(cancelled.cancelled())
                self.assertEqual((await AsyncGateway(self.socket).status())["state"], "latched")
            finally:
                over.set()
            await job

        self.run_async(story())

    def test_a_cancelled_task_stops_the_wheels(self):
        async def drive():
            async with AsyncGateway(self.socket).arm() as wheels:
                await wheels.drive_for(60, 300, 300)

        async def story():
            task = asyncio.ensure_future(drive())
            await asyncio.sleep(0.6)
            task.cancel()
            cancelled_us = now_us()
            with self.assertRaises(asyncio.CancelledError):
                await task
            return cancelled_us

        self.assert_stood_by(self.run_async(story()), 500)

    def test_task_cancelled_twice_ends_promptly_and_wheels_stop(self):
        async def drive():
            async with AsyncGateway(self.socket).arm() as wheels:
                await wheels.drive_for(60, 300, 300)

        async def story():
            task = asyncio.ensure_future(drive())
            await asyncio.sleep(0.6)
            begin_us = now_us()
            task.cancel()
            await asyncio.sleep(0.005)
            task.cancel()
            with self.assertRaises(asyncio.CancelledError):
                await task
            return begin_us

        begin_us = self.run_async(story())
        time.sleep(1)
        self.assert_stood_by(begin_us, 500)

    def test_a_blocked_event_loop_loses_the_lease(self):
        async def story():
            async with AsyncGateway(self.socket) as gateway:
                wheels = await gateway.arm()
                await wheels.drive_for(0.4, 300, 300)
                blocked_us = now_us()
                time.sleep(1.4)
                self.assert_stood_by(blocked_us, 1087)
                with self.assertRaises(LeaseEnded) as caught:
                    await wheels.drive(300, 300)
                self.assertEqual(caught.exception.error, "not_armed")
                with self.assertRaises(LeaseEnded):
                    await wheels.drive(300, 300)
                return (await gateway.why())["cause"]

        self.assertEqual(self.run_async(story()), "lease_lost")

    def test_a_killed_gateway_ends_the_permission_and_is_found_again(self):
        async def story():
            async with AsyncGateway(self.socket, wait=5) as gateway:
                with warnings.catch_warnings(record=True):
                    warnings.simplefilter("always")
                    async with gateway.arm() as wheels:
                        await wheels.drive_for(0.3, 300, 300)
                        self.rig.kill_gateway(signal.SIGKILL)
                        killed_us = now_us()
                        with self.assertRaises(GatewayUnavailable):
                            await wheels.drive_for(1, 300, 300)
                        self.rig.start_gateway(restart_hold=True)
                        with self.assertRaises(LeaseEnded):
                            await wheels.drive(300, 300)
                await asyncio.sleep(0.5)
                self.assert_stood_by(killed_us, 90)
                return (await gateway.status())["state"]

        self.assertIn(self.run_async(story()), ("listening", "stopping"))

    def test_lost_lease_with_unread_events_is_reported(self):
        async def story():
            async with AsyncGateway(self.socket) as gateway:
                await gateway.watch("lease", "stop")
                wheels = await gateway.arm()
                await wheels.drive(200, 200)
                time.sleep(1.4)  # The loop does not run, so the received events are still in the socket.
                with self.assertRaises(LeaseEnded):
                    await wheels.drive_for(1, 200, 200)
                return [event.get("change", event.get("cause")) async for event in gateway.events(timeout=0.3)]

        self.assertEqual(self.run_async(story()), ["gained", "lease_lost", "lost"])

    def test_connection_end_not_yet_read_counts_as_ended_lease(self):
        async def story():
            async with AsyncGateway(self.socket) as gateway:
                wheels = await gateway.arm()
                await wheels.drive(100, 100)
                self.rig.kill_gateway(signal.SIGKILL)
                with self.assertRaises(ConnectionLost):
                    await wheels.drive(100, 100)

        self.run_async(story())

    def test_arming_right_after_a_clean_stop_waits_it_out(self):
        async def story():
            for _ in range(2):
                async with AsyncGateway(self.socket).arm("again") as wheels:
                    await wheels.drive_for(0.3, 300, 300)
            async with AsyncGateway(self.socket) as gateway:
                with self.assertRaises(Refused) as caught:
                    await gateway.arm(wait=0)
                return caught.exception.error

        self.assertEqual(self.run_async(story()), "stale_command")
        self.assert_stood_by(now_us(), 0)

    def test_stop_of_another_client_ends_an_arm_that_waits(self):
        async def drive():
            async with AsyncGateway(self.socket).arm(wait=10) as wheels:
                await wheels.drive_for(0.3, 200, 200)

        async def story(seconds):
            hand = self.rig.hand()
            self.addCleanup(hand.let_go)
            async with AsyncGateway(self.socket) as other:
                while (await other.status())["left"]["at_rest"]:
                    await asyncio.sleep(0.02)
                task = asyncio.ensure_future(drive())
                await asyncio.sleep(seconds)
                await other.stop()
                hand.let_go()
                with self.assertRaisesRegex(Refused, r"the wheels were stopped after t_us .* \(it was refused before, because the wheels turn"):
                    await task
                await asyncio.sleep(1)

        for seconds in (0.3, 1.5):  # The second one is longer than max_age_ms.
            self.run_async(story(seconds))
            self.assert_never_moved()

    def test_task_cancelled_while_arming_leaves_nothing_armed(self):
        async def drive():
            async with AsyncGateway(self.socket).arm(wait=30):
                pass

        async def story():
            async with AsyncGateway(self.socket) as gateway:
                await (await gateway.arm()).drive_for(0.3, 300, 300)
                await gateway.stop()
                task = asyncio.ensure_future(drive())
                await asyncio.sleep(0.1)
                task.cancel()
                with self.assertRaises(asyncio.CancelledError):
                    await task
                await asyncio.sleep(1.5)
                return (await gateway.status())["lease"]["holder"]

        self.assertIsNone(self.run_async(story()))

    def test_drive_for_reports_status_and_true_ends_it(self):
        seen = []

        def collect(status):
            seen.append(status["left"]["speed_mm_s"])
            return seen[-1] > 150

        async def story():
            async with AsyncGateway(self.socket).arm() as wheels:
                return await wheels.drive_for(30, 300, 300, on_status=collect, rate_hz=40)

        begin = time.monotonic()
        self.assertEqual(self.run_async(story()).left_mm_s, 300)
        self.assertLess(time.monotonic() - begin, 4)
        self.assertGreater(len(seen), 3)
        self.assert_stood_by(now_us(), 0)

    @pytest.mark.pace(1)
    def test_replies_of_the_gateway_are_returned(self):
        async def story():
            async with AsyncGateway(self.socket) as gateway:
                self.assertEqual((await gateway.confirm("wheel_radius", 192.0))["state"], "confirmed")
                self.assertEqual((await gateway.confirm("track", 540, how="a tape"))["how"], "a tape")
                with self.assertRaises(Refused):
                    await gateway.config("drive.lease_ms", 300)
                self.assertTrue((await gateway.watch("state", rate_hz=500.0))["limited"])
                await gateway.watch()
                await asyncio.sleep(3)
                self.assertEqual(set(await gateway.tare("right")), {"state", "right"})
                self.assertEqual((await gateway.stop(), await gateway.estop()), ("listening", "latched"))
                with self.assertRaises(ValueError):
                    await gateway.watch("state", rate_hz=0.5)

        self.run_async(story())

    def test_watching_and_driving_side_by_side(self):
        async def watch(speeds):
            async with AsyncGateway(self.socket) as gateway:
                await gateway.watch("state", rate_hz=20)
                async for event in gateway.events():
                    speeds.append(event["left"]["speed_mm_s"])

        async def story():
            speeds = []
            watcher = asyncio.ensure_future(watch(speeds))
            async with AsyncGateway(self.socket).arm() as wheels:
                await wheels.drive_for(0.8, 200, 200)
            watcher.cancel()
            return speeds

        self.assertGreater(max(self.run_async(story())), 150)

    def test_events_report_a_restart(self):
        async def story():
            seen = []
            async with AsyncGateway(self.socket, wait=5) as gateway:
                await gateway.watch("state", rate_hz=20)
                async for event in gateway.events(timeout=5):
                    seen.append(event["event"])
                    if len(seen) == 3:
                        self.rig.kill_gateway(signal.SIGTERM)
                        self.rig.start_gateway(wheels=False)
                    if seen[-1] == "state" and "reconnected" in seen:
                        break
            return seen

        self.assertEqual([n for n in self.run_async(story()) if n != "state"], ["disconnected", "reconnected"])


if __name__ == "__main__":
    unittest.main()
