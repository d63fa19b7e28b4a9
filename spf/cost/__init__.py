"""The cost E(p): settings, spheres of the collision term, and the problem of one frame."""
