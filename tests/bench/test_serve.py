import json

import pytest
from rich.progress import Progress

from app.bench import serve
from app.bench.report import BenchError


@pytest.mark.slow
def test_a_small_crowd_loses_and_doubles_nothing_and_sees_every_clip():
    result = serve.run(5, people=5, answers=30, progress=Progress(disable=True))
    assert result["answers"] >= 30
    assert result["lost"] == result["doubled"] == result["clips_missing"] == 0
    assert 0.0 < result["p50_ms"] <= result["p99_ms"] <= result["max_ms"]
    assert 0.0 < result["reply_p50_ms"] <= result["reply_p99_ms"]
    assert 0.0 <= result["not_ready"] <= 1.0
    json.dumps(result)


def test_nobody_at_all_is_refused():
    with pytest.raises(BenchError, match=r"at least one person and one answer, got 0 and 30\."):
        serve.run(5, people=0, answers=30, progress=Progress(disable=True))
