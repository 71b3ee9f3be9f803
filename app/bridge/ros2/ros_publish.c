// SPDX-License-Identifier: MIT
// Publishes the state of the machine as ROS messages, in metres, radians, newtons and volts.
#include "ros_parts.h"

#include "ros_types.h"

#include <math.h>

// Not const, because the members of samples are not const.
static char left_wheel[] = "left_wheel_joint";
static char right_wheel[] = "right_wheel_joint";
static char nothing[] = "";

/// Removes const, because the members of samples are not const. DDS does not write to these strings.
static char *writable(const char *text) {
    const union {
        const char *ours;
        char *theirs;
    } pointer = {.ours = text};
    return pointer.theirs;
}

static std_msgs_msg_dds__Header_ header(int64_t wall_us, char *frame) {
    return (std_msgs_msg_dds__Header_){
        .stamp = {.sec = (int32_t)(wall_us / 1000000), .nanosec = (uint32_t)(wall_us % 1000000 * 1000)},
        .frame_id = frame};
}

static double in_thousands(iwc_value_t value) {
    return (double)value.value / 1000.0;
}

/// Returns true if distance and speed of the wheel are up to date. Without telemetry the last distance stays known, the
/// speed does not. ROS has no value for an unknown part of a motion (a NaN spreads through TF and filters), so the
/// bridge omits such a motion.
static bool is_moving_known(const iwc_wheel_t *wheel) {
    return wheel->distance_mm.known && wheel->speed_mm_s.known;
}

static geometry_msgs_msg_dds__Quaternion_ heading(double yaw_rad) {
    return (geometry_msgs_msg_dds__Quaternion_){.z = sin(yaw_rad / 2.0), .w = cos(yaw_rad / 2.0)};
}

/// Writes the squares to the diagonal. A huge value marks a component that is not measured.
static void spread(double *covariance, double x, double y, double yaw) {
    const double unknown = 1e6;
    const double squares[6] = {x * x, y * y, unknown, unknown, unknown, yaw * yaw};
    for (size_t i = 0; i < 6U; i++) {
        covariance[7U * i] = squares[i];
    }
}

static void publish_odometry(ros_t *self, const ros_machine_t *machine, const ros_odometry_t *odometry) {
    const double left = in_thousands(machine->now.left.speed_mm_s);
    const double right = in_thousands(machine->now.right.speed_mm_s);
    const double v = (left + right) / 2.0;
    const double yaw_rate = (right - left) / machine->measures.track_m;
    const ros_doubt_t doubt = ros_odometry_doubt(odometry, &machine->measures, v, yaw_rate);
    nav_msgs_msg_dds__Odometry_ odom = {.header = header(machine->wall_us, self->settings.odometry.odom_frame),
                                        .child_frame_id = self->settings.odometry.base_frame};
    odom.pose.pose.position = (geometry_msgs_msg_dds__Point_){.x = odometry->x_m, .y = odometry->y_m};
    odom.pose.pose.orientation = heading(odometry->yaw_rad);
    odom.twist.twist.linear.x = v;
    odom.twist.twist.angular.z = yaw_rate;
    spread(odom.pose.covariance, doubt.x_m, doubt.y_m, doubt.yaw_rad);
    spread(odom.twist.covariance, doubt.v_m_s, doubt.side_m_s, doubt.yaw_rad_s);
    (void)dds_write(self->writers[WRITES_ODOM], &odom);
    if (self->writers[WRITES_TF] > 0) {
        geometry_msgs_msg_dds__TransformStamped_ transform = {
            .header = odom.header,
            .child_frame_id = odom.child_frame_id,
            .transform = {.translation = {.x = odometry->x_m, .y = odometry->y_m},
                          .rotation = odom.pose.pose.orientation}};
        const tf2_msgs_msg_dds__TFMessage_ message = {.transforms = {._length = 1, ._buffer = &transform}};
        (void)dds_write(self->writers[WRITES_TF], &message);
    }
}

static void publish_joints(ros_t *self, const ros_machine_t *machine) {
    const iwc_wheel_t *wheels[2] = {&machine->now.left, &machine->now.right};
    const double radius_m = (double)machine->radius_mm / 1000.0;
    char *names[2] = {left_wheel, right_wheel};
    char *known[2];
    double positions[2];
    double velocities[2];
    uint32_t count = 0;
    for (size_t i = 0; i < 2U; i++) {
        if (is_moving_known(wheels[i])) {
            known[count] = names[i];
            positions[count] = in_thousands(wheels[i]->distance_mm) / radius_m;
            velocities[count] = in_thousands(wheels[i]->speed_mm_s) / radius_m;
            count++;
        }
    }
    const sensor_msgs_msg_dds__JointState_ joints = {.header = header(machine->wall_us, nothing),
                                                     .name = {._length = count, ._buffer = known},
                                                     .position = {._length = count, ._buffer = positions},
                                                     .velocity = {._length = count, ._buffer = velocities}};
    (void)dds_write(self->writers[WRITES_JOINTS], &joints);
}

