"""Acceleration: how rays find the objects that they hit, and the queries they ask."""
