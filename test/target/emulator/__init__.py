# SPDX-License-Identifier: MIT
"""An STM32 in virtual time: Unicorn as its CPU, models of the peripherals that the port touches, a bus with two wheels."""
