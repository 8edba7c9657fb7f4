"""Runs in time: observed, written to files as they go, resumed."""
