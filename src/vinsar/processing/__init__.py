"""From echoes to heights, without the truth."""
