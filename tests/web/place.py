"""A site of its own for each test, and how a browser comes in."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import urlencode

import httpx

from app.web.parts import SiteParts
from tests.support.wayfarer import BROWSER

STEPS = '\n[[path]]\nstep = "text"\ntext = "welcome"\n[[path]]\nstep = "queries"\n'
PROLIFIC = {"PROLIFIC_PID": "pid-of-alice", "STUDY_ID": "id-of-a-study", "SESSION_ID": "id-of-a-visit"}
LINK = f"/join/quickstart?{urlencode(PROLIFIC)}"


class Place:
    """A site of its own, and what stands in its database."""

    def __init__(self, url: str, parts: SiteParts, database: Path) -> None:
        self.url, self.parts, self.store, self.database = url, parts, parts.runtime.store, database

    def browser(self) -> httpx.Client:
        """A browser of its own."""
        return httpx.Client(base_url=self.url, timeout=60.0, headers=BROWSER)

    def grow_old(self, hours: float) -> None:
        """Lets everybody have begun so many hours ago, and forgets what the process knows of them."""
        begun = (datetime.now(UTC) - timedelta(hours=hours)).strftime("%Y-%m-%d %H:%M:%S.%f")
        with closing(sqlite3.connect(self.database)) as rows, rows:
            rows.execute("UPDATE sessions SET created_at = ?", (begun,))
        for record in self.store.sessions():
            self.parts.runtime.forget(record.id)


Opener = Callable[..., AbstractContextManager[Place]]


def ticket_in(page: httpx.Response) -> str:
    found = re.search(r'name="ticket" value="([^"]+)"', page.text)
    assert found is not None, page.text
    return found[1]


def begin(browser: httpx.Client, link: str = LINK) -> str:
    """Opens a link and presses Begin, as a person does; returns the session's address."""
    page = browser.get(link)
    assert page.status_code == 200
    joined = browser.post(link, data={"ticket": ticket_in(page)})
    assert joined.status_code == 303, joined.text
    return joined.headers["location"]


def moment(hours: float) -> str:
    return (datetime.now(UTC).replace(microsecond=0) + timedelta(hours=hours)).isoformat()
