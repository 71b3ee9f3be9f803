// SPDX-License-Identifier: MIT
/// Reads requests and writes replies of services in the forms of both vendors of ROS 2. Pure: no DDS, no I/O.
///
/// CycloneDDS (rmw_cyclonedds) begins the payload with a header of 16 bytes, which identifies the reply for its client.
/// Fast DDS (rmw_fastrtps, the default of ROS) sends no header. It identifies a request by its sample identity: the
/// sequence number, with the GUID of its writer or the GUID that its inline QoS names. The reply names this identity in
/// its inline QoS. CycloneDDS cannot write it, so `ros_service_mark` adds it to the outgoing RTPS message.
#ifndef ROS2_SERVICES_H
#define ROS2_SERVICES_H

#include "rtps.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ROS_GUID_SIZE 16U
/// Most bytes that `ros_service_mark` adds to a reply.
#define ROS_MARK_SIZE 60U
/// Requests and replies of one service that DDS stores. So many calls can be in flight; of more calls, the oldest get no
/// reply.
#define ROS_MARKS 32U
/// Number of writers of replies.
#define ROS_MARK_WRITERS 4U

typedef enum {
    ROS_FORM_UNREADABLE = 0, ///< Not a request of this type. The reply has the form of Fast DDS.
    ROS_FORM_HEADER,         ///< CycloneDDS.
    ROS_FORM_IDENTITY        ///< Fast DDS.
} ros_form_t;

/// Identifies the caller of a service and its request.
typedef struct {
    ros_form_t form;
    uint8_t guid[ROS_GUID_SIZE]; ///< ROS_FORM_HEADER: only the first 8 bytes, those of the header.
    int64_t number;              ///< Sequence number of the request.
} ros_caller_t;

/// Reads the payload of a std_srvs/Trigger request, with its encapsulation. Writes form, and the identity if the
/// payload has one; otherwise the identity is unchanged.
void ros_service_read(const uint8_t *payload, size_t size, ros_caller_t *caller);

/// Reads the sample identity of the DATA submessage at `at` in an RTPS message. Returns false, and writes zeros to
/// `*out_caller`, if there is no such submessage.
bool ros_service_identify(const uint8_t *message, size_t size, size_t at, ros_caller_t *out_caller);

/// Writes the payload of a reply, with its encapsulation. Returns its size. Cuts a text that does not fit.
size_t ros_service_write(const ros_caller_t *caller, bool success, const char *text, uint8_t *out, size_t size);

/// Maps the newest samples of our writers to the callers whose replies they are.
typedef struct {
    uint8_t prefix[ROS_PREFIX_SIZE]; ///< GUID prefix of our participant.
    struct {
        uint8_t id[4];                   ///< Last bytes of the writer's GUID; zeros: unused.
        int64_t number;                  ///< Sequence number of the writer's newest sample.
        ros_caller_t callers[ROS_MARKS]; ///< The caller of sample N is at N % ROS_MARKS.
    } writers[ROS_MARK_WRITERS];
} ros_marks_t;

/// Stores that the next sample of writer `which` is the reply to this caller.
void ros_service_note(ros_marks_t *marks, unsigned which, const ros_caller_t *caller);

/// Copies an RTPS message to `out`, and names each caller that is not of ROS_FORM_HEADER in the inline QoS of its
/// reply. Returns the new length; 0: the message has no such reply, or does not fit.
size_t ros_service_mark(const ros_marks_t *marks, const uint8_t *message, size_t length, uint8_t *out, size_t size);

#endif
