// SPDX-License-Identifier: MIT
// The filters that the port sets in the kernel, and its translation of received frames.
#include "socketcan_socket.h"

#include "iwheel/codec.h"

#include "unit.h"

#include <linux/can/error.h>
#include <string.h>
#include <sys/socket.h>

static const uint32_t ids[] = {256, 257, 266, 288, 289, 290, 298, 512, 513, 544, 545};
static struct can_filter ours[IWL_SOCKETCAN_IDS];
static struct can_filter others[IWL_SOCKETCAN_IDS];

void setUp(void) {
    iwl_socketcan_filters(IWL_SOCKETCAN_OURS, ours);
    iwl_socketcan_filters(IWL_SOCKETCAN_OTHERS, others);
}

/// Rule of the kernel (can/raw.h, af_can.c): one matching filter is enough; an inverted filter passes each frame that
/// does not match it.
static bool passes(const struct can_filter *filter, canid_t can_id) {
    const bool inverted = (filter->can_id & CAN_INV_FILTER) != 0U;
    const bool equal = (can_id & filter->can_mask) == (filter->can_id & ~CAN_INV_FILTER & filter->can_mask);
    return equal != inverted;
}

static bool is_ours(canid_t can_id) {
    bool any = false;
    for (size_t i = 0; i < IWL_SOCKETCAN_IDS; i++) {
        any = any || passes(&ours[i], can_id);
    }
    return any;
}

static bool is_others(canid_t can_id) {
    bool all = true; // Joined filters: all must match.
    for (size_t i = 0; i < IWL_SOCKETCAN_IDS; i++) {
        all = all && passes(&others[i], can_id);
    }
    return all;
}

static bool is_known(uint32_t number) {
    bool known = false;
    for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++) {
        known = known || ids[i] == number;
    }
    return known;
}

TEST(test_filters_every_standard_id_goes_to_exactly_one_socket) {
    for (uint32_t id = 0; id <= CAN_SFF_MASK; id++) {
        TEST_ASSERT_EQUAL_MESSAGE(is_known(id), is_ours(id), "ours");
        TEST_ASSERT_EQUAL_MESSAGE(is_known(id), is_ours(id | CAN_RTR_FLAG), "remote");
        TEST_ASSERT_EQUAL_MESSAGE(!is_known(id), is_others(id), "others");
        TEST_ASSERT_EQUAL_MESSAGE(!is_known(id), is_others(id | CAN_RTR_FLAG), "others, remote");
    }
}

TEST(test_filters_extended_frame_is_matched_by_its_whole_id) {
    for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++) {
        TEST_ASSERT_TRUE(is_ours(ids[i] | CAN_EFF_FLAG));
        TEST_ASSERT_FALSE(is_others(ids[i] | CAN_EFF_FLAG));
        TEST_ASSERT_FALSE(is_ours(ids[i] | CAN_EFF_FLAG | 0x800U));
        TEST_ASSERT_TRUE(is_others(ids[i] | CAN_EFF_FLAG | 0x10000000U));
    }
}

TEST(test_filters_do_not_request_error_frames) {
    for (size_t i = 0; i < IWL_SOCKETCAN_IDS; i++) {
        TEST_ASSERT_EQUAL_HEX32(0, ours[i].can_mask & CAN_ERR_FLAG);
        TEST_ASSERT_EQUAL_HEX32(0, others[i].can_mask & CAN_ERR_FLAG);
    }
}

static iw_can_frame_t translate(canid_t can_id, uint8_t length, int flags) {
    struct can_frame raw = {.can_id = can_id, .len = length};
    memset(raw.data, 0x5A, sizeof raw.data);
    return iwl_socketcan_translate(&raw, flags);
}

