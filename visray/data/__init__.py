"""Data scenes: rows of a table as shapes on a map or on a globe."""
