// SPDX-License-Identifier: MIT
/// Checks of `doctor` and `bringup` before a wheel is touched. They send no frame.
#ifndef DOCTOR_H
#define DOCTOR_H

#include "config/gateway_config.h"
#include "inspect.h"
#include "talk/ctl.h"

/// Default time for which `doctor` listens.
#define DOCTOR_LISTEN_MS 2000U

typedef struct {
    ctl_t *ctl;
    const char *bus; ///< Bus to check; NULL: none was found.
    char found_bus[GATEWAY_ADDRESS_SIZE];
    gateway_config_t config; ///< Values of the file, or the defaults.
    near_gateway_t gateway;
    inspect_findings_t findings;
    inspect_traffic_t traffic;
    iwl_hal_t hal;
    bool open; ///< `hal` is open.
    unsigned listen_ms;
} doctor_t;

/// An option of the command line and its value; NULL if the option is absent.
typedef struct {
    const char *word;
    const char *value;
} doctor_named_t;

/// Sets the configuration in force: the file at `path`, otherwise the installed one if it exists; then the options.
/// Returns an exit code, after it has reported what is wrong.
int doctor_configure(gateway_config_t *config, const char *path, const doctor_named_t *bus, const char *estop);

/// Writes the names of the CAN interfaces, separated by spaces. Returns their number.
unsigned doctor_interfaces(char *out_names, size_t size);

/// Checks the parts that do not need an open bus: kernel, driver, clock, rights. Returns false if the kernel cannot
/// open a bus.
bool doctor_check_machine(doctor_t *self);

/// Adds the findings from the gateway's status, if there is a gateway.
void doctor_check_gateway(doctor_t *self);

/// Opens the bus (and, without a gateway, the e-stop), listens and judges.
void doctor_check_bus(doctor_t *self);

/// Closes everything that is open.
void doctor_close(doctor_t *self);

/// Returns the present level of the e-stop, from the gateway or from the line itself.
inspect_estop_t doctor_estop(doctor_t *self);

/// Prints the findings from number `first` on as text.
void doctor_print(const doctor_t *self, unsigned first);

#endif
