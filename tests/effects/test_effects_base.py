"""Order of the effects of a model."""

from __future__ import annotations

from shipbench.diagnosis.model.term import Term
from shipbench.effects.base import EFFECTS, flow_first


def test_environment_comes_before_the_forces_that_follow_the_flow():
    """A current beside a cross-flow drag, named in either order, is the same model."""
    items = [Term(EFFECTS.get(name), ()) for name in ("cross_flow_drag", "current")]
    assert (
        [i.effect.name for i in flow_first(items)]
        == ["current", "cross_flow_drag"]
        == [i.effect.name for i in flow_first(items[::-1])]
    )
