# SPDX-License-Identifier: MIT
# The core's sources, for core/CMakeLists.txt and the Zephyr module.
set(IWHEEL_CORE_SOURCES
    src/age.c
    src/bit_timing.c
    src/cause.c
    src/codec.c
    src/config.c
    src/confirmation.c
    src/current.c
    src/diverge.c
    src/envelope.c
    src/estop_pair.c
    src/observation.c
    src/follow.c
    src/force_offset.c
    src/gateway.c
    src/assumption_store.c
    src/permit.c
    src/permit_refuse.c
    src/rolling.c
    src/sender.c
    src/setpoint.c
    src/snapshot.c
    src/step.c
    src/watch_pair.c
    src/wheel.c
    src/yaw.c)
