"""Naive NumPy formulas that the kernels are checked against: the shortest form, another formulation."""
