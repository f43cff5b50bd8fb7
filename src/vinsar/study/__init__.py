"""A study: its configuration, its checks, its pipeline, its own data."""
