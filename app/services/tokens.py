"""Secret links: 128 random bits for the participant, only a hash for us."""

from __future__ import annotations

import hashlib
import secrets


def new_token() -> str:
    """Returns a fresh secret of 128 bits, safe in a URL."""
    return secrets.token_urlsafe(16)


def hash_token(token: str) -> str:
    """Returns what is stored and looked up instead of the token; 128 random bits need no salt."""
    return hashlib.sha256(token.encode()).hexdigest()
