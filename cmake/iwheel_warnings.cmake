# SPDX-License-Identifier: MIT
# Warnings for every target of this project. An interface target, so that projects that embed the core do not get them.
add_library(iwheel_warnings INTERFACE)
target_compile_options(iwheel_warnings INTERFACE
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wcast-qual -Wstrict-prototypes
    -Wmissing-prototypes -Wundef)
# A new warning of a newer compiler must not break the builds of other projects and distributions.
option(IWHEEL_WERROR "Warnings are errors" ${PROJECT_IS_TOP_LEVEL})
if(IWHEEL_WERROR)
    target_compile_options(iwheel_warnings INTERFACE -Werror)
endif()

# For code that is written for Linux, with the C library's extensions.
add_library(iwheel_gnu INTERFACE)
target_compile_definitions(iwheel_gnu INTERFACE _GNU_SOURCE)
target_link_libraries(iwheel_gnu INTERFACE iwheel_warnings)
