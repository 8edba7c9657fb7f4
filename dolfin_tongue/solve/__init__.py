"""Solvers of the semi-discrete equations: statics and motion in time."""
