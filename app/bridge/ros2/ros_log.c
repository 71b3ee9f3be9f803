// SPDX-License-Identifier: MIT
// Limits the log lines of CycloneDDS. CycloneDDS writes one for each sample that it cannot read, so another program
// could fill the log.
#include "common/bridge_service.h"
#include "log_limit.h"
#include "ros_parts.h"

#include <dds/ddsrt/log.h>
#include <pthread.h>

static struct {
    pthread_mutex_t lock;
    log_limit_t limit;
} sink = {.lock = PTHREAD_MUTEX_INITIALIZER};

/// DDS calls it in any of its threads.
static void write_line(void *context, const dds_log_data_t *line) {
    uint64_t dropped = 0;
    (void)context;
    (void)pthread_mutex_lock(&sink.lock);
    const bool passes = log_limit_pass(&sink.limit, bridge_now_us(), &dropped);
    (void)pthread_mutex_unlock(&sink.lock);
    if (dropped > 0U) {
        (void)fprintf(stderr, "iwheel-ros2: warning: DDS: %llu more lines in a minute were dropped\n",
                      (unsigned long long)dropped);
    }
    if (passes) {
        (void)fprintf(stderr, "iwheel-ros2: DDS: %s", line->message + line->hdrsize);
    }
}

void ros_limit_log(void) {
    dds_set_log_sink(write_line, NULL);
}
