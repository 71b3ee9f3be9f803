// SPDX-License-Identifier: MIT
#include "iwheel_hardware/drive.hpp"

#include <cmath>
#include <cstdlib>
#include <limits>

namespace iwheel_hardware
{

namespace
{
constexpr int CONNECT_MS = 1000;
constexpr int ASK_MS = 150;
constexpr int ARM_MS = 500;
constexpr int RATE_HZ = 100;
// The gateway may have made a snapshot before the grant of the lease if it came within this time after the grant.
constexpr std::chrono::milliseconds GRANTED{200};
constexpr double MOST_MM_S = 32767.0;
constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

Wheel wheel_of(const iwc_wheel_t & wheel, double radius_m)
{
  return {wheel.distance_mm.known ? static_cast<double>(wheel.distance_mm.value) / 1000.0 / radius_m : UNKNOWN,
    wheel.speed_mm_s.known ? static_cast<double>(wheel.speed_mm_s.value) / 1000.0 / radius_m : UNKNOWN};
}
}  // namespace

Drive::Drive() : gateway_(iwc_new()) {}

Drive::~Drive()
{
  close();
  iwc_free(gateway_);
}

bool Drive::fail(const std::string & why)
{
  close();
  error_ = why;
  return false;
}

void Drive::close()
{
  if (gateway_ != nullptr && state_ == State::ACTIVE) {
    (void)iwc_stop(gateway_, ASK_MS);
  }
  if (gateway_ != nullptr) {
    iwc_close(gateway_);  // The gateway ends the lease with the connection.
  }
  state_ = State::CLOSED;
}

bool Drive::read_radius()
{
  iwc_message_t status;
  char text[48] = "";
  if (iwc_ask(gateway_, "{\"cmd\":\"status\"}", ASK_MS, &status) != IWC_OK || !iwc_state(gateway_, &status, &newest_)) {
    return false;
  }
  (void)iwc_text(&status, "ledger.wheel_radius.value", text, sizeof text);
  radius_m_ = static_cast<double>(std::strtol(text, nullptr, 10)) / 1000.0;
  received_ = Clock::now();
  return radius_m_ > 0.0;
}

bool Drive::open(const std::string & socket)
{
  if (gateway_ == nullptr) {
    return fail("not enough memory");
  }
  close();
  const iwc_result_t result = iwc_connect(gateway_, socket.empty() ? nullptr : socket.c_str(), CONNECT_MS);
  if (result != IWC_OK) {
    return fail(std::string("no gateway: ") + iwc_words(result));
  }
  if (iwc_watches_only(gateway_)) {
    return fail("this socket may only watch: use the gateway's own socket and the group iwheel");
  }
  if (!read_radius()) {
    return fail("the gateway does not report the radius of its wheels: set [wheels] radius_mm in gateway.conf");
  }
  if (iwc_watch(gateway_, IWC_WATCH_STATE | IWC_WATCH_STOP, RATE_HZ, ASK_MS) != IWC_OK) {
    return fail("the gateway does not answer");
  }
  state_ = State::INACTIVE;
  return true;
}

bool Drive::activate(const std::string & name)
{
  if (state_ != State::INACTIVE) {
    error_ = "not connected, or active already: configure first";
    return false;
  }
  iwc_terms_t terms;
  const iwc_result_t result = iwc_arm(gateway_, name.c_str(), false, ARM_MS, &terms);
  if (result == IWC_REFUSED) {
    error_ = iwc_reason(gateway_);
    return false;
  }
  if (result != IWC_OK) {
    return fail(iwc_words(result));  // The gateway may have granted the lease; closing the connection ends it.
  }
  state_ = State::ACTIVE;
  activated_ = Clock::now();
  return true;
}

bool Drive::deactivate()
{
  if (state_ != State::ACTIVE) {
    return true;
  }
  const iwc_result_t result = iwc_stop(gateway_, ASK_MS);
  state_ = State::INACTIVE;
  return (result == IWC_OK) || fail(std::string("stop: ") + iwc_words(result));
}

bool Drive::receive(const iwc_message_t & message)
{
  char text[256] = "";
  if (!message.is_event) {
    if (iwc_truth(&message, "ok").value != 0 || state_ != State::ACTIVE) {
      return true;
    }
    (void)iwc_text(&message, "message", text, sizeof text);
    return fail(std::string("a command was refused: ") + text);
  }
  if (iwc_state(gateway_, &message, &newest_)) {
    received_ = Clock::now();
  } else if (state_ == State::ACTIVE && iwc_is(&message, "event", "stop")) {
    (void)iwc_text(&message, "sentence", text, sizeof text);
    return fail(std::string("stopped: ") + text);
  }
  return true;
}

bool Drive::judge_active()
{
  const auto now = Clock::now();
  if (now - received_ > SILENT) {
    return fail("the gateway does not send; see its log (journalctl -u iwheel-gateway)");
  }
  if (received_ - activated_ > GRANTED && !(newest_.machine == IWC_ARMED && newest_.ours)) {
    return fail("the lease has ended");
  }
  for (const iwc_wheel_t * wheel : {&newest_.left, &newest_.right}) {
    if (!wheel->distance_mm.known || !wheel->speed_mm_s.known) {
      return fail("a wheel sends no telemetry: check its power and cable");
    }
  }
  return true;
}

bool Drive::read(std::array<Wheel, SIDES> & out_wheels)
{
  if (state_ == State::CLOSED) {
    return false;
  }
  iwc_message_t message;
  iwc_result_t result = iwc_latest(gateway_);
  if (result == IWC_OK) {
    for (result = iwc_next(gateway_, 0, &message); result == IWC_OK; result = iwc_next(gateway_, 0, &message)) {
      if (!receive(message)) {
        return false;
      }
    }
  }
  if (result != IWC_TIMEOUT && result != IWC_INTERRUPTED) {
    return fail(std::string("the connection has ended: ") + iwc_words(result));
  }
  if (state_ == State::ACTIVE && !judge_active()) {
    return false;
  }
  out_wheels = {wheel_of(newest_.left, radius_m_), wheel_of(newest_.right, radius_m_)};
  return true;
}

bool Drive::write(const std::array<double, SIDES> & rad_s)
{
  if (state_ != State::ACTIVE) {
    error_ = "not active";
    return false;
  }
  std::array<double, SIDES> mm_s;
  for (size_t side = 0; side < SIDES; side++) {
    mm_s[side] = std::round(rad_s[side] * radius_m_ * 1000.0);
    if (!(std::fabs(mm_s[side]) <= MOST_MM_S)) {  // Also true for NaN.
      return fail("a command is not a number, or faster than 32 m/s: fix the controller");
    }
  }
  const iwc_drive_t command = {static_cast<int32_t>(mm_s[LEFT]), static_cast<int32_t>(mm_s[RIGHT]), false, 0, 0};
  const iwc_result_t result = iwc_drive(gateway_, &command, 0, nullptr);
  return (result == IWC_OK) || fail(std::string("drive: ") + iwc_words(result));
}

}  // namespace iwheel_hardware
