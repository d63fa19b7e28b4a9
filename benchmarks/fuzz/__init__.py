"""Damaged recordings: every reader gives a clear error or a session, never a crash, a hang or unbounded memory."""
