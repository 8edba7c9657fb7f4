"""``python3 -m dolfin_tongue``."""

from dolfin_tongue.app.cli import app

app()
