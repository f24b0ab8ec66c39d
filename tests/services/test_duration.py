"""The time that is told to somebody: what is expected of a study, and what is left of it at their own pace."""

from __future__ import annotations

import pytest

from app import wiring
from app.services import study as services
from app.services.duration import expected_minutes
from app.settings import find_study
from study_core.study import parse_study

QUICKSTART = find_study("quickstart")
LONG = parse_study(QUICKSTART.text.replace("active_queries = 8 ", "active_queries = 96 "))


def test_a_study_takes_at_least_a_minute_and_longer_with_pages() -> None:
    short = QUICKSTART.text.replace("active_queries = 8 ", "active_queries = 1 ")
    assert expected_minutes(parse_study(short.replace("test_queries = 4 ", "test_queries = 0 "))) == 1
    # 14 queries of some 14 seconds, and nine pages besides.
    assert expected_minutes(find_study("full-path")) == pytest.approx((14 * 14 + 9 * 40) / 60, abs=0.5)


def test_the_time_left_is_that_of_the_persons_own_pace() -> None:
    with wiring.headless() as runtime:
        _, record = services.join(runtime, LONG, rehearsal="steady")
        assert services.screen(runtime, record.id).minutes_left is None
        for index, seconds in enumerate((29, 29, 59, 59, 59)):
            services.answer(runtime, record.id, index, "a", 1000 * seconds)
            screen = services.screen(runtime, record.id)
            # The median, and a second between queries: half a minute for each that is left, at last a whole one.
            each_s = {0: 30, 1: 30, 2: 30, 3: 45, 4: 60}[index]
            assert screen.minutes_left == round((99 - index) * each_s / 60)


def test_pages_that_follow_are_part_of_the_time_left() -> None:
    pages = '\n[[path]]\nstep = "queries"\n' + '\n[[path]]\nstep = "text"\ntext = "thanks"\n' * 6
    with wiring.headless() as runtime:
        _, record = services.join(runtime, parse_study(QUICKSTART.text + pages), rehearsal="quick")
        services.answer(runtime, record.id, 0, "a", 0)
        # Eleven queries of a second and six pages of 40.
        assert services.screen(runtime, record.id).minutes_left == round((11 + 240) / 60)
