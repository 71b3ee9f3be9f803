# SPDX-License-Identifier: MIT
# Bare-metal Cortex-M with Debian's gcc-arm-none-eabi.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_ASM_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY) # Nothing links without a linker script.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES IWHEEL_ARM_CPU)

set(IWHEEL_ARM_CPU cortex-m4 CACHE STRING "cortex-m0plus, cortex-m3 or cortex-m4")
# The stack and call graph files change no code; scripts/stack_usage.py reads them.
set(CMAKE_C_FLAGS_INIT
    "-mcpu=${IWHEEL_ARM_CPU} -mthumb -mfloat-abi=soft -ffunction-sections -fdata-sections -fno-common -fstack-usage -fcallgraph-info=su")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
