"""Functional mock-up units (FMI 2 and 3): what they describe, how their variables map to ours, and how they run."""
