"""Sweeps and variants of a study, on a workstation or a cluster."""
