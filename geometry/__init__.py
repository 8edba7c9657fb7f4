"""Geometry of tongues: unit block, Bezier solid, the preliminary tongue, published meshes."""
