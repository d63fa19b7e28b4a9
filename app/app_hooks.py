"""What a server does before the first page is asked for: compile the kernels and start the renderer."""

from typing import Any

from app.server import kernels, renderer


def on_server_loaded(_server_context: Any) -> None:
    """Begin both in the background."""
    kernels()
    renderer()
