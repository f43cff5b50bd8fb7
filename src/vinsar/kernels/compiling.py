"""How kernels are compiled: serial, without the interpreter lock, once for all processes."""

from __future__ import annotations

from typing import Any

from numba import njit

# Letting products and sums fuse halves the arithmetic; no kernel depends on their rounding.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "nsz"},
}


def kernel(function: Any) -> Any:
    """Compile a function that is called from Python, and cache the machine code.

    Numba writes it beside the source, into the user's cache directory where the source cannot be
    written to, or where NUMBA_CACHE_DIR says. Where it may write nowhere, each process compiles.
    """
    try:
        return njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:
        return njit(**_OPTIONS)(function)


def part(function: Any) -> Any:
    """Compile a function that only kernels call, as a part of them."""
    return njit(inline="always", **_OPTIONS)(function)


def helper(function: Any) -> Any:
    """Compile a function that only kernels call, by itself."""
    return njit(**_OPTIONS)(function)
