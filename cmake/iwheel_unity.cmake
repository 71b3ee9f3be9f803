# SPDX-License-Identifier: MIT
# Finds the Unity test framework, which is not part of this repository, and makes unit tests with it.
#
# Provides the target `iwheel_unity` and
#
#     iwheel_unit_test(<name> <sources...>)
#
# which makes the executable `unit_<name>` from the sources, links it with the core and Unity, and registers it with
# CTest as `unit.<name>`. More libraries: target_link_libraries(unit_<name> PRIVATE ...) after it.
#
# Sources of Unity, in the order of preference:
#   1. IWHEEL_UNITY_DIR, a folder with unity.c, unity.h and unity_internals.h
#   2. an installed CMake package that provides unity::framework
#   3. the copy in Debian's package cmock (Debian 13 and later)
#   4. the result of an earlier 5 or 6, stored in IWHEEL_UNITY_CACHE outside the build tree
#   5. the release pinned below, downloaded
#   6. the copy inside Debian's source package ntpsec
# Tests use the interface of Unity 2.5.1, the oldest of these.

set(IWHEEL_UNITY_DIR "" CACHE PATH "Folder with unity.c and unity.h; empty: search for Unity")
if(DEFINED ENV{XDG_CACHE_HOME})
    set(iwheel_cache_home "$ENV{XDG_CACHE_HOME}")
elseif(DEFINED ENV{HOME})
    set(iwheel_cache_home "$ENV{HOME}/.cache")
else()
    set(iwheel_cache_home "${CMAKE_BINARY_DIR}")
endif()
set(IWHEEL_UNITY_CACHE "${iwheel_cache_home}/iwheel/unity" CACHE PATH "Folder for a downloaded Unity")

