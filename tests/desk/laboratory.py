"""A site whose desk has people of every role, and participants to look at."""

from __future__ import annotations

from pathlib import Path

import httpx

from app.desk.admission import COOKIE
from app.services import study as services
from app.services.desk_accounts import DeskAccounts
from app.services.tokens import hash_token, new_token
from app.services.walk import walk
from app.store import ExternalPerson, Role, Source
from app.web.parts import SiteParts
from study_core.comparison import Choice
from study_core.events import AnswerGiven, QueryPrepared
from tests.support.wayfarer import BROWSER

PASSWORD = "correct horse battery"
NAMES = {Role.OWNER: "olga", Role.ASSISTANT: "adam", Role.VIEWER: "vera"}


class Laboratory:
    """A site, its store, and its experimenters.

    Attributes:
        accounts: Those of the site itself.
    """

    def __init__(self, url: str, parts: SiteParts, accounts: DeskAccounts, database: Path) -> None:
        self.url, self.parts, self.accounts, self.database = url, parts, accounts, database
        self.runtime, self.store = parts.runtime, parts.runtime.store

    def people_the_desk(self) -> None:
        """Lets in somebody of each role."""
        for role, name in NAMES.items():
            self.accounts.add("tests", name, PASSWORD, role)

    def nobody(self) -> httpx.Client:
        """A browser in which nobody is logged in."""
        return httpx.Client(base_url=self.url, timeout=60.0, headers=BROWSER | {"Origin": self.url})

    def browser(self, role: Role) -> httpx.Client:
        """A browser in which somebody of that role is logged in."""
        token = new_token()
        self.store.desk.begin_login(NAMES[role], hash_token(token))
        visitor = self.nobody()
        for path in ("/desk", "/api"):
            visitor.cookies.set(COOKIE, token, domain="127.0.0.1", path=path)
        return visitor

    def program(self, role: Role) -> httpx.Client:
        """A program with a token of somebody of that role."""
        token = new_token()
        self.store.desk.add_api_token(NAMES[role], "tests", role, hash_token(token))
        return httpx.Client(base_url=self.url, timeout=60.0, headers={"Authorization": f"Bearer {token}"})

    def participant(self, external_id: str | None = None) -> str:
        """Lets somebody join who reads the welcome page; returns the session's id."""
        opened = self.runtime.open_study(self.parts.study.arms[0])
        person = None if external_id is None else ExternalPerson(self.parts.study.name, external_id)
        return self.store.create_session(
            opened.study.hash, hash_token(new_token()), Source.JOINED, person=person
        ).id

    def under_way(self) -> str:
        """Lets somebody join who stands before the first question; returns the session's id."""
        return services.join(self.runtime, self.parts.study.arms[0])[1].id

    def completed(self, choice: Choice = Choice.A) -> str:
        """Lets somebody go through the whole study, always with the same answer; returns the session's id."""
        session_id = self.under_way()

        def answer(prepared: QueryPrepared) -> AnswerGiven:
            return AnswerGiven(prepared.query_index, choice, 1500)

        walk(self.runtime, session_id, answer)
        return session_id