void ros_publish_motion(ros_t *self, const ros_machine_t *machine, const ros_odometry_t *odometry) {
    const iwc_wheel_t *left = &machine->now.left;
    const iwc_wheel_t *right = &machine->now.right;
    if (odometry->begun && machine->track_mm > 0 && is_moving_known(left) && is_moving_known(right)) {
        publish_odometry(self, machine, odometry);
    }
    if (machine->radius_mm > 0 && (is_moving_known(left) || is_moving_known(right))) {
        publish_joints(self, machine);
    }
}

/// Publishes the wrench of the measured force, along x at the frame's origin. The other parts of that force are zero by
/// definition, whatever else acts on the handle. RViz drops a message in which any part is NaN. Without a known force
/// there is no message.
void ros_publish_wrench(ros_t *self, const ros_machine_t *machine) {
    const iwc_wheel_t *wheels[2] = {&machine->now.left, &machine->now.right};
    for (unsigned i = 0; i < 2U; i++) {
        if (!wheels[i]->force_net_mN.known) {
            continue;
        }
        const geometry_msgs_msg_dds__WrenchStamped_ wrench = {
            .header = header(machine->wall_us, self->handles[i]),
            .wrench = {.force = {.x = in_thousands(wheels[i]->force_net_mN)}}};
        (void)dds_write(self->writers[WRITES_LEFT_WRENCH + i], &wrench);
    }
}

void ros_publish_battery(ros_t *self, const ros_machine_t *machine) {
    const iwc_wheel_t *wheels[2] = {&machine->now.left, &machine->now.right};
    char *frames[2] = {left_wheel, right_wheel};
    for (unsigned i = 0; i < 2U; i++) {
        if (!wheels[i]->battery_dV.known) {
            continue;
        }
        const sensor_msgs_msg_dds__BatteryState_ battery = {.header = header(machine->wall_us, frames[i]),
                                                            .voltage = (float)wheels[i]->battery_dV.value / 10.0F,
                                                            .temperature = NAN,
                                                            .current = NAN,
                                                            .charge = NAN,
                                                            .capacity = NAN,
                                                            .design_capacity = NAN,
                                                            .percentage = NAN,
                                                            .present = true,
                                                            .location = frames[i],
                                                            .serial_number = nothing};
        (void)dds_write(self->writers[WRITES_LEFT_BATTERY + i], &battery);
    }
}

void ros_publish_diagnostics(ros_t *self, const ros_status_t *statuses, int64_t wall_us) {
    diagnostic_msgs_msg_dds__KeyValue_ values[ROS_REPORTS][ROS_VALUES_MAX];
    diagnostic_msgs_msg_dds__DiagnosticStatus_ all[ROS_REPORTS];
    char names[ROS_REPORTS][ROS_ROBOT_SIZE + 24U];
    for (size_t i = 0; i < ROS_REPORTS; i++) {
        const ros_status_t *status = &statuses[i];
        for (size_t j = 0; j < status->value_count; j++) {
            values[i][j] = (diagnostic_msgs_msg_dds__KeyValue_){.key = writable(status->values[j].key),
                                                                .value = writable(status->values[j].text)};
        }
        (void)snprintf(names[i], sizeof names[i], "%s: %s", self->robot, status->name);
        all[i] = (diagnostic_msgs_msg_dds__DiagnosticStatus_){
            .level = (uint8_t)status->level,
            .name = names[i],
            .message = writable(status->message),
            .hardware_id = self->robot,
            .values = {._length = status->value_count, ._buffer = values[i]}};
    }
    const diagnostic_msgs_msg_dds__DiagnosticArray_ array = {.header = header(wall_us, nothing),
                                                             .status = {._length = ROS_REPORTS, ._buffer = all}};
    (void)dds_write(self->writers[WRITES_DIAGNOSTICS], &array);
}

void ros_publish_state(ros_t *self, const char *json) {
    const std_msgs_msg_dds__String_ message = {.data = writable(json)};
    (void)dds_write(self->writers[WRITES_STATE], &message);
}

void ros_publish_estop(ros_t *self, bool pressed) {
    const std_msgs_msg_dds__Bool_ message = {.data = pressed};
    (void)dds_write(self->writers[WRITES_ESTOP], &message);
}
