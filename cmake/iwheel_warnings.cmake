# SPDX-License-Identifier: MIT
# Warnings that every target of ours is built with. An interface target, so that nothing leaks to who embeds the core.
add_library(iwheel_warnings INTERFACE)
target_compile_options(iwheel_warnings INTERFACE
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wcast-qual -Wstrict-prototypes
    -Wmissing-prototypes -Wundef -Werror)
