// SPDX-License-Identifier: MIT
#include "netlink.h"

#include <libmnl/libmnl.h>
#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <string.h>

IW_STATIC_ASSERT(sizeof(struct ifinfomsg) % NLMSG_ALIGNTO == 0, netlink_attributes_follow_without_a_gap);

/// Attributes side by side.
typedef struct {
    const void *first;
    uint32_t size;
} attributes_t;

static attributes_t within(const struct nlattr *nest) {
    return (attributes_t){mnl_attr_get_payload(nest), mnl_attr_get_payload_len(nest)};
}

static const struct nlattr *find(attributes_t among, uint16_t type) {
    const uint8_t *const first = (const uint8_t *)among.first;
    const struct nlattr *attribute = (const struct nlattr *)among.first;
    int left = (int)among.size;
    while (mnl_attr_ok(attribute, left)) {
        if (mnl_attr_get_type(attribute) == type) {
            return attribute;
        }
        attribute = mnl_attr_next(attribute);
        left = (int)among.size - (int)((const uint8_t *)attribute - first);
    }
    return NULL;
}

/// Copies a payload of exactly this size or larger; newer kernels may append to it. False if there is none.
static bool get(attributes_t among, uint16_t type, void *out, size_t size) {
    const struct nlattr *attribute = find(among, type);
    if (attribute == NULL || mnl_attr_get_payload_len(attribute) < size) {
        return false;
    }
    memcpy(out, mnl_attr_get_payload(attribute), size);
    return true;
}

static iw_bus_state_t state_of(uint32_t state) {
    switch (state) {
    case CAN_STATE_ERROR_ACTIVE:
    case CAN_STATE_ERROR_WARNING:
        return IW_BUS_ACTIVE;
    case CAN_STATE_ERROR_PASSIVE:
        return IW_BUS_PASSIVE;
    case CAN_STATE_BUS_OFF:
        return IW_BUS_OFF;
    default:
        return IW_BUS_DOWN;
    }
}

/// The data of an interface of kind "can": a real controller.
static void parse_controller(attributes_t data, iw_netlink_reading_t *reading) {
    struct can_bittiming timing;
    struct can_ctrlmode mode;
    uint32_t state;
    iw_bus_link_t *link = &reading->link;
    if (get(data, IFLA_CAN_BITTIMING, &timing, sizeof timing)) {
        link->bitrate_hz = timing.bitrate;
        link->sample_point_permille = (uint16_t)((timing.sample_point <= 1000U) ? timing.sample_point : 0U);
    }
    if (get(data, IFLA_CAN_CTRLMODE, &mode, sizeof mode)) {
        link->is_mute = (mode.flags & CAN_CTRLMODE_LISTENONLY) != 0U;
        // Loopback echoes without the bus, presume-ack sends without acknowledgement: then an echo proves nothing.
        link->echo_proven =
            link->echo_proven && (mode.flags & (CAN_CTRLMODE_LOOPBACK | CAN_CTRLMODE_PRESUME_ACK)) == 0U;
    }
    if (get(data, IFLA_CAN_STATE, &state, sizeof state) && link->presence == IW_LINK_UP) {
        reading->state = state_of(state);
    }
    (void)get(data, IFLA_CAN_RESTART_MS, &link->restart_ms, sizeof link->restart_ms);
}

/// vcan is of another kind: there is no controller, so no bit timing and no error states.
static void parse_kind(attributes_t info, iw_netlink_reading_t *reading) {
    static const char controller[] = "can";
    char kind[sizeof controller] = "";
    const struct nlattr *data = find(info, IFLA_INFO_DATA);
    if (!get(info, IFLA_INFO_KIND, kind, sizeof kind) || memcmp(kind, controller, sizeof controller) != 0) {
        reading->link.is_virtual = true;
    } else if (data != NULL) {
        parse_controller(within(data), reading);
    }
}

bool iw_netlink_parse(const struct nlmsghdr *message, iw_netlink_reading_t *out_reading) {
    if (message->nlmsg_type != RTM_NEWLINK || mnl_nlmsg_get_payload_len(message) < sizeof(struct ifinfomsg)) {
        return false;
    }
    const struct ifinfomsg *interface = (const struct ifinfomsg *)mnl_nlmsg_get_payload(message);
    const attributes_t all = {mnl_nlmsg_get_payload_offset(message, sizeof *interface),
                              (uint32_t)(mnl_nlmsg_get_payload_len(message) - sizeof *interface)};
    iw_bus_link_t *link = &out_reading->link;
    *out_reading = (iw_netlink_reading_t){.index = interface->ifi_index, .state = IW_BUS_DOWN};
    link->presence = ((interface->ifi_flags & IFF_UP) != 0U) ? IW_LINK_UP : IW_LINK_DOWN;
    if (interface->ifi_type != ARPHRD_CAN) {
        link->presence = IW_LINK_NOT_CAN;
        return true;
    }
    link->echo_proven = (interface->ifi_flags & IFF_ECHO) != 0U;
    out_reading->state = (link->presence == IW_LINK_UP) ? IW_BUS_ACTIVE : IW_BUS_DOWN;
    (void)get(all, IFLA_TXQLEN, &link->queue_length, sizeof link->queue_length);
    const struct nlattr *info = find(all, IFLA_LINKINFO);
    if (info != NULL) {
        parse_kind(within(info), out_reading);
    }
    return true;
}
