"""Arrays, errors, units, files, compilation: what every room uses."""
