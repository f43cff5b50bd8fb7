"""Numba loops over plain arrays: serial, without the interpreter lock, compiled once and cached."""
