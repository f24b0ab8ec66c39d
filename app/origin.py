"""Whether a request comes from one of our own pages."""

from __future__ import annotations

from urllib.parse import urlsplit


def is_same_origin(origin: str | None, host_header: str | None, public_url: str | None) -> bool:
    """Whether a websocket was opened by one of our own pages.

    Args:
        origin: The `Origin` header; browsers always send it with websockets.
        host_header: The `Host` header, which decides if no public address is configured.
        public_url: The address that participants use, if configured.
    """
    if not origin or origin == "null":
        return False
    try:
        theirs = _authority(origin)
        ours = (
            _authority(public_url)
            if public_url
            else (theirs[0], *_authority(f"{theirs[0]}://{host_header}")[1:])
        )
    except ValueError:
        return False
    return bool(theirs[1]) and theirs == ours


def _authority(url: str) -> tuple[str, str, int]:
    """Scheme, host and port of an address, the port filled in."""
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https"):
        raise ValueError(url)
    return (
        parts.scheme,
        (parts.hostname or "").lower(),
        parts.port or (443 if parts.scheme == "https" else 80),
    )
