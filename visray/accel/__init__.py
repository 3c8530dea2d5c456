"""How rays find what they hit."""
