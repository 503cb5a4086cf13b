"""Footage or a wearable to the six-degree-of-freedom motion of the skull CG; knows nothing of meshes."""