TEST(test_translate_preserves_format_id_and_data) {
    const iw_can_frame_t plain = translate(256, 4, 0);
    TEST_ASSERT_EQUAL_HEX32(256, plain.id);
    TEST_ASSERT_EQUAL(4, plain.dlc);
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, plain.kind);
    TEST_ASSERT_EACH_EQUAL_HEX8(0x5A, plain.data, 8);
    TEST_ASSERT_EQUAL_HEX32(256U | IW_CAN_REMOTE, translate(256U | CAN_RTR_FLAG, 0, 0).id);
    TEST_ASSERT_EQUAL_HEX32(0x1ABCDEFFU | IW_CAN_EXTENDED, translate(0x1ABCDEFFU | CAN_EFF_FLAG, 8, 0).id);
    TEST_ASSERT_EQUAL_HEX32(256U | IW_CAN_EXTENDED | IW_CAN_REMOTE,
                            translate(256U | CAN_EFF_FLAG | CAN_RTR_FLAG, 0, 0).id);
}

TEST(test_translate_only_a_frame_of_our_socket_is_an_echo) {
    TEST_ASSERT_EQUAL(IW_CAN_ECHO, translate(266, 5, MSG_CONFIRM | MSG_DONTROUTE).kind);
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, translate(266, 5, MSG_DONTROUTE).kind);
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, translate(266, 5, 0).kind);
}

TEST(test_translate_frame_longer_than_classic_is_no_telemetry) {
    iw_codec_wheel_t decoded[IW_SIDES];
    const iw_can_frame_t frame = translate(256, 64, MSG_TRUNC);
    TEST_ASSERT_EQUAL_HEX32(256U | IW_CAN_FD, frame.id);
    TEST_ASSERT_EQUAL(8, frame.dlc);
    TEST_ASSERT_EQUAL(IW_CODEC_BAD_FORMAT, iw_codec_decode(&frame, decoded));
    const iw_can_frame_t short_fd = translate(256, 4, MSG_TRUNC);
    TEST_ASSERT_EQUAL(IW_CODEC_BAD_FORMAT, iw_codec_decode(&short_fd, decoded));
}

static iwl_can_error_t error_of(canid_t classes, uint8_t controller) {
    struct can_frame raw = {.can_id = CAN_ERR_FLAG | classes, .len = CAN_ERR_DLC};
    memset(raw.data, 0xFF, sizeof raw.data);
    raw.data[1] = controller;
    return iwl_can_error_of(&raw);
}

TEST(test_error_frames_map_to_states) {
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_BUS_OFF, error_of(CAN_ERR_BUSOFF, 0));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_RESTARTED, error_of(CAN_ERR_RESTARTED, 0));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_PASSIVE, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_PASSIVE, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_PASSIVE, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_WARNING));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_ACTIVE, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_ACTIVE, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_ACTIVE, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
}

TEST(test_error_frames_with_several_flags_report_the_worst) {
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_BUS_OFF,
                      error_of(CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_RESTARTED, error_of(CAN_ERR_RESTARTED | CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE));
}

TEST(test_error_frames_of_other_kinds_change_no_state) {
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_NOTHING, error_of(CAN_ERR_LOSTARB, 0xFF));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_NOTHING, error_of(CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSERROR, 0xFF));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_NOTHING, error_of(CAN_ERR_CRTL, 0));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_NOTHING, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW));
    TEST_ASSERT_EQUAL(IWL_CAN_ERROR_NOTHING, error_of(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW));
}

TEST(test_error_mask_has_the_known_classes_only) {
    TEST_ASSERT_EQUAL_HEX32(CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED, iwl_can_error_mask());
}

TEST(test_frame_bits_match_format_and_length) {
    struct can_frame raw = {.can_id = 266, .len = 5};
    TEST_ASSERT_EQUAL_UINT32(47 + 40, iwl_socketcan_bits(&raw));
    raw.can_id = 266U | CAN_RTR_FLAG;
    TEST_ASSERT_EQUAL_UINT32(47, iwl_socketcan_bits(&raw));
    raw = (struct can_frame){.can_id = CAN_EFF_FLAG, .len = 8};
    TEST_ASSERT_EQUAL_UINT32(67 + 64, iwl_socketcan_bits(&raw));
}
