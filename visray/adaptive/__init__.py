"""Adaptive sampling: pictures to a given error, or as good as a given time allows."""
