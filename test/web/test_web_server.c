// SPDX-License-Identifier: MIT
// The key of the page that drives: how long it is valid. The server runs without HTTP and without a gateway.
#include "web_server.h"

#include "unity.h"

#include <stdlib.h>
#include <string.h>

static web_server_t server;
static web_settings_t settings;
static uint64_t now_us;

uint64_t __wrap_bridge_now_us(void);
int __wrap_web_link_step(web_link_t *self, uint64_t at_us);
void __wrap_web_backlog_step(web_backlog_t *self, uint64_t at_us);
int __wrap_web_backlog_take(web_backlog_t *self);
enum MHD_Result __wrap_MHD_run(struct MHD_Daemon *daemon);

uint64_t __wrap_bridge_now_us(void) {
    return now_us;
}

int __wrap_web_link_step(web_link_t *self, uint64_t at_us) {
    (void)self;
    (void)at_us;
    return 0;
}

void __wrap_web_backlog_step(web_backlog_t *self, uint64_t at_us) {
    (void)self;
    (void)at_us;
}

int __wrap_web_backlog_take(web_backlog_t *self) {
    (void)self;
    return -1;
}

enum MHD_Result __wrap_MHD_run(struct MHD_Daemon *daemon) {
    (void)daemon;
    return MHD_YES;
}

static void round_after(uint64_t span_us) {
    now_us += span_us;
    TEST_ASSERT_EQUAL_INT(0, web_server_step(&server));
}

static const char *drive(void) {
    char t_us[24];
    const web_limits_t limits = {.max_speed_mm_s = 500, .ttl_us = 300000};
    web_twist_t twist;
    (void)snprintf(t_us, sizeof t_us, "%llu", (unsigned long long)now_us);
    const web_command_t command = {
        .is_holders = true, .t_us = t_us, .sequence = "1", .v_mm_s = "100", .yaw_mrad_s = "0"};
    return web_driver_take(&server.driver, &command, &limits, now_us, &twist);
}

void setUp(void) {
    memset(&server, 0, sizeof server);
    memset(&settings, 0, sizeof settings);
    settings.web.max_connections = 16;
    server.settings = &settings;
    server.poll_us = UINT64_MAX;
    server.link.gateway.stop.line.socket = "/nowhere/gateway.sock";
    now_us = 1000000;
    bridge_place_t *place = &server.link.lease.place[0];
    place->state = BRIDGE_HELD;
    TEST_ASSERT_TRUE(bridge_secret_draw(place->key));
    server.link.lease.holder = place;
    web_driver_begin(&server.driver, now_us);
}

void tearDown(void) {}

static void test_key_of_a_page_stays_while_it_holds_the_lease(void) {
    round_after(1000);
    TEST_ASSERT_NULL(drive());
}

static void test_key_of_a_page_ends_with_its_lease(void) {
    bridge_lease_end(&server.link.lease, now_us);
    round_after(1000);
    TEST_ASSERT_NOT_NULL(drive());
}

static void test_key_of_a_silent_page_ends(void) {
    TEST_ASSERT_NULL(drive());
    round_after(WEB_SILENT_US + 1000U);
    TEST_ASSERT_NOT_NULL(drive());
    TEST_ASSERT_NULL(bridge_lease_key(&server.link.lease));
}

static void test_key_of_another_page_begins_its_own_sequence(void) {
    TEST_ASSERT_NULL(drive());
    TEST_ASSERT_NOT_NULL(drive()); // The same sequence again.
    web_driver_begin(&server.driver, now_us);
    TEST_ASSERT_NULL(drive());
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_key_of_a_page_stays_while_it_holds_the_lease);
    RUN_TEST(test_key_of_a_page_ends_with_its_lease);
    RUN_TEST(test_key_of_a_silent_page_ends);
    RUN_TEST(test_key_of_another_page_begins_its_own_sequence);
    return UNITY_END();
}
