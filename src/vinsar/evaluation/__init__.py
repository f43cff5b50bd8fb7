"""Results held against the truth."""
