"""Physical constants and the channel names that every dataset shares."""

from __future__ import annotations

from typing import Final

SPEED_OF_LIGHT: Final = 299_792_458.0
"""Speed of light in vacuum, m/s (exact by definition of the metre)."""

CHANNELS: Final = ("lower", "upper")
"""The two interferometric channels: S1 is the lower antenna, S2 the upper one."""


def channel_names(count: int) -> tuple[str, ...]:
    """Return the names of channels above each other, the lowest and the highest at the ends."""
    between = ["middle"] if count == 3 else [f"middle {n}" for n in range(1, count - 1)]
    return (CHANNELS[0], *between, CHANNELS[1]) if count > 1 else CHANNELS[:count]


NORMAL_PER_MAD: Final = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

AXES: Final = ("x", "y", "z")
"""Right-handed axes in metres: x along the rail, y forward, z up."""

REGIONS: Final = ("whole_scene", "visible_ground", "shadow", "delivered")
"""The parts of the scene whose height errors are told apart."""
