"""Checks of scenes against Mitsuba 3."""
