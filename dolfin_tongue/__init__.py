"""A 3D, dynamic, incompressible, muscle-activated tongue under large deformation."""

__version__ = "0.1.0"
