"""What the figures share: declaration, style, maps, curves of sweeps, and writing to files."""
