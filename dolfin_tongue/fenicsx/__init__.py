"""The FEniCSx solver: UFL forms of the terms, DOLFINx spaces, PETSc SNES and TS."""
