"""The body at rest: points, cells, named regions, fibres. Plain arrays, no solver."""
