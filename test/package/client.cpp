// SPDX-License-Identifier: MIT
// A C++ program uses the client: it moves the connection, leaves early on an error, and closes the connection at the end of a scope.
#include <iwheel_client/client.hpp>

#include <cstdio>
#include <utility>

static iwc_result_t drive(iwheel::Client &gateway) {
    iwc_state_t state;
    iwc_message_t message;
    iwc_result_t result = gateway.connect();
    if (result != IWC_OK) {
        return result;
    }
    if ((result = gateway.arm("client.cpp")) != IWC_OK || (result = gateway.drive(100, 100)) != IWC_OK) {
        return result;
    }
    (void)gateway.status(state);
    (void)gateway.watch(IWC_WATCH_STATE | IWC_WATCH_STOP);
    (void)gateway.latest();
    (void)gateway.next(message, 0);
    return gateway.stop();
}

int main() {
    iwheel::Client gateway;
    iwheel::Client moved = std::move(gateway);
    const iwc_result_t result = drive(moved);
    if (result != IWC_OK) {
        std::fprintf(stderr, "%s\n", moved.reason().c_str());
    }
    return (result == IWC_OK) ? 0 : 1;
}
