"""The command line, demos and the pictures of a run."""
