"""Optimisers of the cost, one a file."""
