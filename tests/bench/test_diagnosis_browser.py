"""The page of a diagnosis, opened in a real Chromium: it fits a phone, and no label of a picture is cut."""

from __future__ import annotations

from dataclasses import replace

from chromium import browse
from test_diagnosis_report import make_diagnosis

from shipbench.bench.diagnosis_report import page

CUT = """[...document.querySelectorAll('figure svg')].flatMap((s) => {
  const b = s.getBoundingClientRect();
  return [...s.querySelectorAll('text')].filter((t) => {
    const c = t.getBoundingClientRect();
    return c.left < b.left - 1 || c.right > b.right + 1 || c.top < b.top - 1 || c.bottom > b.bottom + 1;
  }).map((t) => t.textContent);
})"""


def test_it_fits_a_phone_and_no_number_however_long_is_cut(tmp_path):
    d = make_diagnosis()
    far = {name: getattr(d.trace, name).copy() for name in ("measured", "before")}
    for states in far.values():
        states[..., :2] += (12_000.0, -34_000.0)  # positions far from the origin
    d = replace(d, trace=replace(d.trace, **far, after=far["measured"] + 0.01, force=1e-3 * d.trace.force))
    path = tmp_path / "page.html"
    path.write_text(page(d))
    console, scroll, cut, unlabelled = browse([
        ["open", str(path), 390], ["js", "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"], ["js", CUT],
        ["js", "document.querySelectorAll('figure svg:not([role=img][aria-label]), .scroll:not([tabindex])').length"],
    ])  # fmt: skip
    assert console == []
    assert scroll[0] <= scroll[1]  # tables scroll by themselves, the page does not
    assert cut == []
    assert unlabelled == 0
