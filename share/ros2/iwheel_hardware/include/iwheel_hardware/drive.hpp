// SPDX-License-Identifier: MIT
// Drives two velocity joints through an iWheel gateway: the logic of the hardware interface of ros2_control, without ROS.
//
//     CLOSED --open--> INACTIVE --activate--> ACTIVE --deactivate--> INACTIVE
//        ^                                      |
//        +------- any error of read or write ---+
//
// `read` and `write` never wait. Any error stops the wheels and closes the connection, which ends the lease: only `open` and `activate` lead
// to motion again. In ACTIVE each `write` sends one command; the gateway stops the wheels if no command comes for its `lease_ms`, so that a
// controller manager that hangs or dies stops them, too. One thread.
#ifndef IWHEEL_HARDWARE__DRIVE_HPP_
#define IWHEEL_HARDWARE__DRIVE_HPP_

#include <array>
#include <chrono>
#include <string>

#include "iwheel_client/client.h"

namespace iwheel_hardware
{

enum Side { LEFT = 0, RIGHT = 1, SIDES = 2 };

struct Wheel
{
  double position_rad;    // NaN: not known yet.
  double velocity_rad_s;  // NaN: not known at present.
};

class Drive
{
public:
  enum class State { CLOSED, INACTIVE, ACTIVE };

  Drive();
  ~Drive();
  Drive(const Drive &) = delete;
  Drive & operator=(const Drive &) = delete;

  // Connects to the gateway's socket (empty: the only one) and reads the wheels' radius from it. Waits up to a second. Does not arm.
  bool open(const std::string & socket);

  // Stops the wheels if this object holds the lease, and closes the connection.
  void close();

  // Requests the lease under this name; never moves the lease of another client. Waits up to half a second.
  bool activate(const std::string & name);

  // Stops with the ramp. Returns false after closing the connection if the gateway did not reply.
  bool deactivate();

  // Writes the newest measurements to `out_wheels`. Returns false if the connection has ended; in ACTIVE also if a wheel sends no telemetry, or
  // the gateway has stopped the wheels or sent nothing for SILENT.
  bool read(std::array<Wheel, SIDES> & out_wheels);

  // Sends one command, in rad/s. Returns false if a value is not a number or faster than the protocol can carry, the state is not ACTIVE, or
  // the gateway does not read.
  bool write(const std::array<double, SIDES> & rad_s);

  State state() const { return state_; }
  const std::string & error() const { return error_; }  // Reason and fix of the last call that returned false.

  static constexpr std::chrono::milliseconds SILENT{200};

private:
  bool fail(const std::string & why);
  bool receive(const iwc_message_t & message);
  bool read_radius();
  bool judge_active();

  using Clock = std::chrono::steady_clock;
  iwc_t * gateway_;
  State state_ = State::CLOSED;
  std::string error_;
  double radius_m_ = 0.0;
  iwc_state_t newest_ = {};
  Clock::time_point received_ = {};   // Reception of the newest snapshot.
  Clock::time_point activated_ = {};  // Grant of the lease.
};

}  // namespace iwheel_hardware

#endif  // IWHEEL_HARDWARE__DRIVE_HPP_
