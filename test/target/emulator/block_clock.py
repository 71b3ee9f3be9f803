# SPDX-License-Identifier: MIT
"""The functions and structures of block_hook.c."""

import ctypes

from unicorn.unicorn_py3.unicorn import uclib

MASKED, ENTERED, WITHOUT_STACK = range(3)
READ_CFUNC = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_int64, ctypes.c_uint32, ctypes.c_uint32)
WRITE_CFUNC = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32)
UNICORN = {
    "start": uclib.uc_emu_start,
    "stop": uclib.uc_emu_stop,
    "read_registers": uclib.uc_reg_read_batch,
    "write_registers": uclib.uc_reg_write_batch,
    "read_memory": uclib.uc_mem_read,
    "write_memory": uclib.uc_mem_write,
}


class Input(ctypes.Structure):
    _fields_ = [("address", ctypes.c_uint32), ("value", ctypes.c_uint32), ("is_known", ctypes.c_int32)]


class BlockClock(ctypes.Structure):
    _fields_ = [
        ("left", ctypes.c_int64),
        ("spent", ctypes.c_int64),
        ("now_ns", ctypes.c_int64),
        ("busy_ns", ctypes.c_int64),
        ("core_hz", ctypes.c_int64),
        ("tick_ns", ctypes.c_int64),
        ("tick_load", ctypes.c_uint32),
        ("icsr", ctypes.c_uint32),
        ("is_asked_to_stop", ctypes.c_int32),
        ("has_stopped", ctypes.c_int32),
        ("trap", ctypes.c_int32),
        ("begun_at", ctypes.c_uint32),
        ("access_cycles", ctypes.c_int32),
        ("ram_size", ctypes.c_int32),
        ("ids", ctypes.c_int32 * 10),
        ("inputs", Input * 4),
        ("can_blocks", ctypes.c_uint32 * 2),
        ("can", ctypes.c_void_p),
        ("read_can", ctypes.c_void_p),
        ("read", READ_CFUNC),
        ("write", WRITE_CFUNC),
        ("engine", ctypes.c_void_p),
        *((name, ctypes.c_void_p) for name in UNICORN),
    ]

    def __init__(self, access_cycles, ram_size, cpu, ids, accesses):
        functions = {name: ctypes.cast(function, ctypes.c_void_p) for name, function in UNICORN.items()}
        super().__init__(access_cycles=access_cycles, ram_size=ram_size, engine=cpu._uch, tick_ns=-1, **functions)
        self.ids[:] = ids
        self.read, self.write = accesses


class Space(ctypes.Structure):
    _fields_ = [("clock", ctypes.POINTER(BlockClock)), ("base", ctypes.c_uint32)]


def declare(library):
    clock = ctypes.POINTER(BlockClock)
    library.block_clock_spend.argtypes, library.block_clock_spend.restype = (clock, ctypes.c_int64), None
    library.block_clock_execute.argtypes = clock, ctypes.c_int64, ctypes.c_uint64, ctypes.c_uint32
    library.block_clock_enter.argtypes = clock, ctypes.c_uint32, ctypes.c_bool
    library.block_clock_leave.argtypes = (clock,)
