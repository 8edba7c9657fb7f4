"""Runs in time: observed, described, written to files as they go, resumed, read back."""

from dolfin_tongue.record.run import Run, load_run, simulate

__all__ = ["Run", "load_run", "simulate"]
