// SPDX-License-Identifier: MIT
/// @file
/// The interface of client.h for C++11. The destructor closes the connection, which ends the lease, however the
/// scope ends.
///
///     iwheel::Client gateway;
///     if (gateway.connect() == IWC_OK && gateway.arm("example") == IWC_OK) {
///         gateway.drive(200, 200);            // again within gateway.terms().lease_ms, or the wheels stop
///     }                                       // the end of `gateway` stops them too
///
/// Results, timeouts and the rules for threads are those of client.h. Only the constructor throws (std::bad_alloc). All
/// functions of client.h work with `handle()`.
#ifndef IWHEEL_CLIENT_HPP
#define IWHEEL_CLIENT_HPP

#include "client.h"

#include <memory>
#include <new>
#include <string>

namespace iwheel {

/// A connection, or none. It cannot be copied.
class Client {
  public:
    /// Creates a client without a connection. Throws std::bad_alloc.
    Client() : self_(iwc_new()) {
        if (!self_) {
            throw std::bad_alloc();
        }
    }

    iwc_t *handle() const noexcept { return self_.get(); } ///< Handle for the functions of client.h.
    int fd() const noexcept { return iwc_fd(handle()); } ///< See iwc_fd.
    const iwc_terms_t &terms() const noexcept { return terms_; } ///< Terms of the last granted `arm`.
    std::string error() const { return iwc_error(handle()); } ///< See iwc_error.
    std::string reason() const { return iwc_reason(handle()); } ///< See iwc_reason.

    /// See iwc_connect. An empty path means the only running gateway.
    iwc_result_t connect(const std::string &path = "", int timeout_ms = 1000) noexcept {
        return iwc_connect(handle(), path.empty() ? nullptr : path.c_str(), timeout_ms);
    }
    void close() noexcept { iwc_close(handle()); } ///< See iwc_close.

    /// See iwc_next.
    iwc_result_t next(iwc_message_t &out, int timeout_ms) noexcept { return iwc_next(handle(), timeout_ms, &out); }
    iwc_result_t latest() noexcept { return iwc_latest(handle()); } ///< See iwc_latest.
    /// See iwc_ask.
    iwc_result_t ask(const std::string &request, iwc_message_t &out, int timeout_ms = 1000) noexcept {
        return iwc_ask(handle(), request.c_str(), timeout_ms, &out);
    }
    /// See iwc_status.
    iwc_result_t status(iwc_state_t &out, int timeout_ms = 1000) noexcept { return iwc_status(handle(), timeout_ms, &out); }
    /// See iwc_watch.
    iwc_result_t watch(unsigned topics, int rate_hz = 10, int timeout_ms = 1000) noexcept {
        return iwc_watch(handle(), topics, rate_hz, timeout_ms);
    }

    /// See iwc_arm. `terms` returns the terms afterwards.
    iwc_result_t arm(const std::string &name, bool takeover = false, int timeout_ms = 1000) noexcept {
        return iwc_arm(handle(), name.c_str(), takeover, timeout_ms, &terms_);
    }
    /// Sends one command, once. With a timeout of 0 it does not wait for the reply. See iwc_drive.
    iwc_result_t drive(int32_t left_mm_s, int32_t right_mm_s, int timeout_ms = 100, iwc_applied_t *out = nullptr) noexcept {
        const iwc_drive_t command = {left_mm_s, right_mm_s, false, 0, 0};
        return iwc_drive(handle(), &command, timeout_ms, out);
    }
    /// Sends one command with currents.
    iwc_result_t drive(const iwc_drive_t &command, int timeout_ms = 100, iwc_applied_t *out = nullptr) noexcept {
        return iwc_drive(handle(), &command, timeout_ms, out);
    }
    /// See iwc_twist.
    iwc_result_t twist(int32_t v_mm_s, int32_t yaw_mrad_s, int timeout_ms = 100, iwc_applied_t *out = nullptr) noexcept {
        return iwc_twist(handle(), v_mm_s, yaw_mrad_s, timeout_ms, out);
    }
    iwc_result_t stop(int timeout_ms = 1000) noexcept { return iwc_stop(handle(), timeout_ms); } ///< See iwc_stop.
    /// See iwc_estop. An empty reason means none.
    iwc_result_t estop(const std::string &reason = "", int timeout_ms = 1000) noexcept {
        return iwc_estop(handle(), reason.empty() ? nullptr : reason.c_str(), timeout_ms);
    }
    iwc_result_t reset(int timeout_ms = 1000) noexcept { return iwc_reset(handle(), timeout_ms); } ///< See iwc_reset.

  private:
    struct Free {
        void operator()(iwc_t *self) const noexcept { iwc_free(self); }
    };
    std::unique_ptr<iwc_t, Free> self_;
    iwc_terms_t terms_{};
};

} // namespace iwheel

#endif
