"""Two made-up drives."""

from __future__ import annotations

import pytest

from app.stage.stage import Picture
from study_core.scene import Scene
from tests.stage.made_up import drive


@pytest.fixture
def scenes() -> tuple[Scene, Scene]:
    """A and B."""
    return drive(), drive(sway=-0.4, length=2.9, yaw_rad=-2.5)


@pytest.fixture
def picture(scenes: tuple[Scene, Scene]) -> Picture:
    """The first query."""
    return Picture("0", *scenes)
