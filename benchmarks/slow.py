"""The slow tests: pytest -m slow."""

import os
import subprocess
import sys

from dolfin_tongue.app.demo import CHECKOUT, Options
from dolfin_tongue.base.errors import TongueError


def main(options: Options) -> dict[str, object]:
    """Run the tests that are marked slow; TongueError if one fails."""
    environment = dict(os.environ)
    if options.data:
        environment["DOLFIN_TONGUE_DATA"] = str(options.data.resolve())
    command = [sys.executable, "-m", "pytest", "-m", "slow", "-s"]
    done = subprocess.run(command, cwd=CHECKOUT, env=environment)
    if done.returncode:
        raise TongueError(f"pytest ended with {done.returncode}")
    return {"slow tests": "passed"}
