"""The SIRFS objective as compiled row kernels, with the formulas of `surface`, `reflectance`,
`illumination` and `shading_term`.

Every loop runs over one-dimensional rows with few pointers, so that the compiler can emit vector
instructions; each kernel accepts float32 and float64. Arrays that belong together are passed as one
named tuple, which Numba unpacks at the call. Kernels release the interpreter lock and write only to
their own rows.
"""
