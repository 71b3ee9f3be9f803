# SPDX-License-Identifier: MIT
"""The assumption store: what the bus shows, what the operator confirms, what a contradiction disables."""

import time

from scenario import scenario

from .wheels import fault_while_driving


@scenario("confirm: the operator confirms or contradicts, and nothing moves", 4)
def confirm_by_the_operator(t):
    rig, client = t.running()
    reply = client.request("confirm", item="wheel_radius", value=192)
    t.expect(reply)
    t.check((reply["state"], reply["evidence"]) == ("confirmed", "operator"), f"radius confirmed: {reply}")
    t.expect(client.request("confirm", item="wheel_radius", value="soft"), "bad_value")
    t.expect(client.request("confirm", item="speed"), "bad_value")
    reply = client.request("confirm", item="mount_sign_left", value="yes")
    t.check(reply["state"] == "contradicted" and "invert" in reply["disabled"], f"mount sign contradicted: {reply}")
    refusal = client.arm()
    t.expect(refusal, "denied")
    t.check("mount_sign_left" in refusal["message"], f"the refusal names the item: {refusal['message']}")
    t.expect(client.request("confirm", item="mount_sign_left"))
    assumptions = client.request("status")["ledger"]
    t.check(assumptions["wheel_radius"]["state"] == "confirmed", "the radius stays confirmed after a refused value")
    t.rule(not rig.bus.setpoints(), "none of these requests sends a setpoint")
    t.arm_and_drive(client, 150, 150, 0.3)
    t.judge(rig)


@scenario("confirm stores and reports the method of the person; a contradicted track refuses only turns", 6)
def confirm_how_and_track(t):
    rig, client = t.running({"wheels": {"track_mm": 540}})
    entry = client.request("status")["ledger"]["track"]
    t.check((entry["state"], entry["value"], entry["how"]) == ("assumed", "540", None), f"assumed at first: {entry}")
    reply = client.request("confirm", item="track", value=545, how="bringup: 3 full turns by hand")
    t.expect(reply)
    t.check(
        (reply["state"], reply["evidence"], reply["how"], reply["reason"])
        == ("confirmed", "operator", "bringup: 3 full turns by hand", "found by bringup: 3 full turns by hand"),
        f"its source is stored: {reply}",
    )
    t.check("assumption track = 540 is confirmed by the operator: found by bringup" in rig.gateway.text(), "in the log")
    reply = client.request("confirm", item="track")
    t.check(reply["how"] == "bringup: 3 full turns by hand", f"confirmed once more, its source is still stored: {reply}")
    reply = client.request("confirm", item="track", value=600, how="a tape")
    t.check(reply["state"] == "contradicted" and "track_mm" in reply["disabled"], f"contradicted: {reply}")
    t.arm(client)
    reply = client.request("twist", v_mm_s=150, yaw_mrad_s=0)
    t.check(reply["ok"] and reply["left_mm_s"] == reply["right_mm_s"] == 150, f"straight ahead needs no track: {reply}")
    t.drive_for(client, 150, 150, 0.6)
    turn = client.request("twist", v_mm_s=150, yaw_mrad_s=300)
    t.expect(turn, "denied")
    t.check("the operator found 600 by a tape" in turn["message"] and "track_mm" in turn["message"], f"why: {turn}")
    client.request("stop")
    t.silence(rig, client, 5, "at standstill")
    client.request("twist", v_mm_s=0, yaw_mrad_s=300)
    t.expect(client.arm(), "stale_command")
    t.expect(client.request("confirm", item="track"))
    t.judge(rig)


@scenario("a wheel against its command: contradicted, and no arm until the operator confirms it", 7)
def contradicted_sign_refuses_arm(t):
    rig, client, _ = fault_while_driving(t, "sign both swapped", "feedback_sign", 420)
    rig.sim.ask("sign both normal")
    t.reset(client)
    # The wheel that is judged first stops both, which ends the comparison of the other one.
    assumptions = client.request("status")["ledger"]
    signs = [name for name in ("feedback_sign_left", "feedback_sign_right") if assumptions[name]["state"] == "contradicted"]
    t.check(signs, f"one is contradicted by the bus: {assumptions}")
    for name in signs:
        t.check(assumptions[name]["figure"] < 0 and "measured -" in assumptions[name]["reason"], f"contradicted by the bus: {assumptions[name]}")
    t.expect(client.arm(), "denied")
    for name in signs:
        t.expect(client.request("confirm", item=name))
    t.arm_and_drive(client, 150, 150, 0.3)
    t.judge(rig)


