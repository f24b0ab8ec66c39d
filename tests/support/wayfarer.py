"""A program that goes along a study's path as a browser without scripts would, page by page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx

from study_core.path import questionnaire_of
from study_core.questionnaire import example_answer
from study_core.study import Study
from tests.support.screens import Screen, screens

BROWSER = {"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}


class Wayfarer:
    """Somebody in a session of a study that has every kind of step.

    Attributes:
        home: The address of all their pages.
    """

    def __init__(self, client: httpx.Client, study: Study) -> None:
        """Joins.

        Args:
            client: Follows nothing, and waits for at least 15 s.
            study: The study.
        """
        self.client, self.study = client, study
        joined = client.post(f"/join/{study.name}", content=b"")
        assert joined.status_code == 303
        # Where they land may be the page below it that says how to come back.
        self.home = f"/s/{joined.headers['location'].split('/')[2]}/"

    @property
    def token(self) -> str:
        """Returns the secret in the address."""
        return self.home.strip("/").removeprefix("s/")

    def screen(self) -> Screen:
        """Returns where the person is."""
        return next(screen for screen in screens(self.client, self.home) if screen["kind"] != "preparing")

    def page(self) -> str:
        """Returns what the person reads."""
        shown = self.client.get(self.home, headers=BROWSER)
        assert shown.status_code == 200
        return shown.text

    def form(self, **filled_in: Any) -> dict[str, Any]:
        """Returns the current page as it would be sent; what isn't said is filled in rightly."""
        step = self.screen()["step"]
        name = questionnaire_of(self.study.file.path[step])
        items = () if name is None else self.study.file.questionnaire[name]
        right = {item.name: example_answer(item) for item in items}
        return {"_step": step, "_tries": 0, "accept": "yes", **right, **filled_in}

    def send(self, form: dict[str, Any]) -> httpx.Response:
        """Sends a page."""
        return self.client.post(f"{self.home}step", data=form, headers=BROWSER)

    def go_on(self) -> None:
        """Goes one page, answer or break further."""
        screen = self.screen()
        if screen["kind"] == "step":
            assert self.send(self.form()).status_code == 303
        elif screen["kind"] == "break":
            self._post("break", query_index=screen["query_index"])
        else:
            # Sure of it, where the study asks.
            sure = {"confidence": 4} if self.study.file.answering.confidence else {}
            choice = "second" if screen["query_index"] % 3 else "first"
            answer = {"query_index": screen["query_index"], "choice": choice, "response_time_ms": 2000}
            self._post("answer", **answer, **sure)

    def go_until(self, is_there: Callable[[Screen], bool]) -> Screen:
        """Goes on until a screen that is wanted, and returns it."""
        while not is_there(screen := self.screen()):
            assert screen["kind"] != "finished", "the path has ended before"
            self.go_on()
        return screen

    def go_to_step(self, step: int) -> Screen:
        """Goes on to the page of a step."""
        return self.go_until(lambda screen: (screen["kind"], screen["step"]) == ("step", step))

    def _post(self, address: str, **body: Any) -> None:
        response = self.client.post(f"{self.home}{address}", json=body)
        assert response.status_code == 200, response.text
