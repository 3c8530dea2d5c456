"""Polynomial surfaces against exact arithmetic."""
