"""Logging: one line an event on stderr; links and tokens never appear in it."""

from __future__ import annotations

import logging


def configure(level: str = "INFO") -> None:
    """Sets the format of the process's log."""
    logging.basicConfig(level=level, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    for noisy in ("distributed", "websockets", "asyncio", "trimesh", "alembic"):
        logging.getLogger(noisy).setLevel(logging.ERROR)
