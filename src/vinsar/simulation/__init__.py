"""The true scene and its echo: the one wing that knows the truth."""
