// SPDX-License-Identifier: MIT
// Prints the table of docs/user/deploy.md: the sample points that the controllers of Linux boards can set for 1 Mbit/s and 62.5 %.
// test/package/run compares it with that file.
#include "iwheel/bit_timing.h"

#include <stdio.h>
#include <stdlib.h>

#define MHZ 1000000U

/// Limits as the kernel's drivers state them in their can_bittiming_const.
#define MCP251X                                                                                                        \
    { 64U, 3U, 16U, 2U, 8U }
#define MCP251XFD                                                                                                      \
    { 256U, 2U, 256U, 1U, 128U }
#define FLEXCAN                                                                                                        \
    { 256U, 4U, 16U, 2U, 8U }
#define FLEXCAN_FD                                                                                                     \
    { 1024U, 2U, 96U, 2U, 32U }
#define M_CAN                                                                                                          \
    { 512U, 2U, 256U, 2U, 128U }
#define C_CAN                                                                                                          \
    { 1024U, 2U, 16U, 1U, 8U }
#define MTTCAN                                                                                                         \
    { 511U, 2U, 255U, 1U, 127U }
#define GS_USB                                                                                                         \
    { 1024U, 1U, 16U, 1U, 8U }

typedef struct {
    const char *what;
    uint32_t clock_hz;
    iw_bit_timing_limits_t limits;
} controller_t;

static const controller_t controllers[] = {
    {"MCP2515, crystal 8 MHz", 4U * MHZ, MCP251X},
    {"MCP2515, crystal 10 MHz", 5U * MHZ, MCP251X},
    {"MCP2515, crystal 12 MHz", 6U * MHZ, MCP251X},
    {"MCP2515, crystal 16 MHz", 8U * MHZ, MCP251X},
    {"MCP2515, crystal 20 MHz", 10U * MHZ, MCP251X},
    {"MCP2517FD, MCP2518FD, crystal 20 MHz", 20U * MHZ, MCP251XFD},
    {"MCP2517FD, MCP2518FD, crystal 40 MHz", 40U * MHZ, MCP251XFD},
    {"AM335x (BeagleBone Black), d_can", 24U * MHZ, C_CAN},
    {"AM62x (BeaglePlay, SK-AM62), m_can", 80U * MHZ, M_CAN},
    {"Jetson TX2, mttcan at 40 MHz", 40U * MHZ, MTTCAN},
    {"Jetson Orin, mttcan at 50 MHz", 50U * MHZ, MTTCAN},
    {"i.MX6, flexcan at 30 MHz", 30U * MHZ, FLEXCAN},
    {"i.MX, flexcan at 24 MHz", 24U * MHZ, FLEXCAN},
    {"i.MX8M Plus, flexcan (FD) at 40 MHz", 40U * MHZ, FLEXCAN_FD},
    {"i.MX8M Plus, flexcan (FD) at 80 MHz", 80U * MHZ, FLEXCAN_FD},
    {"USB adapter with STM32F072 (gs_usb)", 48U * MHZ, GS_USB},
};

static const char *verdict(unsigned off_permille) {
    return (off_permille <= 5U) ? "yes" : (off_permille <= 25U) ? "with a warning" : "**no**";
}

static void row(const controller_t *controller) {
    const iw_bit_timing_achieved_t wanted = {IW_BUS_BITRATE_HZ, IW_BUS_SAMPLE_POINT_PERMILLE};
    iw_bit_timing_t timing;
    (void)printf("| %s | %u MHz | ", controller->what, (unsigned)(controller->clock_hz / MHZ));
    if (iw_bit_timing_solve(&controller->limits, controller->clock_hz, &wanted, &timing) != IW_OK) {
        (void)printf("1 Mbit/s impossible | **no** |\n");
        return;
    }
    const unsigned permille = iw_bit_timing_achieved(controller->clock_hz, &timing).sample_point_permille;
    const unsigned off = (unsigned)abs((int)permille - (int)IW_BUS_SAMPLE_POINT_PERMILLE);
    (void)printf("%u.%u %% (%u quanta) | %s |\n", permille / 10U, permille % 10U, 1U + timing.tseg1 + timing.tseg2,
                 verdict(off));
}

int main(void) {
    (void)puts("| controller | its clock | nearest sample point at 1 Mbit/s | for iWheels |\n|---|---|---|---|");
    for (size_t i = 0; i < sizeof controllers / sizeof controllers[0]; i++) {
        row(&controllers[i]);
    }
    return 0;
}
