"""What a package needs to take part in shipbench: one file for each part, and the entry points in pyproject.toml."""
