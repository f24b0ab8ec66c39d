"""The JSON API keeps to its description, whatever it is sent, and says what the desk's pages say."""

from __future__ import annotations

from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import positive_data_acceptance

from app.desk.access import CALLERS
from app.store import Role
from tests.desk.conftest import Opener
from tests.desk.laboratory import Laboratory

# A hundred ways to say what isn't allowed differ in nothing that the code looks at.
FAST, SLOW = 2, 60
REFUSED = ["400", "401", "403", "404", "405", "409", "410", "411", "413", "422"]
MODES = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)


def keep_to_the_description(lab: Laboratory, n_examples: int, **known: str) -> int:
    """Sends each operation what the description allows and what it doesn't; returns how many operations there are.

    Args:
        lab: Whose API.
        n_examples: Of each kind, for each operation.
        known: Path parameters that are to be as given.
    """
    config = schemathesis.Config.from_dict(
        {"checks": {"negative_data_rejection": {"expected-statuses": REFUSED}}}
    )
    schema = schemathesis.openapi.from_url(f"{lab.url}/api/v1/openapi.json", config=config)
    with lab.program(Role.OWNER) as owner:
        headers = {"Authorization": owner.headers["authorization"]}
    operations = [found.ok() for found in schema.get_all_operations()]
    for operation in operations:
        theirs = {name: value for name, value in known.items() if f"{{{name}}}" in operation.path}
        for mode in MODES if not known else MODES[:1]:
            if known and (not theirs or operation.method == "delete"):
                continue
            _try(operation.as_strategy(mode, path_parameters=theirs or None), headers, n_examples)
    return len(operations)


def _try(cases: Any, headers: dict[str, str], n_examples: int) -> None:
    @settings(
        max_examples=n_examples,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
        database=None,
        derandomize=True,
    )
    @given(case=cases)
    def keeps_to_it(case: schemathesis.Case) -> None:
        # A description can't say that a verdict needs a reason.
        case.call_and_validate(headers=headers, excluded_checks=[positive_data_acceptance])

    keeps_to_it()


def test_every_operation_keeps_to_its_description(opened: Opener) -> None:
    with opened() as lab:
        n_operations = sum(" /api/v1/" in route and "openapi" not in route for route in CALLERS)
        assert keep_to_the_description(lab, FAST) == n_operations


def test_operations_on_somebody_who_is_there_keep_to_it_too(opened: Opener) -> None:
    with opened() as lab:
        keep_to_the_description(lab, FAST, session_id=lab.completed())


@pytest.mark.slow
def test_every_operation_keeps_to_its_description_whatever_it_is_sent(opened: Opener) -> None:
    with opened() as lab:
        keep_to_the_description(lab, SLOW)
        keep_to_the_description(lab, SLOW, session_id=lab.completed())


def test_a_program_reviews_somebody_and_is_told_when_it_has_not_seen_the_last_change(opened: Opener) -> None:
    with opened() as lab, lab.program(Role.ASSISTANT) as program:
        address = f"/api/v1/people/{lab.under_way()}/review"
        excluded = program.put(address, json={"verdict": "excluded", "reason": "slept", "revision": 0})
        assert excluded.json()["revision"] == 1
        assert excluded.json()["changed_by"] == "adam"
        late = program.put(address, json={"verdict": None, "revision": 0})
        assert late.status_code == 409
        assert late.json()["error"]["code"] == "changed-meanwhile"
        assert program.put(address, json={"verdict": "rejected", "revision": 1}).status_code == 422
        unknown = program.put(address, json={"verdict": None, "revision": 1, "colour": "red"})
        assert unknown.status_code == 422


def test_a_program_deletes_nobody_twice(opened: Opener) -> None:
    with opened() as lab, lab.program(Role.OWNER) as program:
        address = f"/api/v1/people/{lab.under_way()}"
        assert program.delete(address).json()["n_answers"] == 0
        assert program.delete(address).status_code == 410
        assert program.get(address).status_code == 410


def test_a_program_lets_in_no_other(lab: Laboratory) -> None:
    with lab.program(Role.OWNER) as program:
        made = program.post("/api/v1/tokens", json={"label": "another", "role": "viewer"})
    assert made.status_code == 403


def test_the_description_says_how_to_come_in(lab: Laboratory) -> None:
    with lab.nobody() as visitor:
        description = visitor.get("/api/v1/openapi.json").json()
    schemes = description["components"]["securitySchemes"]
    assert {scheme["type"] for scheme in schemes.values()} == {"http", "apiKey"}
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            assert operation["security"], f"{method} {path}"
            assert {"401", "403"} <= set(operation["responses"]), f"{method} {path}"
