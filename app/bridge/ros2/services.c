// SPDX-License-Identifier: MIT
#include "services.h"

#include <string.h>

#define DATA_HEADER      24U ///< Size with the submessage's header.
#define DATA_TO_QOS_AT   6U  ///< Position of octetsToInlineQos.
#define DATA_COUNTS_FROM 8U  ///< Position from which octetsToInlineQos counts.
#define DATA_WRITER_AT   12U
#define DATA_NUMBER_AT   16U
#define DATA             0x15U
#define HAS_QOS          0x02U
#define PID_SENTINEL     0x0001U
/// Parameter of RTPS 2.4, and the parameter that older Fast DDS used. Fast DDS reads both.
#define PID_RELATED        0x0083U
#define PID_RELATED_CUSTOM 0x800FU
#define IDENTITY_SIZE      24U
#define ENCAPSULATION      4U
#define HEADER_GUID        8U
#define NUMBER_MAX         0xFFFFFFFFFF ///< Requests count from 1: a larger number belongs to another type.
#define REQUEST_SIZE       1U           ///< structure_needs_at_least_one_member
#define ALIGNED            4U

/// Reads a number of 64 bits in CDR's form.
static int64_t read_long(const uint8_t *bytes, bool little) {
    const uint64_t first = rtps_read(bytes, 4, little);
    const uint64_t second = rtps_read(bytes + 4, 4, little);
    return (int64_t)(little ? second << 32 | first : first << 32 | second);
}

void ros_service_read(const uint8_t *payload, size_t size, ros_caller_t *caller) {
    const size_t body = (size > ENCAPSULATION) ? size - ENCAPSULATION : 0U;
    const size_t header = HEADER_GUID + sizeof caller->number;
    caller->form = ROS_FORM_UNREADABLE;
    if (body < REQUEST_SIZE || payload[0] != 0U || payload[1] > 1U) { // Only CDR, in either byte order.
        return;
    }
    if (body <= ALIGNED) {
        caller->form = ROS_FORM_IDENTITY;
    } else if (body > header && body <= header + ALIGNED) {
        const uint8_t *bytes = payload + ENCAPSULATION;
        caller->form = ROS_FORM_HEADER;
        memset(caller->guid, 0, sizeof caller->guid);
        for (size_t i = 0; i < HEADER_GUID; i++) { // Stored as little endian, the byte order of the reply.
            caller->guid[i] = bytes[(payload[1] == 1U) ? i : HEADER_GUID - 1U - i];
        }
        caller->number = read_long(bytes + HEADER_GUID, payload[1] == 1U);
        if (caller->number < 1 || caller->number > NUMBER_MAX) {
            caller->form = ROS_FORM_UNREADABLE;
        }
    }
}

size_t ros_service_write(const ros_caller_t *caller, bool success, const char *text, uint8_t *out, size_t size) {
    static const uint8_t encapsulation[ENCAPSULATION] = {0, 1, 0, 0};
    size_t used = sizeof encapsulation;
    memcpy(out, encapsulation, sizeof encapsulation);
    if (caller->form == ROS_FORM_HEADER) {
        memcpy(out + used, caller->guid, HEADER_GUID);
        used += HEADER_GUID;
        rtps_write((uint32_t)caller->number, 4, true, out + used);
        rtps_write((uint32_t)((uint64_t)caller->number >> 32), 4, true, out + used + 4U);
        used += sizeof caller->number;
    }
    memset(out + used, 0, ALIGNED);
    out[used] = success ? 1U : 0U;
    used += ALIGNED;
    const size_t space = size - used - sizeof(uint32_t) - ALIGNED;
    const size_t length = strnlen(text, space - 1U);
    rtps_write((uint32_t)length + 1U, sizeof(uint32_t), true, out + used);
    used += sizeof(uint32_t);
    memset(out + used, 0, length + ALIGNED);
    memcpy(out + used, text, length);
    return used + length + 1U;
}

/// A DATA submessage.
typedef struct {
    const uint8_t *bytes;
    size_t size;
    bool little;
    size_t qos; ///< Position of its inline QoS, whether present or not.
} data_t;

/// Writes the submessage at `at` to `*out`. Returns false if it is not a whole DATA submessage. `out->size` is the size
/// of any whole submessage; 0: there is none.
static bool data_at(const uint8_t *message, size_t length, size_t at, data_t *out) {
    rtps_part_t part;
    const bool is_whole = rtps_part_at(message, length, at, &part);
    *out = (data_t){.bytes = part.bytes, .size = part.size, .little = part.little};
    if (!is_whole || part.bytes[0] != DATA || part.size < DATA_HEADER) {
        return false;
    }
    out->qos = DATA_COUNTS_FROM + rtps_read(part.bytes + DATA_TO_QOS_AT, 2, part.little);
    return out->qos >= DATA_HEADER && out->qos <= out->size;
}

