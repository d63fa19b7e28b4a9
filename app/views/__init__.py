"""The panes of the page, one a file: each reads the state and shows a part of it."""
