"""The radar: waveform, antennas, geometry, aperture, motion."""
