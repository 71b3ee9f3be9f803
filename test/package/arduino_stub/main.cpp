// SPDX-License-Identifier: MIT
// Runs the sketch for five seconds of its own time, which begins shortly before micros() wraps.
#include "sketch.cpp"

static uint32_t time_us = UINT32_MAX - 1000000U;

uint32_t micros() {
    return time_us;
}

int main() {
    setup();
    for (int ms = 0; ms < 5000; ms++) {
        time_us += 1000U;
        loop();
    }
    (void)printf("fastest: %d mm/s, now: %d mm/s\n", wheels.fastest_mm_s, wheels.speed_mm_s[IW_LEFT]);
    return (wheels.fastest_mm_s == 200 && wheels.speed_mm_s[IW_LEFT] == 0) ? 0 : 1;
}
