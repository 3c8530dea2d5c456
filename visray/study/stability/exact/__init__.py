"""Exact first hits of rays with polynomial surfaces."""
