"""Functions that loops evaluate, mostly in single precision, in a form that vectorises."""

from __future__ import annotations

from typing import Any

import numpy as np

from vinsar.kernels.compiling import part

# Fits of sin(pi t) / t and cos(pi t) in powers of t^2 on |t| <= 1/2, errors below 1.2e-6 and 5e-8.
# PyPI's llvmlite has no vector math library: math.sin would keep the loop scalar.
_S0 = np.float32(3.1415902702069918)
_S1 = np.float32(-5.16740673327233)
_S2 = np.float32(2.544010518503205)
_S3 = np.float32(-0.5594624554675647)
_C0 = np.float32(0.9999999532476083)
_C1 = np.float32(-4.934792830619607)
_C2 = np.float32(4.058411352861885)
_C3 = np.float32(-1.3318765680766596)
_C4 = np.float32(0.21968961108988486)
# The same with one more power each: errors below 1.4e-8 and 3e-10.
_F0 = np.float32(3.141592640183991)
_F1 = np.float32(-5.167710090331259)
_F2 = np.float32(2.550077659718429)
_F3 = np.float32(-0.5982921594012917)
_F4 = np.float32(0.07765940809071067)
_G0 = np.float32(0.9999999997806519)
_G1 = np.float32(-4.934802137228358)
_G2 = np.float32(4.058709164342325)
_G3 = np.float32(-1.3352120566615802)
_G4 = np.float32(0.23493755892205392)
_G5 = np.float32(-0.0243967165523548)
# log2((1 + s) / (1 - s)) / s in powers of s^2 for a ratio of sqrt(1/2) to sqrt(2), and 2^t on
# |t| <= 1/2: errors of the logarithm below 6e-8, of the power below 8e-8 of itself.
_L0 = np.float32(2.885390425947)
_L1 = np.float32(0.9615878611117348)
_L2 = np.float32(0.5957965140905794)
_E0 = np.float32(1.000000071654639)
_E1 = np.float32(0.6931469670633592)
_E2 = np.float32(0.2402211972398715)
_E3 = np.float32(0.05550713275787338)
_E4 = np.float32(0.00967554132854452)
_E5 = np.float32(0.0013276471252404304)
# atan(t) / t in powers of t^2 on |t| <= tan(pi / 8): errors below 2e-15.
_A0, _A1, _A2 = 0.9999999999999997, -0.33333333333210663, 0.19999999977383892
_A3, _A4, _A5 = -0.14285712628853892, 0.11111048381739347, -0.0908952721842443
_A6, _A7, _A8 = 0.07673539065407259, -0.06506106895734384, 0.05025322875622525
_A9 = -0.025324847527954004
_EIGHTH = float(np.sqrt(2) - 1)
# A single-precision number: 23 bits of fraction below the exponent, whose zero is 127.
_FRACTION_BITS, _FRACTION, _EXPONENT_ZERO = np.int32(23), np.int32(0x7FFFFF), np.int32(127)
_ROOT_HALF = np.float32(np.sqrt(0.5)).view(np.int32)
_LEAST, _LEAST_EXPONENT = np.finfo(np.float32).tiny, np.float32(-126)
_ONE, _HALF, _SIXTH = np.float32(1), np.float32(0.5), np.float32(1 / 6)
_TWO_THIRDS = np.float32(2 / 3)


@part
def phasor(turn: Any) -> Any:
    """Return cosine and sine of an angle in cycles, -1/2 to 1/2; errors below -105 dB."""
    q = turn * turn
    s = turn * (_S0 + q * (_S1 + q * (_S2 + q * _S3)))
    c = _C0 + q * (_C1 + q * (_C2 + q * (_C3 + q * _C4)))
    twice = s + s
    return _ONE - twice * s, twice * c


@part
def fine_phasor(turn: Any) -> Any:
    """Return cosine and sine of an angle in cycles, -1/2 to 1/2; errors below -124 dB."""
    q = turn * turn
    s = turn * (_F0 + q * (_F1 + q * (_F2 + q * (_F3 + q * _F4))))
    c = _G0 + q * (_G1 + q * (_G2 + q * (_G3 + q * (_G4 + q * _G5))))
    twice = s + s
    return _ONE - twice * s, twice * c


@part
def spline(fraction: Any) -> Any:
    """Return the weights of the four cubic B-splines that reach a place between two samples."""
    rest, square = _ONE - fraction, fraction * fraction
    first = _SIXTH * rest * (rest * rest)
    second = _TWO_THIRDS + square * (_HALF * fraction - _ONE)
    fourth = _SIXTH * fraction * square
    return first, second, _ONE - first - second - fourth, fourth


@part
def power(base: Any, exponent: Any) -> Any:
    """Return a base, 0 to 1, to a positive exponent of at most 1; 0 for what is below 1e-38.

    Roundings of the exponent of two err by 3e-7 of the result for each power of two that it lies
    below 1.
    """
    # Numba widens what integers come to; the casts keep them as wide as the numbers.
    bits = np.int32(np.float32(base).view(np.int32) - _ROOT_HALF)
    whole = np.float32(np.int32(bits >> _FRACTION_BITS))
    ratio = np.int32((bits & _FRACTION) + _ROOT_HALF).view(np.float32)
    s = (ratio - _ONE) / (ratio + _ONE)
    q = s * s
    two = exponent * (whole + s * (_L0 + q * (_L1 + q * _L2)))
    two = max(two, _LEAST_EXPONENT)
    nearest = np.floor(two + _HALF)
    t = two - nearest
    value = _E0 + t * (_E1 + t * (_E2 + t * (_E3 + t * (_E4 + t * _E5))))
    scale = np.int32((np.int32(nearest) + _EXPONENT_ZERO) << _FRACTION_BITS).view(np.float32)
    return value * scale if base >= _LEAST else np.float32(0)


@part
def angle(real: Any, imag: Any) -> Any:
    """Return the angle of a complex number in double precision, rad; 0 for 0."""
    across, up = abs(real), abs(imag)
    steep = up > across
    less, more = (across, up) if steep else (up, across)
    # Beyond an eighth of a turn's tangent, from the diagonal: one division for both.
    diagonal = less > _EIGHTH * more
    over, under = (less - more, less + more) if diagonal else (less, more)
    t = over / under if under != 0 else over
    q = t * t
    high = _A5 + q * (_A6 + q * (_A7 + q * (_A8 + q * _A9)))
    value = t * (_A0 + q * (_A1 + q * (_A2 + q * (_A3 + q * (_A4 + q * high)))))
    value += np.pi / 4 if diagonal else 0.0
    value = np.pi / 2 - value if steep else value
    value = np.pi - value if real < 0 else value
    return -value if imag < 0 else value
