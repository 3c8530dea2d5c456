"""Pictures: their layers, their display on a screen, and their files."""
