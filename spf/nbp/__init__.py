"""Nonparametric belief propagation for hands (Sudderth, Mandel, Freeman, Willsky, NIPS 2004; spec 8).

The pose is not a vector but a graph: sixteen rigid bodies, each with its own place and orientation, held together by joints,
kept apart by their thickness, carried on from frame to frame, and seen with regard to what is in front of what.
"""
