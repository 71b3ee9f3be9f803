# SPDX-License-Identifier: MIT
# Makes a test program of the simulation fast: core and model are compiled again, together with it, as one program. Do not
# use it if instrumentation must measure the shipped core.
#
#     iwheel_whole_program(<target> <library...>)
include(CheckIPOSupported)
check_ipo_supported(RESULT iwheel_ipo OUTPUT iwheel_ipo_why LANGUAGES C)

function(iwheel_whole_program target)
    if(CMAKE_C_FLAGS MATCHES "sanitize|coverage" OR NOT iwheel_ipo)
        target_link_libraries(${target} PRIVATE ${ARGN})
        return()
    endif()
    foreach(library ${ARGN})
        get_target_property(sources ${library} SOURCES)
        get_target_property(folder ${library} SOURCE_DIR)
        list(TRANSFORM sources PREPEND "${folder}/")
        target_sources(${target} PRIVATE ${sources})
        target_include_directories(${target} PRIVATE "${folder}/include")
    endforeach()
    set_target_properties(${target} PROPERTIES INTERPROCEDURAL_OPTIMIZATION ON)
endfunction()
