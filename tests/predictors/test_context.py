"""Context of a prediction: who asks for it, and that no truth is in it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from shipbench.predictors.context import Context, predicted, wants_context


class Plain:
    def predict(self, s0, U, history=None):
        return "plain"


class Asking:
    def predict(self, s0, U, history=None, *, context=None):
        return context


def test_only_a_model_that_names_it_gets_the_context(harbour):
    context = Context.of(harbour)
    assert predicted(Asking(), np.zeros(1), np.zeros(1), None, context) is context
    assert predicted(Plain(), np.zeros(1), np.zeros(1), None, context) == "plain"
    assert not wants_context(print)


def test_it_holds_no_measured_states(harbour):
    assert {f.name for f in fields(Context)} == {"ship", "dt", "inputs", "runs", "start", "began"}
