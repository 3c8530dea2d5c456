"""visray is imported first: it chooses the LLVM that Dr.Jit loads, whatever a test file imports before."""

import visray  # noqa: F401, I001
from virtual import machine  # noqa: F401 - for every test
