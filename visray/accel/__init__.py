"""Acceleration: how rays find the objects that they hit, and the three ray queries.

The queries are the closest hit, occlusion, and transmittance (intersect.py).
"""
