"""Adaptive sampling: renders a picture until its error is small enough, or as well as possible in a given time."""
