"""Reports from the desk: made in the background by the real command."""

from __future__ import annotations

import time

import httpx

from app.store import Role
from tests.desk.conftest import Opener
from tests.desk.laboratory import Laboratory


def wait_until_done(visitor: httpx.Client) -> str:
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        page = visitor.get("/desk/studies/quickstart/report").text
        if "Being made" not in page:
            return page
        time.sleep(0.5)
    raise AssertionError("the report was never done")


def test_a_report_that_can_not_be_made_says_why(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.ASSISTANT) as visitor:
        assert "Make the report" in visitor.get("/desk/studies/quickstart/report").text
        assert visitor.get("/desk/studies/quickstart/report.html").status_code == 404
        lab.under_way()
        assert visitor.post("/desk/studies/quickstart/report").is_redirect
        assert "Being made" in visitor.get("/desk/studies/quickstart/report").text
        page = wait_until_done(visitor)
        assert "It could not be made: Nobody here can be evaluated." in page
        assert lab.store.desk.audit(1)[0].action == "report_begun"


def test_the_appendix_is_a_file_and_in_the_audit(lab: Laboratory, person: str) -> None:
    with lab.browser(Role.ASSISTANT) as visitor:
        made = visitor.get("/desk/studies/quickstart/appendix.md")
    assert made.status_code == 200
    assert made.text.startswith("# Reporting appendix: quickstart")
    assert "attachment" in made.headers["content-disposition"]
    assert lab.store.desk.audit(1)[0].action == "appendix_made"
