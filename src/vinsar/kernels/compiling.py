"""How kernels are compiled: serial, without the interpreter lock, once for all processes."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import shutil
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile

logger = logging.getLogger(__name__)

# Letting products and sums fuse halves the arithmetic; no kernel depends on their rounding.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "nsz"},
}


_HOME = Path(__file__).parent


def _digest() -> str:
    """Return the digest of whatever the machine code of a kernel depends on."""
    digest = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__}".encode())
    for source in sorted(_HOME.glob("*.py")):
        content = source.read_bytes()
        digest.update(f" {source.name} {len(content)} ".encode() + content)
    return digest.hexdigest()


_FAMILY = "vinsar-"
_FOLDER = f"{_FAMILY}{_digest()[:16]}"


class _Cache(FunctionCache):
    """Numba's cache in a folder for each state of all kernel sources, Numba and llvmlite.

    Numba itself asks only for the source of the kernel, its processor and its own version, so that
    a kernel would keep the old code of an edited helper. What cannot be read, such as a file that
    a full disk has cut short, is compiled again. In NUMBA_CACHE_DIR all copies of the same sources
    share their machine code, wherever they lie and whenever they were written.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        locator = self._impl.locator
        place, stamp = locator.get_cache_path(), locator.get_source_stamp()
        if Path(function.__code__.co_filename).parent == _HOME:
            # The folder's name tells all that the stamp would.
            place, stamp = numba.config.CACHE_DIR or place, _FOLDER
        self._cache_path = str(Path(place) / _FOLDER)
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled kernel, or None if there is none that can be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # whatever a spoilt pickle may raise
            logger.warning("%s is compiled again: its cache is spoilt (%s)", self._name, error)
            with contextlib.suppress(OSError):
                Path(self._cache_file._index_path).unlink()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled kernel, and remove what older sources were compiled to."""
        folder = Path(self._cache_path)
        try:
            if not folder.is_dir():
                # Where several copies of the sources may share, the others' stays.
                for older in () if numba.config.CACHE_DIR else folder.parent.glob(f"{_FAMILY}*"):
                    shutil.rmtree(older, ignore_errors=True)
                folder.mkdir(parents=True, exist_ok=True)
            super().save_overload(sig, data)
        except OSError as error:
            logger.warning("%s could not be cached: %s", self._name, error)


def kernel(function: Any) -> Any:
    """Compile a function that is called from Python, and cache the machine code.

    It is written beside the source, into the user's cache directory where the source cannot be
    written to, or where NUMBA_CACHE_DIR says. Where it may be written nowhere, each process
    compiles.
    """
    compiled = njit(**_OPTIONS)(function)
    if numba.config.DISABLE_JIT:
        return compiled
    try:
        compiled._cache = _Cache(function)
    except RuntimeError:
        logger.debug("%s is not cached: there is nowhere to write", function)
    return compiled


def part(function: Any) -> Any:
    """Compile a function that only kernels call, as a part of them."""
    return njit(inline="always", **_OPTIONS)(function)


def helper(function: Any) -> Any:
    """Compile a function that only kernels call, by itself."""
    return njit(**_OPTIONS)(function)
