"""How rays find the few objects that they may meet among many."""
