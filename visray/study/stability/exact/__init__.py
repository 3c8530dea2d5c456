"""First hits of rays and polynomial surfaces in exact arithmetic, apart from all that kernels do."""
