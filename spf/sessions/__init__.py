"""Readers and writers of depth sessions, one format a file."""
