# SPDX-License-Identifier: MIT
"""Driving without faults."""

import json
import time

from scenario import scenario


@scenario("arm, drive, turn, stop, nothing sent afterwards", 8)
def nominal_drive_and_turn(t):
    rig, client = t.running()
    reply = t.arm(client)
    t.check(reply["lease_ms"] == 200 and reply["stop_budget_ms"] <= 1000, f"the reply to arm has lease and stop budget: {reply}")
    t.drive_for(client, 400, 400, 1.5)
    status = client.request("status")
    for side in ("left", "right"):
        measured = status[side]["speed_mm_s"]
        t.check(measured is not None and abs(measured - 400) <= 40, f"{side} wheel runs {measured} mm/s at 400 mm/s commanded")
        t.check(status[side]["applied_mm_s"] == 400, f"{side} applied {status[side]['applied_mm_s']} mm/s")
    t.figure(f"measured {status['left']['speed_mm_s']}/{status['right']['speed_mm_s']} mm/s")
    t.check(status["lease"]["name"] == "test" and 0 < status["lease"]["remaining_ms"] <= 200, f"lease in status: {status['lease']}")
    t.drive_for(client, -200, 200, 1.2)
    status = client.request("status")
    t.check(status["left"]["speed_mm_s"] < -150 and status["right"]["speed_mm_s"] > 150, "the machine turns on the spot")
    t.expect(client.request("stop"))
    t.check(client.request("status")["state"] == "stopping", "stop leads to stopping")
    t.silence(rig, client, text="listening again after the hold")
    why = t.stopped_by(client, "client_stop", "listening")
    t.check(not why["latched"], "a stop does not latch")
    truth = json.loads(rig.sim.ask("status"))
    t.check(truth is not None, "the simulator reports its state")
    time.sleep(0.3)
    t.judge(rig)


@scenario("arming alone moves nothing; the first lease ends on its own", 5)
def arm_moves_nothing(t):
    rig, client = t.running()
    t.arm(client)
    begin = time.monotonic()
    t.check(rig.wait_status(client, lambda s: s["state"] == "stopping", 2), "the lease ends without a drive")
    t.figure(f"lease ended after {time.monotonic() - begin:.2f} s")
    t.check(0.8 <= time.monotonic() - begin <= 1.3, "the first lease is one second", True)
    t.silence(rig, client, 3, "then nothing is sent")
    t.stopped_by(client, "lease_lost", "listening")
    t.rule(not any(speed for _, _, speed in rig.bus.setpoints()), "nothing but zeros")
    t.judge(rig, moves=False)


@scenario("commands above the limits, and twist", 5)
def limits_and_twist(t):
    rig, client = t.running({"wheels": {"track_mm": 540}})
    t.arm(client)
    reply = client.drive(2000, 1000)
    t.check(reply["ok"] and (reply["left_mm_s"], reply["right_mm_s"], reply["limited"]) == (1000, 500, True), f"both scaled by one factor: {reply}")
    reply = client.drive(100, -100, left_mA=500, right_mA=600)
    t.check(reply["ok"] and (reply["left_mA"], reply["right_mA"], reply["limited"]) == (600, 600, True), f"both wheels get the larger limit: {reply}")
    reply = client.request("twist", v_mm_s=300, yaw_mrad_s=500)
    t.check(reply["ok"] and (reply["left_mm_s"], reply["right_mm_s"]) == (165, 435), f"twist to wheels: {reply}")
    reply = client.request("twist", v_mm_s=300, yaw_mrad_s=2000)
    t.check(reply["ok"] and (reply["left_mm_s"], reply["right_mm_s"], reply["limited"]) == (-120, 420, True), f"turned by 1 rad/s, in the same curve: {reply}")
    t.drive_for(client, 165, 435, 0.8)
    t.stop_for(client, 0.6)
    t.judge(rig)


@scenario("mirrored wheel, current as setpoint, eight bytes, other type", 5)
def other_configuration(t):
    rig, client = t.running(
        {
            "wheels": {"setpoint_type": 7, "current_role": "setpoint", "setpoint_dlc": 8},
            "left": {"invert": "yes"},
            "drive": {"accel_mm_s2": 2000, "decel_mm_s2": 3000, "lease_ms": 300, "max_current_mA": 1500},
        }
    )
    t.arm(client)
    t.expect(client.drive(300, 300), "missing_field")
    refusal = None
    for _ in range(20):
        reply = client.drive(300, 300, left_mA=1000, right_mA=1000)
        refusal = refusal or (None if reply["ok"] else reply)
        time.sleep(0.05)
    t.check(refusal is None, f"drive with currents: {refusal}")
    left = [frame for frame in rig.bus.frames if frame.id == 266 and frame.data[1:3] == (-300).to_bytes(2, "big", signed=True)]
    t.check(
        left and all(frame.data[3:5] == (-1000).to_bytes(2, "big", signed=True) for frame in left[2:]), "speed and current are negated for the mirrored wheel"
    )
    client.request("stop")
    t.silence(rig, client, text="nothing is sent at the end")
    t.judge(rig)


@scenario("force: the wheel's offset, a load, tare", 12)
def force_offset_and_tare(t):
    rig, client = t.running()
    status = rig.wait_status(
        client, lambda s: all(s[side]["offset_provenance"] == "wheel" and s[side]["force_validity"] == "valid" for side in ("left", "right")), 6
    )
    if not t.check(status, f"both offsets come from the wheels: {[client.request('status')[s]['offset_provenance'] for s in ('left', 'right')]}"):
        return
    for side in ("left", "right"):
        t.check(abs(status[side]["force_net_mN"]) < 3000, f"{side} without load: {status[side]['force_net_mN']} mN")
    rig.sim.ask("load left 50")
    time.sleep(1.0)
    net = client.request("status")["left"]["force_net_mN"]
    t.check(net is not None and 45_000 <= net <= 55_000, f"50 N on the left shows as {net} mN")
    t.figure(f"50 N shows as {(net or 0) / 1000:.1f} N")
    time.sleep(2.2)
    t.expect(client.request("tare", side="left"), "denied")
    rig.sim.ask("load left 0")
    time.sleep(3.2)
    t.expect(client.request("tare", side="left"))
    status = client.request("status")
    t.check(status["left"]["offset_provenance"] == "operator", f"tare counts as the operator's: {status['left']['offset_provenance']}")
    t.check(status["right"]["offset_provenance"] == "wheel", "the other wheel is untouched")
    t.rule(not rig.bus.setpoints(), "none of these requests sends a setpoint")
    t.judge(rig, moves=False)


@scenario("unknown is null, never zero", 3)
def unknown_is_null(t):
    rig, client = t.running(sim=("power off",), wheels=False)
    status = client.request("status")
    for side in ("left", "right"):
        for key in ("speed_rpm", "speed_mm_s", "battery_dV", "ticks", "force_net_mN", "applied_mm_s", "speed_age_ms"):
            t.check(status[side][key] is None, f"{side} {key} is {status[side][key]} although it was never received")
    t.expect(client.arm(), "wheel_lost")
    rig.sim.ask("power on")
    t.check(rig.wait_at_rest(client, 8), "online once they have power")
    t.judge(rig, moves=False)
