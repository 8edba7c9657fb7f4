"""Options and fixtures of all tests."""

import os
from pathlib import Path

import pytest


def pytest_addoption(parser):
    parser.addoption(
        "--data",
        default=os.environ.get("DOLFIN_TONGUE_DATA"),
        help="folder of a published tongue (tongue.vtu, muscles.json, attachments.json)",
    )


@pytest.fixture(scope="session")
def published_folder(request) -> Path:
    folder = request.config.getoption("--data")
    if not folder or not Path(folder, "tongue.vtu").exists():
        pytest.skip("no published tongue: give its folder with --data or DOLFIN_TONGUE_DATA")
    return Path(folder)
