"""Pictures: how they are kept, shown and written."""
