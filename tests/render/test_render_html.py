"""The common base of the pages: escaping, the data in it, the policy, the header."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from shipbench.render.html import Tile, content_policy, embedded, plotly_version, render_page
from shipbench.render.linked import packed


@pytest.mark.parametrize("text", ["</script><script>alert(1)</script>", "<!--<script>", "a\u2028b", "\\u003c", "é"])
def test_embedded_data_come_back_and_cannot_end_their_element(text):
    inside = str(embedded({"name": text}))
    assert "<" not in inside
    assert json.loads(inside) == {"name": text}


def test_embedded_data_refuse_numbers_that_json_does_not_have():
    with pytest.raises(ValueError, match="JSON"):
        embedded([float("nan")])


def test_packed_values_are_steps_from_the_last_finite_one():
    assert packed(np.array([1.234, 1.25, np.nan, 1e30, -0.5]), 2) == [123, 2, None, None, -175]


def test_a_page_has_one_header_and_escapes_what_it_is_given(tmp_path):
    (tmp_path / "p.html.j2").write_text('{% extends "base.html.j2" %}{% block content %}{{ word }}{% endblock %}')
    hostile = "<img src=x>"
    made = {
        "title": hostile,
        "dataset": hostile,
        "command": hostile,
        "tiles": [Tile(hostile, hostile, hostile)],
        "word": hostile,
    }
    text = render_page("p.html.j2", folder=tmp_path, **made)
    assert "<img" not in text
    assert text.count("&lt;img") == 8  # title twice, data set, command, tile, word
    assert re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", text)
    assert "Plotly" not in text
    with_plots = render_page("p.html.j2", folder=tmp_path, plots=True, **made)
    assert f"Plotly {plotly_version()} (MIT licence)" in with_plots


def test_the_policy_never_allows_evaluation_or_the_network():
    policy = content_policy("a{}", ["f()", "g()"], plots=True)
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe-eval" not in policy
    assert "http" not in policy
    assert re.search(r"script-src 'sha256-[^']+' 'sha256-[^']+'$", policy)
