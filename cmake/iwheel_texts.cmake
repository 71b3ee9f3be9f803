# SPDX-License-Identifier: MIT
# iwheel_texts(TARGET NAME FILE...): what a program prints from files, compiled in. The header NAME_texts.h defines for each FILE a string:
# that of help/status.txt is NAME_status. Made while configuring, so that whoever compiles one file alone has it; an edit configures anew.
function(iwheel_texts target name)
    set(IWHEEL_TEXTS "")
    foreach(file IN LISTS ARGN)
        set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
        file(READ ${file} text)
        string(REPLACE "\\" "\\\\" text "${text}")
        string(REPLACE "\"" "\\\"" text "${text}")
        string(REGEX REPLACE "\n$" "" text "${text}")
        string(REPLACE "\n" "\\n\"\n    \"" text "${text}")
        get_filename_component(stem ${file} NAME_WE)
        string(APPEND IWHEEL_TEXTS "\nstatic const char ${name}_${stem}[] =\n    \"${text}\\n\";\n")
    endforeach()
    configure_file(${PROJECT_SOURCE_DIR}/cmake/texts.h.in ${CMAKE_CURRENT_BINARY_DIR}/texts/${name}_texts.h @ONLY)
    target_include_directories(${target} PUBLIC ${CMAKE_CURRENT_BINARY_DIR}/texts)
endfunction()
