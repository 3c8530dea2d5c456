"""The story of one pixel: what is hit, and what becomes of each light there."""