set(iwheel_unity_version 2.6.1)
set(iwheel_unity_url https://github.com/ThrowTheSwitch/Unity/archive/refs/tags/v${iwheel_unity_version}.tar.gz)
set(iwheel_unity_sha256 b41a66d45a6b99758fb3202ace6178177014d52fc524bf1f72687d93e9867292)

# Sets `out_complete` to true if the folder has all files that are compiled.
function(iwheel_unity_is_complete folder out_complete)
    set(${out_complete} TRUE PARENT_SCOPE)
    foreach(file unity.c unity.h unity_internals.h)
        if(NOT EXISTS "${folder}/${file}")
            set(${out_complete} FALSE PARENT_SCOPE)
        endif()
    endforeach()
endfunction()

# Moves a downloaded folder into the cache in one step, so that parallel configurations never see a part of it.
function(iwheel_unity_keep folder)
    string(RANDOM LENGTH 8 suffix)
    file(MAKE_DIRECTORY "${IWHEEL_UNITY_CACHE}.${suffix}")
    foreach(file unity.c unity.h unity_internals.h)
        file(COPY "${folder}/${file}" DESTINATION "${IWHEEL_UNITY_CACHE}.${suffix}")
    endforeach()
    file(RENAME "${IWHEEL_UNITY_CACHE}.${suffix}" "${IWHEEL_UNITY_CACHE}" RESULT result)
    if(NOT result EQUAL 0) # Another configuration was first.
        file(REMOVE_RECURSE "${IWHEEL_UNITY_CACHE}.${suffix}")
    endif()
endfunction()

function(iwheel_unity_download)
    set(work "${CMAKE_BINARY_DIR}/unity-download")
    set(archive "${work}/unity.tar.gz")
    message(STATUS "Unity: trying the release ${iwheel_unity_version}")
    file(DOWNLOAD "${iwheel_unity_url}" "${archive}" STATUS status TIMEOUT 15 INACTIVITY_TIMEOUT 5)
    list(GET status 0 code)
    if(code EQUAL 0)
        file(SHA256 "${archive}" actual)
        if(actual STREQUAL iwheel_unity_sha256)
            file(ARCHIVE_EXTRACT INPUT "${archive}" DESTINATION "${work}" PATTERNS "*/src/unity*")
            iwheel_unity_keep("${work}/Unity-${iwheel_unity_version}/src")
        else()
            message(WARNING "Unity: the file from ${iwheel_unity_url} has the wrong SHA-256 ${actual}; it is not used")
        endif()
    else()
        list(GET status 1 reason)
        message(STATUS "Unity: no download (${reason})")
    endif()
    file(REMOVE_RECURSE "${work}")
endfunction()

function(iwheel_unity_from_debian)
    set(work "${CMAKE_BINARY_DIR}/unity-debian")
    message(STATUS "Unity: trying the source package ntpsec")
    execute_process(COMMAND "${PROJECT_SOURCE_DIR}/scripts/from_debian" unity "${work}" RESULT_VARIABLE result)
    if(result EQUAL 0)
        iwheel_unity_keep("${work}")
    endif()
    file(REMOVE_RECURSE "${work}")
endfunction()

# Sets `out_folder` to a folder with Unity's sources, or to an empty string.
function(iwheel_unity_find out_folder)
    foreach(folder /usr/share/cmock/vendor/unity/src "${IWHEEL_UNITY_CACHE}")
        iwheel_unity_is_complete("${folder}" complete)
        if(complete)
            set(${out_folder} "${folder}" PARENT_SCOPE)
            return()
        endif()
    endforeach()
    foreach(source download from_debian)
        cmake_language(CALL iwheel_unity_${source})
        iwheel_unity_is_complete("${IWHEEL_UNITY_CACHE}" complete)
        if(complete)
            set(${out_folder} "${IWHEEL_UNITY_CACHE}" PARENT_SCOPE)
            return()
        endif()
    endforeach()
    set(${out_folder} "" PARENT_SCOPE)
endfunction()

set(iwheel_unity_folder "${IWHEEL_UNITY_DIR}")
if(iwheel_unity_folder)
    iwheel_unity_is_complete("${iwheel_unity_folder}" iwheel_unity_complete)
    if(NOT iwheel_unity_complete)
        message(FATAL_ERROR "IWHEEL_UNITY_DIR=${iwheel_unity_folder} lacks unity.c, unity.h or unity_internals.h. "
            "Set it to the folder that has them (in Unity's own tree: src), or leave it empty.")
    endif()
else()
    find_package(unity QUIET)
    if(NOT TARGET unity::framework)
        iwheel_unity_find(iwheel_unity_folder)
    endif()
endif()

if(iwheel_unity_folder)
    message(STATUS "Unity: ${iwheel_unity_folder}")
    add_library(iwheel_unity STATIC "${iwheel_unity_folder}/unity.c")
    target_include_directories(iwheel_unity SYSTEM PUBLIC "${iwheel_unity_folder}")
    target_compile_definitions(iwheel_unity PUBLIC UNITY_SUPPORT_64)
elseif(TARGET unity::framework)
    message(STATUS "Unity: installed package")
    add_library(iwheel_unity INTERFACE)
    target_link_libraries(iwheel_unity INTERFACE unity::framework)
else()
    message(FATAL_ERROR "The unit tests need Unity, and no source of it is available. Set -DIWHEEL_UNITY_DIR=FOLDER with "
        "unity.c and unity.h in it, or -DBUILD_TESTING=OFF to build without tests.")
endif()

# Support files of many tests that need only the core are compiled once.
set(IWHEEL_SHARED_SUPPORT fixture fake_bus gateway_rig gateway_judge permit_rig setpoint_rig)

function(iwheel_shared_support file)
    if(NOT TARGET support_${file})
        add_library(support_${file} OBJECT "${PROJECT_SOURCE_DIR}/test/support/${file}.c")
        target_include_directories(support_${file} PRIVATE "${PROJECT_SOURCE_DIR}/test/support")
        target_link_libraries(support_${file} PRIVATE iwheel::core iwheel_unity iwheel_gnu)
    endif()
endfunction()

# `main` for tests without a `main` of their own.
add_library(iwheel_unit_main STATIC "${PROJECT_SOURCE_DIR}/test/support/unit_main.c")
target_link_libraries(iwheel_unit_main PRIVATE iwheel_unity iwheel_gnu)

add_custom_target(iwheel_unit_tests) # All unit tests and their dependencies.

function(iwheel_unit_test name)
    set(sources ${ARGN})
    foreach(file ${IWHEEL_SHARED_SUPPORT})
        if("../support/${file}.c" IN_LIST sources)
            iwheel_shared_support(${file})
            list(REMOVE_ITEM sources "../support/${file}.c")
            list(APPEND sources $<TARGET_OBJECTS:support_${file}>)
        endif()
    endforeach()
    add_executable(unit_${name} ${sources})
    target_include_directories(unit_${name} PRIVATE "${PROJECT_SOURCE_DIR}/test/support")
    target_link_libraries(unit_${name} PRIVATE iwheel::core iwheel_unit_main iwheel_unity iwheel_gnu)
    add_dependencies(iwheel_unit_tests unit_${name})
    add_test(NAME unit.${name} COMMAND unit_${name})
    set_tests_properties(unit.${name} PROPERTIES LABELS unit TIMEOUT 1200) # Some steps of ./check have little processor time.
endfunction()
