// SPDX-License-Identifier: MIT
/// What `doctor` and `bringup` look at before anybody touches the wheels. Nothing here sends a frame.
#ifndef DOCTOR_H
#define DOCTOR_H

#include "config/gateway_config.h"
#include "inspect.h"
#include "talk/ctl.h"

/// How long `doctor` listens unless told otherwise.
#define DOCTOR_LISTEN_MS 2000U

typedef struct {
    ctl_t *ctl;
    const char *bus; ///< In question; null: none could be found.
    char found_bus[GATEWAY_ADDRESS_SIZE];
    gateway_config_t config; ///< The file's, or the defaults.
    near_gateway_t gateway;
    inspect_findings_t findings;
    inspect_heard_t heard;
    iwl_hal_t hal;
    bool open; ///< `hal` is.
    unsigned listen_ms;
} doctor_t;

/// A word of the command line and what it says; NULL: nothing.
typedef struct {
    const char *word;
    const char *value;
} doctor_named_t;

/// The configuration in force: the file at `path`, or else the installed one if there is one; then the words. An exit code, after
/// telling what is wrong.
int doctor_configure(gateway_config_t *config, const char *path, const doctor_named_t *bus, const char *estop);

/// The interfaces of the kind CAN, separated by blanks. How many.
unsigned doctor_interfaces(char *out_names, size_t size);

/// Kernel, driver, clock, rights: what does not need the bus to be open. False if the kernel cannot open it at all.
bool doctor_look_at_machine(doctor_t *self);

/// What the gateway tells of itself, if there is one.
void doctor_look_at_gateway(doctor_t *self);

/// Opens the bus (and, without a gateway, the e-stop), listens and judges.
void doctor_look_at_bus(doctor_t *self);

/// Closes what is open.
void doctor_close(doctor_t *self);

/// The e-stop's present level, from the gateway or from the line itself.
inspect_estop_t doctor_estop(doctor_t *self);

/// Prints the findings from number `first` on for people.
void doctor_print(const doctor_t *self, unsigned first);

#endif
