"""Exact first hits of rays with polynomial surfaces; truth.py explains the method."""
