"""``python3 -m dolfin_tongue``."""

from dolfin_tongue.cli import app

app()
