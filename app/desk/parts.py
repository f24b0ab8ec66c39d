"""What the desk is made of."""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import Request

from app.services.desk_accounts import DeskAccounts
from app.services.reports import ReportShelf
from app.services.runtime import Runtime
from study_core.study import Study


@dataclass(frozen=True)
class DeskParts:
    """What the desk is made of.

    Attributes:
        runtime: The services' resources.
        study: The study that people can join.
        accounts: Lets experimenters in.
        database: URL of the database.
        reports: What is written for experimenters.
        public_url: Address that participants use, if it isn't the one the server listens on.
    """

    runtime: Runtime
    study: Study
    accounts: DeskAccounts
    database: str
    reports: ReportShelf
    public_url: str | None

    @property
    def is_encrypted(self) -> bool:
        """Returns whether browsers reach the server by https alone."""
        return (self.public_url or "").startswith("https://")

    def base_url(self, request: Request) -> str:
        """Returns the address at which participants reach the server."""
        return (self.public_url or f"{request.url.scheme}://{request.url.netloc}").rstrip("/")
