"""visray: a ray tracer whose primitives and Blinn-Phong integrator are Dr.Jit kernels."""

from visray import llvm

llvm.prepare()  # before anything imports Dr.Jit, which loads its LLVM at once
