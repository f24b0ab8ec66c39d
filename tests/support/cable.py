"""A network cable between a browser and a server, which can be pulled out."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_CHUNK = 65536


class Cable:
    """Carries bytes both ways between its own port and a server's.

    While it is pulled out, nothing passes and nobody is told: that is what a lost network looks like. Connections
    from before or meanwhile are dead when it is plugged in again.
    """

    def __init__(self, port: int) -> None:
        self._port = port
        self._is_pulled = threading.Event()
        self._trigger: bytes | None = None
        self._ends: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def is_pulled(self) -> bool:
        """Whether nothing passes."""
        return self._is_pulled.is_set()

    def pull(self) -> None:
        """Lets nothing pass any more."""
        self._is_pulled.set()

    def pull_after(self, said: bytes) -> None:
        """Lets nothing pass once the browser has said something: the server hears it, its reply is lost."""
        self._trigger = said

    def plug_in(self) -> None:
        """Carries new connections; closes those that have lost something."""
        with self._lock:
            self._cut_all()
            self._is_pulled.clear()

    def close(self) -> None:
        """Ends everything."""
        self._listener.close()
        with self._lock:
            self._cut_all()

    def _cut_all(self) -> None:
        for end in self._ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        self._ends.clear()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                browser, _ = self._listener.accept()
                threading.Thread(target=self._connect, args=(browser,), daemon=True).start()

    def _connect(self, browser: socket.socket) -> None:
        try:
            server = socket.create_connection(("127.0.0.1", self._port))
        except OSError:
            browser.close()
            return
        with self._lock:
            self._ends |= {browser, server}
        back = threading.Thread(target=self._carry, args=(server, browser, False), daemon=True)
        back.start()
        self._carry(browser, server, True)
        back.join()
        with self._lock:
            self._ends -= {browser, server}
        browser.close()
        server.close()

    def _carry(self, source: socket.socket, target: socket.socket, is_from_browser: bool) -> None:
        with suppress(OSError):
            while data := source.recv(_CHUNK):
                if self.is_pulled:
                    continue
                if is_from_browser and self._trigger is not None and self._trigger in data:
                    self._trigger = None
                    # Before it is passed on, so that the reply can't overtake.
                    self._is_pulled.set()
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)


@contextmanager
def cable_to(port: int) -> Iterator[Cable]:
    """Gives a cable that is taken away at the end."""
    cable = Cable(port)
    try:
        yield cable
    finally:
        cable.close()
