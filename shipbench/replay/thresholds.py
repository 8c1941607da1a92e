"""Every number by which a predicted trajectory is matched to a run, or called one of another frame."""

from __future__ import annotations

from ..thresholds import Threshold, Thresholds

THRESHOLDS = Thresholds(
    Threshold("start_position", 0.01, "ship lengths", "rounding of a start position", "chosen-by-judgement"),
    Threshold("start_heading", 1.0, "deg", "rounding of a start heading", "chosen-by-judgement"),
    Threshold("start_speed", 0.1, "m/s at 130 m", "rounding of a start speed", "chosen-by-judgement"),
    Threshold("other_place", 2.0, "ship lengths", "distance of a start in another frame", "chosen-by-judgement"),
    Threshold("other_heading", 45.0, "deg", "difference of a heading in another frame", "chosen-by-judgement"),
    Threshold("other_unit", 0.5, "share", "difference of a speed in another unit, of the speed", "chosen-by-judgement"),
    Threshold("frame_time", 20.0, "s at 130 m", "time over which two tracks are compared", "chosen-by-judgement"),
    Threshold("turn_time", 16.0, "s at 130 m", "time over which a yaw rate changes", "chosen-by-judgement"),
    Threshold("against", -0.5, "1", "correlation of turns to the other side than measured", "chosen-by-judgement"),
    Threshold("explained", 0.2, "share", "of a difference that its cause may leave", "chosen-by-judgement"),
)
"""All of them."""
