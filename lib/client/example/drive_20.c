// SPDX-License-Identifier: MIT
// Drives both wheels forward for some seconds and stops. Only this loop sends commands, so the wheels also stop if the
// program dies.
#include <iwheel_client/client.h>

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

int main(int count, char **words) {
    iwc_t *gateway = iwc_new();
    iwc_terms_t terms = {.lease_ms = 0};
    iwc_result_t result = (gateway != NULL) ? iwc_connect(gateway, NULL, 1000) : IWC_INVALID;
    if (result == IWC_OK) {
        result = iwc_arm(gateway, "drive_20", false, 1000, &terms);
    }
    const int seconds = (count > 1) ? (int)strtol(words[1], NULL, 10) : 2;
    for (int left_ms = seconds * 1000; result == IWC_OK && left_ms > 0; left_ms -= terms.lease_ms / 3 + 1) {
        result = iwc_drive(gateway, &(iwc_drive_t){.left_mm_s = 200, .right_mm_s = 200}, 100, NULL);
        (void)usleep((useconds_t)terms.lease_ms * 1000U / 3U);
    }
    if (result != IWC_OK) {
        (void)fprintf(stderr, "drive_20: %s\n", iwc_reason(gateway));
    }
    const iwc_result_t stopped = (terms.lease_ms > 0) ? iwc_stop(gateway, 1000) : result;
    iwc_free(gateway);
    return (result == IWC_OK && stopped == IWC_OK) ? EXIT_SUCCESS : EXIT_FAILURE;
}