@scenario("driving shows gear ratio, byte order, type and signs; only the operator confirms the rest", 12)
def ledger_by_driving(t):
    rig, client = t.running()
    client.request("watch", topics=["state"], rate_hz=1)
    time.sleep(2.6)  # Two seconds at standstill first: units and offset.
    t.arm_and_drive(client, 500, 400, 4.5)
    status = client.request("status")
    states = {name: (entry["state"], entry["evidence"]) for name, entry in status["ledger"].items()}
    for item in (
        "setpoint_type",
        "force_unit_left",
        "force_unit_right",
        "offset_included",
        "feedback_sign_left",
        "feedback_sign_right",
        "gear_ratio",
        "pose_byte_order",
        "dlc",
    ):
        t.check(states[item] == ("confirmed", "bus"), f"{item}: {status['ledger'][item]}")
    for item in ("current_role", "mount_sign_left", "mount_sign_right", "wheel_radius"):
        t.check(states[item][0] == "assumed", f"{item}: {status['ledger'][item]}")
    t.check(client.wait_event("ledger", item="gear_ratio", state="confirmed"), "watchers of state receive an event")
    client.request("stop")
    t.judge(rig)


@scenario("another gear, another byte order, other lengths: contradicted, and values that depend on it are not reported", 22)
def ledger_contradicted_by_driving(t):
    rig, client = t.running(sim=("gear both 3", "pose reversed", "padding on"))
    t.arm_and_drive(client, 600, 500, 9)
    status = client.request("status")
    for item in ("gear_ratio", "pose_byte_order", "dlc"):
        entry = status["ledger"][item]
        t.check(entry["state"] == "contradicted" and entry["disabled"], f"{item}: {entry}")
        t.check(f"assumption {item} = " in rig.gateway.text(), f"{item} is in the log")
    for side in ("left", "right"):
        t.check(status[side]["distance_mm"] is None, f"no {side} distance: {status[side]['distance_mm']}")
        t.check(status[side]["speed_mm_s"] is not None, "the speed does not depend on the gear ratio: rpm are the wheel's")
        t.check(status[side]["ticks"] is not None, "ticks are reported unchanged")
    t.check(status["pose"]["x_mm"] is None, f"no pose: {status['pose']}")
    t.check(status["state"] == "armed", "driving goes on")
    time.sleep(0.1)
    client.request("stop")
    t.judge(rig)


@scenario("tare: refused while nothing is known, under unrest, under load and in motion, each with its reason", 24)
def tare_refused_with_the_reason(t):
    rig, client = t.running(sim_args=("--uptime", "100"), sim=("load both 60",))

    def refused(error, words):
        reply = client.request("tare", side="left")
        t.expect(reply, error)
        t.check(words in reply.get("message", ""), f"'{words}' expected: {reply.get('message')}")

    time.sleep(2.6)
    refused("denied", "unsteady")
    left = client.request("status")["left"]
    zero = (left["offset_provenance"], left["offset_contaminated"], left["force_net_mN"], left["force_validity"])
    t.check(zero == ("none", True, None, "no_offset"), f"a load at the start is no zero: {zero}")
    rig.sim.ask("load both 0")
    time.sleep(2.6)
    reply = client.request("tare")
    t.expect(reply)
    t.check(abs(reply["left"]["offset_mN"] - 12300) < 500 and reply["left"]["samples"] == 40, f"left {reply.get('left')}")
    t.check(abs(reply["right"]["offset_mN"] - 9800) < 500, f"right {reply.get('right')}")
    rig.sim.ask("zero left 45")  # A constant weight: the samples do not vary.
    time.sleep(2.6)
    refused("denied", "far from its earlier zero")
    rig.sim.ask("raw left 32767")
    time.sleep(2.6)
    refused("denied", "end of its range")
    t.check(client.request("status")["left"]["force_validity"] == "saturated", "saturated is reported")
    rig.sim.ask("raw left auto")
    rig.sim.ask("zero left 12.3")
    time.sleep(2.6)
    t.arm_and_drive(client, 200, 200, 1)
    refused("not_at_rest", "turned within the last two seconds")
    client.request("stop")
    t.silence(rig, client, 6)
    rig.sim.ask("mute left")
    time.sleep(0.6)
    refused("wheel_lost", "has not sent force")
    t.judge(rig)
