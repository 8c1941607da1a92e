"""Command line as `python -m shipbench`."""

from .cli.app import main

if __name__ == "__main__":
    main()
