"""States of a motion, the diagnosis of a lost one, comparison of two."""
