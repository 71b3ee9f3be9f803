# SPDX-License-Identifier: MIT
"""Reads several registers of the CPU in one call; one wrapped call for each costs a third of the emulation's time."""

import ctypes

from unicorn.unicorn_py3.unicorn import uclib


class Registers:
    def __init__(self, cpu, *ids):
        self.engine, self.count = cpu._uch, len(ids)
        self.ids = (ctypes.c_int * self.count)(*ids)
        self.slots = (ctypes.c_uint64 * self.count)()
        first, size = ctypes.addressof(self.slots), ctypes.sizeof(ctypes.c_uint64)
        self.pointers = (ctypes.c_void_p * self.count)(*(first + size * at for at in range(self.count)))

    def read(self):
        uclib.uc_reg_read_batch(self.engine, self.ids, self.pointers, self.count)
        return self.slots[:]

    def write(self, *values):
        self.slots[:] = values
        uclib.uc_reg_write_batch(self.engine, self.ids, self.pointers, self.count)
