"""A picture of a surface f(x, y, z) = 0 without a scene file."""