static void read_related(const data_t *data, ros_caller_t *caller) {
    size_t at = data->qos;
    while (at + RTPS_SUBMESSAGE <= data->size) {
        const uint32_t kind = rtps_read(data->bytes + at, 2, data->little);
        const size_t size = rtps_read(data->bytes + at + 2U, 2, data->little);
        at += RTPS_SUBMESSAGE;
        if (kind == PID_SENTINEL || size > data->size - at) {
            return;
        }
        if ((kind == PID_RELATED || kind == PID_RELATED_CUSTOM) && size >= IDENTITY_SIZE) {
            memcpy(caller->guid, data->bytes + at, ROS_GUID_SIZE); // The sequence number is that of the sample.
        }
        at += size;
    }
}

bool ros_service_identify(const uint8_t *message, size_t size, size_t at, ros_caller_t *out_caller) {
    static const uint8_t unknown[ROS_GUID_SIZE] = {0};
    data_t data;
    memset(out_caller, 0, sizeof *out_caller);
    if (at < RTPS_HEADER || !data_at(message, size, at, &data)) {
        return false;
    }
    out_caller->number = rtps_read_sequence(data.bytes + DATA_NUMBER_AT, data.little);
    if ((data.bytes[1] & HAS_QOS) != 0U) {
        read_related(&data, out_caller);
    }
    if (memcmp(out_caller->guid, unknown, sizeof unknown) == 0) {
        memcpy(out_caller->guid, message + RTPS_PREFIX_AT, ROS_PREFIX_SIZE);
        memcpy(out_caller->guid + ROS_PREFIX_SIZE, data.bytes + DATA_WRITER_AT, ROS_GUID_SIZE - ROS_PREFIX_SIZE);
    }
    return true;
}

void ros_service_note(ros_marks_t *marks, unsigned which, const ros_caller_t *caller) {
    const int64_t number = ++marks->writers[which].number;
    marks->writers[which].callers[number % ROS_MARKS] = *caller;
}

/// Returns the caller whose reply this sample is; NULL: no caller has to be named.
static const ros_caller_t *caller_of(const ros_marks_t *marks, const data_t *data) {
    const int64_t number = rtps_read_sequence(data->bytes + DATA_NUMBER_AT, data->little);
    for (unsigned i = 0; i < ROS_MARK_WRITERS; i++) {
        const int64_t newest = marks->writers[i].number;
        if (memcmp(marks->writers[i].id, data->bytes + DATA_WRITER_AT, sizeof marks->writers[i].id) == 0 &&
            number > 0 && number <= newest && number + (int64_t)ROS_MARKS > newest) {
            const ros_caller_t *caller = &marks->writers[i].callers[number % ROS_MARKS];
            return (caller->form != ROS_FORM_HEADER) ? caller : NULL;
        }
    }
    return NULL;
}

static size_t write_related(uint32_t kind, const ros_caller_t *caller, bool little, uint8_t *out) {
    rtps_write(kind, 2, little, out);
    rtps_write(IDENTITY_SIZE, 2, little, out + 2);
    memcpy(out + RTPS_SUBMESSAGE, caller->guid, ROS_GUID_SIZE);
    rtps_write_sequence(caller->number, little, out + RTPS_SUBMESSAGE + ROS_GUID_SIZE);
    return RTPS_SUBMESSAGE + IDENTITY_SIZE;
}

/// Writes the submessage with the caller in its inline QoS. Returns its size.
static size_t write_marked(const data_t *data, const ros_caller_t *caller, uint8_t *out) {
    const bool has_qos = (data->bytes[1] & HAS_QOS) != 0U;
    size_t used = data->qos;
    memcpy(out, data->bytes, used);
    used += write_related(PID_RELATED, caller, data->little, out + used);
    used += write_related(PID_RELATED_CUSTOM, caller, data->little, out + used);
    if (!has_qos) {
        rtps_write(PID_SENTINEL, 2, data->little, out + used);
        rtps_write(0, 2, data->little, out + used + 2U);
        used += RTPS_SUBMESSAGE;
    }
    memcpy(out + used, data->bytes + data->qos, data->size - data->qos);
    used += data->size - data->qos;
    out[1] |= HAS_QOS;
    rtps_write((uint32_t)(used - RTPS_SUBMESSAGE), 2, data->little, out + 2);
    return used;
}

size_t ros_service_mark(const ros_marks_t *marks, const uint8_t *message, size_t length, uint8_t *out, size_t size) {
    bool marked = false;
    data_t data;
    if (length < RTPS_HEADER || size < length || memcmp(message, "RTPS", 4) != 0 ||
        memcmp(message + RTPS_PREFIX_AT, marks->prefix, sizeof marks->prefix) != 0) {
        return 0;
    }
    memcpy(out, message, RTPS_HEADER);
    size_t used = RTPS_HEADER;
    for (size_t at = RTPS_HEADER; at < length; at += data.size) {
        const bool is_data = data_at(message, length, at, &data);
        const ros_caller_t *caller = is_data ? caller_of(marks, &data) : NULL;
        if (data.size == 0U || used + data.size + ROS_MARK_SIZE > size) {
            return 0;
        }
        if (caller != NULL) {
            used += write_marked(&data, caller, out + used);
            marked = true;
        } else {
            memcpy(out + used, data.bytes, data.size);
            used += data.size;
        }
    }
    return marked ? used : 0U;
}
