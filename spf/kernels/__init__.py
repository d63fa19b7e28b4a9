"""The only numba code of the project. Imports nothing of ours but its siblings; randomness comes in from outside."""
