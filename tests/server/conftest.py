"""A model on disk."""

import pytest
from conftest import ARM


@pytest.fixture
def arm(tmp_path):
    """The path of a model with two arms."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path
