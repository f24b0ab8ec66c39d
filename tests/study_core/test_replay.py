"""A derived query is compared to the stored one number by number."""

import math
from dataclasses import replace

from study_core.comparison import Choice
from study_core.replay import first_difference
from tests.study_core.made_up import prepared


def test_the_same_query_has_no_difference():
    assert first_difference(prepared(2), prepared(2)) is None


def test_cost_machine_and_program_version_are_not_the_query():
    elsewhere = replace(prepared(2), compute_ms=1e6, code_version="9.9", machine="aarch64")
    assert first_difference(prepared(2), elsewhere) is None


def test_one_bit_of_one_number_is_named_with_both_values():
    stored = prepared(2)
    controls = stored.proposed.query.controls_b.copy()
    before = float(controls[7])
    after = math.nextafter(before, 9.0)
    controls[7] = after
    query = replace(stored.proposed.query, controls_b=controls)
    derived = replace(stored, proposed=replace(stored.proposed, query=query))
    expected = f"query.controls_b[7]: stored {before!r}, derived {after!r}"
    assert str(first_difference(stored, derived)) == expected


def test_another_clip_another_length_and_a_missing_clip_are_differences():
    stored = prepared(2)
    other = replace(stored, clips={**stored.clips, "tall": "00"})
    assert str(first_difference(stored, other)) == f"clips.tall: stored {'ab' * 32!r}, derived '00'"
    fewer = replace(stored, clips={"wide": stored.clips["wide"]})
    assert "clips.tall" in str(first_difference(stored, fewer))
    assert "clips.tall" in str(first_difference(fewer, stored))
    versions = replace(stored.proposed.provenance, versions=("driving-v1",))
    shorter = replace(stored, proposed=replace(stored.proposed, provenance=versions))
    assert "provenance.versions" in str(first_difference(stored, shorter))


def test_sides_are_compared_where_they_were_written_down_and_only_there():
    stored = prepared(2)
    derived = replace(stored, first_shown=Choice.B, clips={"wide": "00", "tall": "11"})
    assert first_difference(stored, derived) is not None
    unwritten = replace(stored, first_shown=None)
    assert first_difference(unwritten, derived) is None
    other = replace(derived, proposed=prepared(3).proposed)
    assert first_difference(unwritten, other) is not None
