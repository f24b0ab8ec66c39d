"""What a page hears of its session."""

from __future__ import annotations

import json
from collections.abc import Generator
from typing import Any

import httpx

Screen = dict[str, Any]


def screens(client: httpx.Client, home: str) -> Generator[Screen, None, None]:
    """Yields a session's screens as the server sends them, until it ends them.

    Args:
        client: Waits for at least 15 s, after which the server repeats itself.
        home: Path of the participant's page.
    """
    with client.stream("GET", f"{home}screens") as response:
        response.raise_for_status()
        for line in response.iter_lines():
            if line:
                assert line.startswith("data: ")
                yield json.loads(line.removeprefix("data: "))


def first_question(client: httpx.Client, home: str) -> Screen:
    """Waits for a question and returns its screen."""
    return next(screen for screen in screens(client, home) if screen["kind"] == "question")
