# SPDX-License-Identifier: MIT
# Warnings that every target of ours is built with. An interface target, so that nothing leaks to who embeds the core.
add_library(iwheel_warnings INTERFACE)
target_compile_options(iwheel_warnings INTERFACE
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wcast-qual -Wstrict-prototypes
    -Wmissing-prototypes -Wundef)
# A newer compiler's new warning must not stop somebody else's build, nor a distribution's.
option(IWHEEL_WERROR "Warnings are errors" ${PROJECT_IS_TOP_LEVEL})
if(IWHEEL_WERROR)
    target_compile_options(iwheel_warnings INTERFACE -Werror)
endif()

# What is written for Linux, with the C library's extensions.
add_library(iwheel_gnu INTERFACE)
target_compile_definitions(iwheel_gnu INTERFACE _GNU_SOURCE)
target_link_libraries(iwheel_gnu INTERFACE iwheel_warnings)
