"""The command line as a user types it: in a process of its own, or in this one, which saves seconds of imports."""

from __future__ import annotations

import io
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

import pytest

from app.cli import main

Done = subprocess.CompletedProcess[str]


def run_apart(*arguments: str) -> Done:
    """Runs a command to its end in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "app.cli", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def run(*arguments: str, answer: str = "") -> Done:
    """Runs a command to its end in this process, with what the user types in between."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["prefstudy", *arguments])
        patch.setattr(sys, "stdin", io.StringIO(answer))
        with pytest.raises(SystemExit) as ended:
            main()
    return Done(arguments, int(ended.value.code or 0), out.getvalue(), err.getvalue())


def assert_one_line_with(done: Done, *said: str) -> None:
    """A refusal is one line on stderr with the remedy, and no traceback."""
    lines = [line for line in done.stderr.splitlines() if line.startswith("Error:")]
    assert done.returncode == 1, done.stderr
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    for text in said:
        assert text in lines[0]
