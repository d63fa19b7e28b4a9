"""Accuracy on given sessions, several seeds, mean ± spread: ``uv run python -m benchmarks.accuracy SESSION … [--json PATH]``.

The part of :mod:`benchmarks.holds` that tracks recordings, with all of its options.
"""

from __future__ import annotations

import sys

from benchmarks.holds.__main__ import main

__all__ = ["accuracy"]


def accuracy(arguments: list[str]) -> None:
    """Track every session from an automatic start with each seed and print the table.

    Args:
        arguments: sessions first, then options of :mod:`benchmarks.holds`.
    """
    first = next((i for i, text in enumerate(arguments) if text.startswith("-")), len(arguments))
    sessions, options = arguments[:first], arguments[first:]
    if not sessions:
        sys.exit("accuracy: name the sessions to track first; options follow them, and --help lists those of holds.")
    main(["--kinds", "--recording", *sessions, *options])


if __name__ == "__main__":
    accuracy(sys.argv[1:])
