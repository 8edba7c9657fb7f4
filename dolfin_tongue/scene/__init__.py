"""A scene: a body and what is picked for it; whether it can be solved at all."""

from dolfin_tongue.scene.scene import Scene

__all__ = ["Scene"]
