// SPDX-License-Identifier: MIT
// Two velocity joints on an iWheel gateway, without ROS: what the hardware interface of ros2_control does.
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
  double velocity_rad_s;  // NaN: not known now.
};

class Drive
{
public:
  enum class State { CLOSED, INACTIVE, ACTIVE };

  Drive();
  ~Drive();
  Drive(const Drive &) = delete;
  Drive & operator=(const Drive &) = delete;

  // Connects to the gateway's socket (empty: the only one) and reads the wheels' radius from it. Waits up to a second. Arms nothing.
  bool open(const std::string & socket);

  // Stops the wheels if they are ours, and closes the connection.
  void close();

  // Asks for the lease under this name; never takes it over. Waits up to half a second.
  bool activate(const std::string & name);

  // Ramp to zero. False: the gateway did not answer, and the connection is closed.
  bool deactivate();

  // The newest measurements. False in ACTIVE: a wheel is not known, the gateway has stopped or is silent for SILENT; everywhere: the
  // connection has ended.
  bool read(std::array<Wheel, SIDES> & out_wheels);

  // One command, rad/s. False: not a number, faster than the protocol can carry, not ACTIVE, or the gateway does not read.
  bool write(const std::array<double, SIDES> & rad_s);

  State state() const { return state_; }
  const std::string & error() const { return error_; }  // Of the last call that returned false, with the fix.

  static constexpr std::chrono::milliseconds SILENT{200};

private:
  bool fail(const std::string & why);
  bool take(const iwc_message_t & message);
  bool read_radius();
  bool judge_active();

  using Clock = std::chrono::steady_clock;
  iwc_t * gateway_;
  State state_ = State::CLOSED;
  std::string error_;
  double radius_m_ = 0.0;
  iwc_state_t newest_ = {};
  Clock::time_point received_ = {};   // When the newest snapshot came.
  Clock::time_point activated_ = {};
};

}  // namespace iwheel_hardware

#endif  // IWHEEL_HARDWARE__DRIVE_HPP_
