// SPDX-License-Identifier: MIT
/// Services as the vendors of ROS 2 send them. Pure: no DDS, no I/O.
///
/// ROS has two forms of a request and its reply. CycloneDDS (rmw_cyclonedds) begins the payload with a header of 16 bytes, by which the client
/// knows its reply. Fast DDS (rmw_fastrtps, the default of ROS) sends none: a request is known by its sample identity, which is the GUID of its
/// writer, or the one that its inline QoS names, and its sequence number; the reply names it in its inline QoS. CycloneDDS cannot write
/// that, so `ros_service_mark` adds it to the RTPS message on its way to the socket.
#ifndef ROS2_SERVICES_H
#define ROS2_SERVICES_H

#include "rtps.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ROS_GUID_SIZE 16U
/// Bytes that `ros_service_mark` adds to a message, at most.
#define ROS_MARK_SIZE 60U
/// Replies of one writer that a late reader may still ask for: those that DDS keeps.
#define ROS_MARKS 10U
/// Writers of replies.
#define ROS_MARK_WRITERS 4U

typedef enum {
    ROS_FORM_UNREADABLE = 0, ///< No request of this type. The reply has the form of Fast DDS.
    ROS_FORM_HEADER,         ///< CycloneDDS.
    ROS_FORM_IDENTITY        ///< Fast DDS.
} ros_form_t;

/// Whose reply it is.
typedef struct {
    ros_form_t form;
    uint8_t guid[ROS_GUID_SIZE]; ///< ROS_FORM_HEADER: the first 8 bytes are the header's.
    int64_t number;
} ros_caller_t;

/// Reads the payload of a std_srvs/Trigger request, with the encapsulation before it. Leaves the identity as it is unless the payload has one.
void ros_service_read(const uint8_t *payload, size_t size, ros_caller_t *caller);

/// The sample identity of the DATA submessage at `at` in an RTPS message. False, with `*out_caller` of zeros: there is none.
bool ros_service_identify(const uint8_t *message, size_t size, size_t at, ros_caller_t *out_caller);

/// Writes the payload of a reply, with its encapsulation. Returns its size; a text that does not fit is cut.
size_t ros_service_write(const ros_caller_t *caller, bool success, const char *text, uint8_t *out, size_t size);

/// Which sample of our writers is the reply to whom.
typedef struct {
    uint8_t prefix[ROS_PREFIX_SIZE]; ///< Of the GUIDs of our participant.
    struct {
        uint8_t id[4];                   ///< Of the writer, the last bytes of its GUID; zeros: unused.
        int64_t number;                  ///< Sequence number of its newest sample.
        ros_caller_t callers[ROS_MARKS]; ///< That of sample N is at N % ROS_MARKS.
    } writers[ROS_MARK_WRITERS];
} ros_marks_t;

/// The next sample of writer `which` is the reply to this caller.
void ros_service_note(ros_marks_t *marks, unsigned which, const ros_caller_t *caller);

/// Copies an RTPS message to `out` and names the callers of ROS_FORM_IDENTITY in the inline QoS of their replies. Returns the new length; 0:
/// the message has no such reply, or does not fit.
size_t ros_service_mark(const ros_marks_t *marks, const uint8_t *message, size_t length, uint8_t *out, size_t size);

#endif
