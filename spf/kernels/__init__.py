"""The only numba code of the project. Imports nothing of ours but its own siblings; randomness comes in from outside."""
