"""Bones and scenes of tongues that demos, tests and benchmarks share."""
