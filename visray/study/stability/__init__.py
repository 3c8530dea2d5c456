"""The stability study: polynomial surfaces against exact arithmetic."""
