"""Geometry of tongues: unit block, Bezier solid, the preliminary tongue, published meshes."""

if __name__ != "dolfin_tongue.geometry":
    raise ImportError(
        f"import dolfin_tongue.geometry, not {__name__}: the folder at the top of the checkout is "
        "a part of the package, and its classes would exist twice"
    )
