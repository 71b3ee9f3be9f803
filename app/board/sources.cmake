# SPDX-License-Identifier: MIT
# The board's side of the serial line to the host, without the chip: for the image, and for tests on this machine, which
# link it with iwheel_northbound_server and a serial line of their own.
set(iwheel_host_sources board_answers.c configure.c confirm.c host.c host_send.c board_assumptions.c pending.c board_settings.c board_events.c)
list(TRANSFORM iwheel_host_sources PREPEND ${CMAKE_CURRENT_LIST_DIR}/)
