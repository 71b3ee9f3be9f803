# SPDX-License-Identifier: MIT
"""Run by ROS 2's own Python: calls services as `ros2 service call` does, one client for each call.

usage: jazzy_caller.py SERVICE...     prints a JSON line for each: service, success, message, begin_us and answer_us (CLOCK_MONOTONIC)
"""

import json
import sys
import time

import rclpy
from std_srvs.srv import Trigger

WAIT_S = 10


def call(node, service):
    client = node.create_client(Trigger, service)
    if not client.wait_for_service(WAIT_S):
        return {"service": service, "success": None, "message": "there is no such service"}
    begin_us = time.monotonic_ns() // 1000
    future = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=3)
    answer = future.result()
    node.destroy_client(client)
    if answer is None:
        return {"service": service, "success": None, "message": "no answer", "begin_us": begin_us}
    return {"service": service, "success": answer.success, "message": answer.message, "begin_us": begin_us, "answer_us": time.monotonic_ns() // 1000}


rclpy.init()
caller = rclpy.create_node("caller")
for name in sys.argv[1:]:
    print(json.dumps(call(caller, name)), flush=True)
