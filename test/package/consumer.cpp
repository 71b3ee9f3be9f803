// SPDX-License-Identifier: MIT
// A C++ program uses the core.
#include "iwheel/bit_timing.h"
#include "iwheel/gateway.h"

#include <cstdio>

int main() {
    iw_config_t config;
    iw_config_default(&config);
    iw_bit_timing_t timing;
    const iw_bit_timing_limits_t limits = {1024, 1, 16, 1, 8};
    const iw_bit_timing_achieved_t wanted = {IW_BUS_BITRATE_HZ, IW_BUS_SAMPLE_POINT_PERMILLE};
    const bool good = iw_config_check(&config) == IW_CONFIG_OK &&
                      iw_bit_timing_solve(&limits, 32000000, &wanted, &timing) == IW_OK && timing.prescaler == 2 &&
                      iw_refusal_text(IW_REFUSE_BUSY)[0] == 'a';
    std::puts(good ? "C++: good" : "C++: bad");
    return good ? 0 : 1;
}
