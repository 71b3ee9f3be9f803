// SPDX-License-Identifier: MIT
#include "simulator.h"
#include "tell.h"

#include <sysexits.h>

int main(int argc, char **argv) {
    static sim_simulator_t simulator;
    sim_options_t options;
    int result = sim_options_read(&options, argc, argv);
    if (result >= 0) {
        return result;
    }
    if (options.command[0] != '\0') {
        return sim_tell(options.control_path, options.command);
    }
    result = sim_simulator_open(&simulator, &options);
    if (result >= 0) {
        return result;
    }
    sim_simulator_run(&simulator);
    sim_simulator_close(&simulator);
    return EX_OK;
}
