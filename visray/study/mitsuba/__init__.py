"""The check of a scene against Mitsuba 3."""
