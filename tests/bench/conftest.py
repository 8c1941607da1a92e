"""The toy ship for the tests of the benchmark core."""

from toy_ship import toy, toy_folder

__all__ = ["toy", "toy_folder"]
