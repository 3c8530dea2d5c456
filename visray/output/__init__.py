"""Pictures: layers, display, and files."""
