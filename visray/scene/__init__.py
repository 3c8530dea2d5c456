"""Scenes: their records, their validation, and reading and writing of scene files."""
