"""Messages about a study file lead to the right line."""

import pytest

from study_core.toml_lines import line_of

TEXT = '''name = "x"

[text]
welcome = """
path = 3
[protocol]
"""
[protocol]   # how many
active_queries = 3

[[path]]
step = "consent"

[[path]]
step = "queries"
break_every = 4

[[questionnaire.closing]]
name = "one"
[[questionnaire.closing]]
name = "two"

[[condition]]
acquisition.method = "random"
[condition.text]
welcome = "hi"
'''


@pytest.mark.parametrize(
    ("location", "line"),
    [
        (("name",), 1),
        (("text", "welcome"), 4),
        (("protocol",), 8),
        (("protocol", "active_queries"), 9),
        (("protocol", "missing"), 8),
        (("path", 0, "step"), 12),
        (("path", 1, "break_every"), 16),
        (("path", 1), 14),
        (("questionnaire", "closing", 1, "name"), 21),
        (("condition", 0, "acquisition", "method"), 24),
        (("condition", 0, "text", "welcome"), 26),
        (("nowhere",), None),
    ],
)
def test_a_place_in_the_file_has_its_line(location, line):
    assert line_of(TEXT, location) == line
